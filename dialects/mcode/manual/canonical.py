"""The canonical spelling of a line of MCode, by which two listings are compared and a file is formatted.

A drive accepts one statement in many spellings: any case, `=` or a blank after the head, blanks between the parts, a
head that touches its argument. The canonical spelling has capitals, `=` after a variable or a flag, one blank after an
instruction, no other blanks, and commas between the items of PR. Texts in quotation marks stay as they are. Two lines
of one canonical spelling are one statement, of one size in program memory.
"""

from __future__ import annotations

from collections.abc import Container

from multidrop.dialects.mcode.manual.grammar import (
    Argument,
    Binary,
    Compare,
    LineError,
    Name,
    Number,
    Statement,
    Text,
    Unary,
    parse,
    tokens,
)
from multidrop.dialects.mcode.manual.table import lookup


def canonical(text: str, names: Container[str] = ()) -> str:
    """Return a line in canonical spelling, without its remark. `names` are labels and variables, in capitals.

    A line that no drive accepts stays as it is.
    """
    try:
        statement = parse(text, names)
    except LineError:
        return text[: next((each.start for each in tokens(text) if each.kind == "remark"), None)].strip(" \t")
    return spelled(statement, names) if statement is not None else ""


def spelled(statement: Statement, names: Container[str] = ()) -> str:
    """Write a statement in canonical spelling."""
    arguments = ",".join(_argument(each) for each in statement.arguments)
    end = ";" if statement.quiet else ""
    between = "=" if _takes_equals(statement, names) else " " if statement.word and arguments else ""
    return f"{statement.word}{between}{arguments}{end}"


def _takes_equals(statement: Statement, names: Container[str]) -> bool:
    """Whether `=` follows the head; one without a value is an error, and is kept."""
    if not statement.arguments:
        return statement.equals
    row = None if statement.word in names else lookup(statement.word)
    return bool(statement.word) and (row is None or row.kind in ("variable", "flag"))


def _argument(part: Argument | None) -> str:
    match part:
        case None:
            return ""
        case Text(value, quoted):
            return f'"{value}"' if quoted else value
        case Number(value):
            return repr(value).upper()
        case Name(word):
            return word
        case Unary(op, operand):
            return f"{op} {_argument(operand)}" if op.isalnum() or op.endswith("_") else f"{op}{_argument(operand)}"
        case Binary(op, left, right) | Compare(op, left, right):
            return f"{_argument(left)}{op}{_argument(right)}"
