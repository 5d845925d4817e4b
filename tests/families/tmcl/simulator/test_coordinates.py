"""The coordinates of a simulated module: set, read and taken by hosts and programs, moved to, kept without power."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.tmcl.manual import program_file
from multidrop.families.tmcl.manual.commands import TmclCall
from multidrop.families.tmcl.simulator.program_run import TmclRun
from tests.support.tmcl_module import Module

SCO, GCO, CCO = 30, 31, 32


def run(text: str) -> tuple[int, tuple[str, ...]]:
    """The position at the end of a program file, and its errors."""
    *_, summary = TmclRun.read(text, "x.tmc")(TmclRun.drive).run()
    return summary.position, summary.errors


def test_a_program_moves_to_the_coordinates_that_it_set_took_and_worked_out() -> None:
    text = """
        SCO 1, 0, 4000
        MVP COORD, 0, 1
        WAIT POS, 0, 0
        CCO 2, 0
        GCO 2, 0
        CALC MUL, -2
        ACO 3, 0
        MVP COORD, 0, 3
        WAIT POS, 0, 0
        STOP
    """
    assert program_file.check(text) == []
    assert run(text) == (-8000, ())


def test_the_accumulator_names_a_coordinate() -> None:
    assert run("SCO 5, 0, 700\nCALC LOAD, 5\nMVPA COORD, 0\nWAIT POS, 0, 0\nSTOP\n") == (700, ())


def test_a_host_sets_reads_and_moves() -> None:
    module = Module()
    assert module.ask(f"{SCO} 0, 0, 1234") == 1234
    assert (module.ask(f"{GCO} 0, 0, 0"), module.ask(f"{GCO} 1, 0, 0")) == (1234, 0)
    module.ask("MVP COORD, 0, 0")
    module.rest()
    assert module.ask("GAP 1, 0") == 1234
    module.ask(f"{CCO} 20, 0, 0")
    assert module.ask(f"{GCO} 20, 0, 0") == 1234


@pytest.mark.parametrize("storing", [0, 1])
def test_what_is_kept_without_power_follows_global_parameter_84(storing: int) -> None:
    module = Module()
    module.ask(f"SGP 84, 0, {storing}")
    for number in (0, 1, 2):
        module.ask(f"{SCO} {number}, 0, {number + 100}")
    if not storing:
        module.ask(f"{GCO} 2, 255, 0")
    module.device.power(False, 0.0)
    module.device.power(True, 0.0)
    assert [module.ask(f"{GCO} {number}, 0, 0") for number in (0, 1, 2)] == [0, 101 * storing, 102]


def test_all_coordinates_are_copied_at_once() -> None:
    module = Module()
    module.ask(f"{SCO} 7, 0, 7")
    module.ask(f"{GCO} 0, 255, 0")
    module.ask(f"{SCO} 7, 0, 8")
    module.ask(f"{SCO} 0, 0, 9")
    module.ask(f"{SCO} 0, 255, 0")
    assert (module.ask(f"{GCO} 7, 0, 0"), module.ask(f"{GCO} 0, 0, 0")) == (7, 9)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 255), st.integers(0, 255), st.sampled_from([SCO, GCO, CCO]))
def test_any_numbers_are_answered_and_no_motor_turns(value: int, number: int, motor: int, command: int) -> None:
    module = Module()
    frame = module.reply(str(TmclCall(command, number, motor, value)))
    copies = motor == 255 and command != CCO
    assert (frame.status == 100) is (number <= 20 and (motor == 0 or copies))
    assert module.ask("GAP 3, 0") == 0
