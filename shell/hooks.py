"""What a feature adds to sessions and to the commands that open them. It is called by `Session` and by these commands.

A feature's verbs and commands are `shell.operations.operation.Operation`s.
"""

from __future__ import annotations

import argparse
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import replace
from itertools import takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.shell.operations.operation import Examples
from multidrop.shell.operations.parameter import Parameter, guarded_as, of_fields
from multidrop.shell.operations.parsing import values

if TYPE_CHECKING:
    from multidrop.shell.session import Session

App = Any
"""`tui.app.MultidropApp`, of a room above this one; a feature's function names it, and mypy checks its body."""
Prepare = Callable[["Session"], None]
"""Takes a session before a URL is opened."""
Around = Callable[[App], AbstractContextManager[object]]
"""What is entered before a screen runs, and left after that."""


def nothing(session: Session) -> None:
    """Prepare nothing."""


COMMANDS = ("shell", "tui")
"""The commands that take options of features."""


class Options(NamedTuple):
    """Options of a command that is there already, one of `COMMANDS`.

    The functions take what was given, an instance of the data class `options`. `prepare` takes the session before a URL
    is opened, `opened` once all are, in a command that is not for a person. `instead` and `around` are of `tui`.
    """

    command: str
    options: type
    """A data class, whose fields are the options: `shell.operations.parameter`."""
    prepare: Callable[[Session, Any], None] = lambda session, given: None
    opened: Callable[[Session, Any], Awaitable[None]] | None = None
    instead: Callable[[Any, bool], int | None] = lambda given, more: None
    """Runs something in place of the command and returns the exit code; None: its option was not given. `more`: URLs or
    other options were given, too."""
    around: Callable[[App, Any], AbstractContextManager[object]] = lambda app, given: nullcontext()
    """What is entered before the screen runs, and left after that."""
    examples: Sequence[str] = ()
    """Further examples of the command."""

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add. Raises Diagnostic for a command that takes no options of features."""
        if self.command not in COMMANDS:
            raise Diagnostic(f"{self.command} takes no options of features; {' and '.join(COMMANDS)} do")
        return tuple(f"{self.command} {name}" for parameter in self.parameters for name in parameter.names)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The options. Raises Diagnostic where they cannot be read."""
        replaced = (replace(field, holder=(self.options.__name__, self.options)) for field in of_fields(self.options))
        return guarded_as(self.prepare, replaced)


class Added:
    """The options of features that were given to a command."""

    def __init__(self, command: str, chosen: argparse.Namespace) -> None:
        self._given: list[tuple[Options, Any]] = []
        for option in options(command):
            arguments = values(option.parameters, chosen)
            self._given.append((option, option.options(**{one.name: arguments[one.name] for one in option.parameters})))

    def prepare(self, session: Session) -> None:
        """Do what the options ask for before a URL is opened."""
        for option, given in self._given:
            option.prepare(session, given)

    async def opened(self, session: Session) -> None:
        """Do what the options ask for once all URLs are open. Raises what they raise."""
        for option, given in self._given:
            if option.opened is not None:
                await option.opened(session, given)

    def instead(self, more: bool) -> int | None:
        """Run what an option asks for in place of its command, and return the exit code; None: no option does.

        `more`: URLs or options of the command itself were given.
        """
        for option, given in self._given:
            besides = any(other != one.options() for one, other in self._given if one is not option)
            if (code := option.instead(given, more or besides)) is not None:
                return code
        return None

    @contextmanager
    def around(self, app: App) -> Iterator[None]:
        """What the options ask for while a screen runs. Raises what they raise as they begin."""
        with ExitStack() as stack:
            for option, given in self._given:
                stack.enter_context(option.around(app, given))
            yield


class Switch(NamedTuple):
    """What a person turns on and off on the screen: an entry of the list of everything, which can have a key.

    It types `LINE on` or `LINE off` for the selected line of drives.
    """

    name: str
    """The function in `[keys]` of the settings; with a capital, the title of the entry."""
    line: str
    """The verb: `/twin`."""
    meaning: str
    """What it is, in the list of everything."""
    keyed: str
    """What its key does, in the help of the screen."""
    is_on: Callable[[Session], bool]

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return (f"the key of {self.name}",)

    def typed(self, session: Session) -> str:
        """The line that changes it. Raises Diagnostic where a switch by others fails."""
        return f"{self.line} {self._next(session)}"

    def title(self, session: Session) -> str:
        """`Twin on`: what the entry does; empty where the switch fails, which is then not offered."""
        try:
            return f"{self.name.capitalize()} {self._next(session)}"
        except Diagnostic:  # by others
            return ""

    def _next(self, session: Session) -> str:
        return "off" if self.is_on(session) else "on"


class Predicting(NamedTuple):
    """A feature that predicts where drives go (`Workspace.predicted`): the difference to that can be plotted."""

    missing: str
    """What is said of a drive whose positions it does not predict now."""
    begin: str
    """What to type, so that it does."""

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return ("predicted positions",)


def switches() -> Iterator[Switch]:
    """All switches of features."""
    return registry.added(Switch)


def options(command: str) -> Iterator[Options]:
    """The options that features add to a command; a feature of the wheel that adds none is not imported."""
    those = (*registry.with_words(f"{command} -"), *registry.by_others())
    return (record for record in registry.records(those, Options) if record.command == command)


def check(command: str, given: Sequence[str]) -> None:
    """Raise Diagnostic if an option is given of a feature of the wheel that is not there."""
    for word in takewhile("--".__ne__, given):
        if word.startswith("-"):
            registry.with_word(f"{command} {word.partition('=')[0]}")


def added_to(command: str) -> tuple[Parameter, ...]:
    """The options that features add to a command."""
    return tuple(one for option in options(command) for one in option.parameters)


def examples(command: str) -> list[str]:
    """The examples that features and families add to those of a command."""
    every = [example for option in options(command) for example in option.examples]
    return [*every, *(line for added in registry.added(Examples) if added.command == command for line in added.lines)]
