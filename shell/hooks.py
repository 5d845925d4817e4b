"""What a feature adds to sessions and to the commands that open them. It is called by `Session` and by these commands.

A feature's verbs and commands are `shell.operations.operation.Operation`s.
"""

from __future__ import annotations

import argparse
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from itertools import takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Kinds
from multidrop.shell.operations.operation import TYPE_RAISES, Examples

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


class AtSession(NamedTuple):
    """What is done as a session begins, before anything is open: subscribe to its events (`Session.subscribe`).

    `shell.session_hooks.SessionHooks`, the session's `hooks`, has lists of functions that take a line.
    """

    begin: Callable[[Session], None]

    def passes(self) -> Mapping[str, Kinds]:
        """See `base.foreign`: `begin` below takes whatever it raises."""
        return {"begin": (Exception, SystemExit)}


COMMANDS = ("shell", "tui")
"""The commands that take options of features."""


class Options(NamedTuple):
    """Options of a command that is there already, one of `COMMANDS`.

    `prepare` and `opened` take the session and the parsed arguments: `prepare` before a URL is opened, `opened` once
    all are, in a command that is not for a person. `instead` and `around` are of the options of `tui`.
    """

    command: str
    arguments: Mapping[str, Any]
    """As those of an Operation."""
    excludes: str = ""
    """The option of the command that these exclude."""
    prepare: Callable[[Session, argparse.Namespace], None] = lambda session, chosen: None
    opened: Callable[[Session, argparse.Namespace], Awaitable[None]] | None = None
    instead: Callable[[argparse.Namespace], int | None] = lambda chosen: None
    """Runs something in place of the command and returns the exit code; None: its option was not given."""
    around: Callable[[App, argparse.Namespace], AbstractContextManager[object]] = lambda app, chosen: nullcontext()
    """What is entered before the screen runs, and left after that."""
    examples: Sequence[str] = ()
    """Further examples of the command."""

    def passes(self) -> Mapping[str, Kinds]:
        """What its callers expect to be raised, besides what a person reads; see `base.foreign`."""
        return {"type": TYPE_RAISES}

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add. Raises Diagnostic for a command that takes no options of features."""
        if self.command not in COMMANDS:
            raise Diagnostic(f"{self.command} takes no options of features; {' and '.join(COMMANDS)} do")
        return tuple(f"{self.command} {each.partition(' ')[0]}" for each in self.arguments)


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


def begin(session: Session) -> list[str]:
    """Load the features by others, and let every feature begin in a session.

    Return a warning for each that cannot be loaded or cannot begin; the others and the session go on.
    """
    from multidrop.base.isolation import at_once
    from multidrop.shell.operations.table import load_others

    warnings = load_others()
    for feature in registry.features():
        for each in registry.records((feature,), AtSession):
            why: list[str] = []
            with registry.Attempt(why):
                at_once(each.begin)
                each.begin(session)
            warnings += [f"the feature {feature.name} cannot begin: {text}" for text in why]
    return warnings


def options(command: str) -> Iterator[Options]:
    """The options that features add to a command; a feature of the wheel that adds none is not imported."""
    those = (*registry.with_words(f"{command} -"), *registry.by_others())
    return (each for each in registry.records(those, Options) if each.command == command)


def check(command: str, given: Sequence[str]) -> None:
    """Raise Diagnostic if an option is given of a feature of the wheel that is not there."""
    for each in takewhile("--".__ne__, given):
        if each.startswith("-"):
            registry.with_word(f"{command} {each.partition('=')[0]}")


def with_options(command: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of a command, and those that features add."""
    found = dict(arguments)
    for each in options(command):
        if each.excludes not in found:
            found |= each.arguments
            continue
        group = {each.excludes: found[each.excludes], **each.arguments}
        named = {f"[{' | '.join(group)}]": group}
        found = {
            name: about
            for key, given in found.items()
            for name, about in (named if key == each.excludes else {key: given}).items()
        }
    return found


def asked_for(chosen: argparse.Namespace, besides: str) -> bool:
    """Whether any option of a feature was given, besides one in its notation."""
    notations = (name for each in options(chosen.command) for name in each.arguments if name != besides)
    return any(getattr(chosen, each.partition(" ")[0].strip("-").replace("-", "_")) for each in notations)


def prepare(session: Session, chosen: argparse.Namespace) -> None:
    """Do what the options of features ask for before a URL is opened."""
    for each in options(chosen.command):
        each.prepare(session, chosen)


async def opened(session: Session, chosen: argparse.Namespace) -> None:
    """Do what the options of features ask for once all URLs are open. Raises what they raise."""
    for each in options(chosen.command):
        if each.opened is not None:
            await each.opened(session, chosen)


def instead(chosen: argparse.Namespace) -> int | None:
    """Run what an option asks for in place of its command, and return the exit code; None: no option does."""
    codes = (each.instead(chosen) for each in options(chosen.command))
    return next((code for code in codes if code is not None), None)


@contextmanager
def around(app: App, chosen: argparse.Namespace) -> Iterator[None]:
    """What the options of features ask for while a screen runs. Raises what they raise as they begin."""
    with ExitStack() as stack:
        for each in options(chosen.command):
            stack.enter_context(each.around(app, chosen))
        yield


def examples(command: str) -> list[str]:
    """The examples that features and families add to those of a command."""
    found = [example for each in options(command) for example in each.examples]
    return [*found, *(line for each in registry.added(Examples) if each.command == command for line in each.lines)]
