"""The texts of arguments: what makes a value of one, and the words and helps that come from other tables.

A `read` makes a value of a text, or raises argparse's one line of error.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from multidrop.base.text import real

HOST = "127.0.0.1"
KEYS = [f"F{number}" for number in range(2, 13)]


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

    def __init__(
        self, option_strings: Sequence[str], dest: str, help: str | None = None, required: bool = False
    ) -> None:
        super().__init__(option_strings, dest, nargs=0, default=False, required=required, help=help)

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        super().__call__(parser, chosen, True, option)


class Each(argparse.Action):
    """Gathers the values of an option that is repeated; of `NAME=VALUE` each name is given once."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: object, option: object = None) -> None:
        before: list[Any] = getattr(chosen, self.dest) or []
        if isinstance(values, tuple) and any(values[0] == name for name, *_ in before):
            raise argparse.ArgumentError(self, f"{values[0]} is given twice")
        setattr(chosen, self.dest, [*before, values])


class United(argparse.Action):
    """Keeps the names of all values of an option that is repeated."""

    def __call__(self, parser: object, chosen: argparse.Namespace, values: Any, option: object = None) -> None:
        before = getattr(chosen, self.dest)
        setattr(chosen, self.dest, values if before is NOT_GIVEN else before | values)


class NamedValues(argparse.Action):
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

    value = whole(text, low, high)
    if value is None:
        raise argparse.ArgumentTypeError(f"{text} is not a number from {low} to {high}{other and f', or {other}'}")
    return value


def baud(text: str) -> int:
    return number(text, 300, 1_000_000)


def any_baud(text: str) -> int:
    return number(text, 1, 99_999_999)


def count(text: str) -> int:
    return number(text, 1, 100_000)


def rounds(text: str) -> int | None:
    return None if text == "forever" else number(text, 1, 10**9, "forever")


def duration(text: str) -> float:
    seconds = real(text) or 0.0
    if not 0 < seconds <= 1e7:
        raise argparse.ArgumentTypeError(f"{text} is not a number of seconds above 0")
    return seconds


def speed(text: str) -> float:
    value = real(text) or 0.0
    if not 0.001 <= value <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0.001 to 1000")
    return value


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


def setting_names(text: str) -> frozenset[str]:
    """Read names of settings, with commas between several."""
    return frozenset(name.strip().upper() for name in text.split(",") if name.strip())


class Accessed(NamedTuple):
    """Registers that a person reads or writes."""

    address: int
    length: int | None
    """Of those to read; None: the value that begins there."""
    values: Sequence[int] | None
    """What is written; None: nothing."""


def _number_of_register(text: str) -> int:
    if not re.fullmatch(r"[+-]?(0[xX][0-9A-Fa-f]{1,16}|\d{1,20})", text, re.ASCII):
        raise argparse.ArgumentTypeError(f"no number {text}; valid: as 87 or 0x57")
    return int(text, 16 if "x" in text.lower() else 10)


def register_access(text: str) -> Accessed:
    """Read `ADDRESS`, `ADDRESS COUNT` or `ADDRESS =VALUE,VALUE`."""
    match = re.fullmatch(r"(\S+?)(?:\s*=\s*(.+)|\s+(\S+))?", text.strip())
    if match is None:
        raise argparse.ArgumentTypeError("")
    address = _number_of_register(match[1])
    if not 0 <= address <= 0xFFFF:
        raise argparse.ArgumentTypeError(f"no register {match[1]}; valid: 0 to 0xFFFF")
    if match[2] is None:
        return Accessed(address, _number_of_register(match[3]) if match[3] else None, None)
    return Accessed(address, None, [_number_of_register(register.strip()) for register in match[2].split(",")])


def output_number(text: str) -> int:
    number = _number_of_register(text)
    if not 1 <= number <= 0x10000:
        raise argparse.ArgumentTypeError(f"no output {text}; valid: from 1")
    return number


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
    number = whole(port, 0, 65535)
    if number is None:
        raise argparse.ArgumentTypeError(f"no port {text!r}; valid: PORT or HOST:PORT")
    return host.removeprefix("[").removesuffix("]") or HOST, number


# Arguments


def program_language_names() -> Sequence[str]:
    from multidrop.dialects.families import program_languages

    return list(program_languages())


def language_help() -> str:
    from multidrop.dialects.families import DEFAULT, program_languages

    known = program_languages()
    named = (f"{name} for {', '.join(files.endings)}" for name, files in known.items() if name != DEFAULT)
    return f"default: {'; '.join(named)}; else {DEFAULT}"


def titles() -> str:
    from multidrop.dialects.families import program_languages

    return " or ".join(f"{files.title} ({', '.join(files.endings)})" for files in program_languages().values())


class CheckedPersonalities:
    """The personalities on which a check of a program depends; a family is imported only to look for one of them."""

    def __contains__(self, personality: object) -> bool:
        return any(personality == known for known in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __iter__(self) -> Iterator[str]:
        from multidrop.simulator.declared import simulated
        from multidrop.simulator.families import PROGRAMS

        return (
            personality
            for name, programs in PROGRAMS.items()
            if programs.by_product
            for personality in simulated()[name].personalities
        )


def usual_personality() -> str:
    from multidrop.simulator.cell.spec import DriveSpec

    return DriveSpec().personality


def checked_personality() -> str:
    return f"the drive that the program is for (default: {usual_personality()})"


def converter_names() -> Sequence[str]:
    from multidrop.dialects.families import program_languages

    return [name for files in program_languages().values() for name in files.converters]


def edited_personality() -> str:
    return f"the drive that programs are for, unless the editor names one (default: {usual_personality()})"


def tested_personality() -> str:
    return f"%(choices)s (default: the cell's, or {usual_personality()})"


def tested_personalities() -> Sequence[str]:
    from multidrop.simulator.declared import simulated
    from multidrop.simulator.families import PROGRAMS

    return tuple(personality for name in PROGRAMS for personality in simulated()[name].personalities)


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
