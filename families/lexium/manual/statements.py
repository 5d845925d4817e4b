"""Work on a parsed line of MCode: its canonical spelling, how its condition is read, its size, a device name."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from string import ascii_lowercase, ascii_uppercase, digits

from multidrop.families.lexium.manual.grammar import (
    LOGIC,
    Argument,
    BinaryTerm,
    Compare,
    Expression,
    LineError,
    NameTerm,
    Number,
    Statement,
    Text,
    UnaryTerm,
    parse,
    tokens,
)
from multidrop.families.lexium.manual.groups import CONDITIONAL, FUNCTIONS
from multidrop.families.lexium.manual.table import lookup

# The canonical spelling of a line of MCode, by which two listings are compared and a file is formatted.
#
# A drive accepts one statement in many spellings: any case, `=` or a blank after the head, blanks between the parts, a
# head that touches its argument. The canonical spelling has capitals, `=` after a variable or a flag, one blank after
# an instruction, no other blanks, and commas between the items of PR. Texts in quotation marks stay as they are. Two
# lines of one canonical spelling are one statement, of one size in program memory.


def canonical(text: str, names: Container[str] = ()) -> str:
    """Return a line in canonical spelling, without its remark. `names` are labels and variables, in capitals.

    A line that no drive accepts stays as it is.
    """
    try:
        statement = parse(text, names)
    except LineError:
        return text[: next((token.start for token in tokens(text) if token.kind == "remark"), None)].strip(" \t")
    return spelled(statement, names) if statement is not None else ""


def spelled(statement: Statement, names: Container[str] = ()) -> str:
    arguments = ",".join(_spelled(argument) for argument in statement.arguments)
    end = ";" if statement.quiet else ""
    between = "=" if _takes_equals(statement, names) else " " if statement.word and arguments else ""
    return f"{statement.word}{between}{arguments}{end}"


def _takes_equals(statement: Statement, names: Container[str]) -> bool:
    """Whether `=` follows the head; one without a value is an error, and is kept."""
    if not statement.arguments:
        return statement.equals
    row = None if statement.word in names else lookup(statement.word)
    return bool(statement.word) and (row is None or row.valued)


def _spelled(part: Argument | None) -> str:
    match part:
        case None:
            return ""
        case Text(value, quoted):
            return f'"{value}"' if quoted else value
        case Number(value):
            return repr(value).upper()
        case NameTerm(word):
            return word
        case UnaryTerm(op, operand):
            return f"{op} {_spelled(operand)}" if op.isalnum() or op.endswith("_") else f"{op}{_spelled(operand)}"
        case BinaryTerm(op, left, right) | Compare(op, left, right):
            return f"{_spelled(left)}{op}{_spelled(right)}"


# The reading of a condition of BR or CL: the one rule of checker, simulator and help.
#
# The manual shows one comparison without logic ("only one condition", 5.1.14, 5.1.22). Longer conditions are read from
# left to right. `+ - * /` after a comparison belong to its right side: `P<R1+100` is P<(R1+100). `& | ^` after a
# comparison take its result, 0 or 1: `R1=1&MV` is (R1=1)&MV. A second comparison takes everything to its left:
# `KF&12=12` is (KF&12)=12, `I1=1&I2=1` is ((I1=1)&I2)=1. `grammar.parse` builds its trees by this rule.


def condition_of(statement: Statement) -> Expression | None:
    if statement.word not in CONDITIONAL or len(statement.arguments) != 2:
        return None
    argument = statement.arguments[1]
    return argument if isinstance(argument, Expression) else None


def compares(expression: Argument) -> bool:
    return any(isinstance(text, Compare) for text in _within(expression))


def is_mixed(condition: Expression) -> bool:
    """Whether it exceeds the manual's form: several comparisons, or a comparison beside logic."""
    parts = list(_within(condition))
    comparisons = sum(isinstance(part, Compare) for part in parts)
    logic = any(isinstance(part, BinaryTerm | UnaryTerm) and part.op in (*LOGIC, "!") for part in parts)
    return comparisons > 1 or (comparisons == 1 and logic)


def condition_reading(condition: Expression) -> str:
    """Show the condition as it is read, with brackets around each operation but the last."""
    match condition:
        case Number(value):
            return str(value)
        case NameTerm(word):
            return word
        case UnaryTerm(op, operand):
            return f"{op} {_inner(operand)}" if op in FUNCTIONS else op + _inner(operand)
        case BinaryTerm(op, left, right) | Compare(op, left, right):
            return _inner(left) + op + _inner(right)


def _inner(part: Expression) -> str:
    bracketed = isinstance(part, BinaryTerm | Compare) or (isinstance(part, UnaryTerm) and part.op == "!")
    return f"({condition_reading(part)})" if bracketed else condition_reading(part)


def _within(expression: Argument) -> Iterator[Argument]:
    yield expression
    if isinstance(expression, UnaryTerm):
        yield from _within(expression.operand)
    elif isinstance(expression, BinaryTerm | Compare):
        yield from _within(expression.left)
        yield from _within(expression.right)


# The bytes that a line takes in program memory, which separate the programs of a listing.
#
# The sizes follow what was seen on real units (`HM 1` 4 bytes, `H` and `E` 2, `P=30000` 5): a byte for the mnemonic,
# one for the end, for a number one and as many as its value needs, for a user's name three, for a text two and its
# characters. The manual gives no sizes.


def size_of(statement: Statement, product: str = "") -> int:
    """Bytes that a line takes in program memory; a product's words take one, names take three."""
    head = 1 if lookup(statement.word, product) else 3
    commas = max(len(statement.arguments) - 1, 0)
    return (
        head
        + sum(_argument_size(argument, product) for argument in statement.arguments)
        + commas
        + int(statement.quiet)
        + 1
    )


def _argument_size(argument: Argument | None, product: str) -> int:
    match argument:
        case None:
            return 0
        case Number(value):
            return 9 if isinstance(value, float) else 2 if -128 <= value < 128 else 3 if abs(value) < 32768 else 5
        case NameTerm(word):
            return 1 if lookup(word, product) else 3
        case Text(value):
            return 2 + len(value)
        case UnaryTerm(_, operand):
            return 1 + _argument_size(operand, product)
        case BinaryTerm(_, left, right) | Compare(_, left, right):
            return 1 + _argument_size(left, product) + _argument_size(right, product)


# The names that DN accepts (MCode reference 5.1.33): one letter or digit, whose case counts.
#
# A Lexium accepts a name in quotation marks only; anything else is error 21. An MDrivePlus also accepts a bare name
# (two clients for units send `DN a`), and a character's code of two or three digits (`DN=65` and `DN="65"` are A).


UNNAMED = "!"
"""The name of a drive without a name of its own."""
NAMES = (UNNAMED, *ascii_lowercase, *digits, *ascii_uppercase)
"""All names, the likelier first."""
_CHARACTER_CODE = re.compile(r"\d{2,3}", re.ASCII)


def device_name(argument: Argument | None, quoted_only: bool) -> str:
    """Return the name in a DN line; empty where the drive refuses it. `quoted_only`: the drive is a Lexium."""
    if isinstance(argument, Text):
        bare, value = not argument.quoted, argument.value
    elif isinstance(argument, Number) and isinstance(argument.value, int):
        bare, value = True, str(argument.value)
    else:
        return ""
    if quoted_only:
        value = "" if bare else value
    elif _CHARACTER_CODE.fullmatch(value):
        value = chr(int(value))
    return value if len(value) == 1 and value.isascii() and value.isalnum() else ""


def names_in(part: Argument | None) -> Iterator[NameTerm]:
    match part:
        case NameTerm():
            yield part
        case UnaryTerm(_, operand):
            yield from names_in(operand)
        case BinaryTerm(_, left, right) | Compare(_, left, right):
            yield from names_in(left)
            yield from names_in(right)


def words_of(statement: Statement) -> Iterator[str]:
    """Yield the words of a statement: its head, and the names in its arguments."""
    if statement.word:
        yield statement.word
    for argument in statement.arguments:
        yield from (name.word for name in names_in(argument))
        yield from _functions(argument)


def _functions(part: Argument | None) -> Iterator[str]:
    match part:
        case UnaryTerm(op, operand):
            yield from (op,) if op in FUNCTIONS else ()
            yield from _functions(operand)
        case BinaryTerm(_, left, right) | Compare(_, left, right):
            yield from _functions(left)
            yield from _functions(right)
