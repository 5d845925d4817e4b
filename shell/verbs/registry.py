"""The registry of verbs: one decorated function each; dispatch, help and completion read it."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dialects import Diagnostic
from shell.events import By

if TYPE_CHECKING:
    from drives.drive import Drive
    from shell.workspace import Commands, Workspace


@dataclass(frozen=True)
class Call:
    """One use of a verb: the session, what stands behind the name, and who entered it."""

    workspace: Workspace
    commands: Commands
    verb: Verb
    rest: str
    by: By = By.OPERATOR

    def words(self, low: int = 0, high: int | None = None) -> list[str]:
        """The words behind the name, quotes taken off. Raises Diagnostic with the usage for a wrong number."""
        splitter = shlex.shlex(self.rest, posix=True)
        splitter.whitespace_split, splitter.escape, splitter.commenters = True, "", ""
        try:
            found = list(splitter)
        except ValueError:
            raise Diagnostic("a quotation mark is not closed", self.verb.name) from None
        if len(found) < low or (high is not None and len(found) > high):
            raise self.wrong()
        return found

    def wrong(self, message: str = "") -> Diagnostic:
        """The usage as a Diagnostic, with what is wrong where that can be said."""
        usage = f"usage: {self.verb.usage}"
        return Diagnostic(message, self.verb.name, usage) if message else Diagnostic(usage, self.verb.name)

    def drive(self, target: str) -> Drive:
        """The drive that `ADDR` or `BUS:ADDR` means; the selected one where it is empty."""
        from shell.lines import split_target

        bus, address = split_target(target)
        return self.workspace.drive(bus, address or None)


Function = Callable[[Call], Coroutine[Any, Any, None]]


@dataclass(frozen=True)
class Verb:
    """A host command."""

    name: str
    """With its slash."""
    usage: str
    """The whole line: name and arguments, as `shell.verbs.usage` reads it."""
    meaning: str
    """One line."""
    help: str
    """All of the docstring."""
    function: Function
    recorded: Callable[[Call], str] | None = None
    """The line that a macro keeps; None: it is not kept."""
    immediate: bool = False
    """Done at once, so nothing that a stop would have to end."""
    concurrent: bool = False
    """Runs beside what is typed at a prompt, which goes on at once."""
    words: Mapping[str, str] = field(default_factory=dict)
    """What the words of its usage mean that are typed as they stand."""
    table: Callable[[], list[str]] | None = None
    """More lines of its help, from the table that it works by."""
    fits: Callable[[Workspace], bool] = lambda workspace: True
    """Whether it does anything for what is selected; it is offered only then."""

    def meaning_of(self, typed: Sequence[str]) -> str:
        """What it does with these words, where its first one says; else its meaning."""
        return self.words.get(typed[0], self.meaning) if typed else self.meaning

    def described(self) -> list[str]:
        """Its help, line by line."""
        return [self.usage, *self.help.splitlines(), *(self.table() if self.table else ())]


VERBS: dict[str, Verb] = {}
"""By name, in the order in which help shows them."""


def as_typed(call: Call) -> str:
    """Keep the line in a macro as it was typed."""
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
) -> Callable[[Function], Function]:
    """Register a function under the first word of its usage; its docstring is its help."""

    def register(function: Function) -> Function:
        name = usage.split()[0]
        text = inspect.cleandoc(function.__doc__ or "")
        meaning = text.partition("\n")[0]
        VERBS[name] = Verb(
            name, usage, meaning, text, function, recorded, immediate, concurrent, words or {}, table, fits
        )
        return function

    return register
