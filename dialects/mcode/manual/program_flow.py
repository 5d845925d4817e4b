"""The order in which a program's lines are executed, as far as its text shows it.

A program is what lies between `PG <address>` and `PG`. A line leads to the next one, BR to its label, CL to its label
and to the next line; E and RT lead nowhere. A line with an error leads nowhere, so that nothing is concluded from it.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.dialects.mcode.manual.grammar import Name, Number, Statement
from multidrop.dialects.mcode.manual.program_file import ProgramLine

PLACES = {"BR": 0, "CL": 0, "OE": 0, "TC": 0, "TM": 0, "TI": 1, "TP": 1, "TT": 1, "TR": 1, "TA": 1}
"""Words that go to a place or name one, and the position of that place among their arguments."""


@dataclass(frozen=True)
class Step:
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
        """Whether it is a BR without a condition."""
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
        self._naming = [each for each in statements.values() if each.word in PLACES and each.word not in names]
        self.steps: list[Step] = []
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
            step = Step(line, statement, word, follows)
            if step.label:
                self.labels.setdefault(step.label, len(self.steps))
            self.steps.append(step)
            follows = True

    def place(self, statement: Statement) -> int | None:
        """The step that a statement goes to or names; None where the text does not show it."""
        at = PLACES[statement.word]
        target = statement.arguments[at] if len(statement.arguments) > at else None
        if isinstance(target, Name):
            return self.labels.get(target.word)
        found = self._starts.get(str(target.value)) if isinstance(target, Number) else None
        return found if found is not None and found < len(self.steps) else None

    @property
    def hidden(self) -> bool:
        """Whether some line goes to an address whose line the text does not show."""
        return any(self.place(each) is None and not _names_nothing(each) for each in self._naming)

    def next(self, at: int) -> int | None:
        """The next line of the same program; None after its last."""
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

    def called(self) -> frozenset[int]:
        """The beginnings of the subroutines that CL, OE or a trip names."""
        places = (self.place(each) for each in self._naming if each.word != "BR")
        return frozenset(place for place in places if place is not None)

    def branched(self) -> frozenset[int]:
        """The places that some BR goes to."""
        places = (self.place(each) for each in self._naming if each.word == "BR")
        return frozenset(place for place in places if place is not None)


def _names_nothing(statement: Statement) -> bool:
    """Whether it names no place: OE and the trips without one, or with 0, which takes it away."""
    at = PLACES[statement.word]
    target = statement.arguments[at] if len(statement.arguments) > at else None
    return statement.word not in ("BR", "CL") and target in (None, Number(0))
