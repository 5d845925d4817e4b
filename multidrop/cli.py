"""The command line: the parser that the declarations of operations make.

Building the parser imports nothing but argparse, so that --help and --version are quick. Only the requested command
becomes a parser of its own. Its arguments are added when it is parsed, and its file in `multidrop.commands` is imported
when it runs.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

    from multidrop.shell.operations.operation import Operation
    from multidrop.shell.operations.parameter import Parameter

URLS = """A URL is {}; sim: alone is the demo cell. Keys after a ?: dialect, drives=a,b,c, baud,
party=0|1, checksum=0|1|2, em=0..3, echo=local, address=none, timeout=SECONDS, relay=multidrop|socat."""
WIDTH = 79
DESCRIPTION = "A terminal and a scripting shell for motion drives on a shared line."
EPILOG = (
    "Without a command: the screen, with saved connections, serial ports and the demo cell. "
    "multidrop COMMAND --help shows its arguments."
)
EXTRAS = {"pytest": "pytest"}
"""The modules of the extras in pyproject.toml that are no feature's, by extra."""


class Formatter(argparse.HelpFormatter):
    """A formatter of help that does not import `shutil`, and with it three compressors, for the width of a terminal."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=_columns() - 2)


class ExamplesFormatter(Formatter, argparse.RawDescriptionHelpFormatter):
    """The formatter of a command's help, which keeps the lines of its examples."""


def _columns() -> int:
    """The width of the output: COLUMNS, the terminal's, or 80."""
    given = os.environ.get("COLUMNS", "")
    if given.isdecimal() and int(given):
        return int(given)
    try:
        return os.get_terminal_size(sys.__stdout__.fileno() if sys.__stdout__ else 1).columns or 80
    except (OSError, ValueError):  # not a terminal, or closed
        return 80


class Parser(argparse.ArgumentParser):
    """An argument parser that reports wrong usage in one line, and adds a command's arguments when it parses them."""

    operation: Operation | None = None
    """None: the parser of all commands."""
    complete = True
    """False until the arguments of the command have been added."""

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse; see argparse."""
        self.add_arguments(args or ())
        return super().parse_known_args(args, namespace)

    def add_arguments(self, given: Sequence[str]) -> None:
        """Add the arguments of the command, or its parts. One with both is a part if the first word names one."""
        if self.operation is None or self.complete:
            return
        from multidrop.shell.operations.table import COMMANDS

        self.complete = True
        own = COMMANDS.parts(self.operation.command)
        named = given[:1] and given[0] in own
        if self.operation.run and not named:
            self._add_own(self.operation, given)
        if own and (named or not self.operation.run):
            self.add_commands(own, given, "|".join(own), required=True)

    def _add_own(self, operation: Operation, given: Sequence[str]) -> None:
        """Add the arguments of the command, with the options of features."""
        from multidrop.shell import hooks

        added: Sequence[Parameter] = ()
        if operation.open:
            _check_options(operation.command, given)
            added = hooks.added_to(operation.command)
            if _has_others(given, (*operation.command_arguments, *added)):
                _load_others(given)
                added = hooks.added_to(operation.command)
        operation.add_to(self, added)
        _add_no_config(self)
        self.set_defaults(run_by=operation, command=operation.command)

    def add_commands(
        self, commands: Mapping[str, Operation], given: Sequence[str], metavar: str, *, required: bool
    ) -> None:
        """Add the commands, or only the one that the first word names."""
        added = self.add_subparsers(prog=self.prog, metavar=metavar, required=required, parser_class=Parser)
        asked = given[0] if given else ""
        if asked not in commands:
            _load_others(given)
        for name, operation in (_the_one(asked, commands) if asked in commands else commands).items():
            part = added.add_parser(
                name,
                help=operation.meaning,
                description=operation.meaning[0].upper() + operation.meaning[1:] + ".",
                formatter_class=ExamplesFormatter,
            )
            part.operation, part.complete = operation, False

    def add_all(self) -> None:
        """Add the arguments and the examples of the command and of its parts."""
        self.add_arguments(())
        if self.operation is not None:
            self.epilog = _epilog(self.operation)
        for action in self._actions:
            for part in (action.choices or {}).values() if isinstance(action, argparse._SubParsersAction) else ():
                part.add_all()

    def error(self, message: str) -> NoReturn:
        """Report wrong usage and where to look, and exit with 2."""
        from multidrop.shell.streams.stdout import shortened, write

        write(sys.stderr, f"{self.prog}: {shortened(' '.join(message.split()))}; see {self.prog} --help")
        self.exit(2)

    def format_help(self) -> str:
        """Return the help, with the examples of the command."""
        if self.operation is not None:
            self.epilog = _epilog(self.operation)
        return super().format_help()

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help. Raises OSError, which argparse suppresses."""
        (file or sys.stdout).write(self.format_help())


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        sys.stdout.write(f"{version()}\n")
        parser.exit()


def _has_others(given: Sequence[str], known: Sequence[Parameter]) -> bool:
    """Whether a line has an option that no feature of the wheel declares, or asks for help: others may add one."""
    names = {"--no-config", *(name for parameter in known if parameter.option for name in parameter.names)}
    return any(word.startswith("-") and word.partition("=")[0] not in names for word in given)


def _load_others(given: Sequence[str]) -> None:
    """Load the features by others, whose commands a line may mean; say of each that cannot be loaded why."""
    from multidrop.base.places import without_configuration
    from multidrop.shell.operations.table import load_others

    with without_configuration() if "--no-config" in given else nullcontext():
        _warn(load_others())


def _warn(warnings: Sequence[str]) -> None:
    if warnings:
        from multidrop.shell.streams.stdout import write

        write(sys.stderr, *(f"warning: {warning}" for warning in warnings))


def _the_one(name: str, commands: Mapping[str, Operation]) -> Mapping[str, Operation]:
    """The command that a line asks for. Raises SystemExit where its feature is not there."""
    from multidrop.base.errors import Diagnostic
    from multidrop.shell.streams.stdout import fail

    try:
        return {name: commands[name]}
    except Diagnostic as problem:
        raise SystemExit(fail(problem)) from None


def _check_options(command: str, given: Sequence[str]) -> None:
    """Raise SystemExit for an option whose feature is not there."""
    from multidrop.base.errors import Diagnostic
    from multidrop.shell.hooks import check
    from multidrop.shell.streams.stdout import fail

    try:
        check(command, given)
    except Diagnostic as problem:
        raise SystemExit(fail(problem)) from None


def _add_no_config(parser: Parser) -> None:
    suppressed = argparse.SUPPRESS  # a default of the command would replace what stood before the command
    parser.add_argument("--no-config", action="store_true", default=suppressed, help="read no configuration file")


def parse(given: Sequence[str]) -> argparse.Namespace:
    """Parse the command line. Raises SystemExit: 2 for wrong usage, 0 for --help and --version."""
    return build(given).parse_args(given)


def run(chosen: argparse.Namespace) -> int:
    """Run a parsed command; return the exit code. A Diagnostic, or a loss, is one line on standard error."""
    command = chosen.run_by.command_work
    from multidrop.base import registry
    from multidrop.base.errors import Diagnostic, TransportLost
    from multidrop.shell.hooks import Added
    from multidrop.shell.streams.stdout import fail

    try:
        with _without_configuration() if hasattr(chosen, "no_config") else nullcontext():
            more = {"added": Added(chosen.command, chosen)} if getattr(chosen.run_by, "open", False) else {}
            code: int = command(chosen, **more)
            return code
    except (Diagnostic, TransportLost) as problem:
        return fail(problem)
    finally:
        _warn(registry.warnings())  # of features that were loaded for a word of a file, without a session


def _without_configuration() -> AbstractContextManager[None]:
    """Ignore the configuration file, once it is said what of it is not in force."""
    from multidrop.base.places import without_configuration
    from multidrop.commands.machine import say_not_in_force

    say_not_in_force()
    return without_configuration()


def extras() -> dict[str, str]:
    """The extras of the distribution: the name of each, and a module that is there once it is installed."""
    from multidrop.base import registry

    return EXTRAS | {extra: module for wheel in registry.wheels() for extra, module in wheel.extras.items()}


def version() -> str:
    """Describe the installation, as in `multidrop 0.1.0, Python 3.11.7, extras: rerun`; import no module for it."""
    import multidrop

    installed = [extra for extra, module in sorted(extras().items()) if PathFinder.find_spec(module) is not None]
    python = ".".join(map(str, sys.version_info[:3]))
    return f"multidrop {multidrop.__version__}, Python {python}, extras: {', '.join(installed) or 'none'}"


def build(given: Sequence[str] = ()) -> Parser:
    """Make the parser of the command that is asked for, or of all commands."""
    parser = Parser(prog="multidrop", description=DESCRIPTION, epilog=EPILOG, formatter_class=Formatter)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    _add_no_config(parser)
    if given[:1] != ["--version"]:
        from multidrop.commands.operations import START
        from multidrop.shell.operations.table import COMMANDS

        parser.set_defaults(run_by=START)
        parser.add_commands(COMMANDS.parts(""), given, "COMMAND", required=False)
    return parser


def urls() -> str:
    """Explain URLs."""
    from multidrop.shell.connect.schemes import sentence

    return URLS.format(sentence())


def _epilog(operation: Operation) -> str:
    import textwrap

    from multidrop.shell.hooks import examples
    from multidrop.shell.operations.table import COMMANDS

    own = COMMANDS.parts(operation.command)
    given = [*operation.examples, *examples(operation.command)] or [
        form.examples[-1] for form in own.values() if form.examples
    ]
    lines = ["examples:", *(f"  multidrop {form}" for form in given)]
    if own and operation.run:  # argparse does not list them
        lines = ["also:", *(f"  {form.command:<15} {form.meaning}" for form in own.values()), "", *lines]
    if operation.own_urls:
        lines += ["", *textwrap.wrap(operation.own_urls, WIDTH, break_on_hyphens=False, break_long_words=False)]
    elif operation.takes_urls:
        lines += ["", *textwrap.wrap(urls(), WIDTH, break_on_hyphens=False, break_long_words=False)]
    return "\n".join(lines)
