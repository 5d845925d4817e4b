"""The command line: one table of commands, and the parser that it makes.

Building the parser imports nothing but argparse, so that --help and --version are quick. A command's arguments are
added when that command is parsed, and its file in `multidrop.commands` is imported when it runs.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from multidrop import arguments
from shell.connect.url_forms import sentence

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

URLS = f"""A URL is {sentence()}; sim: alone is the demo cell. Keys after a ?: dialect, drives=a,b,c, baud,
party=0|1, checksum=0|1|2, em=0..3, echo=local, address=none, timeout=SECONDS."""
WIDTH = 79
DESCRIPTION = "A terminal and a scripting shell for motion drives on a shared line."
EPILOG = (
    "Without a command: the screen, with saved connections, serial ports and the demo cell. "
    "multidrop COMMAND --help shows its arguments."
)


@dataclass(frozen=True)
class Command:
    """A command, or a group of commands (`parts`)."""

    meaning: str
    examples: Sequence[str]
    run: str = ""
    """`FILE.FUNCTION` in `multidrop.commands`; it takes the parsed arguments and returns the exit code."""
    add: Callable[[argparse.ArgumentParser], None] = arguments.none
    """Adds the arguments."""
    urls: bool = False
    """The help explains URLs."""
    parts: Mapping[str, Command] = field(default_factory=dict)


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
        "send a program file to a drive, and verify every line",
        ["program download press shuttle.mxt --drive b"],
        "program_drive.download",
        arguments.program_download,
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
        ["shell sim:", "shell /dev/ttyUSB0?drives=a,b", "shell sim: < lines.txt"],
        "lines.shell",
        arguments.urls,
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
    "ports": Command(
        "list the serial ports of this machine, with their stable names",
        ["ports", "ports --json"],
        "ports.run",
        arguments.ports,
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


class Parser(argparse.ArgumentParser):
    """An argument parser that reports wrong usage in one line, and adds a command's arguments when it parses them."""

    command: Command | None = None

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse; see argparse."""
        if self.command is not None:
            _add_arguments(self, self.command)
            self.command = None
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Report wrong usage and where to look, and exit with 2."""
        from shell.output import shortened, write

        write(sys.stderr, f"{self.prog}: {shortened(' '.join(message.split()))}; see {self.prog} --help")
        self.exit(2)

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help. Raises OSError, which argparse suppresses."""
        (file or sys.stdout).write(self.format_help())


def parse(given: Sequence[str]) -> argparse.Namespace:
    """Parse the command line. Raises SystemExit: 2 for wrong usage, 0 for --help and --version."""
    return build().parse_args(given)


def run(chosen: argparse.Namespace) -> int:
    """Run a parsed command; return the exit code."""
    file, _, function = chosen.run_by.partition(".")
    command: Callable[[argparse.Namespace], int] = getattr(
        importlib.import_module(f"multidrop.commands.{file}"), function
    )
    return command(chosen)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        import multidrop

        sys.stdout.write(f"multidrop {multidrop.__version__}\n")
        parser.exit()


def build(whole: bool = False) -> Parser:
    """Make the parser of all commands; a `whole` one has the arguments of each command, too."""
    parser = Parser(prog="multidrop", description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    parser.set_defaults(run_by="screen.start")
    _add_commands(parser, COMMANDS, "COMMAND", required=False)
    if whole:
        _complete(parser)
    return parser


def _complete(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of a command and of its parts."""
    if isinstance(parser, Parser) and parser.command is not None:
        _add_arguments(parser, parser.command)
        parser.command = None
    for action in parser._actions:
        for part in (action.choices or {}).values() if isinstance(action, argparse._SubParsersAction) else ():
            _complete(part)


def _add_commands(parser: Parser, commands: Mapping[str, Command], metavar: str, *, required: bool) -> None:
    parts = parser.add_subparsers(metavar=metavar, required=required, parser_class=Parser)
    for name, command in commands.items():
        part = parts.add_parser(
            name,
            help=command.meaning,
            description=command.meaning[0].upper() + command.meaning[1:] + ".",
            epilog="\n".join(_epilog(command)),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        part.command = command


def _add_arguments(parser: Parser, command: Command) -> None:
    command.add(parser)
    if command.parts:
        _add_commands(parser, command.parts, "|".join(command.parts), required=True)
    else:
        parser.set_defaults(run_by=command.run)


def _epilog(command: Command) -> list[str]:
    lines = ["examples:", *(f"  multidrop {each}" for each in command.examples)]
    if command.urls:
        lines += ["", *textwrap.wrap(URLS, WIDTH, break_on_hyphens=False, break_long_words=False)]
    return lines
