"""What the verbs of scripts are given: as a line is checked beforehand, and as it is executed."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass

from multidrop.base.errors import DriveError
from multidrop.shell.line_syntax import VerbLine, parse
from multidrop.shell.operations.table import script_verbs
from multidrop.shell.operations.verb import Chosen
from multidrop.shell.origin import Origin
from multidrop.shell.scripts import words
from multidrop.shell.scripts.captured_prints import Hearing
from multidrop.shell.scripts.expression import Comparison, DriveQuestion, Expression, Name, Value, evaluate
from multidrop.shell.scripts.questions import Checks, MacroSelection, converted, known
from multidrop.shell.session import Session


class CheckFailed(DriveError):
    """A check in a script did not hold. Any verb of scripts may raise it.

    It makes the report of a script say "failure", where any other exception makes it say "error".
    """


@dataclass(frozen=True)
class LineCheck:
    """A line that is checked before anything is sent."""

    word: str
    names: MutableMapping[str, str | None]
    """The names that have a value in this line; None: the value is not known yet."""
    known: bool
    """All values of the line are known."""

    def expression(self, text: str) -> Expression:
        """Parse an expression. Raises Diagnostic."""
        return words.expression(self.word, text, self.names)

    def comparison(self, text: str) -> Comparison:
        """Parse a comparison. Raises Diagnostic."""
        return words.comparison(self.word, text, self.names)


@dataclass(frozen=True)
class LineUse:
    """A line that is executed, with its values filled in."""

    session: Session
    heard: Hearing
    """What drives have printed, and the drive that the line is about."""
    names: MutableMapping[str, str]
    """The names of `/set`, with their values."""
    place: MacroSelection | None
    """The selection of a macro."""
    origin: Origin
    word: str
    text: str
    """The whole line."""

    def comparison(self, text: str) -> Comparison:
        """Parse a comparison. Raises Diagnostic."""
        return words.comparison(self.word, text, self.names)

    async def value(self, text: str) -> Value:
        """The value of an expression, once its words were read from their drives. Raises Diagnostic."""
        tree = words.expression(self.word, text, self.names)
        tree, checks = await converted(self.session, self.origin, tree, self.place)
        return evaluate(tree, await self.known(tree, checks))

    async def known(self, tree: Expression, checks: Checks) -> Mapping[Name | DriveQuestion, Value]:
        """The values of the names and words of an expression."""
        return await known(self.session, self.origin, tree, self.names, self.place, checks)


def chosen(text: str) -> Chosen:
    """The arguments of a line of a verb of scripts. Raises Diagnostic."""
    line = parse(text)
    assert isinstance(line, VerbLine)
    return script_verbs()[line.name].parsed(line.rest)
