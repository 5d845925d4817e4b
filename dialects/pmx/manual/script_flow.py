"""Warnings of A-SCRIPT that is never executed, and of moves without WAIT (manual 7.6 to 7.10, 7.19, 10.1).

The checker has found the blocks closed. A loop is endless if its condition compares two equal numbers, as `WHILE 1=1`.
A controller that moves refuses another move, homing, a jog and a new position of that axis (`?Moving`), which ends the
program in an error. Nothing is reported after a statement that may wait: WAIT, DELAY, STOP, ABORT, a reading of the
motion, another loop with a condition, a subroutine that does one of these.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from multidrop.dialects.pmx.manual.script_parser import Statement
from multidrop.dialects.problems import Problem
from multidrop.dialects.walks import nearest, walk

FARTHEST = 500
"""Statements after a move that are looked at."""
_HOMING = re.compile(r"(?:HL|L|Z)?HOME([XY])[+-]|ZOME([XY])[+-]")
_JOG = re.compile(r"JOG([XY])[+-]")
_PLACE = re.compile(r"[EP]([XY])")
_HALT = re.compile(r"(?:STOP|ABORT)([XY]?)")
_MOTION = re.compile(r"(?:MST|PS|SLS|P|E)[XY]")
_MARKS = ("END", "ENDSUB", "ENDIF", "ENDWHILE", "ELSE")
_COMPARED = {">": int.__gt__, "<": int.__lt__, "=": int.__eq__, ">=": int.__ge__, "<=": int.__le__, "!=": int.__ne__}


def check(statements: Sequence[Statement]) -> Iterator[Problem]:
    """Report what the paths through correct blocks show; a statement with an error is passed over."""
    flow = _Flow(statements)
    yield from _unreachable(flow)
    for at, each in enumerate(statements):
        axes = _moved(each)
        if axes and (found := _disturbed(flow, at, axes)) is not None:
            yield _unawaited(each, statements[found], axes)


def _unreachable(flow: _Flow) -> Iterator[Problem]:
    """Report the first statement of each part that no path reaches."""
    reached = walk(flow.beginnings, flow.ways)
    dead = False
    for at, each in enumerate(flow.statements):
        if at in reached or each.wrong:
            dead = False
        elif not dead and each.word not in _MARKS:
            dead = True
            hint = "an endless loop or a condition of constants precedes it"
            yield Problem(each.line, each.column, f"{each} is never executed", hint, warning=True)


def _unawaited(move: Statement, other: Statement, axes: str) -> Problem:
    """Report a move that another statement does not wait for."""
    if other is move:
        what = f"the next {move} begins before this one has ended"
    else:
        what = f"{other} in line {other.line} does not wait for the end of this move"
    return Problem(move.line, move.column, what, f"WAIT{axes[0]} is missing after it", warning=True)


class _Flow:
    """The statements of a file, and which may be executed after which."""

    def __init__(self, statements: Sequence[Statement]) -> None:
        self.statements = statements
        self.beginnings: list[int] = []
        self.subroutines: dict[int, int] = {}
        self._partner: dict[int, int] = {}  # IF, ELSEIF, WHILE: where a false condition leads; ENDWHILE: its WHILE
        self._end: dict[int, int] = {}  # ELSEIF, ELSE: the ENDIF
        self._match()

    def _match(self) -> None:
        """Find where each block leads."""
        outside, opened = True, list[list[int]]()
        for at, each in enumerate(self.statements):
            if each.word in ("PRG", "SUB") and not each.wrong:
                self.beginnings.append(at)
                if each.word == "SUB":
                    self.subroutines[each.number] = at
            elif outside:
                self.beginnings.append(at)
            outside = each.word in ("END", "ENDSUB")
            if each.word in ("IF", "WHILE"):
                opened.append([at])
            elif each.word in ("ELSEIF", "ELSE", "ENDIF", "ENDWHILE") and opened:
                self._partner[opened[-1][-1]] = at
                opened[-1].append(at)
                if each.word in ("ENDIF", "ENDWHILE"):
                    self._close(opened.pop())

    def _close(self, parts: Sequence[int]) -> None:
        first, *inner, last = parts
        if self.statements[last].word == "ENDWHILE":
            self._partner[first] = last + 1
            self._partner[last] = first
        self._end.update(dict.fromkeys(inner, last))

    def ways(self, at: int) -> Iterator[int]:
        """The statements that may be executed next, those of a called subroutine left out."""
        each = self.statements[at]
        if each.word in ("END", "ENDSUB"):
            return
        if each.word == "ENDWHILE":
            yield self._partner[at]
            return
        holds = _holds(each) if each.word in ("IF", "ELSEIF", "WHILE") else True
        if holds is not False and at + 1 < len(self.statements):
            yield self._end.get(at + 1, at + 1)
        if holds is not True and self._partner[at] < len(self.statements):
            yield self._partner[at]


def _holds(each: Statement) -> bool | None:
    """Whether a condition of two numbers holds; None for any other."""
    left, right = (value.constant for value in each.values)
    return None if left is None or right is None else _COMPARED[each.op](left, right)


def _axis(pattern: re.Pattern[str], word: str) -> str:
    """The axis in a word of this form; empty for any other word."""
    found = pattern.fullmatch(word)
    return "".join(filter(None, found.groups())) if found else ""


def _moved(each: Statement) -> str:
    """The axes of a move that ends by itself; empty for any other statement."""
    return each.word if each.kind == "move" else _axis(_HOMING, each.word) if each.kind == "command" else ""


def _disturbed(flow: _Flow, move: int, axes: str) -> int | None:
    """Find the statement that does not wait for the end of a move, if any."""

    def disturbs(at: int) -> bool:
        each = flow.statements[at]
        own = _moved(each) or _axis(_JOG, each.word) or (_axis(_PLACE, each.word) if each.kind == "set" else "")
        return bool(set(own) & set(axes))

    def ways(at: int) -> Iterator[int]:
        if not _waits(flow, at, move, axes):
            yield from flow.ways(at)

    return nearest(flow.ways(move), ways, disturbs, FARTHEST)


def _waits(flow: _Flow, at: int, move: int, axes: str) -> bool:
    """Whether a statement may wait for the end of a move."""
    each = flow.statements[at]
    if each.wrong or each.kind == "delay" or any(_MOTION.fullmatch(value.text) for value in each.values):
        return True
    if each.kind == "wait":
        return each.word in axes
    if each.word == "WHILE":
        return at > move and _holds(each) is None
    if each.word != "GOSUB":
        halted = _HALT.fullmatch(each.word)
        return halted is not None and (not halted[1] or halted[1] in axes)
    begin = flow.subroutines.get(each.number)
    if begin is None:
        return True
    return nearest([begin], flow.ways, lambda place: _is_busy(flow.statements[place]), FARTHEST) is not None


def _is_busy(each: Statement) -> bool:
    """Whether a subroutine with this statement may wait: it waits, moves, halts, loops, or calls another."""
    motion = any(_MOTION.fullmatch(value.text) for value in each.values)
    waits = each.wrong or each.kind in ("delay", "wait", "move") or each.word in ("WHILE", "GOSUB")
    return motion or waits or bool(_HALT.fullmatch(each.word)) or bool(_moved(each))
