"""The line that a typed PR prints, and the same PR with the host's signature after its values.

A line that does not match comes from a running program or another drive. Some lines match by chance: the reply to `PR
P` looks like any number that a program prints. The host then appends an item: the drive's own name, or a mark
(`signatures.Sign`). (MCode reference 5.1.102.)
"""

from __future__ import annotations

import re
from functools import lru_cache

from multidrop.dialects.mcode.manual.grammar import LineError, Name, Number, Statement, Text, parse
from multidrop.dialects.mcode.manual.mnemonic import Mnemonic
from multidrop.dialects.mcode.manual.table import lookup

NOTHING = r"(?!)"
"""Matches no line."""
INTEGER = r"-?\d{1,10}"
"""A value of 32 bits. A longer one is two lines that ran into each other."""
INTEGERS = r"-?\d[\d-]*"
"""Several values without separators."""
FREE = r"[ -~]*"
OPTIONED = {"IT", "VT"}
"""Words that take a number as an option."""
SEVERAL = OPTIONED | {"LS", "TA", "TC", "TI", "TM", "TP", "TR", "TT"}
"""Words that print several values."""
CLEARED = {"ER", "ST"}
"""Words that a drive clears when it prints them (5.1.40, 5.1.120)."""
_ESCAPE = re.compile(r"\\(.?)", re.S)
_CODES = {"r": "", "t": r"\t?", "b": r"[\b]?", "e": r"\x1b?", "g": r"\x07?", "c": r"\x03?"}


@lru_cache(maxsize=256)
def form(text: str) -> str | None:
    """Return a regular expression for the line that a PR prints; None where it is unknown, or prints several lines."""
    statement = _print(text)
    if statement is None:
        return None
    pieces: list[str] = []
    arguments = [each for each in statement.arguments if each is not None]
    while arguments:
        item = arguments.pop(0)
        if isinstance(item, Name) and item.word in OPTIONED and arguments and isinstance(arguments[0], Number):
            arguments.pop(0)
        pieces.append(_piece(item))
    return _joined(pieces)


def signed(text: str, item: str) -> str | None:
    """Append an item to the values of a PR; None where it prints no value, or is not a PR of one line."""
    statement = _print(text)
    if statement is None or all(isinstance(each, (Text, Number)) for each in statement.arguments):
        return None
    return f"{text.rstrip().removesuffix(';').rstrip()},{item}{';' * statement.quiet}"


def reading(text: str) -> str | None:
    """Return a regular expression for a PR that only reads whole numbers; None for any other.

    The repetition of the line in EM=0 does not match it.
    """
    statement = _print(text)
    if statement is None or statement.quiet or not isinstance(statement.arguments[-1], Name):
        return None
    words = [each.word for each in statement.arguments if isinstance(each, Name)]
    rows = [lookup(word) for word in words if word not in CLEARED]
    plain = all(isinstance(each, (Name, Text)) for each in statement.arguments)
    whole = len(rows) == len(words) and all(row is not None and _whole(row) for row in rows)
    return form(text) if plain and whole else None


def _print(text: str) -> Statement | None:
    try:
        statement = parse(text)
    except LineError:
        return None
    if statement is None or statement.word != "PR" or not statement.arguments:
        return None
    texts = [each.value for each in statement.arguments if isinstance(each, Text)]
    names = [lookup(each.word) for each in statement.arguments if isinstance(each, Name)]
    broken = any(r"\n" in each for each in texts) or any(row is not None and row.lines for row in names)
    return None if broken else statement


def _piece(item: object) -> str:
    if isinstance(item, Text):
        return _literal(item.value)
    if isinstance(item, Number):
        return re.escape(str(item.value))
    if isinstance(item, Name):
        row = lookup(item.word)
        return INTEGER if row is None or _whole(row) else FREE
    return FREE


def _whole(row: Mnemonic) -> bool:
    """Whether a word prints one whole number."""
    number = isinstance(row.low, int) and not isinstance(row.default, (float, str))
    return row.kind in ("variable", "flag") and number and row.name not in SEVERAL


def _literal(text: str) -> str:
    """Match a text in quotation marks; units either execute a control code or print it."""
    out, at = [], 0
    for found in _ESCAPE.finditer(text):
        code = _CODES.get(found[1], re.escape(found[1]))
        out += [re.escape(text[at : found.start()]), f"(?:{code}|{re.escape(found[0])})"]
        at = found.end()
    return "".join((*out, re.escape(text[at:])))


def _joined(pieces: list[str]) -> str:
    """Join the parts so that no two can match the same characters: a long line then matches fast."""
    if FREE in pieces:
        first, last = pieces.index(FREE), len(pieces) - 1 - pieces[::-1].index(FREE)
        pieces = [*pieces[:first], FREE, *pieces[last + 1 :]]
    out = [""]
    for piece in pieces:
        digits = piece == INTEGER or re.fullmatch(r"(?:\d|\\-)+", piece) is not None
        if out[-1] in (INTEGER, INTEGERS) and (digits or piece == FREE):
            out[-1] = INTEGERS if digits else FREE
        elif out[-1] != FREE or piece != INTEGER:
            out.append(piece)
    return "".join(out)
