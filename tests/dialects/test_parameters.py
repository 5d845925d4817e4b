"""Settings of PMX controllers, Modbus drives and TMCL modules: read, ordered, withheld."""

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import family_of
from multidrop.dialects.values import COMMUNICATION, Permission, Reading, Readings, same
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.host.modbus.family import ModbusFamily
from multidrop.families.lexium.manual import parameters as mcode
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.families.pmx.host import values as pmx
from multidrop.families.pmx.host.codec import Pmx, PmxState
from multidrop.families.pmx.simulator.settings import REGISTERS as PMX_REGISTERS
from multidrop.families.tmcl.host import values as tmcl
from multidrop.families.tmcl.host.codec import Tmcl, TmclState
from multidrop.families.tmcl.manual.modules import module_of
from tests.families.lexium.host.modbus.test_exchange import Far
from tests.support.procedure import ProcedureRunner

UNIT = PmxState(Pmx(), "00")


def held(**values):
    return Readings(tuple(Reading(name, value) for name, value in values.items()))


def steps(plan):
    return [change.text for change in plan]


@pytest.mark.parametrize(
    ("one", "other", "alike"),
    [
        (1, 1.0, True), (1, 2, False), (2000000000, 2000000001, False), (0.1 + 0.2, 0.3, True), ((1, 0), (1, 0), True),
        ((1, 0), (1, 0, 0), False), ("a", "a", True), ("1", 1, False), (None, 0, False), (None, None, True),
    ],
)  # fmt: skip
def test_values_are_compared_as_numbers(one, other, alike):
    assert same(one, other) is alike


def test_a_plan_of_a_controller_keeps_the_low_speed_below_the_high_one():
    now = held(LSPD=2000, HSPD=5000)
    assert steps(pmx.PmxParameters(UNIT).plan(now, {"LSPD": 100, "HSPD": 1000}, Permission())) == [
        "LSPD=100",
        "HSPD=1000",
    ]
    assert steps(pmx.PmxParameters(UNIT).plan(now, {"LSPD": 9000, "HSPD": 9900}, Permission())) == [
        "HSPD=9900",
        "LSPD=9000",
    ]
    mixed = {"ACC": 300, "DN": "2ED07", "SLRX": 2.5, "HSPDX": 40}
    made = pmx.PmxParameters(UNIT).plan(held(ACC=1, DN="2ED00", SLRX=1.0, HSPDX=0), mixed, Permission())
    assert steps(made) == ["HSPDX=40", "ACC=300", "SLRX=2.500"] and made.withheld == (("DN", COMMUNICATION),)


@pytest.mark.parametrize(
    ("name", "value", "now"), [("SLX", 1, {}), ("SLAX", 5, {"SLX": 1}), ("SLOAD", 1, {}), ("JV5", 9, {}), ("DB", 3, {})]
)
def test_what_a_controller_only_gets_by_name(name, value, now):
    present = held(**{name: 0, **now})
    assert [each[0] for each in pmx.PmxParameters(UNIT).plan(present, {name: value}, Permission()).withheld] == [name]
    assert steps(pmx.PmxParameters(UNIT).plan(present, {name: value}, Permission(frozenset({name})))) == [
        f"{name}={value}"
    ]


@pytest.mark.parametrize(
    "wanted", [{"HSPD": 7000000}, {"SLRX": 0}, {"PX": 5}, {"DO": 1}, {"HSPD": "fast"}, {"ACC": 1.5}]
)
def test_a_wrong_value_for_a_controller(wanted):
    with pytest.raises(Diagnostic):
        pmx.PmxParameters(UNIT).plan(held(), wanted, Permission())


def test_every_register_of_a_controller_is_a_setting_with_its_range():
    for name, register in PMX_REGISTERS.items():
        if name == "JO":
            continue
        scale = 1000 if name.startswith("SLR") else 1
        assert name in pmx.NAMES
        for value in (register.low, register.high):
            pmx.PmxParameters(UNIT).plan(held(), {name: value / scale}, Permission(frozenset({name})))


def test_a_plan_of_a_module():
    module, table = TmclState(Tmcl(), "1", motors=2), module_of("")
    names = tmcl.setting_names(table, 2)
    now = Readings(tuple(tmcl.reading(name, 0 if name in ("4", "12") else 1, table) for name in names))
    wanted = {"12": 1, "13": 0, "5": 7, "5_1": 8, "4": 9, "G65": 3, "G77": 0, "140": 6}
    made = tmcl.TmclParameters(module).plan(now, wanted, Permission())
    assert steps(made) == ["SAP 5, 0, 7", "SAP 13, 0, 0", "SAP 140, 0, 6", "SAP 5, 1, 8", "SGP 77, 0, 0"]
    assert dict(made.withheld) == {
        "12": "a move that the limit switch holds back may go on",
        "4": "a move may wait for it",
        "G65": COMMUNICATION,
    }
    for wrong in ({"1": 5}, {"140": 9}, {"5_2": 5}, {"X": 1}, {"6": 1.5}):
        with pytest.raises(Diagnostic):
            tmcl.TmclParameters(module).plan(now, wrong, Permission(frozenset(wrong)))


def talk(far, procedure):
    runner = ProcedureRunner(procedure)
    while runner.request is not None:
        runner.answer(far(runner.request))
    return runner.result


def modbus_drive(**values):
    state = ModbusState(Modbus())
    state.identified("LMDCE", "LMDCE 6.002, Hw: 3.2", "LMDCE571")
    far = Far(**{row.name: row.default for row in REGISTERS.values() if row.default is not None} | values)
    far.specific = {"IS": "IS = 1, 0, 0\r\nIS = 2, 2, 1", "OS": "OS = 1, 16, 0"}
    return state, far


def test_registers_are_read_without_er_and_what_has_none_is_listed():
    state, far = modbus_drive(VM=512000, EF=1, ER=65)
    found = talk(far, ModbusFamily(state).values.parameters.read(lambda done, total: None))
    assert found.values["VM"] == 512000 and far.get("ER") == 65
    listed = dict(found.unread)
    assert all(name in found.values or name in listed for name in (each.name for each in mcode.settings("LMDCE")))
    assert {"TS", "TA", "LK", "V1"} <= listed.keys()


def test_a_plan_over_modbus_has_the_order_of_mcode_and_leaves_out_what_no_register_takes():
    state, _ = modbus_drive()
    present = held(VI=1000, VM=768000, A=1000000, D5=0, MS=256)
    wanted = {"VM": 500, "VI": 100, "A": 70, "AJ": 5, "D5": 999}
    made = ModbusFamily(state).values.parameters.plan(present, wanted, Permission())
    assert steps(made) == ["VI=100", "VM=500"]
    assert {name for name, _ in made.impossible} == {"A", "AJ", "D5"}


def test_every_family_of_drives_reads_parameters():
    assert all(family_of(ModbusState(each)).values.parameters.language for each in (Modbus(), ModbusFamily.codec))
