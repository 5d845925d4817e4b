"""The program of a simulated TMCL module: download, run, waits, stop, autostart, in virtual time."""

import pytest

from tests.support.tmcl_module import Module


def loaded(*lines: str, **settings: int) -> Module:
    module = Module(settings={"4": 100_000, "5": 1_000_000, **settings})
    assert module.reply("132 0, 0, 0").status == 100
    for line in lines:
        assert module.reply(line).status == 101
    assert module.reply("133 0, 0, 0").status == 100
    return module


def test_a_download_executes_nothing_not_even_a_stop():
    module = Module()
    module.ask("ROR 0, 5000")
    module.reply("132 0, 0, 0")
    assert module.reply("MST 0").status == 101
    module.wait(1.0)
    module.reply("133 0, 0, 0")
    assert module.ask("GAP 3, 0") == 5000


def test_a_program_moves_waits_and_jumps():
    module = loaded("MVP ABS, 0, 20000", "27 1, 0, 0", "27 0, 0, 100", "MVP ABS, 0, 0", "27 1, 0, 0", "22 0, 0, 0")
    module.ask("129 1, 0, 0")
    module.wait(1.0)
    assert (module.ask("GAP 1, 0"), module.ask("135 0, 0, 0"), module.ask("GGP 128, 0")) == (20000, 1, 1)
    module.wait(1.2)
    assert module.ask("GAP 0, 0") == 20000, "it has begun again"


def test_128_halts_the_program_and_leaves_the_motor():
    module = loaded("ROR 0, 5000", "27 0, 0, 100", "ROR 0, -5000", "28 0, 0, 0")
    module.ask("129 1, 0, 0")
    module.wait(0.5)
    module.ask("128 0, 0, 0")
    module.wait(2.0)
    assert (module.ask("GAP 3, 0"), module.ask("135 0, 0, 0")) == (5000, 0)
    module.ask("129 0, 0, 0")
    module.wait(1.0)
    assert (module.ask("GAP 3, 0"), module.ask("135 0, 0, 0")) == (-5000, 0), "it goes on and ends"


def test_a_step_and_a_reset():
    module = loaded("SAP 4, 0, 7", "SAP 4, 0, 8")
    module.ask("130 0, 0, 0")
    module.wait(1.0)
    assert module.ask("GAP 4, 0") == 7
    module.ask("131 0, 0, 0")
    module.ask("130 0, 0, 0")
    assert module.ask("GAP 4, 0") == 7
    module.ask("130 0, 0, 0")
    assert module.ask("GAP 4, 0") == 8


@pytest.mark.parametrize(("autostart", "speed"), [(0, 0), (1, 5000)])
def test_a_module_starts_its_program_at_power_up_with_parameter_77(autostart, speed):
    module = loaded("ROR 0, 5000", G77=autostart)
    module.device.power(False, module.now)
    module.device.power(True, module.now)
    module.wait(1.0)
    assert module.ask("GAP 3, 0") == speed


def test_a_wait_gives_up_after_its_time():
    module = loaded("MVP ABS, 0, 1000000", "27 1, 0, 50", "MST 0")
    module.ask("129 1, 0, 0")
    module.wait(0.4)
    assert module.ask("GAP 3, 0") == 100_000
    module.wait(0.4)
    assert module.ask("GAP 3, 0") == 0


def test_a_run_from_before_the_first_line_begins_with_the_first_line():
    module = loaded("SAP 4, 0, 7", "28 0, 0, 0")
    module.ask("129 1, 0, -5")
    module.wait(1.0)
    assert (module.ask("GAP 4, 0"), module.ask("135 0, 0, 0")) == (7, 0)
    empty = Module()
    empty.ask("129 1, 0, -5")
    empty.wait(1.0)
    assert empty.ask("135 0, 0, 0") == 0
