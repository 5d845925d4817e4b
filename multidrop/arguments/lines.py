"""The arguments of the commands that open lines, show logs and explain this machine."""

from __future__ import annotations

import argparse

from multidrop.arguments import parts


def urls(parser: argparse.ArgumentParser) -> None:
    """Add any number of URLs, and how to open them."""
    parser.add_argument("urls", metavar="URL", nargs="*", help="what to open")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--raw", action="store_true", help="look for no drives: bytes both ways, with times and in hex")
    way.add_argument("--twin", action="store_true", help="run a simulated twin beside each drive; warn of differences")
    parts.no_reconnect(parser)


def shell(parser: argparse.ArgumentParser) -> None:
    """Add any number of URLs, and the answer to questions."""
    urls(parser)
    parts.yes(parser)


def send(parser: argparse.ArgumentParser) -> None:
    """Add a URL and lines."""
    parts.url(parser)
    parser.add_argument("lines", metavar="LINE", nargs="+", help="text for a drive, @ADDR TEXT, or a /verb")
    parts.json_of_lines(parser)
    parts.yes(parser)


def run(parser: argparse.ArgumentParser) -> None:
    """Add a script, what to open, and values."""
    parser.add_argument(
        "script",
        metavar="SCRIPT",
        help="a file of lines as typed at the prompt, or a Python program (.py); -: standard input",
    )
    parts.on(parser, required=False)
    parts.values(parser)
    parts.role(parser)
    parts.json_of_lines(parser)
    parts.junit(parser)
    parts.yes(parser)


def sim(parser: argparse.ArgumentParser) -> None:
    """Add a cell, and how to serve it."""
    parser.add_argument("cell", metavar="CELL", nargs="?", help="a cell file (TOML)")
    parser.add_argument(
        "--allow",
        metavar="PATH",
        action="append",
        default=[],
        type=_allowed,
        help="let paths of the cell lead there, too: a file or a folder outside its own; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print the endpoints as JSON objects, one a line")
    parser.add_argument("--speed", metavar="N", type=_speed, default=1.0, help="run time N times as fast")


def plot(parser: argparse.ArgumentParser) -> None:
    """Add a URL, drives, and where the samples go."""
    parts.url(parser)
    parser.add_argument(
        "--drive",
        metavar="ADDR",
        action="append",
        default=[],
        help="a drive, or ADDR.WORD for a value that it prints (default: all drives)",
    )
    parser.add_argument(
        "--rate",
        metavar="N|max",
        default="50",
        help="samples a second of each drive, at most (default: 50); max: as fast as the line allows",
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--to",
        metavar="FILE.rrd|rerun+http://HOST:PORT/proxy",
        help="a file (an existing one is added to), or a viewer elsewhere",
    )
    where.add_argument("--serve", metavar="[HOST:]PORT", help="serve a viewer's data here")
    parts.no_reconnect(parser)


def ports(parser: argparse.ArgumentParser) -> None:
    """Add the form of the list."""
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def scan(parser: argparse.ArgumentParser) -> None:
    """Add a port, what is searched, and where the result goes."""
    _searched(parser)
    parser.add_argument("--all", action="store_true", help="go on after the first drives that reply")
    parts.yes(parser)
    parser.add_argument("--save", metavar="NAME", default="", help="save what was found as a connection of this name")


def rescue(parser: argparse.ArgumentParser) -> None:
    """Add a port, what is searched, and how far the rescue goes."""
    _searched(parser)
    parser.add_argument("--all", action="store_true", help="take every step, although other drives reply")
    parser.add_argument(
        "--plain", action="store_true", help="then set EM=0, CK=0 and PY=0 in the drive, after a question"
    )
    parser.add_argument("--erase", action="store_true", help="go as far as FD, which erases; it is asked about as well")
    parts.yes(parser)
    parser.set_defaults(save="")


def _searched(parser: argparse.ArgumentParser) -> None:
    from multidrop.dialects.families import FAMILIES

    parser.add_argument("url", metavar="PORT-OR-URL", help="the port to search; its baud rate is tried first")
    parser.add_argument("--baud", metavar="N", type=parts.baud, help="this baud rate only")
    languages = [name for name, family in FAMILIES.items() if family.scan is not None]
    parser.add_argument("--dialect", choices=languages, help="this language only")
    parser.add_argument("--json", action="store_true", help="print one JSON object a drive")


def _allowed(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError("an empty path would allow the current folder; name the path")
    return text


def _speed(text: str) -> float:
    number = parts.any_number(text)
    if not 0.001 <= number <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0.001 to 1000")
    return number


def log_show(parser: argparse.ArgumentParser) -> None:
    """Add a log, and which of its entries are shown."""
    parser.add_argument("file", metavar="FILE", nargs="?", default="", help="a session log (default: the newest)")
    parts.drives(parser, "entries of this drive only, ADDR or BUS:ADDR")
    parser.add_argument("--all", action="store_true", help="show the bytes of polls, too")
    parser.add_argument("--json", action="store_true", help="print the entries as they are in the file")


def log_grep(parser: argparse.ArgumentParser) -> None:
    """Add a pattern, a log, and which of its entries are searched."""
    parser.add_argument("pattern", metavar="PATTERN", help="a regular expression, searched in what `log show` prints")
    log_show(parser)
    parser.add_argument("-i", "--ignore-case", action="store_true", help="a and A are the same")


def log_replay(parser: argparse.ArgumentParser) -> None:
    """Add a log, and the drives on which it is taken again."""
    parser.add_argument("file", metavar="FILE", help="a session log; its last session is replayed")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--to", metavar="URL", default="", help="what to open")
    where.add_argument(
        "--against",
        metavar="CELL",
        default="",
        help="a cell file (TOML), in virtual time",
    )
    parser.add_argument("--fast", action="store_true", help="leave out the pauses between lines")
    parser.add_argument("--json", action="store_true", help="print one JSON object a difference, and a summary")
    parts.yes(parser)


def report(parser: argparse.ArgumentParser) -> None:
    """Add where the report goes."""
    parser.add_argument("-o", "--output", metavar="FILE", default="", help="a new file (default: asks in a terminal)")
    parser.add_argument("--yes", action="store_true", help="write it without a question")


def completion(parser: argparse.ArgumentParser) -> None:
    """Add the shell."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))
