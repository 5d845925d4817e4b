"""The order in which a program's lines are executed, as far as its text shows it.

A program is what lies between `PG <address>` and `PG`. A line leads to the next one, BR to its label, CL to its label
and to the next line; E and RT lead nowhere. A line with an error leads nowhere, so that nothing is concluded from it.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.dialects.program_files import Problem, nearest, walk, way_to
from multidrop.families.lexium.manual.grammar import Argument, NameTerm, Number, Statement, words
from multidrop.families.lexium.manual.groups import CONDITIONAL, HOLDING, HOMINGS, MOVES, PLACES, WATCHING
from multidrop.families.lexium.manual.program_file import ProgramLine
from multidrop.families.lexium.manual.table import lookup


@dataclass(frozen=True)
class FlowStep:
    """A line of a program. `statement` is None for a line with an error; `follows` is False at a program's first."""

    line: ProgramLine
    statement: Statement | None
    word: str
    """The drive's word at its head; empty for a bare number, a user's variable, and a line with an error."""
    follows: bool

    @property
    def label(self) -> str:
        """The name that it gives to its place; empty for any line but LB."""
        return self.line.declares if self.word == "LB" else ""

    @property
    def unconditional(self) -> bool:
        return self.word == "BR" and self.statement is not None and len(self.statement.arguments) == 1

    @property
    def ends(self) -> bool:
        """Whether the next line is never executed after it."""
        return self.word in ("E", "RT") or self.unconditional


class Flow:
    """The steps of all programs of a file, in order, and where each leads."""

    def __init__(
        self, lines: Sequence[ProgramLine], statements: Mapping[int, Statement], names: Container[str]
    ) -> None:
        self.steps: list[FlowStep] = []
        self.labels: dict[str, int] = {}
        self._starts: dict[str, int] = {}
        follows = False
        for line in lines:
            if line.section != "program":
                continue
            if line.mark is not None:
                self._starts.setdefault(line.mark, len(self.steps))
                follows = False
                continue
            statement = statements.get(line.number)
            word = statement.word if statement is not None and statement.word not in names else ""
            step = FlowStep(line, statement, word, follows)
            if step.label:
                self.labels.setdefault(step.label, len(self.steps))
            self.steps.append(step)
            follows = True
        self.hidden = False
        """Some line goes to an address whose line the text does not show."""
        self.called, self.branched = set[int](), set[int]()
        """The beginnings of the subroutines that CL, OE or a trip names; the places that some BR goes to."""
        for each in statements.values():
            if each.word not in PLACES or each.word in names:
                continue
            if (place := self.place(each)) is not None:
                (self.branched if each.word == "BR" else self.called).add(place)
            elif each.word in ("BR", "CL") or self._target(each) not in (None, Number(0)):  # 0 takes a trip away
                self.hidden = True

    @staticmethod
    def _target(statement: Statement) -> Argument | None:
        at = PLACES[statement.word]
        return statement.arguments[at] if len(statement.arguments) > at else None

    def place(self, statement: Statement) -> int | None:
        """The step that a statement goes to or names; None where the text does not show it."""
        target = self._target(statement)
        if isinstance(target, NameTerm):
            return self.labels.get(target.word)
        start = self._starts.get(str(target.value)) if isinstance(target, Number) else None
        return start if start is not None and start < len(self.steps) else None

    def next(self, at: int) -> int | None:
        following = at + 1
        return following if following < len(self.steps) and self.steps[following].follows else None

    def ways(self, at: int) -> Iterator[int]:
        """The lines that may be executed next, those of a called subroutine left out."""
        step = self.steps[at]
        if step.statement is None:
            return
        if step.word == "BR" and (place := self.place(step.statement)) is not None:
            yield place
        if not step.ends and (following := self.next(at)) is not None:
            yield following


# Warnings of lines that are never executed, of programs without an end, and of RT without a call.
#
# A host may start a program at any label (EX), so only a line without a label is unreachable, and only a label that
# nothing calls, that no BR goes to and that no line runs on to counts as the beginning of a program. E and RT after a
# line that goes elsewhere are the usual last lines, and are not reported. (MCode reference 3.3, 5.1.35, 5.1.112.)


AT_POWER_UP = "SU"
"""The one word of the drive that a label may have."""


def check_paths(flow: Flow, mentioned: Container[str]) -> Iterator[Problem]:
    """Report what the paths through the programs show. `mentioned` are words that lines with an error have."""
    dead = _dead(flow)
    for at, step in enumerate(flow.steps):
        if flow.next(at) is None and step.statement is not None and not step.ends and at not in dead:
            yield _warn(step, "the program runs on past this line, its last one", "end it with E")
    if not flow.hidden:
        # Report the first line of each part that no path reaches.
        reported: FlowStep | None = None
        for at, away in dead.items():
            step = flow.steps[at]
            if away is not reported and step.word not in ("E", "RT"):
                reported = away
                what = f"never executed: {away.line.text} in line {away.line.number} leads elsewhere"
                yield _warn(step, what, "give it a label, or delete it")
        # Report paths on which RT is reached without a call, each place once.
        before = walk(_beginnings(flow), flow.ways)
        seen = set[int]()
        for end in (place for place in before if flow.steps[place].word == "RT"):
            way = list(way_to(end, before))[::-1]
            begin = way[0][0] if way else end
            source, place = next(((source, place) for source, place in way if place in flow.called), (begin, None))
            if source in seen or (place is None and flow.steps[begin].label in mentioned):
                continue
            seen.add(source)
            yield _without_call(flow, begin, end) if place is None else _into(flow, source, place, end)


def _warn(step: FlowStep, what: str, hint: str) -> Problem:
    return Problem(step.line.number, step.line.column, what, hint, warning=True)


def _dead(flow: Flow) -> dict[int, FlowStep]:
    """The lines between one that leads elsewhere and the next label, each with the former."""
    dead: dict[int, FlowStep] = {}
    away: FlowStep | None = None
    for at, step in enumerate(flow.steps):
        if not step.follows or step.statement is None or step.label:
            away = None
        elif away is not None:
            dead[at] = away
        if step.ends and away is None:
            away = step
    return dead


def _beginnings(flow: Flow) -> Iterator[int]:
    """The lines at which a program may be started, other than by a call."""
    inner = flow.called | flow.branched
    for at, step in enumerate(flow.steps):
        previous = flow.steps[at - 1] if step.follows else None
        alone = previous is None or (previous.statement is not None and previous.ends)
        first = previous is None and at not in flow.called
        if step.label == AT_POWER_UP or first or (step.label and alone and at not in inner):
            yield at


def _into(flow: Flow, source: int, place: int, end: int) -> Problem:
    step, subroutine = flow.steps[source], flow.steps[place]
    rt = f"RT in line {flow.steps[end].line.number} then has nothing to return to"
    if step.word == "BR" and place != flow.next(source):
        name = subroutine.label or subroutine.line.text
        return _warn(step, f"BR goes into the subroutine {name}, and {rt}", f"call it: CL {name}")
    what = f"the program runs on into the subroutine of line {subroutine.line.number}, and {rt}"
    return _warn(step, what, "end it with E first")


def _without_call(flow: Flow, begin: int, end: int) -> Problem:
    """Report a beginning from which RT is reached, although nothing calls it."""
    step, rt = flow.steps[begin], f"RT in line {flow.steps[end].line.number}"
    if step.label in ("", AT_POWER_UP):
        return _warn(step, f"the program that begins here ends with {rt}", "end it with E")
    return _warn(
        step,
        f"nothing in this file calls {step.label}, which ends with {rt}",
        "call it (CL, OE or a trip), or end it with E",
    )


# Warnings of lines that do not wait for the end of a move: H is missing (MCode reference 3.4.2, 5.1.50).
#
# A move that is not waited for is often meant, so only lines that disturb it are reported: another move, which
# replaces it, homing and settings that a moving drive refuses (errors 73, 74, 85, 87, 95), and a new position. Nothing
# is reported after a line that may wait: H, also with a time; a condition or an assignment that reads the motion; a
# loop that waits for anything else; a subroutine that does one of these. A slew has no end to wait for, and SL ends
# every move.


FARTHEST = 500
"""Lines after a move that are looked at."""


def check_moves(flow: Flow) -> Iterator[Problem]:
    for at, step in enumerate(flow.steps):
        if not _has_an_end(step):
            continue

        def ways(place: int, move: int = at) -> Iterator[int]:
            if not _waits(flow, place, move):
                yield from flow.ways(place)

        def disturbs(place: int) -> bool:
            return _disturbs(flow.steps[place])

        ahead = nearest(flow.ways(at), ways, disturbs, FARTHEST)
        if ahead is not None:
            other = flow.steps[ahead]
            if other is step:
                what = f"the next {step.line.text} begins before this one has ended"
            else:
                what = f"{other.line.text} in line {other.line.number} does not wait for the end of this move"
            yield Problem(step.line.number, step.line.column, what, "H is missing after it", warning=True)


def _has_an_end(step: FlowStep) -> bool:
    """Whether it starts a move that ends by itself; with a third parameter MA and MR go on."""
    if step.statement is None or not step.statement.arguments:
        return False
    goes_on = step.statement.arguments[2:]
    return step.word in HOMINGS or (step.word in MOVES and goes_on in ((), (Number(0),), (None,)))


def _disturbs(step: FlowStep) -> bool:
    if step.statement is None:
        return False
    if not step.statement.word:
        return True
    row = lookup(step.word)
    if row is None or not (row.rest or step.word in MOVES):
        return False
    return bool(step.statement.arguments) or not (row.valued or step.word in MOVES | HOMINGS)


def _waits(flow: Flow, at: int, move: int) -> bool:
    """Whether a line may wait for the end of the move in the line `move`."""
    step = flow.steps[at]
    if step.statement is None or step.word in HOLDING:
        return True
    if step.word != "PR" and words(step.line.text) & WATCHING:
        return True
    if step.word not in CONDITIONAL:
        return False
    place = flow.place(step.statement)
    if place is None:
        return True
    if step.word == "CL":
        return nearest([place], flow.ways, lambda each: _is_busy(flow.steps[each]), FARTHEST) is not None
    return not step.unconditional and move < place <= at


def _is_busy(step: FlowStep) -> bool:
    """Whether a subroutine with this line may wait: it holds, watches the motion, moves, or calls another."""
    calm = step.statement is not None and step.word not in HOLDING - {"RT"} and step.word != "CL"
    return not calm or _disturbs(step) or bool(words(step.line.text) & WATCHING)
