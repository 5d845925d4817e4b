"""The arguments of `multidrop macro`."""

from __future__ import annotations

import argparse

from multidrop.arguments import parts

_KEYS = [f"F{number}" for number in range(2, 13)]


def show(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name."""
    parser.add_argument("name", metavar="NAME")


def play(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name, what to open, values, and the manner of playing."""
    show(parser)
    parts.on(parser, required=False)
    parts.role(parser)
    parts.values(parser)
    parser.add_argument(
        "--times", metavar="N|forever", type=_rounds, default=1, help="play N rounds, or until it is interrupted"
    )
    parser.add_argument("--fast", action="store_true", help="leave out the recorded pauses")
    parts.json_of_lines(parser)
    parts.junit(parser)
    parts.yes(parser)


def describe(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name and its note."""
    show(parser)
    parser.add_argument("text", metavar="TEXT", nargs="+", help="the note")


def rename(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name and another one."""
    show(parser)
    parser.add_argument("new", metavar="NEW", help="the other name")


def copy(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name, another one, and where it goes."""
    rename(parser)
    parser.add_argument("--project", action="store_true", help="into the folder macros of the current folder")


def delete(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name, and the answer to the question."""
    show(parser)
    parts.yes(parser)


def key(parser: argparse.ArgumentParser) -> None:
    """Add a key, a macro's name, and the page of the key."""
    parser.add_argument("key", metavar="F2..F12", type=_function_key)
    parser.add_argument("name", metavar="NAME|off", help="off: free the key")
    parser.add_argument("--page", metavar="PAGE", default="1", help="a number or a word (default: 1)")


def import_(parser: argparse.ArgumentParser) -> None:
    """Add a file of function keys."""
    parser.add_argument(
        "file", metavar="FILE", help="function-key strings, one a line: F2 STRING ; comment (-: standard input)"
    )
    parser.add_argument("--force", action="store_true", help="replace the macros of these names")


def export(parser: argparse.ArgumentParser) -> None:
    """Add the new file, and the macros."""
    parser.add_argument("file", metavar="FILE", help="the new file (-: standard output)")
    parser.add_argument("names", metavar="NAME", nargs="*", help="a macro (default: those on keys)")


def _function_key(text: str) -> str:
    key = text.upper()
    if key not in _KEYS:
        raise argparse.ArgumentTypeError(f"no key {text}; valid: F2 to F12")
    return key


def _rounds(text: str) -> int | None:
    return None if text == "forever" else parts.number(text, 1, 10**9, "forever")
