"""The check of an A-SCRIPT program: blocks, subroutines, size, dead statements, moves without WAIT (manual 7.19, 10).

A file without PRG is program 0 from its first statement outside of a SUB to END. A loop is endless if its condition
compares two equal numbers, as `WHILE 1=1`. A controller that moves refuses another move, homing, a jog and a new
position of that axis (`?Moving`), which ends the program in an error. Nothing is reported after a statement that may
wait: WAIT, DELAY, STOP, ABORT, a reading of the motion, another loop with a condition, a subroutine that does one of
these. (7.6 to 7.10, 10.1.)
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from multidrop.dialects.program_files import Problem, errors, in_order, nearest, refuse, walk
from multidrop.families.pmx.manual import script_compiler
from multidrop.families.pmx.manual.script_compiler import MEMORY_LINES
from multidrop.families.pmx.manual.script_parser import ScriptStatement, parse

_OPENS = {"ENDIF": "IF", "ELSE": "IF", "ELSEIF": "IF", "ENDWHILE": "WHILE"}
_ENDS = {"IF": "ENDIF", "WHILE": "ENDWHILE", "PRG": "END", "SUB": "ENDSUB"}


@dataclass(frozen=True)
class CompiledScript:
    """A correct program: its statements, its compiled lines, and the file's line of each of those."""

    statements: tuple[ScriptStatement, ...]
    code: tuple[str, ...]
    source: tuple[int, ...]
    warnings: tuple[Problem, ...] = ()


def check(text: str) -> list[Problem]:
    return _checked(text)[1]


def read(text: str, name: str) -> CompiledScript:
    """Compile a program. Raises Diagnostic for the first error; `name` is the file's name there."""
    statements, problems = _checked(text)
    refuse(problems, name)
    code = script_compiler.compile_(statements)
    return CompiledScript(tuple(statements), tuple(code.lines), tuple(code.source), tuple(problems))


def _checked(text: str) -> tuple[list[ScriptStatement], list[Problem]]:
    statements, problems = parse(text)
    if not statements and not problems:
        return statements, [Problem(1, 1, "holds no program: no line but remarks and blanks")]
    checker = _BlockChecker()
    for statement in statements:
        checker.take(statement)
    checker.finish()
    statements = [statement for statement in statements if statement is not checker.final]
    flow = () if checker.problems else _check_flow(statements)
    problems += [*flow, *checker.problems, *_calls(statements)]
    if not errors(problems):
        code = script_compiler.compile_(statements)
        if len(code.lines) > MEMORY_LINES:
            what = f"the program is too long: {len(code.lines)} lines compiled, and the controller holds {MEMORY_LINES}"
            problems.append(Problem(code.source[MEMORY_LINES], 1, what, "the memory ends at this line"))
    return statements, in_order(problems)


class _BlockChecker:
    """The match of blocks, statement by statement."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.open: list[ScriptStatement] = []
        self.closed: set[int] = set()  # lines of an IF after its ELSE
        self.seen: dict[str, int] = {}
        self.explicit = False
        self.astray = False  # a statement outside of everything is reported already
        self.last: ScriptStatement | None = None
        self.final: ScriptStatement | None = None  # an END after the last ENDSUB, which ends nothing

    def wrong(self, at: ScriptStatement, what: str, hint: str = "") -> None:
        self.problems.append(Problem(at.line, at.column, what, hint))

    def take(self, each: ScriptStatement) -> None:
        before, self.last = self.last, each
        if self.final is not None and not each.wrong:
            self.wrong(self.final, "END without a PRG")
            self.final = None
        if each.wrong:
            self.place(each)
        elif each.word == "END" and not self.open and before is not None and before.word == "ENDSUB":
            self.final = each
        elif each.kind != "block" or each.word == "GOSUB":
            self.within(each)
        elif each.word in ("PRG", "SUB"):
            self.begin(each)
        elif each.word in ("END", "ENDSUB"):
            self.end(each)
        elif each.word in ("IF", "WHILE"):
            self.within(each)
            self.open.append(each)
        else:
            self.inner(each)

    def place(self, each: ScriptStatement) -> None:
        """Treat a line with an error as the block word it resembles, where that fits, without another report."""
        if each.word in ("PRG", "SUB"):
            self.open[:] = [each]
            self.explicit = self.explicit or each.word == "PRG"
            return
        if not self.open:  # perhaps the program of a file without PRG
            self.open.append(ScriptStatement("block", "PRG", (), "", each.line, each.column, wrong=True))
        innermost = self.open[-1].word
        if each.word in ("IF", "WHILE"):
            self.open.append(each)
        elif each.word in ("ENDIF", "ENDWHILE") and innermost == _OPENS[each.word]:
            self.open.pop()
        elif _ENDS[innermost] == each.word and each.word in ("END", "ENDSUB"):
            self.open.clear()

    def within(self, each: ScriptStatement) -> None:
        if len(self.open) == 1 and self.open[0].wrong and self.open[0].kind == "block":
            self.open.clear()
        if self.open:
            return
        if self.explicit or "PRG 0" in self.seen:
            self.wrong(each, f"{each} is outside of a program or subroutine", "begin with PRG 0, or move it")
            self.astray = True
        if not self.astray:
            self.seen["PRG 0"] = each.line
        self.open.append(ScriptStatement("block", "PRG", (), "", each.line, each.column))

    def begin(self, each: ScriptStatement) -> None:
        if self.open and not self.open[0].wrong and (self.open[0].values or not self.astray):
            outer = self.open[0]
            self.wrong(each, f"{each} inside of {_called(outer)}", f"end that with {_ENDS[outer.word]} first")
            self.unclosed(self.open[1:])
        self.open.clear()
        if (before := self.seen.get(str(each))) is not None:
            self.wrong(each, f"there is a {each} already, in line {before}", "number them differently")
        self.explicit = self.explicit or each.word == "PRG"
        self.seen.setdefault(str(each), each.line)
        self.open.append(each)

    def end(self, each: ScriptStatement) -> None:
        word = "PRG" if each.word == "END" else "SUB"
        if not self.open:
            if each.word == "END" and not self.seen:
                self.seen["PRG 0"] = each.line  # an empty program
                return
            self.wrong(each, f"{each.word} without a {word}")
            return
        self.unclosed(self.open[1:])
        if self.open[0].word != word and not self.open[0].wrong:
            self.wrong(each, f"{_called(self.open[0])} is ended by {each.word}", f"write {_ENDS[self.open[0].word]}")
        if each.word == "END" and not self.explicit:
            self.seen.setdefault("PRG 0", each.line)
        self.open.clear()

    def inner(self, each: ScriptStatement) -> None:
        wanted = _OPENS[each.word]
        if not any(outer.word == wanted for outer in self.open):
            self.wrong(each, f"{each.word} without {wanted}")
            return
        while self.open[-1].word != wanted:
            self.unclosed([self.open.pop()])
        opened = self.open[-1]
        if each.word in ("ELSE", "ELSEIF"):
            if opened.line in self.closed:
                self.wrong(each, f"{each.word} after the ELSE of the IF in line {opened.line}", "ELSE comes last")
            if each.word == "ELSE":
                self.closed.add(opened.line)
        else:
            self.open.pop()

    def unclosed(self, blocks: Sequence[ScriptStatement]) -> None:
        for block in blocks:
            if not block.wrong:
                self.wrong(block, f"{block.word} is never ended", f"{_ENDS[block.word]} is missing")

    def finish(self) -> None:
        if self.open and not self.open[0].values and self.last is not None:
            self.unclosed(self.open[1:])
            if not self.astray and not self.open[0].wrong:
                self.wrong(self.last, "the program has no END", "its last line is END")
            return
        self.unclosed(self.open)


def _called(block: ScriptStatement) -> str:
    return f"{block} of line {block.line}" if block.values else f"the program that begins in line {block.line}"


def _calls(statements: Sequence[ScriptStatement]) -> list[Problem]:
    subroutines = [statement for statement in statements if statement.word == "SUB"]
    defined = {subroutine.number for subroutine in subroutines if not subroutine.wrong}
    surely = len(defined) == len(subroutines)
    problems, calls, inside = [], dict[int, set[int]](), None
    for statement in statements:
        if statement.word == "SUB":
            inside = None if statement.wrong else statement.number
        elif statement.word in ("ENDSUB", "PRG", "END"):
            inside = None
        elif statement.wrong or (statement.word == "GOSUB" and statement.number not in defined and not surely):
            continue
        elif statement.word == "GOSUB" and statement.number not in defined:
            at = statement.values[0].column
            problems.append(
                Problem(statement.line, at, f"SUB {statement.number} is not defined", "write it, or call another")
            )
        elif statement.word == "GOSUB" and inside is not None:
            calls.setdefault(inside, set()).add(statement.number)
            if inside in walk([statement.number], lambda number: calls.get(number, ())):
                what = f"SUB {inside} calls itself" + (
                    f" by SUB {statement.number}" if statement.number != inside else ""
                )
                problems.append(
                    Problem(statement.line, statement.column, what, "only so many calls are kept", warning=True)
                )
    return problems


FARTHEST = 500
"""Statements after a move that are looked at."""
_HOMING = re.compile(r"(?:HL|L|Z)?HOME([XY])[+-]|ZOME([XY])[+-]")
_JOG = re.compile(r"JOG([XY])[+-]")
_PLACE = re.compile(r"[EP]([XY])")
_HALT = re.compile(r"(?:STOP|ABORT)([XY]?)")
_MOTION = re.compile(r"(?:MST|PS|SLS|P|E)[XY]")
_MARKS = ("END", "ENDSUB", "ENDIF", "ENDWHILE", "ELSE")
_COMPARED = {">": int.__gt__, "<": int.__lt__, "=": int.__eq__, ">=": int.__ge__, "<=": int.__le__, "!=": int.__ne__}


def _check_flow(statements: Sequence[ScriptStatement]) -> Iterator[Problem]:
    """Report what the paths through blocks show that match; a statement with an error is passed over.

    These are the first statement of each part that no path reaches, and moves that another statement does not wait for.
    """
    flow = _Flow(statements)
    reached = walk(flow.beginnings, flow.ways)
    dead = False
    for at, statement in enumerate(statements):
        if at in reached or statement.wrong:
            dead = False
        elif not dead and statement.word not in _MARKS:
            dead = True
            hint = "an endless loop or a condition of constants precedes it"
            yield Problem(statement.line, statement.column, f"{statement} is never executed", hint, warning=True)
    for at, move in enumerate(statements):
        axes = _moved(move)
        if not axes or (disturbed := _disturbed(flow, at, axes)) is None:
            continue
        other = statements[disturbed]
        what = f"{other} in line {other.line} does not wait for the end of this move"
        if other is move:
            what = f"the next {move} begins before this one has ended"
        yield Problem(move.line, move.column, what, f"WAIT{axes[0]} is missing after it", warning=True)


class _Flow:
    """The statements of a file, and which may be executed after which."""

    def __init__(self, statements: Sequence[ScriptStatement]) -> None:
        self.statements = statements
        self.beginnings: list[int] = []
        self.subroutines: dict[int, int] = {}
        self._partner: dict[int, int] = {}  # IF, ELSEIF, WHILE: where a false condition leads; ENDWHILE: its WHILE
        self._end: dict[int, int] = {}  # ELSEIF, ELSE: the ENDIF
        self._match()

    def _match(self) -> None:
        outside, opened = True, list[list[int]]()
        for at, statement in enumerate(self.statements):
            if statement.word in ("PRG", "SUB") and not statement.wrong:
                self.beginnings.append(at)
                if statement.word == "SUB":
                    self.subroutines[statement.number] = at
            elif outside:
                self.beginnings.append(at)
            outside = statement.word in ("END", "ENDSUB")
            if statement.word in ("IF", "WHILE"):
                opened.append([at])
            elif statement.word in ("ELSEIF", "ELSE", "ENDIF", "ENDWHILE") and opened:
                self._partner[opened[-1][-1]] = at
                opened[-1].append(at)
                if statement.word in ("ENDIF", "ENDWHILE"):
                    first, *inner, last = opened.pop()
                    if statement.word == "ENDWHILE":
                        self._partner[first] = last + 1
                        self._partner[last] = first
                    self._end.update(dict.fromkeys(inner, last))

    def ways(self, at: int) -> Iterator[int]:
        """The statements that may be executed next, those of a called subroutine left out."""
        statement = self.statements[at]
        if statement.word in ("END", "ENDSUB"):
            return
        ways = []
        holds = _holds(statement) if statement.word in ("IF", "ELSEIF", "WHILE") else statement.word != "ENDWHILE"
        if holds is not False:
            ways.append(self._end.get(at + 1, at + 1))
        if holds is not True:
            ways.append(self._partner.get(at, len(self.statements)))
        yield from (at for at in ways if at < len(self.statements) and self.statements[at].word not in ("PRG", "SUB"))


def _holds(each: ScriptStatement) -> bool | None:
    """Whether a condition of two numbers holds; None for any other."""
    if each.wrong:
        return None
    left, right = (value.constant for value in each.values)
    return None if left is None or right is None else _COMPARED[each.op](left, right)


def _axis(pattern: re.Pattern[str], word: str) -> str:
    match = pattern.fullmatch(word)
    return "".join(filter(None, match.groups())) if match else ""


def _moved(each: ScriptStatement) -> str:
    """The axes of a move that ends by itself; empty for any other statement."""
    return each.word if each.kind == "move" else _axis(_HOMING, each.word) if each.kind == "command" else ""


def _disturbed(flow: _Flow, move: int, axes: str) -> int | None:

    def disturbs(at: int) -> bool:
        statement = flow.statements[at]
        own = (
            _moved(statement)
            or _axis(_JOG, statement.word)
            or (_axis(_PLACE, statement.word) if statement.kind == "set" else "")
        )
        return bool(set(own) & set(axes))

    def ways(at: int) -> Iterator[int]:
        if not _waits(flow, at, move, axes):
            yield from flow.ways(at)

    return nearest(flow.ways(move), ways, disturbs, FARTHEST)


def _waits(flow: _Flow, at: int, move: int, axes: str) -> bool:
    """Whether a statement may wait for the end of a move."""
    statement = flow.statements[at]
    if statement.wrong or statement.kind == "delay" or any(_MOTION.fullmatch(value.text) for value in statement.values):
        return True
    if statement.kind == "wait":
        return statement.word in axes
    if statement.word == "WHILE":
        return at > move and _holds(statement) is None
    if statement.word != "GOSUB":
        halted = _HALT.fullmatch(statement.word)
        return halted is not None and (not halted[1] or halted[1] in axes)
    begin = flow.subroutines.get(statement.number)
    if begin is None:
        return True

    def may_wait(place: int) -> bool:
        """Whether a subroutine with this statement waits, moves, halts, loops, or calls another."""
        other = flow.statements[place]
        if other.wrong or other.kind in ("delay", "wait", "move") or other.word in ("WHILE", "GOSUB"):
            return True
        motion = any(_MOTION.fullmatch(value.text) for value in other.values)
        return motion or bool(_HALT.fullmatch(other.word)) or bool(_moved(other))

    return nearest([begin], flow.ways, may_wait, FARTHEST) is not None
