"""The declaration of an operation: a function, and what a person reads of it.

The function is the declaration of its arguments: `async def rename(call: Call, macro: MacroName, new: NewName)` is
`/macro rename MACRO NEW`. From it come the verb at the prompt and in scripts, the command with `--help`, completion and
the man page. The declarations are imported for every `--help`, so they import nothing that costs time; the bodies of
the functions do.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from enum import Enum, StrEnum, auto
from functools import cache
from inspect import isawaitable, iscoroutine
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base.feature import Kinds
from multidrop.shell.operations.parameter import Listed, Parameter, gathered, parameters
from multidrop.shell.operations.parsing import LineParser, add_parameters, values

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace


class Group(StrEnum):
    """The titles of `/help`, in their order."""

    STOPS = "Stop and end"
    LINES = "Lines and drives"
    VALUES = "Settings and values"
    PROGRAMS = "Programs of drives"
    MACROS = "Macros"
    WAITS = "Waits"
    BYTES = "Bytes"
    SCREEN = "The session and its screen"
    SIMULATED = "Simulated drives"


class VerbKind(Enum):
    """What a verb of scripts is to the lines around it."""

    STEP = auto()
    IF = auto()
    """Whether it returns true decides over the lines up to `/else` or `/end`."""
    COUNT = auto()
    """The lines up to `/end` are executed as often as it returns."""
    WHILE = auto()
    """They are executed as long as it returns true, before each round."""
    BETWEEN = auto()
    """It divides or ends a block."""
    CALL = auto()
    """It stands for the lines of a file or a macro."""


class Scripted(NamedTuple):
    """What makes a verb one of scripts, which get to it line by line. `do` is given a `shell.scripts.use.LineUse`."""

    kind: VerbKind = VerbKind.STEP
    check: Callable[..., None] | None = None
    """Raises Diagnostic for arguments that are wrong before anything is sent. It is given a `LineCheck`
    of `shell.scripts.use`, and the arguments."""
    bare: bool = False
    """Its names have no braces: it has an expression."""
    steers: bool = False
    """It has a result only where it fails."""
    verdict: bool = False
    """It is a check, which reports count."""
    goes_on: bool = False
    """A check that fails is noted, and the script goes on."""


ADDED = "added"
"""The parameter with the options of features."""


class Examples(NamedTuple):
    """More examples of a command, without `multidrop` in front."""

    command: str
    lines: tuple[str, ...]


Call = Any
"""`shell.session.Call`, which knows the session and so all verbs; a function names it, and mypy checks its body."""


def typed(call: Call) -> str:
    """Record a line as it was typed."""
    return f"{call.verb.name} {call.rest}".strip()


class Operation(NamedTuple):
    """A task of the product: a verb in a session, a command, or both.

    As a verb, the function is given the `Call`, or what `at` makes of it; as a command, what `through` gives it. Both
    add arguments of their own: `[ADDR]` behind those of a verb, and `URL` and `--drive` before those of a command.
    """

    do: Callable[..., Any] | None = None
    """What it does; a coroutine is awaited. A command returns its exit code, or None for 0. None: a group."""
    verb: str = ""
    """Its name, and the fixed words behind it: `/play`, `/macro rename`. Several with one name are its forms."""
    command: str = ""
    """The words of the command: `program check`."""
    help: str = ""
    """The help on the verb; its first line is the meaning. Of a form it is the meaning of its fixed word."""
    meaning: str = ""
    """The meaning of the command."""
    examples: Sequence[str] = ()
    """Of the command, without `multidrop` in front."""
    at: Callable[..., Any] | None = None
    through: Callable[..., Any] | None = None
    """Calls a function with what `do` is given first, and returns the exit code; a coroutine is awaited."""
    group: str = ""
    """The title of `/help` under which the verb is listed: one of `Group`, or another one of a feature."""
    after: str = ""
    """The verb or command that it is listed after, in `/help` and `--help`.

    Empty: in the order of the declarations; a feature's comes last."""
    recorded: Callable[[Call], str] | None = None
    """The line that a macro records; None: none."""
    rows: Callable[[], Sequence[str]] | None = None
    """More lines of the help on the verb, from the table that it uses."""
    fits: Callable[[Workspace], bool] | None = None
    """The condition under which the verb is offered."""
    changes: bool = False
    """It changes a drive, or lets it run."""
    checked: bool = False
    """A script is refused as a whole for arguments that are wrong; of other verbs a value may be unknown by then."""
    script: Scripted | None = None
    """It is a verb of scripts alone."""
    immediate: bool = False
    """The verb is done at once, so a stop has nothing to end."""
    concurrent: bool = False
    """The verb runs beside the lines typed at a prompt."""
    urls: bool = False
    """The help on a group explains URLs, as that on a command with a URL does."""
    own_urls: str = ""
    """The explanation of its own URLs, where it takes other ones."""
    extends: bool = False
    """Of a feature: a form of a verb that is there already. It comes before the verb's own, and takes the place of
    those with the same `verb`."""
    open: bool = False
    """Features may add options to the command: `do` is given them as `added`, a `shell.hooks.Added`."""
    connection: bool = False
    """The standard output of the command is a connection, whose end it notices itself."""

    def passes(self) -> Mapping[str, Kinds]:
        """What its callers expect to be raised, besides what a person reads; see `base.foreign`."""
        return {"do": (SystemExit,)} if self.command and not self.verb else {}

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        if self.extends:
            named = self.fixed[:1] or tuple(name for option in self.options for name in option.names)
            return tuple(f"{self.name} {word}" for word in named)
        return tuple(filter(None, (self.verb, self.command)))

    @property
    def name(self) -> str:
        """The name of the verb; empty: none."""
        return self.verb.partition(" ")[0]

    # As a verb

    @property
    def fixed(self) -> tuple[str, ...]:
        """The fixed words behind the name of the verb."""
        return tuple(self.verb.split()[1:])

    @property
    def arguments(self) -> tuple[Parameter, ...]:
        """The arguments of the verb."""
        return _own(self.do, 1) + _own(self.at, 1) if self.verb else ()

    @property
    def places(self) -> tuple[Parameter, ...]:
        return tuple(argument for argument in self.arguments if not argument.option)

    @property
    def options(self) -> tuple[Parameter, ...]:
        return tuple(argument for argument in self.arguments if argument.option)

    @property
    def usage(self) -> str:
        """The fixed words and the arguments of the verb."""
        return " ".join((*self.fixed, *(place.usage for place in (*self.places, *self.options))))

    def parsed(self, text: str) -> dict[str, Any]:
        """The values of the text behind the fixed words. Raises WrongWords."""
        return _line_parser(self.do, self.at).line(text, self.name)

    async def work(self, call: Call, found: Mapping[str, Any]) -> None:
        """Do it for a verb's line."""
        first: Any = call
        if self.at is not None:
            places, named = gathered(_own(self.at, 1), found)
            first = self.at(call, *places, **named)
        await self.done(first, found)

    async def done(self, first: Any, found: Mapping[str, Any]) -> Any:
        """Call the function with what it is given first; return what it returns."""
        assert self.do is not None
        places, named = gathered(_own(self.do, 1), found)
        result = self.do(first, *places, **named)
        return await result if isawaitable(result) else result

    # As a command

    @property
    def command_arguments(self) -> tuple[Parameter, ...]:
        """The arguments of the command."""
        own = _own(self.do, int(self.through is not None)) if self.command else ()
        return _own(self.through, 1) + own

    @property
    def run(self) -> bool:
        """Whether the command does anything: it is no mere group."""
        return self.do is not None

    @property
    def takes_urls(self) -> bool:
        """Whether the help on the command explains URLs."""
        return self.urls or any(Listed.URL in argument.argument.listed for argument in self.command_arguments)

    def add_to(self, parser: argparse.ArgumentParser, added: Sequence[Parameter] = ()) -> None:
        """Add the arguments of the command to its parser, with those that features add."""
        add_parameters(parser, (*self.command_arguments, *added))

    def command_work(self, chosen: argparse.Namespace, **more: object) -> int:
        """Run the command; return the exit code. `more`: what `do` is given besides its arguments."""
        assert self.do is not None
        do, arguments = self.do, values(self.command_arguments, chosen)
        places, named = gathered(_own(do, int(self.through is not None)), arguments)
        named |= more
        if self.through is None:
            result = do(*places, **named)
        else:
            own, names = gathered(_own(self.through, 1), arguments)
            result = self.through(lambda first: do(first, *places, **named), *own, **names)
        if iscoroutine(result):
            import asyncio

            result = asyncio.run(result)
        return result or 0


def _own(function: Callable[..., Any] | None, given: int) -> tuple[Parameter, ...]:
    return () if function is None else _parameters(function, given, (ADDED,))


_parameters = cache(parameters)


@cache
def _line_parser(do: Callable[..., Any] | None, at: Callable[..., Any] | None) -> LineParser:
    return LineParser(_own(do, 1) + _own(at, 1))
