"""Programs as people write them (`tests/programs/*.tmc`), downloaded to a module and run: what each does."""

import pytest

from multidrop.families.tmcl.host.codec import frame_of
from multidrop.families.tmcl.manual import program_file
from tests.support.sample_files import FOLDER
from tests.support.tmcl_module import Module


def begun(name, product="TMCM", **world):
    """A module that runs a program from its first line."""
    module = Module(product=product, **world)
    module.ask("132 0, 0, 0")
    file = FOLDER / f"{name}.tmc"
    for line in program_file.compiled(program_file.read(file.read_text(), file.name)):
        module.send(frame_of(1, line.call))
    module.ask("133 0, 0, 0")
    module.ask("129 1, 0, 0")
    return module


def test_a_hard_stop_is_found_by_a_stall():
    module = begun("hard_stop_home", stall_at=-30_000)
    module.wait(20.0)
    assert [module.ask(text) for text in ("GGP 7, 2", "GAP 1, 0", "135 0, 0, 0")] == [1, 0, 0]
    assert module.device.motors[0].shaft.position(module.now) == pytest.approx(500 - 30_000)


def test_three_feeds_begin_together_and_switch_an_output():
    module = begun("three_feeds", product="TMCM-3110")
    module.wait(0.1)
    assert module.ask("GIO 0, 2") == 1 and all(module.ask(f"GAP 3, {motor}") for motor in range(3))
    module.wait(20.0)
    assert [module.ask(f"GAP 1, {motor}") for motor in range(3)] == [19_200, -19_200, 19_200]
    assert (module.ask("GIO 0, 2"), module.ask("GGP 20, 2"), module.ask("135 0, 0, 0")) == (0, 0, 0)


def test_a_button_moves_on_and_another_one_interrupts():
    presses = ((5.0, 1, 1), (5.2, 1, 0), (7.0, 1, 1), (7.1, 1, 0), (7.2, 2, 1), (7.3, 2, 0))
    module = begun("pendant", home=(-9000, -8000), inputs=presses)
    module.wait(4.9)
    assert (module.ask("GAP 1, 0"), module.ask("RFS STATUS, 0")) == (0, 0)
    module.wait(2.0)
    assert module.ask("GAP 1, 0") == 5000
    module.wait(3.0)
    assert 5000 < module.ask("GAP 1, 0") < 10_000 and module.ask("GAP 3, 0") == 0
    assert module.ask("135 0, 0, 0") == 1


@pytest.mark.parametrize("travel", [40_000, 50_000])
def test_searches_from_both_sides_measure_the_travel(travel):
    module = begun("sides", limit_minus=-20_000, limit_plus=travel - 20_000)
    module.wait(60.0)
    assert [module.ask(text) for text in ("GGP 10, 2", "GAP 1, 0", "135 0, 0, 0")] == [travel, 0, 0]
