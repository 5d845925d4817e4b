"""The modules by their tables: every number of the maker's library, ranges, units, banks, ports, several motors."""

import json
import subprocess

import pytest

from multidrop.families.tmcl.host import codec
from multidrop.families.tmcl.manual.modules import MODULES, AxisParameter, module_of
from tests.support.foreign_python import TABLES_ONLY, foreign_python
from tests.support.tmcl_module import Module

EXTREMES = (-(2**31), 2**31 - 1)
TABLES = """
import importlib, json
def table(owner):
    return {name: value for name, value in vars(owner).items() if not name.startswith("_")}
found = {}
for name in %r:
    module = getattr(importlib.import_module("pytrinamic.modules.TMCM" + name), "TMCM" + name)
    own = module(None)
    found[name] = [table(each) for each in (own.motors[0].AP, own.GP0, own.GP3, own.IO)] + [len(own.motors)]
print(json.dumps(found))
"""


@pytest.mark.process
def test_the_tables_have_the_numbers_of_the_makers_library():
    python = foreign_python(*TABLES_ONLY)
    script = [str(python), "-c", TABLES % (list(MODULES),)]
    done = subprocess.run(script, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    for name, (axis, bank_0, bank_3, ports, motors) in json.loads(done.stdout).items():
        own = MODULES[name]
        assert set(own.axis) == set(axis.values()), name  # a number may have two names
        assert [sorted(own.banks[bank]) for bank in (0, 3)] == [sorted(bank_0.values()), sorted(bank_3.values())], name
        inputs = {n for word, n in ports.items() if word.startswith(("IN", "AIN"))}
        analog = {n for word, n in ports.items() if word.startswith(("AIN", "VIN"))}
        outputs = {n for word, n in ports.items() if word.startswith("OUT")}
        assert (set(own.inputs), set(own.outputs), own.motors) == (inputs, outputs, motors), name
        assert analog <= set(own.analog), name


@pytest.mark.parametrize("product", MODULES)
def test_a_parameter_of_which_only_the_number_is_known_takes_any_value_and_changes_nothing_else(product):
    module = Module(product=f"TMCM-{product}")
    table = MODULES[product]
    held = {number: module.ask(f"GAP {number}, 0") for number in table.axis}
    for number, row in table.axis.items():
        if not row.known:
            for value in EXTREMES:
                assert module.ask(f"SAP {number}, 0, {value}") == value
                assert module.ask(f"GAP {number}, 0") == value
            held[number] = EXTREMES[-1]
    assert {number: module.ask(f"GAP {number}, 0") for number in table.axis} == held
    for bank in (0, 3):
        for number, row in table.banks[bank].items():
            if not row.known:
                assert module.ask(f"SGP {number}, {bank}, -5") == -5
                assert module.ask(f"GGP {number}, {bank}") == -5


@pytest.mark.parametrize("product", MODULES)
def test_every_other_number_is_refused_and_every_range_is_kept(product):
    module = Module(product=f"TMCM-{product}")
    table = MODULES[product]
    for number in range(256):
        assert module.reply(f"GAP {number}, 0").status == (100 if number in table.axis else 3)
        assert module.reply(f"GGP {number}, 0").status == (100 if number in table.banks[0] else 3)
        assert module.reply(f"GGP {number}, 3").status == (100 if number in table.banks[3] else 3)
    for number, row in table.axis.items():
        if row.writable and len(row.limits) < 2**32:
            assert module.refusal(f"SAP {number}, 0, {row.limits[-1] + 1}") == 4
            assert module.refusal(f"SAP {number}, 0, {row.limits[0] - 1}") == 4
        elif not row.writable:
            assert module.refusal(f"SAP {number}, 0, 0") == 3


def test_tmcm_is_the_1241_and_a_version_names_the_module():
    assert module_of("TMCM") is module_of("TMCM-1241") is MODULES["1241"]
    known = {number for number, row in MODULES["1241"].axis.items() if row.known}
    assert module_of("TMCM-1110").axis.keys() == known - {AxisParameter.UNIT_MODE}
    for product in MODULES:
        module = Module(product=f"TMCM-{product}")
        assert module.ask("136 1, 0, 0") >> 16 == int(product)
        assert module.send(codec.frame_of(1, codec.TmclCall(136)))[1:5].decode() == product


def test_a_module_with_an_old_chip_counts_in_its_units():
    """16e6 * v / (2^p * 2048 * 32) microsteps/s, 16e6^2 * a / 2^(p + r + 29) microsteps/s2."""
    module = Module(product="TMCM-1140", settings={"154": 5, "153": 6, "5": 2047})
    module.ask("ROR 0, 1000")
    module.wait(10.0)
    assert module.ask("GAP 3, 0") == 1000
    first = module.ask("GAP 1, 0")
    module.wait(1.0)
    assert module.ask("GAP 1, 0") - first == round(16e6 * 1000 / (2**5 * 2048 * 32))
    module = Module(product="TMCM-1140", settings={"154": 5, "153": 6, "5": 100})
    module.ask("ROR 0, 2047")
    module.wait(0.1)
    assert module.ask("GAP 1, 0") == pytest.approx(16e6**2 * 100 / 2 ** (5 + 6 + 29) * 0.1**2 / 2, abs=1)


def test_an_acceleration_of_0_still_stops():
    module = Module(product="TMCM-6110", settings={"5": 0})
    module.ask("ROR 0, 10")
    module.wait(60.0)
    assert module.ask("GAP 3, 0") == 10
    module.ask("MST 0")
    module.wait(60.0)
    assert module.ask("GAP 3, 0") == 0


def test_user_variables_are_kept_by_stgp_only():
    module = Module()
    module.ask("SGP 5, 2, -77")
    module.ask("SGP 255, 2, 78")
    module.ask("STGP 5, 2")
    module.device.power(False, 0.0)
    module.device.power(True, 0.0)
    assert [module.ask(f"GGP {n}, 2") for n in (5, 255)] == [-77, 0]
    module.ask("SGP 5, 2, 1")
    module.ask("RSGP 5, 2")
    assert module.ask("GGP 5, 2") == -77


def test_ports_are_read_and_set():
    module = Module(product="TMCM-3110", inputs=((0.0, 3, 1),), analog=((0.0, 777),))
    assert [module.ask(f"GIO {port}, 0") for port in range(8)] == [0, 0, 1, 0, 0, 0, 0, 0]
    assert (module.ask("GIO 255, 0"), module.ask("GIO 0, 1"), module.ask("GIO 8, 1")) == (4, 777, 240)
    assert module.ask("SIO 7, 2, 1") == 1
    assert (module.ask("GIO 7, 2"), module.ask("GIO 255, 2")) == (1, 128)
    refused = ["SIO 8, 2, 1", "SIO 0, 2, 2", "SIO 0, 0, 1", "GIO 8, 0", "GIO 1, 1", "GIO 0, 3"]
    assert [module.refusal(text) for text in refused] == [3, 4, 4, 3, 3, 4]


@pytest.mark.parametrize(("product", "status"), [("TMCM", 3), ("TMCM-1276", 3), ("TMCM-6110", 4), ("TMCM-1140", 4)])
def test_a_motor_that_the_module_lacks_is_refused_as_its_firmware_does(product, status):
    motors = module_of(product).motors
    assert Module(product=product).refusal(f"GAP 1, {motors}") == status


def test_each_motor_moves_alone_and_says_so():
    module = Module(product="TMCM-6110")
    for motor in range(6):
        module.ask(f"MVP ABS, {motor}, {1000 * (motor + 1)}")
    assert module.ask("138 0, 0, 33") == 33
    module.ask("SAP 4, 3, 0")
    notices = module.wait(10.0)
    assert [codec.parse_reply(notices[at : at + 9]).value for at in range(0, len(notices), 9)] == [1, 32]
    assert [module.ask(f"GAP 8, {motor}") for motor in range(6)] == [1, 1, 1, 0, 1, 1]
    module.ask("STAP 4, 3")
    module.device.power(False, module.now)
    module.device.power(True, module.now)
    assert [module.ask(f"GAP 4, {motor}") for motor in (2, 3)] == [1000, 0]


def test_a_program_waits_for_the_motor_that_it_names():
    module = Module(product="TMCM-3110")
    for line in ("132 0, 0, 0", "MVP ABS, 2, 5000", "27 1, 2, 0", "MVP ABS, 1, 300", "28 0, 0, 0", "133 0, 0, 0"):
        module.reply(line)
    module.ask("129 1, 0, 0")
    module.wait(0.05)
    assert (module.ask("GAP 0, 2"), module.ask("GAP 0, 1")) == (5000, 0)
    module.wait(5.0)
    assert [module.ask(f"GAP 1, {motor}") for motor in range(3)] == [0, 300, 5000]
