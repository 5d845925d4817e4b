"""Warnings of trips that are set up and never enabled, and the reverse (MCode reference 5.1.125 to 5.1.132)."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence

from multidrop.dialects.mcode.manual.grammar import Number, Statement
from multidrop.dialects.mcode.manual.program_file import ProgramLine
from multidrop.dialects.problems import Problem

BITS: Mapping[str, int] = {"TI": 1, "TP": 2, "TC": 4, "TT": 8, "TR": 16, "TA": 32, "TM": 64}
"""The trips, each with the number by which TE enables it."""
Read = Sequence[tuple[ProgramLine, Statement]]
"""The lines of a file without an error, each with its statement."""


def check(read: Read, mentioned: Container[str]) -> Iterator[Problem]:
    """Report trips without TE, and TE without trips. `mentioned` are words that lines with an error have."""
    first = {statement.word: (line, statement) for line, statement in reversed(read) if statement.arguments}
    enabled = _enabled(read)
    if enabled is not None and "TE" not in mentioned:
        for word, bit in BITS.items():
            if word in first and not enabled & bit:
                line, statement = first[word]
                what = f"{word} is set up, but TE never enables it"
                hint = f"TE={bit} enables it, after each trip again"
                yield Problem(line.number, line.column + statement.column, what, hint, warning=True)
    missing = {word: bit for word, bit in BITS.items() if word not in first and word not in mentioned}
    yield from _undefined(read, missing)


def _bits(statement: Statement) -> int | None:
    """The number that a line gives TE; None for a number that the text does not show."""
    value = statement.arguments[0]
    return value.value if isinstance(value, Number) and isinstance(value.value, int) else None


def _enabled(read: Read) -> int | None:
    """All trips that some line enables; None if the text does not show it."""
    found = 0
    for _, statement in read:
        if statement.word == "TE" and statement.arguments:
            bits = _bits(statement)
            if bits is None:
                return None
            found |= bits
    return found


def _undefined(read: Read, missing: Mapping[str, int]) -> Iterator[Problem]:
    """Report the first TE for each set of trips that nothing sets up."""
    reported = set[str]()
    for line, statement in read:
        bits = _bits(statement) if statement.word == "TE" and statement.arguments else None
        words = [word for word, bit in missing.items() if (bits or 0) & bit and word not in reported]
        if words:
            reported.update(words)
            what = f"TE enables {', '.join(words)}, which nothing in this file sets up"
            yield Problem(
                line.number, line.column + statement.column, what, "a drive refuses it: error 27", warning=True
            )
