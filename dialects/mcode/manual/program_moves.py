"""Warnings of lines that do not wait for the end of a move: H is missing (MCode reference 3.4.2, 5.1.50).

A move that is not waited for is often meant, so only lines that disturb it are reported: another move, which replaces
it, homing and settings that a moving drive refuses (errors 73, 74, 85, 87, 95), and a new position. Nothing is reported
after a line that may wait: H, also with a time; a condition or an assignment that reads the motion; a loop that waits
for anything else; a subroutine that does one of these. A slew has no end to wait for, and SL ends every move.
"""

from __future__ import annotations

from collections.abc import Iterator

from multidrop.dialects.mcode.manual.conditions import CONDITIONAL
from multidrop.dialects.mcode.manual.grammar import Number, words
from multidrop.dialects.mcode.manual.program_flow import Flow, Step
from multidrop.dialects.problems import Problem
from multidrop.dialects.walks import nearest

MOVES = frozenset({"MA", "MR"})
HOMINGS = frozenset({"HM", "HI", "HF"})
DISTURBING = frozenset({"P", "C1", "C2", "AS", "RD"})
"""Variables that must not be set while the drive moves."""
REFUSED = frozenset({"S", "IP", "CP", "FD", "SC"})
"""Instructions that a moving drive refuses."""
MOTION = frozenset({"MV", "MP", "VC", "V", "AV", "P", "PC", "C1", "C2", "ST", "LL", "AF", "EF", "ER"})
"""Words by which a program watches the motion."""
WAITS = frozenset({"H", "PS", "SL", "IV", "E", "RT", "DE"})
FARTHEST = 500
"""Lines after a move that are looked at."""


def check(flow: Flow) -> Iterator[Problem]:
    """Report each move that a later line does not wait for."""
    for at, step in enumerate(flow.steps):
        if not _has_an_end(step):
            continue

        def ways(place: int, move: int = at) -> Iterator[int]:
            if not _waits(flow, place, move):
                yield from flow.ways(place)

        def disturbs(place: int) -> bool:
            return _disturbs(flow.steps[place])

        found = nearest(flow.ways(at), ways, disturbs, FARTHEST)
        if found is not None:
            yield _unawaited(step, flow.steps[found])


def _unawaited(move: Step, other: Step) -> Problem:
    """Report a move that another line does not wait for."""
    if other is move:
        what = f"the next {move.line.text} begins before this one has ended"
    else:
        what = f"{other.line.text} in line {other.line.number} does not wait for the end of this move"
    return Problem(move.line.number, move.line.column, what, "H is missing after it", warning=True)


def _has_an_end(step: Step) -> bool:
    """Whether it starts a move that ends by itself; with a third parameter MA and MR go on."""
    if step.statement is None or not step.statement.arguments:
        return False
    goes_on = step.statement.arguments[2:]
    return step.word in HOMINGS or (step.word in MOVES and goes_on in ((), (Number(0),), (None,)))


def _disturbs(step: Step) -> bool:
    """Whether a line must not be executed during a move."""
    if step.statement is None:
        return False
    if step.word in REFUSED or not step.statement.word:
        return True
    return bool(step.statement.arguments) and step.word in MOVES | HOMINGS | DISTURBING


def _waits(flow: Flow, at: int, move: int) -> bool:
    """Whether a line may wait for the end of the move in the line `move`."""
    step = flow.steps[at]
    if step.statement is None or step.word in WAITS:
        return True
    if step.word != "PR" and words(step.line.text) & MOTION:
        return True
    if step.word not in CONDITIONAL:
        return False
    place = flow.place(step.statement)
    if place is None:
        return True
    if step.word == "CL":
        return nearest([place], flow.ways, lambda each: _is_busy(flow.steps[each]), FARTHEST) is not None
    return not step.unconditional and move < place <= at


def _is_busy(step: Step) -> bool:
    """Whether a subroutine with this line may wait: it holds, watches the motion, moves, or calls another."""
    calm = step.statement is not None and step.word not in WAITS - {"RT"} and step.word != "CL"
    return not calm or _disturbs(step) or bool(words(step.line.text) & MOTION)
