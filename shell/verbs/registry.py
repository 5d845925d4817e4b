"""The registry of verbs, one decorated function each: dispatch, usage, help and completion read it."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic
from multidrop.shell.events import By
from multidrop.shell.lines import split_target

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session
    from multidrop.shell.workspace import Workspace


def split(text: str, where: str) -> list[str]:
    """Split text into words, without their quotation marks. Raises Diagnostic for a mark that is not closed."""
    splitter = shlex.shlex(text, posix=True)
    splitter.whitespace_split, splitter.escape, splitter.commenters = True, "", ""
    try:
        return list(splitter)
    except ValueError:
        raise Diagnostic("a quotation mark is not closed", where) from None


@dataclass(frozen=True)
class Call:
    """One use of a verb: where it works, the text after its name, and its origin."""

    session: Session
    verb: Verb
    rest: str
    by: By = By.OPERATOR

    @property
    def workspace(self) -> Session:
        """The session, under its former name."""
        return self.session

    commands = workspace

    def words(self, low: int = 0, high: int | None = None) -> list[str]:
        """The words after the name, without quotes. Raises Diagnostic with the usage for a wrong number of words."""
        return self.verb.arguments(self.rest, low, high)

    def output_file(self, name: str) -> str:
        """Return the path of a file to write. Raises Diagnostic for a macro's that leaves the current folder.

        A macro may be another person's file: it must not overwrite files elsewhere.
        """
        if self.by is By.MACRO and not Path(name).resolve().is_relative_to(Path.cwd().resolve()):
            hint = "name a file inside it, or type the line"
            raise Diagnostic(f"{name} leaves the current folder, in which a macro writes", self.verb.name, hint)
        return name

    def wrong(self, message: str = "") -> Diagnostic:
        """A Diagnostic with the usage, and with the error if it is known."""
        return self.verb.wrong(message)

    def drive(self, target: str) -> Drive:
        """Find the drive of `ADDR` or `BUS:ADDR`; the selected drive for an empty target."""
        bus, address = split_target(target)
        return self.workspace.drive(bus, address or None)


Function = Callable[[Call], Coroutine[Any, Any, None]]


@dataclass(frozen=True)
class Verb:
    """A host command."""

    name: str
    """With its slash."""
    usage: str
    """The whole line: name and arguments, in the notation of `shell.verbs.usage`."""
    meaning: str
    """One line."""
    help: str
    """All of the docstring."""
    function: Function
    recorded: Callable[[Call], str] | None = None
    """The line that a macro records; None: the verb is not recorded."""
    immediate: bool = False
    """The verb is done at once, so a stop has nothing to end."""
    concurrent: bool = False
    """The verb runs beside the lines typed at a prompt."""
    words: Mapping[str, str] = field(default_factory=dict)
    """The meanings of the literal words of its usage."""
    table: Callable[[], list[str]] | None = None
    """More lines of its help, from the table that the verb uses."""
    fits: Callable[[Workspace], bool] = lambda workspace: True
    """Whether the verb applies to the selection; only then is it offered."""
    check: Callable[[Verb, str], object] = lambda verb, rest: None
    """Raises Diagnostic for arguments that are wrong whatever is open: a script is checked before it begins."""

    def arguments(self, rest: str, low: int = 0, high: int | None = None) -> list[str]:
        """The words after the name, without quotes. Raises Diagnostic with the usage for a wrong number of words."""
        found = split(rest, self.name)
        too_many = high is not None and len(found) > high
        if len(found) < low or too_many:
            raise self.wrong()
        return found

    def wrong(self, message: str = "") -> Diagnostic:
        """A Diagnostic with the usage, and with the error if it is known."""
        usage = f"usage: {self.usage}"
        return Diagnostic(message, self.name, usage) if message else Diagnostic(usage, self.name)

    def meaning_of(self, typed: Sequence[str]) -> str:
        """The meaning of the first word if that is a literal; else the meaning of the verb."""
        return self.words.get(typed[0], self.meaning) if typed else self.meaning

    def described(self) -> list[str]:
        """The help, line by line."""
        return [self.usage, *self.help.splitlines(), *(self.table() if self.table else ())]


VERBS: dict[str, Verb] = {}
"""By name, in the order of the overview."""


def as_typed(call: Call) -> str:
    """Record the line as typed."""
    return f"{call.verb.name} {call.rest}".strip()


def verb(
    usage: str,
    *,
    recorded: Callable[[Call], str] | None = None,
    immediate: bool = False,
    concurrent: bool = False,
    words: Mapping[str, str] | None = None,
    table: Callable[[], list[str]] | None = None,
    fits: Callable[[Workspace], bool] = lambda workspace: True,
    check: Callable[[Verb, str], object] = lambda verb, rest: None,
) -> Callable[[Function], Function]:
    """Register a function under the first word of its usage; the docstring is the help."""

    def register(function: Function) -> Function:
        name = usage.split()[0]
        text = inspect.cleandoc(function.__doc__ or "")
        meaning = text.partition("\n")[0]
        VERBS[name] = Verb(
            name, usage, meaning, text, function, recorded, immediate, concurrent, words or {}, table, fits, check
        )
        return function

    return register
