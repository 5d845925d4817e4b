"""The arguments of the commands that change macros' files."""

from __future__ import annotations

import argparse

from multidrop import arguments


def describe(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name and its note."""
    arguments.macro_show(parser)
    parser.add_argument("text", metavar="TEXT", nargs="+", help="the note")


def rename(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name and another one."""
    arguments.macro_show(parser)
    parser.add_argument("new", metavar="NEW", help="the other name")


def copy(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name, another one, and where it goes."""
    rename(parser)
    parser.add_argument("--project", action="store_true", help="into the folder macros of the current folder")


def delete(parser: argparse.ArgumentParser) -> None:
    """Add a macro's name, and the answer to the question."""
    arguments.macro_show(parser)
    arguments.yes(parser)


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
    if not (key[:1] == "F" and key[1:].isdecimal() and key.isascii() and 2 <= int(key[1:3]) <= 12 and len(key) < 4):
        raise argparse.ArgumentTypeError(f"no key {text}; valid: F2 to F12")
    return key
