"""The questions of a certificate: the table of a family.

A table has one question in a row: the lines that are sent, what they may do, and the answer by our rulings.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from multidrop.base.files import rows
from multidrop.dialects.codec import Procedure
from multidrop.dialects.state import OfDrive

NOTHING, ERROR, MODE, MOVES = "nothing", "error", "mode", "moves"
DOES = (NOTHING, MODE, ERROR, MOVES)
"""What a question may do: only read; also change a setting for a while; also raise an error; also move the motor."""
BYTES, FITS = "bytes", "fits"
"""What the answer is, in place of the printed lines: the bytes of the replies; whether they are as our ruling says."""


class Question(NamedTuple):
    """One question to a drive."""

    name: str
    asks: frozenset[str]
    """The traits that a drive must have (`Certifying.traits`)."""
    does: str
    shows: str
    """BYTES, FITS, or empty: the printed lines, the error numbers."""
    keeps: tuple[str, ...]
    """The settings that it changes, to be restored from the last to the first."""
    lines: tuple[str, ...]
    """What is sent. `{WORD}`, `{WORD+100}`: the value that the drive has before; `/wait`: until it is at rest."""
    ruled: str
    """The form of the answer by our rulings, a regular expression."""


class Occupied(NamedTuple):
    """Why some questions are not asked of a drive now; empty: they are."""

    changes: str = ""
    """The reason for all but those that only read."""
    errors: str = ""
    """The reason for those that may raise an error."""

    def reason(self, does: str) -> str:
        return "" if does == NOTHING else self.changes or (self.errors if does in (ERROR, MOVES) else "")


class Certifying(OfDrive):
    """The questions to a drive."""

    module: ClassVar[str]
    """The `__file__` of the module beside which `questions.csv` is."""
    reads: ClassVar[str]
    """The line that prints a setting."""
    writes: ClassVar[str]
    """The line that gives a setting a value."""
    refused: ClassVar[str] = "error {code}"
    """The answer of a drive that refuses: its error number, or the text of its reply (`{text}`)."""

    def traits(self) -> set[str]:
        """What the drive has that some questions need."""
        return set()

    def occupied(self) -> Procedure[Occupied]:
        """Find out what must not be asked of it at rest without a running program; raises no error and clears none."""
        return Occupied()
        yield  # a conversation

    def masked(self, raw: bytes) -> str:
        """The bytes of a reply as a text, without the drive's name."""
        return raw.decode("latin-1")

    def questions(self) -> list[Question]:
        """The questions for the drive, in order; of several with one name the first."""
        own, questions = self.traits(), dict[str, Question]()
        for question in self.table():
            if question.asks <= own:
                questions.setdefault(question.name, question)
        return list(questions.values())

    @classmethod
    def table(cls) -> list[Question]:
        """All questions."""
        return [
            Question(
                row["name"],
                frozenset(row["asks"].split()),
                row["does"],
                row["shows"],
                tuple(filter(None, row["keeps"].split("; "))),
                tuple(row["lines"].split(" // ")),
                row["ruled"],
            )
            for row in rows(cls.module, "questions.csv")
        ]
