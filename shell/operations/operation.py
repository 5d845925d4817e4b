"""The declaration of an operation: one record gives its verb with help and completion, and its command with `--help`.

This module and the declarations are imported for every `--help`, so they import nothing that costs time.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base.feature import Kinds
from multidrop.base.on_demand import imported

if TYPE_CHECKING:
    from multidrop.base.errors import Diagnostic
    from multidrop.shell.operations.parameter import Parameter
    from multidrop.shell.workspace import Workspace

ACTIONS = "multidrop.shell.operations.arguments"
NOTHING: Mapping[str, Any] = MappingProxyType({})
TYPE_RAISES: Kinds = (ValueError, TypeError, argparse.ArgumentTypeError)
"""What argparse expects of the `type` of an argument."""
Arguments = Mapping[str, Any]
"""The arguments of a command by their notation; each has its help, a mapping with `help` and what else
argparse takes for it, or a function that returns either.

`FILE` is one word, `[FILE]` may be left out, `FILE ...` is one or more, `[FILE ...]` any number; `--json` is a flag,
`--to URL` an option with a value, `--vary KEY=VALUES ...` one that may be repeated. A word is kept under its metavar in
small letters, several with an s, or under the NAME of `NAME=FILE`. `--a | --b` has a mapping of the arguments of which
a line has one; in brackets none is needed. Functions read the tables of families, whose import takes time.
"""


class Examples(NamedTuple):
    """More examples of a command, without `multidrop` in front."""

    command: str
    lines: tuple[str, ...]


class Operation(NamedTuple):
    """A task of the product: a verb in a session, a command, or both."""

    usage: str = ""
    """Name and arguments of the verb, in the notation of `multidrop.shell.operations.usage`; empty: no verb."""
    help: str = ""
    """The help on the verb; its first line is the meaning."""
    work: str | Callable[[Any], Coroutine[Any, Any, None]] = ""
    """What the verb does, from a `shell.verbs.call.Call`: a function, or `FILE:FUNCTION` in `multidrop.shell.verbs`."""
    words: Mapping[str, str] = NOTHING
    """The meanings of the literal words of the usage."""
    recorded: str | Callable[..., Any] = ""
    """`FILE:FUNCTION` of the line that a macro records; `typed`: the line as typed; empty: none."""
    checked: str | Callable[..., Any] = ""
    """`FILE:FUNCTION`, which raises Diagnostic for arguments that are wrong whatever is open: scripts are checked."""
    rows: str | Callable[[], Sequence[str]] = ""
    """`MODULE:FUNCTION` for more lines of its help, from the table that the verb uses."""
    fits: Callable[[Workspace], bool] | None = None
    """The condition under which the verb is offered."""
    changes: Sequence[str] | None = None
    """The first words with which the verb changes a drive, or lets it run; none: with any. None: it never does."""
    immediate: bool = False
    """The verb is done at once, so a stop has nothing to end."""
    concurrent: bool = False
    """The verb runs beside the lines typed at a prompt."""
    command: str = ""
    """The words of the command: `program check`; empty: no command."""
    meaning: str = ""
    """The meaning of the command."""
    run: str | Callable[[argparse.Namespace], int] = ""
    """From the parsed arguments to the exit code: a function, or its `FILE.FUNCTION` in `multidrop.commands`; empty:
    a group."""
    examples: Sequence[str] = ()
    arguments: Arguments = NOTHING
    urls: bool = False
    """The help on a group explains URLs, as that on a command with a URL does."""
    own_urls: str = ""
    """The explanation of its own URLs, where it takes other ones."""
    connection: bool = False
    """The standard output of the command is a connection, whose end it notices itself."""
    group: str = ""
    """The title of `/help` under which a feature's verb is listed."""
    after: str = ""
    """The verb or command that a feature's is listed after, in `/help` and `--help`; empty: it comes last."""

    def passes(self) -> Mapping[str, Kinds]:
        """What its callers expect to be raised, besides what a person reads; see `base.foreign`."""
        return {"run": (SystemExit,), "type": TYPE_RAISES}

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return tuple(filter(None, (self.name, self.command)))

    def offered(self, workspace: Workspace) -> bool:
        """Whether the verb is offered; one whose condition fails is not."""
        from multidrop.base.errors import Diagnostic

        try:
            return self.fits is None or self.fits(workspace)
        except Diagnostic:  # by others
            return False

    @property
    def name(self) -> str:
        return self.usage.partition(" ")[0]

    def following(self, words: Sequence[str]) -> Iterator[tuple[str, str] | Parameter]:
        """What may follow these words: see `Verb.following`."""
        from multidrop.shell.operations.usage import following

        yield from ((each, self.words.get(each, "")) for each in following(self.usage, words))

    def narrowed(self, words: Sequence[str]) -> str:
        """The usage with only the forms that begin with these words."""
        from multidrop.shell.operations.usage import narrowed

        return narrowed(self.usage, words)

    @property
    def lines(self) -> list[str]:
        """The help on the verb; the first line is its meaning."""
        return [line.strip() for line in self.help.strip().splitlines()]

    def meaning_of(self, typed: Sequence[str]) -> str:
        """The meaning of the first word if that is a literal; else the meaning of the verb."""
        return self.words.get(typed[0], self.lines[0]) if typed else self.lines[0]

    def described(self) -> list[str]:
        """The usage, the help, and the rows of its table."""
        rows = imported(self.rows) if isinstance(self.rows, str) and self.rows else self.rows
        return [self.usage, *self.lines, *(rows() if rows else ())]

    @property
    def takes_urls(self) -> bool:
        """Whether the help on the command explains URLs."""
        return self.urls or "URL" in str([*self.arguments.items()])

    def check(self, rest: str) -> None:
        """Raise Diagnostic for arguments that are wrong whatever is open."""
        if self.checked:
            self.imported(self.checked)(self, rest)

    def with_forms(self, added: Forms) -> Operation:
        """The verb, whose forms are a group in brackets, with the forms of a feature before them."""
        usage = self.usage.replace("[", f"[{added.usage} | ", 1)
        return self._replace(usage=usage, help=added.help, words={**added.words, **self.words})

    def imported(self, place: str | Callable[..., Any]) -> Any:
        return imported(f"multidrop.shell.verbs.{place}") if isinstance(place, str) else place

    @property
    def command_work(self) -> Callable[[argparse.Namespace], int]:
        """What the command does."""
        if not isinstance(self.run, str):
            return self.run
        file, _, function = self.run.partition(".")
        work: Callable[[argparse.Namespace], int] = imported(f"multidrop.commands.{file}:{function}")
        return work

    def wrong(self, message: str = "") -> Diagnostic:
        """A Diagnostic with the usage, and with the error if it is known."""
        from multidrop.base.errors import Diagnostic

        usage = f"usage: {self.usage}"
        return Diagnostic(message, self.name, usage) if message else Diagnostic(usage, self.name)


class Forms(NamedTuple):
    """Forms of a verb that is there already, whose work takes them to the feature."""

    verb: str
    usage: str
    """The forms, as in the usage of an Operation: `[ADDR ...] --to FILE | [ADDR ...] --serve PORT`."""
    help: str
    """The help on the verb with them, whole."""
    words: Mapping[str, str] = NOTHING
    """The meanings of their literal words; these are unlike those of the verb."""

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return tuple(f"{self.verb} {word}" for word in self.words)


def add_arguments(parser: argparse._ActionsContainer, arguments: Arguments) -> None:
    for notation, about in arguments.items():
        if " | " in notation:
            group = parser.add_mutually_exclusive_group(required=not notation.startswith("["))
            add_arguments(group, about)
            continue
        about = about() if callable(about) else about
        options: dict[str, Any] = dict(about) if isinstance(about, Mapping) else {"help": about or None}
        name, _, metavar = notation.partition(" ")
        if notation.startswith("-"):
            if metavar.endswith(" ..."):
                options = {"action": imported(f"{ACTIONS}:Each"), "default": []} | options
            elif not metavar and "choices" not in options:
                options["action"] = "store_true"
            elif not {"type", "choices", "required"} & options.keys():
                options.setdefault("default", "")
            if metavar and "action" not in options:
                options["action"] = imported(f"{ACTIONS}:Once")
            names = name.split("|")
        else:
            given, _, metavar = notation.rpartition("=")
            optional, several = metavar.startswith("["), "..." in metavar
            metavar = metavar.strip("[]").removesuffix(" ...")
            if optional or several:
                options["nargs"] = ("*" if several else "?") if optional else "+"
            if optional and not several:
                options.setdefault("default", "")
            word = re.match(r"\w+", metavar)
            names = [given or (word[0].lower() if word else "") + "s" * several]
            if "choices" in options:
                metavar = ""
        metavar = metavar.removesuffix(" ...")
        if metavar:
            options["metavar"] = metavar
        parser.add_argument(*names, **options)
