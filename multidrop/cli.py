"""The command line: one table of commands, and the parser that it makes.

Building the parser imports nothing but argparse, so that --help and --version are quick. Only the requested command
becomes a parser of its own. Its arguments are added when it is parsed, and its file in `multidrop.commands` is imported
when it runs.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.machinery import PathFinder
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from dialects.on_demand import imported
from multidrop import arguments

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

URLS = """A URL is {}; sim: alone is the demo cell. Keys after a ?: dialect, drives=a,b,c, baud,
party=0|1, checksum=0|1|2, em=0..3, echo=local, address=none, timeout=SECONDS."""
WIDTH = 79
DESCRIPTION = "A terminal and a scripting shell for motion drives on a shared line."
EPILOG = (
    "Without a command: the screen, with saved connections, serial ports and the demo cell. "
    "multidrop COMMAND --help shows its arguments."
)


class Command(NamedTuple):
    """A command, or a group of commands (`parts`)."""

    meaning: str
    examples: Sequence[str]
    run: str = ""
    """`FILE.FUNCTION` in `multidrop.commands`; it takes the parsed arguments and returns the exit code."""
    add: Callable[[argparse.ArgumentParser], None] = arguments.none
    """Adds the arguments."""
    urls: bool = False
    """The help explains URLs."""
    parts: Mapping[str, Command] = MappingProxyType({})
    """The commands of a group; with `run`, the ones that a first word in place of its arguments names."""


PROGRAM = {
    "check": Command(
        "report the errors in program files, by line and column",
        ["program check shuttle.mxt pick.prg"],
        "program_check.run",
        arguments.program_check,
    ),
    "test": Command(
        "run program files on a simulated drive in virtual time: prints, errors, a summary",
        [
            "program test shuttle.mxt",
            "program test shuttle.mxt --trace --watch P --break K1,3",
            "program test shuttle.mxt --cell press.toml#line:b --until 60 --json",
        ],
        "program_test.run",
        arguments.program_test,
    ),
    "list": Command(
        "print the program in a drive",
        ["program list sim:#pmx"],
        "program_drive.list_",
        arguments.program_drive,
        urls=True,
    ),
    "upload": Command(
        "save the program in a drive to a new file",
        ["program upload press kept.mxt --drive b"],
        "program_drive.upload",
        arguments.program_upload,
        urls=True,
    ),
    "download": Command(
        "back up what a drive holds, send it a program file, and read that back",
        ["program download press shuttle.mxt --drive b", "program download press shuttle.mxt --save --run G1"],
        "program_drive.download",
        arguments.program_download,
        urls=True,
    ),
}
PARAMS = {
    "backup": Command(
        "save all settings of a drive to a new file",
        ["params backup press kept.toml --drive b", "params backup press kept --drive all"],
        "params.backup",
        arguments.params_backup,
        urls=True,
    ),
    "diff": Command(
        "print what differs from a file, another drive or the defaults; exit code 0: nothing, 1: something",
        [
            "params diff press kept.toml --drive b",
            "params diff press --drive a --other b",
            "params diff press --defaults",
        ],
        "params.diff",
        arguments.params_diff,
        urls=True,
    ),
    "restore": Command(
        "send the settings of a file that differ, in an order that the drive accepts; asks first",
        ["params restore press kept.toml --drive b --dry-run", "params restore press kept.toml --drive b --save"],
        "params.restore",
        arguments.params_restore,
        urls=True,
    ),
}
MACRO = {
    "list": Command("list the macros: name, key, number of lines", ["macro list"], "macro.list_"),
    "show": Command("print a macro's file", ["macro show shuttle"], "macro.show", arguments.macro_show),
    "play": Command(
        "play a macro",
        ["macro play shuttle --on press --set STEPS=51200"],
        "macro.play",
        arguments.macro_play,
        urls=True,
    ),
}
SNAPSHOT = {
    "apply": Command(
        "put the state of a drive in a cell file onto a replacement drive",
        [
            "snapshot apply machine.toml press --drive b",
            "snapshot apply machine.toml /dev/ttyUSB0 --from b --dry-run",
        ],
        "snapshot.apply",
        arguments.snapshot_apply,
        urls=True,
    ),
}
LOG = {
    "show": Command(
        "print a session log: typed lines, bytes both ways, replies, notices, failures",
        ["log show", "log show day.jsonl --drive b", "log show --json"],
        "log.show",
        arguments.log_show,
    ),
    "follow": Command(
        "print the end of a session log, and what is added to it, until interrupted",
        ["log follow"],
        "log.follow",
        arguments.log_show,
    ),
    "grep": Command(
        "print the entries of a session log that match; exit code 0: some do, 1: none does",
        ['log grep "PR P"', "log grep -i refused day.jsonl --drive b"],
        "log.grep",
        arguments.log_grep,
    ),
}
COMMANDS: Mapping[str, Command] = {
    "demo": Command("show the simulated demo cell; no hardware, no configuration", ["demo"], "screen.demo"),
    "tui": Command(
        "show the screen, with a tab for each bus",
        ["tui sim:", "tui press eth"],
        "screen.tui",
        arguments.urls,
        urls=True,
    ),
    "shell": Command(
        "show the prompt; read lines from standard input if that is no terminal",
        ["shell sim:", "shell /dev/ttyUSB0?drives=a,b", "shell sim: < lines.txt", "shell --raw /dev/ttyUSB0"],
        "lines.shell",
        arguments.shell,
        urls=True,
    ),
    "send": Command(
        "run lines, print the replies, exit",
        ['send sim:#press "@a MR 51200" "/wait stopped" "@a PR P"', 'send press "PR AL"'],
        "lines.send",
        arguments.send,
        urls=True,
    ),
    "run": Command(
        "run a script of lines",
        ["run shuttle.txt --on press", "run shuttle.txt --on sim:#press --set STEPS=51200"],
        "lines.run",
        arguments.run,
        urls=True,
    ),
    "sim": Command(
        "serve a simulated cell to other programs; the demo cell without CELL",
        ["sim", "sim cell.toml --json", "sim --speed 10"],
        "sim.run",
        arguments.sim,
    ),
    "program": Command(
        "check and test program files; transfer programs",
        [each.examples[-1] for each in PROGRAM.values()],
        urls=True,
        parts=PROGRAM,
    ),
    "params": Command(
        "save, compare and restore the settings of drives",
        [each.examples[0] for each in PARAMS.values()],
        urls=True,
        parts=PARAMS,
    ),
    "macro": Command(
        "list, show and play macros", [each.examples[-1] for each in MACRO.values()], urls=True, parts=MACRO
    ),
    "plot": Command(
        "plot position and velocity until interrupted: to a file, or to a viewer served here or elsewhere",
        [
            "plot sim:#press --to run.rrd",
            "plot press --drive b --serve 9876",
            "plot press --to rerun+http://pc:9876/proxy",
        ],
        "plot.run",
        arguments.plot,
        urls=True,
    ),
    "snapshot": Command(
        "read every drive into a new cell file, which the simulator opens as the same machine",
        ["snapshot press -o machine.toml", "snapshot sim: -o machine.toml", *SNAPSHOT["apply"].examples],
        "snapshot.take",
        arguments.snapshot,
        urls=True,
        parts=SNAPSHOT,
    ),
    "ports": Command(
        "list the serial ports of this machine, with their stable names",
        ["ports", "ports --json"],
        "ports.run",
        arguments.ports,
    ),
    "scan": Command(
        "find the drives on a port: baud rates, names, modes; ask before what another drive may take for an error",
        ["scan /dev/ttyUSB0", "scan /dev/ttyUSB0 --baud 9600 --dialect mcode --json", "scan COM3 --all --save press"],
        "scan.run",
        arguments.scan,
        urls=True,
    ),
    "rescue": Command(
        "free a drive that does not reply, step by step; ask before what may do harm, and before FD, which erases",
        ["rescue /dev/ttyUSB0", "rescue /dev/ttyUSB0 --plain", "rescue COM3 --baud 9600 --dialect mcode"],
        "rescue.run",
        arguments.rescue,
        urls=True,
    ),
    "log": Command(
        "show, follow and search session logs, which /log begins",
        [each.examples[-1] for each in LOG.values()],
        parts=LOG,
    ),
    "report": Command(
        "show what a bug report needs, and write it to a file",
        ["report", "report -o report.txt"],
        "report.run",
        arguments.report,
    ),
    "completion": Command(
        "print the completion of this command line for a shell",
        ["completion bash > ~/.local/share/bash-completion/completions/multidrop", "completion fish | source"],
        "completion.run",
        arguments.completion,
    ),
}


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

    command: Command | None = None
    """None: the parser of all commands."""
    complete = True
    """False until the arguments of the command have been added."""

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse; see argparse."""
        self.complete_for(args or ())
        return super().parse_known_args(args, namespace)

    def complete_for(self, given: Sequence[str]) -> None:
        """Add the arguments of the command, and of its part that is asked for."""
        if self.command is not None and not self.complete:
            self.complete = True
            _add_arguments(self, self.command, given)

    def error(self, message: str) -> NoReturn:
        """Report wrong usage and where to look, and exit with 2."""
        from shell.output import shortened, write

        write(sys.stderr, f"{self.prog}: {shortened(' '.join(message.split()))}; see {self.prog} --help")
        self.exit(2)

    def format_help(self) -> str:
        """Return the help, with the examples of the command."""
        if self.command is not None:
            self.epilog = _epilog(self.command)
        return super().format_help()

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help. Raises OSError, which argparse suppresses."""
        (file or sys.stdout).write(self.format_help())


def parse(given: Sequence[str]) -> argparse.Namespace:
    """Parse the command line. Raises SystemExit: 2 for wrong usage, 0 for --help and --version."""
    return build(given).parse_args(given)


def run(chosen: argparse.Namespace) -> int:
    """Run a parsed command; return the exit code."""
    file, _, function = chosen.run_by.partition(".")
    command: Callable[[argparse.Namespace], int] = imported(f"multidrop.commands.{file}:{function}")
    return command(chosen)


EXTRAS = {"rerun": "rerun"}
"""The modules of the extras in pyproject.toml, by extra."""


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        sys.stdout.write(f"{version()}\n")
        parser.exit()


def version() -> str:
    """Describe the installation, as in `multidrop 0.1.0, Python 3.11.7, extras: rerun`; import no module for it."""
    import multidrop

    found = [extra for extra, module in EXTRAS.items() if PathFinder.find_spec(module) is not None]
    python = ".".join(map(str, sys.version_info[:3]))
    return f"multidrop {multidrop.__version__}, Python {python}, extras: {', '.join(found) or 'none'}"


def build(given: Sequence[str] = (), *, whole: bool = False) -> Parser:
    """Make the parser of the command that is asked for, or of all commands.

    A `whole` one has the arguments of each command, too.
    """
    parser = Parser(prog="multidrop", description=DESCRIPTION, epilog=EPILOG, formatter_class=Formatter)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    parser.set_defaults(run_by="screen.start")
    if given[:1] != ["--version"]:
        _add_commands(parser, COMMANDS, given, "COMMAND", required=False)
    if whole:
        _complete(parser)
    return parser


def _complete(parser: argparse.ArgumentParser) -> None:
    """Add the arguments and the examples of a command and of its parts."""
    if isinstance(parser, Parser) and parser.command is not None:
        parser.complete_for(())
        parser.epilog = _epilog(parser.command)
    for action in parser._actions:
        for part in (action.choices or {}).values() if isinstance(action, argparse._SubParsersAction) else ():
            _complete(part)


def _add_commands(
    parser: Parser, commands: Mapping[str, Command], given: Sequence[str], metavar: str, *, required: bool
) -> None:
    parts = parser.add_subparsers(prog=parser.prog, metavar=metavar, required=required, parser_class=Parser)
    asked = given[0] if given else ""
    for name, command in ({asked: commands[asked]} if asked in commands else commands).items():
        part = parts.add_parser(
            name,
            help=command.meaning,
            description=command.meaning[0].upper() + command.meaning[1:] + ".",
            formatter_class=ExamplesFormatter,
        )
        part.command, part.complete = command, False


def _add_arguments(parser: Parser, command: Command, given: Sequence[str]) -> None:
    """Add the arguments of a command, or its parts. A command with both is a part only if the first word names one."""
    named = given[:1] and given[0] in command.parts
    if command.run and not named:
        command.add(parser)
        parser.set_defaults(run_by=command.run)
    if command.parts and (named or not command.run):
        _add_commands(parser, command.parts, given, "|".join(command.parts), required=True)


def urls() -> str:
    """Explain URLs."""
    from shell.connect.url_forms import sentence

    return URLS.format(sentence())


def _epilog(command: Command) -> str:
    import textwrap

    lines = ["examples:", *(f"  multidrop {each}" for each in command.examples)]
    if command.urls:
        lines += ["", *textwrap.wrap(urls(), WIDTH, break_on_hyphens=False, break_long_words=False)]
    return "\n".join(lines)
