"""TMCL's own notation, `MVP ABS, 0, 51200`: a word, then its fields with commas between them.

A command without a word is called by its number, then type, motor and value: `138 0, 0, 1`. Numbers are decimal. Words
and types may be written in small letters.
"""

from __future__ import annotations

import difflib
import re

from multidrop.dialects.codec import Command
from multidrop.dialects.tmcl.manual.commands import BANK, INT32, MOTOR, MOTORS, TYPE, VALUE, WORDS, Call, Row

BYTE = range(256)
RANGES = {TYPE: BYTE, MOTOR: MOTORS, BANK: BYTE, VALUE: INT32}
NUMBER = re.compile(r"[+-]?\d{1,11}", re.ASCII)
BY_NUMBER = (TYPE, MOTOR, VALUE)
"""Fields after the number of a command."""


class LineError(ValueError):
    """An invalid TMCL line; the text says why and what is valid."""


def parse(text: str) -> Call:
    """The command in a line. Raises LineError."""
    found = text.read_by(_read) if isinstance(text, Command) else _read(text)
    if isinstance(found, LineError):
        raise found
    return found


def _read(text: str) -> Call | LineError:
    try:
        return _parsed(text)
    except LineError as error:
        return error


def _parsed(text: str) -> Call:
    word, _, rest = text.strip().partition(" ")
    fields = [field.strip() for field in rest.split(",")] if rest.strip() else []
    if word.isascii() and word.isdigit():
        return _by_number(word, fields)
    row = WORDS.get(word.upper())
    if row is None:
        raise LineError(f"no command {word!r}{_suggestion(word)}")
    if len(fields) != len(row.fields):
        raise LineError(f"{row.word} takes {_count(len(row.fields))}: {row.syntax}")
    values = {name: _value(row, name, field) for name, field in zip(row.fields, fields, strict=True)}
    return Call(row.command, values.get(TYPE, 0), values.get(MOTOR, values.get(BANK, 0)), values.get(VALUE, 0))


def _by_number(word: str, fields: list[str]) -> Call:
    if int(word) not in BYTE:
        raise LineError(f"no command {word}; valid: 0 to 255")
    if len(fields) != len(BY_NUMBER):
        raise LineError(f"a command by its number takes {_count(len(BY_NUMBER))}: {word} {', '.join(BY_NUMBER)}")
    kind, motor, value = (_number(name, field) for name, field in zip(BY_NUMBER, fields, strict=True))
    return Call(int(word), kind, motor, value)


def _value(row: Row, name: str, field: str) -> int:
    if name == TYPE and field.upper() in row.types:
        return row.types[field.upper()]
    if name == TYPE and row.types and not NUMBER.fullmatch(field):
        raise LineError(f"{row.word} has no type {field!r}; valid: {', '.join(row.types)}")
    return _number(name, field)


def _number(name: str, field: str) -> int:
    valid = RANGES[name]
    if not NUMBER.fullmatch(field) or int(field) not in valid:
        raise LineError(f"{name} cannot be {field!r}; valid: {valid[0]} to {valid[-1]}")
    return int(field)


def _count(fields: int) -> str:
    return "1 field" if fields == 1 else f"{fields} fields"


def _suggestion(word: str) -> str:
    near = difflib.get_close_matches(word.upper(), list(WORDS), 3, 0.6)
    return f"; did you mean {' or '.join(near)}?" if near else f"; valid: {', '.join(WORDS)}"
