"""A-SCRIPT run in virtual time on a controller that is a stand-in: programs, subroutines, errors, times."""

from __future__ import annotations

import pytest

from multidrop.families.pmx.manual.script_checker import read
from multidrop.families.pmx.manual.script_compiler import MEMORY_LINES
from multidrop.families.pmx.simulator.commands import CommandedController
from multidrop.families.pmx.simulator.programs import PmxInterpreter
from tests.support.pmx_programs import STEP_PER_EDGE, TEN_TIMES, TWO, WATCHDOG

SPEED = 10_000.0
"""Steps/s of the stand-in, at once."""
IDLE, RUNNING, PAUSED, ERROR = 0, 1, 2, 4


class Stand(CommandedController):
    """A stand-in: axes that move at one speed; registers that hold what they are given. X cannot pass `wall`."""

    def __init__(self, wall: float = 1e9) -> None:
        self.now = 0.0
        self.position = {"X": 0.0, "Y": 0.0}
        self.target = {"X": 0.0, "Y": 0.0}
        self.trouble = {"X": False, "Y": False}
        self.registers: dict[str, int] = {"POLX": 0}
        self.asked: list[tuple[float, str]] = []
        self.wall = wall

    @property
    def deadline(self) -> float | None:
        dues = [self.now + abs(self.target[a] - self.position[a]) / SPEED for a in "XY" if self.moving(a)]
        if self.moving("X") and self.position["X"] < self.wall < self.target["X"]:
            dues.append(self.now + (self.wall - self.position["X"]) / SPEED)
        return min(dues, default=None)

    def settle(self, now: float) -> None:
        for axis in "XY":
            left = self.target[axis] - self.position[axis]
            if abs(left) <= SPEED * (now - self.now) + 1e-6:
                self.position[axis] = self.target[axis]
            elif left:
                self.position[axis] += SPEED * (now - self.now) * (1 if left > 0 else -1)
        if self.position["X"] >= self.wall - 1e-6 and self.target["X"] > self.wall:
            self.position["X"] = self.target["X"] = self.wall
            self.trouble["X"] = True
        self.now = now

    def ask(self, text: str, now: float) -> str:
        self.settle(now)
        self.asked.append((now, text))
        name, sign, value = text.partition("=")
        if sign:
            self.registers[name] = int(value)
        elif name in ("PX", "PY"):
            return str(round(self.position[name[1]]))
        elif name in ("CLRX", "CLRY"):
            self.trouble[name[3]] = False
        elif name in ("ABORTX", "ABORTY"):
            self.target[name[5]] = self.position[name[5]]
        elif name[0] in "XY" and name[1:].lstrip("-").isdigit():
            if self.trouble[name[0]]:
                return "?Clear SNL Error"
            if self.moving(name[0]):
                return "?Moving"
            self.target[name[0]] = float(name[1:])
        elif name not in ("ABS", "INC", "STOREX", "JX+"):
            return str(self.registers[name]) if name in self.registers else f"?{name}"
        return "OK"

    def moving(self, axis: str) -> bool:
        return self.target[axis] != self.position[axis]

    def troubled(self, axis: str) -> bool:
        return self.trouble[axis]


def loaded(text: str, stand: Stand | None = None) -> tuple[PmxInterpreter, Stand]:
    stand = stand or Stand()
    programs = PmxInterpreter(stand)
    programs.memory.load(read(text, "x.prg").code)
    return programs, stand


def ran(text: str, until: float = 10.0, stand: Stand | None = None) -> tuple[PmxInterpreter, Stand]:
    """Program 0, started at time 0."""
    programs, stand = loaded(text, stand)
    assert programs.control(0, 1, 0.0)
    programs.advance(until)
    return programs, stand


def test_lines_are_kept_as_they_came_and_read_again() -> None:
    memory = loaded("X1\nEND")[0].memory
    assert [memory.line(n) for n in range(4)] == ["CV1", "&X$1", "XX", "0"] and memory.line(MEMORY_LINES - 1) == "0"
    assert memory.store(7, "&1234$56") and memory.line(7) == "&1234$56"
    assert not memory.store(7, "") and not memory.store(7, "A B") and not memory.store(7, "X" * 25)


@pytest.mark.parametrize(
    ("sum_", "gives"),
    [
        ("7+-9", -2), ("7-9", -2), ("7*-3", -21), ("7/2", 3), ("-7/2", -4), ("7%5", 2), ("1<<4", 16), ("256>>4", 16),
        ("12&10", 8), ("12|3", 15), ("~5", -6), ("2147483647+1", -2147483648), ("1<<31", -2147483648),
        ("65536*65536", 0), ("PX", 0), ("V2", 0),
    ],
)  # fmt: skip
def test_sums_are_of_32_bit_integers(sum_: str, gives: int) -> None:
    programs, _ = ran(f"V1={sum_}\nEND")
    assert programs.variables[1] == gives and programs.status(0) == IDLE


@pytest.mark.parametrize(
    ("condition", "true"),
    [("1=1", 1), ("1!=1", 0), ("1>=1", 1), ("1>1", 0), ("-1<1", 1), ("2<=1", 0), ("PX=0", 1), ("V9>-1", 1)],
)
def test_conditions(condition: str, true: int) -> None:
    programs, _ = ran(f"IF {condition}\nV1=1\nELSEIF 1=1\nV2=1\nELSE\nV3=1\nENDIF\nV4=1\nEND")
    assert programs.variables[1:5] == [true, 1 - true, 0, 1]


def test_a_loop_ends_when_its_condition_is_false() -> None:
    programs, stand = ran(TEN_TIMES)
    assert programs.status(0) == IDLE and programs.variables[1] == 10
    moves = [text for _, text in stand.asked if text in ("X0", "X1000")]
    assert moves == ["X0", "X1000"] * 10


def test_wait_goes_on_when_the_axis_stands_and_costs_nothing_meanwhile() -> None:
    programs, stand = ran("X5000\nWAITX\nY1000\nEND")
    (at,) = [t for t, text in stand.asked if text == "Y1000"]
    assert at == pytest.approx(0.5, abs=0.002) and programs.executed < 10


def test_a_delay_lasts_its_milliseconds() -> None:
    _, stand = ran("ABS\nDELAY=1500\nINC\nV1=250\nDELAY=V1\nABS\nEND")
    first, second, third = (t for t, _ in stand.asked)
    assert second - first == pytest.approx(1.5002) and third - second == pytest.approx(0.2508)


def test_the_next_deadline_is_the_next_line_or_the_axes() -> None:
    programs, _ = loaded("X5000\nWAITX\nDELAY=1000\nEND")
    assert programs.deadline is None
    programs.control(0, 1, 2.0)
    assert programs.deadline == 2.0
    programs.advance(2.1)
    assert programs.deadline == pytest.approx(2.5, abs=0.001) and programs.counter(0) == 2
    programs.advance(2.7)
    assert programs.deadline == pytest.approx(3.5, abs=0.001)
    programs.advance(4.0)
    assert programs.deadline is None and programs.status(0) == IDLE


def test_one_big_step_of_time_is_the_same_as_many_small_ones() -> None:
    whole, small = (loaded(TWO) for _ in range(2))
    for programs, stand in (whole, small):
        stand.registers["DI1"] = 0
        programs.control(1, 1, 0.0)
    whole[0].advance(1.0)
    for step in range(1001):
        small[0].advance(step / 1000)
    told = [[(round(t, 9), text) for t, text in stand.asked] for _, stand in (whole, small)]
    assert told[0] == told[1] and len(told[0]) > 100


def test_pause_holds_what_is_left_of_a_delay() -> None:
    programs, _ = loaded("DELAY=1000\nV1=1\nEND")
    programs.control(0, 1, 0.0)
    programs.advance(0.4)
    programs.control(0, 2, 0.4)
    programs.advance(5.0)
    assert programs.status(0) == PAUSED and programs.deadline is None
    programs.control(0, 3, 5.0)
    programs.advance(5.59)
    assert programs.status(0) == RUNNING and programs.variables[1] == 0
    programs.advance(5.7)
    assert programs.status(0) == IDLE and programs.variables[1] == 1


def test_pause_during_a_wait_goes_on_with_what_comes_after_it() -> None:
    programs, _ = loaded("X1000\nWAITX\nV1=1\nEND")
    programs.control(0, 1, 0.0)
    programs.advance(0.05)
    programs.control(0, 2, 0.05)
    programs.advance(1.0)
    assert programs.variables[1] == 0
    programs.control(0, 3, 1.0)
    programs.advance(1.1)
    assert programs.variables[1] == 1


def test_sr_takes_0_to_3_only_and_continue_is_for_what_is_paused() -> None:
    programs, _ = loaded("DELAY=1000\nEND")
    assert not programs.control(0, 4, 0.0) and not programs.control(0, -1, 0.0)
    assert programs.control(0, 3, 0.0) and programs.status(0) == IDLE
    assert programs.control(0, 2, 0.0) and programs.status(0) == IDLE


def test_two_programs_run_at_once_and_one_controls_the_other() -> None:
    programs, stand = loaded(TWO)
    stand.registers["DI1"] = 0
    programs.control(1, 1, 0.0)
    programs.advance(0.35)
    assert (programs.status(0), programs.status(1)) == (RUNNING, RUNNING)
    stand.registers["DI1"] = 1
    programs.advance(0.36)
    where = stand.position["X"]
    assert programs.status(0) == IDLE and 0 < where < 1000
    programs.advance(1.0)
    assert stand.position["X"] == where
    stand.registers["DI1"] = 0
    programs.advance(1.3)
    assert programs.status(0) == RUNNING and stand.position["X"] != where


def test_a_watchdog_program_stops_the_other_and_starts_it_again_after_its_delay() -> None:
    programs, stand = loaded(WATCHDOG)
    stand.registers |= {"MSTX": 0}
    programs.control(0, 1, 0.0)
    programs.control(1, 1, 0.0)
    programs.advance(1.0)
    stand.registers["MSTX"] = 2048 + 1
    programs.advance(3.9)
    assert programs.status(0) == IDLE and stand.registers["DO"] == 0
    stand.registers["MSTX"] = 0
    programs.advance(4.1)
    assert programs.status(0) == RUNNING and stand.registers["DO"] == 1


def test_a_subroutine_returns_behind_its_call() -> None:
    programs, stand = loaded(STEP_PER_EDGE)
    stand.registers["DI1"] = 0
    programs.control(0, 1, 0.0)
    for edge in range(3):
        stand.registers["DI1"] = 1
        programs.advance(edge + 0.5)
        stand.registers["DI1"] = 0
        programs.advance(edge + 1.0)
    assert stand.position["X"] == 2000 and programs.variables[1] == 3000


def test_gs_runs_a_subroutine_alone_or_between_two_statements() -> None:
    programs, _ = loaded("WHILE 1=1\nV1=V1+1\nENDWHILE\nEND\nSUB 5\nV5=V5+1\nENDSUB")
    assert not programs.call(6, 0.0) and programs.status(0) == IDLE
    assert programs.call(5, 0.0) and programs.status(0) == RUNNING
    programs.advance(0.1)
    assert programs.status(0) == IDLE and programs.variables[5] == 1
    programs.control(0, 1, 0.1)
    programs.advance(0.2)
    before = programs.variables[1]
    assert programs.call(5, 0.2)
    programs.advance(0.3)
    assert programs.status(0) == RUNNING and programs.variables[5] == 2 and programs.variables[1] > before


HANDLED = "V1=V1+1\nX1000\nWAITX\nV2=PX\nX0\nWAITX\nEND\nSUB 31\nV31=V31+1\nECLEARX\nENDSUB"


def test_an_error_of_the_axis_goes_to_sub_31_and_then_on_with_the_statement_that_failed() -> None:
    programs, stand = ran(HANDLED, stand=Stand(wall=400))
    assert programs.variables[31] == 1 and programs.variables[1:3] == [1, 400]
    assert programs.status(0) == IDLE and stand.position["X"] == 0
    assert "axis X" in programs.failure(0)


def test_with_bit_13_of_pol_the_program_begins_anew_after_sub_31() -> None:
    stand = Stand(wall=400)
    stand.registers["POLX"] = 1 << 13
    programs, _ = ran("V1=V1+1\nIF V1=1\nX1000\nWAITX\nENDIF\nEND\nSUB 31\nECLEARX\nENDSUB", stand=stand)
    assert programs.variables[1] == 2 and programs.status(0) == IDLE


def test_without_sub_31_a_program_that_fails_is_in_error_and_can_be_started_again() -> None:
    programs, _ = ran("X1000\nWAITX\nV1=1\nEND", stand=Stand(wall=400))
    assert programs.status(0) == ERROR and programs.variables[1] == 0
    programs.control(0, 0, 10.0)
    assert programs.status(0) == IDLE


def test_a_command_that_is_refused_is_an_error() -> None:
    programs, _ = ran("X1000\nX0\nEND")
    assert programs.status(0) == ERROR and "?Moving" in programs.failure(0)
    programs, _ = ran("V1=1/V2\nEND")
    assert programs.status(0) == ERROR and "zero" in programs.failure(0)


def test_what_fails_in_sub_31_is_the_end() -> None:
    programs, _ = ran("X1000\nX0\nEND\nSUB 31\nV31=V31+1\nX0\nENDSUB")
    assert programs.status(0) == ERROR and programs.variables[31] == 1


def test_only_the_program_that_moved_the_axis_is_told_of_its_error() -> None:
    text = "PRG 0\nX1000\nWAITX\nEND\nPRG 1\nWHILE 1=1\nV1=V1+1\nENDWHILE\nEND"
    programs, _ = loaded(text, Stand(wall=400))
    programs.control(0, 1, 0.0)
    programs.control(1, 1, 0.0)
    programs.advance(1.0)
    assert (programs.status(0), programs.status(1)) == (ERROR, RUNNING)


def test_calls_without_end_are_an_error() -> None:
    programs, _ = ran("GOSUB 1\nEND\nSUB 1\nGOSUB 1\nENDSUB")
    assert programs.status(0) == ERROR and "32 nested calls" in programs.failure(0)


@pytest.mark.parametrize(
    "lines", [["&1234$5"], ["AM"], ["CV1"] * MEMORY_LINES, ["SE"], ["JR5"], ["CV1", "CV2", "AM"], ["0"]]
)
def test_lines_that_mean_nothing_are_an_error(lines: list[str]) -> None:
    programs = PmxInterpreter(Stand())
    programs.memory.load(lines)
    programs.control(0, 1, 0.0)
    programs.advance(10.0)
    assert programs.status(0) == ERROR and programs.failure(0)


def test_a_program_that_is_not_there_is_in_error_when_it_is_started() -> None:
    programs, _ = loaded("X1\nEND")
    programs.control(1, 1, 0.0)
    assert programs.status(1) == ERROR and programs.deadline is None


def test_power_up_stops_everything_and_clears_half_of_the_variables() -> None:
    programs, _ = ran("V1=1\nV40=40\nDELAY=60000\nEND", until=1.0)
    programs.power_up(1.0)
    assert programs.status(0) == IDLE and programs.variables[1] == 0 and programs.variables[40] == 40
    assert programs.memory.line(0) == "CV1"


def test_a_subroutine_called_over_the_wire_fails_for_itself_and_starts_no_program() -> None:
    stand = Stand()
    stand.registers["POLX"] = 1 << 13
    programs, _ = loaded("V1=1\nEND\nSUB 2\nV2=1/V9\nENDSUB\nSUB 31\nV31=1\nENDSUB", stand)
    programs.call(2, 0.0)
    programs.advance(1.0)
    assert programs.status(0) == IDLE and programs.variables[31] == 1 and programs.variables[1] == 0
