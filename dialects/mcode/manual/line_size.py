"""The bytes that a line takes in program memory, which separate the programs of a listing.

The sizes follow what was seen on real units (`HM 1` 4 bytes, `H` and `E` 2, `P=30000` 5): a byte for the mnemonic, one
for the end, for a number one and as many as its value needs, for a user's name three, for a text two and its
characters. The manual gives no sizes.
"""

from __future__ import annotations

from multidrop.dialects.mcode.manual.grammar import Argument, Binary, Compare, Name, Number, Statement, Text, Unary
from multidrop.dialects.mcode.manual.table import lookup


def size_of(statement: Statement, product: str = "") -> int:
    """Bytes that a line takes in program memory; a product's words take one, names take three."""
    head = 1 if lookup(statement.word, product) else 3
    commas = max(len(statement.arguments) - 1, 0)
    return head + sum(_size(each, product) for each in statement.arguments) + commas + int(statement.quiet) + 1


def _size(argument: Argument | None, product: str) -> int:
    match argument:
        case None:
            return 0
        case Number(value):
            return 9 if isinstance(value, float) else 2 if -128 <= value < 128 else 3 if abs(value) < 32768 else 5
        case Name(word):
            return 1 if lookup(word, product) else 3
        case Text(value):
            return 2 + len(value)
        case Unary(_, operand):
            return 1 + _size(operand, product)
        case Binary(_, left, right) | Compare(_, left, right):
            return 1 + _size(left, product) + _size(right, product)
