"""The arguments of each command. Those of the program commands come from the tables of families."""

from __future__ import annotations

import argparse


def none(parser: argparse.ArgumentParser) -> None:
    """Add no argument."""


def urls(parser: argparse.ArgumentParser) -> None:
    """Add any number of URLs, and how to open them."""
    parser.add_argument("urls", metavar="URL", nargs="*", help="what to open")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--raw", action="store_true", help="look for no drives: bytes both ways, with times and in hex")
    way.add_argument("--twin", action="store_true", help="run a simulated twin beside each drive; warn of differences")
    _no_reconnect(parser)


def shell(parser: argparse.ArgumentParser) -> None:
    """Add any number of URLs, and the answer to questions."""
    urls(parser)
    yes(parser)


def send(parser: argparse.ArgumentParser) -> None:
    """Add a URL and lines."""
    _url(parser)
    parser.add_argument("lines", metavar="LINE", nargs="+", help="text for a drive, @ADDR TEXT, or a /verb")
    _json_of_lines(parser)
    yes(parser)


def run(parser: argparse.ArgumentParser) -> None:
    """Add a script, what to open, and values."""
    parser.add_argument(
        "script",
        metavar="SCRIPT",
        help="a file of lines as typed at the prompt, or a Python program (.py); -: standard input",
    )
    _on(parser, required=False)
    _set(parser)
    _role(parser)
    _json_of_lines(parser)
    _junit(parser)
    yes(parser)


def sim(parser: argparse.ArgumentParser) -> None:
    """Add a cell, and how to serve it."""
    parser.add_argument("cell", metavar="CELL", nargs="?", help="a cell file (TOML)")
    parser.add_argument("--json", action="store_true", help="print the endpoints as JSON objects, one a line")
    parser.add_argument("--speed", metavar="N", type=_speed, default=1.0, help="run time N times as fast")


def macro_show(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name."""
    parser.add_argument("name", metavar="NAME")


def macro_play(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name, what to open, values, and the manner of playing."""
    macro_show(parser)
    _on(parser, required=False)
    _role(parser)
    _set(parser)
    parser.add_argument(
        "--times", metavar="N|forever", type=_rounds, default=1, help="play N rounds, or until it is interrupted"
    )
    parser.add_argument("--fast", action="store_true", help="leave out the recorded pauses")
    _json_of_lines(parser)
    _junit(parser)
    yes(parser)


def plot(parser: argparse.ArgumentParser) -> None:
    """Add a URL, drives, and where the samples go."""
    _url(parser)
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
    _no_reconnect(parser)


def snapshot(parser: argparse.ArgumentParser) -> None:
    """Add what to open, and the new file."""
    parser.add_argument("urls", metavar="URL", nargs="+", help="what to open")
    parser.add_argument("-o", "--output", metavar="CELL.toml", required=True, help="the new file")


def snapshot_apply(parser: argparse.ArgumentParser) -> None:
    """Add the cell file, the replacement drive, and what may be done to it."""
    parser.add_argument("file", metavar="CELL.toml", help="a cell file, as snapshot writes it")
    _url(parser)
    parser.add_argument("--drive", metavar="ADDR", default="", help="the replacement (default: the only drive)")
    parser.add_argument(
        "--from", dest="source", metavar="NAME", default="", help="the drive in the file (default: of the same name)"
    )
    parser.add_argument(
        "--with",
        dest="named",
        metavar="NAME,...",
        action="append",
        default=[],
        help="write these settings too, which can move the motor or lock the drive",
    )
    parser.add_argument("--other-product", action="store_true", help="the replacement may be another product")
    parser.add_argument("--dry-run", action="store_true", help="show what would be done, and do nothing")
    yes(parser)


def ports(parser: argparse.ArgumentParser) -> None:
    """Add the form of the list."""
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def scan(parser: argparse.ArgumentParser) -> None:
    """Add a port, what is searched, and where the result goes."""
    _searched(parser)
    parser.add_argument("--all", action="store_true", help="go on after the first drives that reply")
    yes(parser)
    parser.add_argument("--save", metavar="NAME", default="", help="save what was found as a connection of this name")


def rescue(parser: argparse.ArgumentParser) -> None:
    """Add a port, what is searched, and how far the rescue goes."""
    _searched(parser)
    parser.add_argument("--all", action="store_true", help="take every step, although other drives reply")
    parser.add_argument(
        "--plain", action="store_true", help="then set EM=0, CK=0 and PY=0 in the drive, after a question"
    )
    parser.add_argument("--erase", action="store_true", help="go as far as FD, which erases; it is asked about as well")
    yes(parser)
    parser.set_defaults(save="")


def _searched(parser: argparse.ArgumentParser) -> None:
    from dialects.families import FAMILIES

    parser.add_argument("url", metavar="PORT-OR-URL", help="the port to search; its baud rate is tried first")
    parser.add_argument("--baud", metavar="N", type=_baud, help="this baud rate only")
    languages = [name for name, family in FAMILIES.items() if family.scan is not None]
    parser.add_argument("--dialect", choices=languages, help="this language only")
    parser.add_argument("--json", action="store_true", help="print one JSON object a drive")


def log_show(parser: argparse.ArgumentParser) -> None:
    """Add a log, and which of its entries are shown."""
    parser.add_argument("file", metavar="FILE", nargs="?", default="", help="a session log (default: the newest)")
    parser.add_argument("--drive", metavar="ADDR", default="", help="entries of this drive only, ADDR or BUS:ADDR")
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
    yes(parser)


def report(parser: argparse.ArgumentParser) -> None:
    """Add where the report goes."""
    parser.add_argument("-o", "--output", metavar="FILE", default="", help="a new file (default: asks in a terminal)")
    parser.add_argument("--yes", action="store_true", help="write it without a question")


def completion(parser: argparse.ArgumentParser) -> None:
    """Add the shell."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))


def program_check(parser: argparse.ArgumentParser) -> None:
    """Add files, their language, and the drive that they are for."""
    from multidrop.commands.languages import DEFAULT_PERSONALITY, Checked

    _files(parser)
    parser.add_argument(
        "--personality",
        metavar="P",
        type=str.upper,
        choices=Checked(),
        default=DEFAULT_PERSONALITY,
        help=f"the drive that the program is for (default: {DEFAULT_PERSONALITY})",
    )
    parser.add_argument(
        "--format", action="store_true", help="rewrite files without errors in canonical spelling; remarks stay"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def program_test(parser: argparse.ArgumentParser) -> None:
    """Add files, their language, the simulated drive, and the limits of the run."""
    from multidrop.commands.languages import DEFAULT_PERSONALITY, TESTED

    _files(parser)
    parser.add_argument(
        "--personality",
        metavar="P",
        type=str.upper,
        choices=TESTED,
        help=f"%(choices)s (default: the cell's, or {DEFAULT_PERSONALITY})",
    )
    parser.add_argument(
        "--cell", metavar="CELL", help="a drive of a cell file and its world: CELL, CELL#BUS or CELL#BUS:NAME"
    )
    parser.add_argument(
        "--until", metavar="SECONDS", type=duration, help="virtual seconds at most, for a program without an end"
    )
    parser.add_argument(
        "--run", metavar="LABEL", default="", help="the label or program to execute (default: its own start)"
    )
    parser.add_argument(
        "--trace", action="store_true", help="print each line that is executed, with its time and what it changed"
    )
    parser.add_argument(
        "--break",
        dest="breaks",
        metavar="LINE|LABEL[,PASSES]",
        action="append",
        default=[],
        help="end the run before this line; may be repeated",
    )
    parser.add_argument(
        "--watch",
        metavar="NAME",
        action="append",
        default=[],
        help="print a variable whenever a line has changed it; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def program_drive(parser: argparse.ArgumentParser) -> None:
    """Add a URL and a drive."""
    _url(parser)
    parser.add_argument("--drive", metavar="ADDR", default="", help="the drive (default: the first)")


def program_upload(parser: argparse.ArgumentParser) -> None:
    """Add a drive and the new file."""
    program_drive(parser)
    parser.add_argument("file", metavar="FILE", help="the new file; it can be downloaded again")
    parser.add_argument("--raw", action="store_true", help="save the lines as they are stored, without remarks")


def program_download(parser: argparse.ArgumentParser) -> None:
    """Add a drive and the file."""
    from multidrop.commands.languages import titles

    program_drive(parser)
    parser.add_argument("file", metavar="FILE", help=titles())
    parser.add_argument("--save", action="store_true", help="save it with S, so that power-off does not lose it")
    parser.add_argument("--run", metavar="LABEL", default="", help="execute the program at this label at the end")
    parser.add_argument("--only-changed", action="store_true", help="send nothing where the drive holds it already")
    parser.add_argument("--no-verify", action="store_true", help="do not read the program back")


def _settings_of(parser: argparse.ArgumentParser) -> None:
    _url(parser)
    parser.add_argument(
        "--drive", metavar="ADDR", default="", help="the drive (default: the first); all: FILE is a folder of files"
    )


def params_backup(parser: argparse.ArgumentParser) -> None:
    """Add a drive and the new file."""
    _settings_of(parser)
    parser.add_argument("file", metavar="FILE", help="the new file; -: standard output")


def params_diff(parser: argparse.ArgumentParser) -> None:
    """Add a drive and what it is compared with."""
    _settings_of(parser)
    parser.add_argument("file", metavar="FILE", nargs="?", default="", help="a file of `params backup`")
    parser.add_argument("--against", metavar="URL2", default="", help="compare with a drive there")
    parser.add_argument(
        "--other", metavar="ADDR", default="", help="the drive to compare with (default: the first of URL2)"
    )
    parser.add_argument("--defaults", action="store_true", help="compare with the defaults")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def params_restore(parser: argparse.ArgumentParser) -> None:
    """Add a drive, the file, and what the restore may do."""
    _settings_of(parser)
    parser.add_argument("file", metavar="FILE", help="a file of `params backup`")
    parser.add_argument("--dry-run", action="store_true", help="show the steps, and send nothing")
    parser.add_argument("--save", action="store_true", help="keep the settings over power-off (S, STORE, STAP)")
    parser.add_argument("--communication", action="store_true", help="restore communication settings too")
    parser.add_argument(
        "--with",
        dest="named",
        metavar="NAME,...",
        action="append",
        default=[],
        help="restore these settings too, which can move the motor or belong to the unit",
    )
    parser.add_argument(
        "--other-product", action="store_true", help="restore what the drive has of another product's file"
    )
    yes(parser)


def _files(parser: argparse.ArgumentParser) -> None:
    from multidrop.commands.languages import endings, names, titles

    parser.add_argument("files", metavar="FILE", nargs="+", help=titles())
    parser.add_argument("--language", choices=names(), help=f"default: {endings()}")


def _url(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("url", metavar="URL", help="what to open")


def _no_reconnect(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--no-reconnect", action="store_true", help="give up a lost connection, and do not try again")


def _on(parser: argparse.ArgumentParser, required: bool = True) -> None:
    parser.add_argument(
        "--on", metavar="URL", action="append", required=required, default=[], help="what to open; may be repeated"
    )


def _role(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--role",
        metavar="NAME=URL",
        action="append",
        default=[],
        type=_role_url,
        help="open a URL as the bus NAME, which lines address as @NAME:ADDR; may be repeated",
    )


def _junit(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--junit", metavar="FILE", default="", help="write the checks to a JUnit XML file")


def _json_of_lines(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print one JSON object a line, and a summary")


def yes(parser: argparse.ArgumentParser) -> None:
    """Add the answer to questions."""
    parser.add_argument("--yes", action="store_true", help="answer every question with yes beforehand")


def _set(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set", metavar="NAME=VALUE", action="append", default=[], type=_value, help="the value of {NAME} in a line"
    )


def _value(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign or not name:
        raise argparse.ArgumentTypeError(f"{text} is not NAME=VALUE")
    return name, value


def _role_url(text: str) -> tuple[str, str]:
    name, url = _value(text)
    if not (name.replace("-", "").replace("_", "").isalnum() and name.isascii()):
        raise argparse.ArgumentTypeError(f"{name} is not a name of letters, digits, - and _")
    return name, url


def _baud(text: str) -> int:
    if not (text.isdecimal() and 300 <= int(text) <= 1_000_000):
        raise argparse.ArgumentTypeError(f"{text} is not a number from 300 to 1000000")
    return int(text)


def _rounds(text: str) -> int | None:
    if text == "forever":
        return None
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:12]) <= 10**9):
        raise argparse.ArgumentTypeError(f"{text} is not a number from 1 to 1000000000, or forever")
    return int(text)


def _speed(text: str) -> float:
    number = _number(text)
    if not 0.001 <= number <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0.001 to 1000")
    return number


def duration(text: str) -> float:
    """Read a number of seconds."""
    number = _number(text)
    if not 0 < number <= 1e7:
        raise argparse.ArgumentTypeError(f"{text} is not a number of seconds above 0")
    return number


def _number(text: str) -> float:
    """Read a number; 0, which no argument takes, for anything else."""
    try:
        return float(text)
    except ValueError:
        return 0.0
