"""The command line: what may be typed (argparse), and which command does it.

Building the parser imports nothing but argparse, so that --help and --version answer at once; each command imports
what it needs when it is run (`multidrop.commands.general`).
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NoReturn

from shell.connect.url_forms import sentence

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

URLS = f"""A URL is {sentence()}; sim: alone is the demo cell. Keys after a ?: dialect, drives=a,b,c, baud,
party=0|1, checksum=0|1|2, em=0..3, echo=local, address=none, timeout=SECONDS."""

WIDTH = 79
MCODE = ("LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM", "MDI", "MDIE", "MDIX")
"""The personalities that run MCode programs (`simulator.cell.spec` has them too, and is not imported for --help)."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose usage errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Tell what is wrong and where to look, and exit with 2."""
        from shell.output import shortened, write

        write(sys.stderr, f"{self.prog}: {shortened(' '.join(message.split()))}; {self.prog} --help tells more")
        self.exit(2)

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help. Raises OSError, which argparse keeps to itself."""
        (file or sys.stdout).write(self.format_help())


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """What was asked for. Raises SystemExit: 2 for wrong usage, 0 for --help and --version."""
    return build().parse_args(arguments)


def run(chosen: argparse.Namespace) -> int:
    """Do it; the exit code."""
    from multidrop.commands import general as commands

    command: Callable[[argparse.Namespace], int] = getattr(commands, chosen.command)
    return command(chosen)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        import multidrop

        sys.stdout.write(f"multidrop {multidrop.__version__}\n")
        parser.exit()


def build() -> Parser:
    """The parser of all commands."""
    parser = Parser(
        prog="multidrop",
        description="A terminal and a scripting shell for motion drives on a shared line.",
        epilog="Without a command: the screen, with saved connections, serial ports and the demo cell. "
        "multidrop COMMAND --help tells more.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    parser.set_defaults(command="start")
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for add in (_demo, _tui, _shell, _send, _run, _sim, _program, _macro, _plot, _ports):
        add(commands)
    return parser


def _add(
    commands: argparse._SubParsersAction[Parser], name: str, meaning: str, *examples: str, urls: bool = False
) -> Parser:
    lines = ["examples:", *(f"  multidrop {each}" for each in examples)]
    if urls:
        lines += ["", *textwrap.wrap(URLS, WIDTH, break_on_hyphens=False, break_long_words=False)]
    parser = commands.add_parser(
        name,
        help=meaning,
        description=meaning[0].upper() + meaning[1:] + ".",
        epilog="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(command=name)
    return parser


def _demo(commands: argparse._SubParsersAction[Parser]) -> None:
    _add(commands, "demo", "the screen on the simulated demo cell; no hardware, no configuration", "demo")


def _tui(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _add(commands, "tui", "the screen, with a tab for each bus", "tui sim:", "tui press eth", urls=True)
    parser.add_argument("urls", metavar="URL", nargs="*", help="what to open")


def _shell(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = ("shell sim:", "shell /dev/ttyUSB0?drives=a,b", "shell sim: < lines.txt")
    meaning = "the prompt; reads lines from standard input where that is no terminal"
    parser = _add(commands, "shell", meaning, *examples, urls=True)
    parser.add_argument("urls", metavar="URL", nargs="*", help="what to open")


def _send(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = ('send sim:#press "@a MR 51200" "/wait stopped" "@a PR P"', 'send press "PR AL"')
    parser = _add(commands, "send", "run lines, print the replies, exit", *examples, urls=True)
    parser.add_argument("url", metavar="URL", help="what to open")
    parser.add_argument("lines", metavar="LINE", nargs="+", help="text for a drive, @ADDR TEXT, or a /verb")


def _run(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = ("run shuttle.txt --on press", "run shuttle.txt --on sim:#press --set STEPS=51200")
    parser = _add(commands, "run", "run a script of lines", *examples, urls=True)
    parser.add_argument(
        "script", metavar="SCRIPT", help="a file of the lines that are typed at the prompt; # begins a comment"
    )
    _on(parser)
    _set(parser)


def _on(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--on", metavar="URL", action="append", required=True, help="what to open; may be repeated")


def _set(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set", metavar="NAME=VALUE", action="append", default=[], type=_value, help="the value of {NAME} in a line"
    )


def _value(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign or not name:
        raise argparse.ArgumentTypeError(f"{text} is not NAME=VALUE")
    return name, value


def _sim(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = ("sim", "sim cell.toml --json", "sim --speed 10")
    parser = _add(commands, "sim", "serve a simulated cell to the outside; without CELL the demo cell", *examples)
    parser.add_argument("cell", metavar="CELL", nargs="?", help="a cell file (TOML)")
    parser.add_argument("--json", action="store_true", help="tell the endpoints as JSON objects, one a line")
    parser.add_argument("--speed", metavar="N", type=_speed, default=1.0, help="let time pass N times as fast")


def _speed(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.001 <= number <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0.001 to 1000")
    return number


def _program(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = (
        "program check shuttle.mxt pick.prg",
        "program test shuttle.mxt --cell press.toml#line:b --until 60 --json",
        "program list sim:#pmx",
        "program upload press kept.mxt --drive b",
        "program download press shuttle.mxt --drive b",
    )
    parser = _add(commands, "program", "check and try out program files, and move programs", *examples, urls=True)
    parts = parser.add_subparsers(metavar="check|test|list|upload|download", required=True, parser_class=Parser)
    _program_check(parts, examples[0])
    _program_test(parts, "program test shuttle.mxt", examples[1])
    _program_transfer(parts, "list", "print the program in a drive", examples[2])
    upload = _program_transfer(parts, "upload", "keep the program in a drive in a new file", examples[3])
    upload.add_argument("file", metavar="FILE", help="the file to write; it can be downloaded again")
    upload.add_argument("--raw", action="store_true", help="a PMX's compiled lines as they are stored")
    download = _program_transfer(
        parts, "download", "put a program file into a drive, every line made sure of", examples[4]
    )
    download.add_argument("file", metavar="FILE", help="MCode (.mxt, .txt), A-SCRIPT or compiled lines (.prg, .asc)")


def _program_check(parts: argparse._SubParsersAction[Parser], example: str) -> None:
    check = _add(parts, "check", "tell what is wrong with program files, by line and column", example)
    check.set_defaults(command="program_check")
    check.add_argument("files", metavar="FILE", nargs="+", help="MCode, or A-SCRIPT (.prg, .asc)")
    _language(check)
    check.add_argument(
        "--personality",
        metavar="P",
        type=str.upper,
        choices=MCODE,
        default="LMDCM",
        help="the drive it is for; LMDCM",
    )
    check.add_argument("--json", action="store_true", help="one JSON object a line")


def _language(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--language", choices=("mcode", "pmx"), help="pmx for .prg and .asc, else mcode, unless given")


def _program_test(parts: argparse._SubParsersAction[Parser], *examples: str) -> None:
    meaning = "run program files on a simulated drive in virtual time: what it prints, its errors, a summary"
    test = _add(parts, "test", meaning, *examples)
    test.set_defaults(command="program_test")
    test.add_argument("files", metavar="FILE", nargs="+", help="MCode, or A-SCRIPT (.prg, .asc)")
    _language(test)
    test.add_argument(
        "--personality",
        metavar="P",
        type=str.upper,
        choices=(*MCODE, "PMX"),
        help=f"{', '.join(MCODE)}; else the cell's, or LMDCM",
    )
    test.add_argument(
        "--cell", metavar="CELL", help="a drive of a cell file and its world: CELL, CELL#BUS or CELL#BUS:NAME"
    )
    test.add_argument(
        "--until", metavar="SECONDS", type=_duration, help="virtual seconds at most, for a program without an end"
    )
    test.add_argument("--run", metavar="LABEL", default="", help="what to execute (SU, else address 1; PMX: 0, 1)")
    test.add_argument("--json", action="store_true", help="one JSON object a line")


def _program_transfer(parts: argparse._SubParsersAction[Parser], name: str, meaning: str, example: str) -> Parser:
    parser = _add(parts, name, meaning, example, urls=True)
    parser.set_defaults(command=f"program_{name}")
    parser.add_argument("url", metavar="URL", help="what to open")
    parser.add_argument("--drive", metavar="ADDR", default="", help="the drive (the first unless given)")
    return parser


def _duration(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number <= 1e7:
        raise argparse.ArgumentTypeError(f"{text} is not a number of seconds above 0")
    return number


def _macro(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = ("macro list", "macro show shuttle", "macro play shuttle --on press --set STEPS=51200")
    parser = _add(commands, "macro", "list, show and play macros", *examples, urls=True)
    parts = parser.add_subparsers(metavar="list|show|play", required=True, parser_class=Parser)
    _add(parts, "list", "the macros: name, key, number of lines", "macro list").set_defaults(command="macro_list")
    show = _add(parts, "show", "a macro's file", "macro show shuttle")
    show.set_defaults(command="macro_show")
    show.add_argument("name", metavar="NAME")
    play = _add(parts, "play", "play a macro", examples[2], urls=True)
    play.set_defaults(command="macro_play")
    play.add_argument("name", metavar="NAME")
    _on(play)
    _set(play)


def _plot(commands: argparse._SubParsersAction[Parser]) -> None:
    examples = (
        "plot sim:#press --to run.rrd",
        "plot press --drive b --serve 9876",
        "plot press --to rerun+http://pc:9876/proxy",
    )
    meaning = "position and velocity to a file, a viewer that is served here, or one elsewhere, until interrupted"
    parser = _add(commands, "plot", meaning, *examples, urls=True)
    parser.add_argument("url", metavar="URL", help="what to open")
    parser.add_argument(
        "--drive", metavar="ADDR", action="append", default=[], help="a drive (all of them unless given)"
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--to",
        metavar="FILE.rrd|rerun+http://HOST:PORT/proxy",
        help="a file (one that is there is added to), or a viewer elsewhere",
    )
    where.add_argument("--serve", metavar="[HOST:]PORT", help="serve a viewer's data here")


def _ports(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _add(
        commands, "ports", "the serial ports of this machine, with their stable names", "ports", "ports --json"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
