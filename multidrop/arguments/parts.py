"""Arguments that several commands have, and the types of their values."""

from __future__ import annotations

import argparse


def none(parser: argparse.ArgumentParser) -> None:
    """Add no argument."""


def files(parser: argparse.ArgumentParser) -> None:
    """Add program files, and their language."""
    from multidrop.commands.languages import endings, names, titles

    parser.add_argument("files", metavar="FILE", nargs="+", help=titles())
    parser.add_argument("--language", choices=names(), help=f"default: {endings()}")


def personality(parser: argparse.ArgumentParser, about: str) -> None:
    """Add the drive that programs are checked for."""
    from multidrop.commands.languages import DEFAULT_PERSONALITY, Checked

    parser.add_argument(
        "--personality",
        metavar="P",
        type=str.upper,
        choices=Checked(),
        default=DEFAULT_PERSONALITY,
        help=f"{about} (default: {DEFAULT_PERSONALITY})",
    )


class _Several(argparse.Action):
    """Joins the drives of an option that is repeated: `a,b`."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        """Add a drive to those before it."""
        before = getattr(chosen, self.dest)
        setattr(chosen, self.dest, f"{before},{values}" if before else values)


def drives(parser: argparse.ArgumentParser, about: str) -> None:
    """Add the drives of a command: one, several, or `all`."""
    parser.add_argument("--drive", metavar="ADDR", default="", action=_Several, help=f"{about}; may be repeated")


def run_label(parser: argparse.ArgumentParser) -> None:
    """Add where a program begins."""
    parser.add_argument(
        "--run", metavar="LABEL", default="", help="the label or program to execute (default: its own start)"
    )


def url(parser: argparse.ArgumentParser) -> None:
    """Add what to open."""
    parser.add_argument("url", metavar="URL", help="what to open")


def no_reconnect(parser: argparse.ArgumentParser) -> None:
    """Add the wish that lost lines stay lost."""
    parser.add_argument("--no-reconnect", action="store_true", help="give up a lost connection, and do not try again")


def on(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Add what to open, by an option."""
    parser.add_argument(
        "--on", metavar="URL", action="append", required=required, default=[], help="what to open; may be repeated"
    )


def role(parser: argparse.ArgumentParser) -> None:
    """Add roles of buses."""
    parser.add_argument(
        "--role",
        metavar="NAME=URL",
        action="append",
        default=[],
        type=_role_url,
        help="open a URL as the bus NAME, which lines address as @NAME:ADDR; may be repeated",
    )


def junit(parser: argparse.ArgumentParser) -> None:
    """Add the report in JUnit XML."""
    parser.add_argument("--junit", metavar="FILE", default="", help="write the checks to a JUnit XML file")


def json_of_lines(parser: argparse.ArgumentParser) -> None:
    """Add the form of the output."""
    parser.add_argument("--json", action="store_true", help="print one JSON object a line, and a summary")


def yes(parser: argparse.ArgumentParser) -> None:
    """Add the answer to questions."""
    parser.add_argument("--yes", action="store_true", help="answer every question with yes beforehand")


def values(parser: argparse.ArgumentParser) -> None:
    """Add the values of names in lines."""
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


def baud(text: str) -> int:
    """Read a baud rate."""
    return number(text, 300, 1_000_000)


def number(text: str, low: int, high: int, other: str = "") -> int:
    """Read a whole number; `other`: the words that are valid in place of one."""
    from multidrop.dialects.text import whole

    found = whole(text, low, high)
    if found is None:
        raise argparse.ArgumentTypeError(f"{text} is not a number from {low} to {high}{other and f', or {other}'}")
    return found


def duration(text: str) -> float:
    """Read a number of seconds."""
    number = any_number(text)
    if not 0 < number <= 1e7:
        raise argparse.ArgumentTypeError(f"{text} is not a number of seconds above 0")
    return number


def any_number(text: str) -> float:
    """Read a number; 0, which no argument takes, for anything else."""
    try:
        return float(text)
    except ValueError:
        return 0.0
