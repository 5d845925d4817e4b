"""What the sections of operations name with `@`: the types of values, and arguments that come from other tables.

A type makes a value of a text, or raises argparse's one line of error.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from multidrop.base.text import real

HOST = "127.0.0.1"
KEYS = [f"F{number}" for number in range(2, 13)]
NONE = None
upper, integer = str.upper, int


NOT_GIVEN = object()
"""The value of an argument that a line does not have: argparse would read a default as if it were typed."""


class Several(argparse.Action):
    """Joins the drives of an option that is repeated: `a,b`."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        before = getattr(chosen, self.dest)
        setattr(chosen, self.dest, f"{before},{values}" if isinstance(before, str) and before else values)


class Once(argparse.Action):
    """Keeps the value of an option that a line may have once: the first of two would be dropped without a word."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        if self in (given := chosen.__dict__.setdefault("_given", [])):
            raise argparse.ArgumentError(self, "given twice")
        given.append(self)
        setattr(chosen, self.dest, values)


class OnceFlag(Once):
    """Keeps that an option without a value was given, which a line may do once."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None) -> None:
        super().__init__(option_strings, dest, nargs=0, default=False, help=help)

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        super().__call__(parser, chosen, True, option)


class Each(argparse.Action):
    """Gathers the values of an option that is repeated; of `NAME=VALUE` each name is given once."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        before: list[Any] = getattr(chosen, self.dest) or []
        if isinstance(values, tuple) and any(values[0] == name for name, *_ in before):
            raise argparse.ArgumentError(self, f"{values[0]} is given twice")
        setattr(chosen, self.dest, [*before, values])


class Named(argparse.Action):
    """Keeps words `NAME=VALUE`, of which each name is given once."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: Any, option: object = None) -> None:
        names = [name for name, _ in values]
        for name in names:
            if names.count(name) > 1:
                raise argparse.ArgumentError(self, f"{name} is given twice")
        setattr(chosen, self.dest, values)


# Values


def number(text: str, low: int, high: int, other: str = "") -> int:
    """Read a whole number; `other`: the words that are valid in place of one."""
    from multidrop.base.text import whole

    found = whole(text, low, high)
    if found is None:
        raise argparse.ArgumentTypeError(f"{text} is not a number from {low} to {high}{other and f', or {other}'}")
    return found


def baud(text: str) -> int:
    return number(text, 300, 1_000_000)


def any_baud(text: str) -> int:
    return number(text, 1, 99_999_999)


def count(text: str) -> int:
    return number(text, 1, 100_000)


def rounds(text: str) -> int | None:
    return None if text == "forever" else number(text, 1, 10**9, "forever")


def duration(text: str) -> float:
    found = real(text) or 0.0
    if not 0 < found <= 1e7:
        raise argparse.ArgumentTypeError(f"{text} is not a number of seconds above 0")
    return found


def speed(text: str) -> float:
    found = real(text) or 0.0
    if not 0.001 <= found <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0.001 to 1000")
    return found


def one_text(text: str) -> str:
    """A text as it was typed; without its quotation marks where they go around the whole."""
    from multidrop.shell.line_syntax import split

    words = split(text, "")
    return words[0] if len(words) == 1 else text


def some_text(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError("")
    return text


def per_turn(text: str) -> str:
    if "/" not in text:
        raise argparse.ArgumentTypeError(f"{text} is no unit of a turn or a step, as mm/turn")
    return text


def named_value(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign or not name:
        raise argparse.ArgumentTypeError(f"{text} is not NAME=VALUE")
    return name, value


def role_url(text: str) -> tuple[str, str]:
    name, url = named_value(text)
    if not (name.replace("-", "").replace("_", "").isalnum() and name.isascii()) or name.startswith("-"):
        raise argparse.ArgumentTypeError(f"{name} is not a name of letters, digits, - and _, not - first")
    return name, url


def key_and_values(text: str) -> tuple[str, str]:
    key, sign, values = text.partition("=")
    if not (sign and key.strip()):
        raise argparse.ArgumentTypeError(f"{text} is not KEY=VALUES")
    return key.strip(), values


def allowed(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError("an empty path would allow the current folder; name the path")
    return text


def function_key(text: str) -> str:
    key = text.upper()
    if key not in KEYS:
        raise argparse.ArgumentTypeError(f"no key {text}; valid: F2 to F12")
    return key


def address(text: str) -> tuple[str, int]:
    """Read `[HOST:]PORT`."""
    from multidrop.base.text import whole

    host, _, port = text.rpartition(":")
    found = whole(port, 0, 65535)
    if found is None:
        raise argparse.ArgumentTypeError(f"no port {text!r}; valid: PORT or HOST:PORT")
    return host.removeprefix("[").removesuffix("]") or HOST, found


# Arguments


def language() -> Mapping[str, Any]:
    from multidrop.dialects.families import DEFAULT, program_languages

    known = program_languages()
    named = (f"{name} for {', '.join(each.endings)}" for name, each in known.items() if name != DEFAULT)
    endings = f"default: {'; '.join(named)}; else {DEFAULT}"
    return {"help": endings, "choices": list(known)}


def titles() -> str:
    from multidrop.dialects.families import program_languages

    return " or ".join(f"{each.title} ({', '.join(each.endings)})" for each in program_languages().values())


class _Checked:
    """The personalities on which a check of a program depends; a family is imported only to look for one of them."""

    def __contains__(self, personality: object) -> bool:
        return any(personality == each for each in self)

    def __iter__(self) -> Iterator[str]:
        from multidrop.simulator.declared import simulated
        from multidrop.simulator.families import PROGRAMS

        return (
            personality
            for name, programs in PROGRAMS.items()
            if programs.by_product
            for personality in simulated()[name].personalities
        )


def personality(about: str) -> Mapping[str, Any]:
    """Declare the drive that programs are checked for."""
    from multidrop.simulator.cell.spec import DriveSpec

    default = DriveSpec().personality
    about = f"{about} (default: {default})"
    return {"help": about, "type": str.upper, "choices": _Checked(), "default": default}


def checked_personality() -> Mapping[str, Any]:
    return personality("the drive that the program is for")


def converted() -> Mapping[str, Any]:
    from multidrop.dialects.families import program_languages

    names = [name for files in program_languages().values() for name in files.converters]
    return {"help": "what the new file is for: %(choices)s", "choices": names, "required": True}


def edited_personality() -> Mapping[str, Any]:
    return personality("the drive that programs are for, unless the editor names one")


def tested_personality() -> Mapping[str, Any]:
    """Declare the simulated drive of a program test."""
    from multidrop.simulator.cell.spec import DriveSpec
    from multidrop.simulator.declared import simulated
    from multidrop.simulator.families import PROGRAMS

    tested = tuple(personality for name in PROGRAMS for personality in simulated()[name].personalities)
    about = f"%(choices)s (default: the cell's, or {DriveSpec().personality})"
    return {"help": about, "type": str.upper, "choices": tested}


def languages() -> list[str]:
    from multidrop.dialects.families import FAMILIES

    return list(FAMILIES)


def relayed() -> str:
    from multidrop.shell.relaying import ports

    return ports()


def scanned_languages() -> list[str]:
    from multidrop.dialects.families import FAMILIES

    return [name for name, family in FAMILIES.items() if family.scan is not None]


def freed_languages() -> list[str]:
    """The languages of drives that `rescue` can free."""
    from multidrop.dialects.families import FAMILIES

    scans = {name: family.scan() for name, family in FAMILIES.items()}
    return [name for name, scan in scans.items() if scan is not None and scan.clears]
