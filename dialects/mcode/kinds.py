"""What answer a typed MCode line will get, and what it changes about the way in which the drive answers."""

from __future__ import annotations

import re

from dialects.base import Kind
from dialects.mcode.table import PRINTS_LINES

WORD = re.compile(r"\s*([A-Za-z_]+)\s*=?\s*(.*)", re.S)
SLOW = {"S", "IP", "CP", "FD"}
"""They work on the flash memory and answer late (MCode reference 5.1.113)."""
VALUES = {"EM": r"[0-3]", "PY": r"[01]", "CK": r"[0-2]", "ES": r"[0-3]", "DN": r'"[A-Za-z0-9]"'}
"""Settings of the wire, and the values that a drive takes for them."""


def word_of(text: str) -> tuple[str, str]:
    """The mnemonic at the head of a line, in capitals, and what follows it."""
    found = WORD.match(text)
    return (found.group(1).upper(), found.group(2).strip()) if found else ("", text.strip())


def setting_of(text: str) -> tuple[str, str] | None:
    """The wire setting that a line makes: (`EM`, `1`); None for any other line, and for a value that is refused."""
    word, value = word_of(text)
    if word in VALUES and re.fullmatch(VALUES[word], value):
        return word, value.strip('"')
    return None


def kind_of(text: str) -> Kind:
    """What answer the line will get."""
    word, rest = word_of(text)
    if word[:2] == "PR":
        return Kind.LIST if (word[2:] + rest).strip().upper() in PRINTS_LINES else Kind.PRINT
    if word == "L":
        return Kind.LIST
    if word == "PG":
        return Kind.PROGRAM
    return Kind.SETTING if setting_of(text) or word == "FD" else Kind.COMMAND


def enters_program(text: str) -> bool:
    """Whether the line is `PG` with an address, which enters program mode."""
    word, rest = word_of(text)
    return word == "PG" and bool(rest)
