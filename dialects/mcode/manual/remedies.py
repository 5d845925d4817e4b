"""What to do about a line that a drive refuses: the word's range, its form or its products, else the error's remedy."""

from __future__ import annotations

from multidrop.dialects.mcode.manual import error_texts
from multidrop.dialects.mcode.manual.errors import ErrorNumber
from multidrop.dialects.mcode.manual.grammar import LineError, Number, Statement, parse, tokens
from multidrop.dialects.mcode.manual.program_products import words_of
from multidrop.dialects.mcode.manual.table import lookup

SPOKEN_OF_FORM = frozenset({ErrorNumber.OUT_OF_RANGE, ErrorNumber.ILLEGAL_DATA, ErrorNumber.NO_SEPARATOR})
"""Errors about what follows a word."""


def remedy(code: int, text: str, product: str) -> str:
    """Return what to do about a line that a product refuses with this error; empty where that is not known."""
    try:
        statement = parse(text)
    except LineError:
        statement = None
    row = lookup(statement.word, product) if statement is not None else None
    if statement is None or row is None:
        return error_texts.hint(code, product)
    if code == ErrorNumber.NOT_AVAILABLE:
        return _others(statement, product) or error_texts.hint(code, product)
    if code == ErrorNumber.OUT_OF_RANGE and (valid := out_of_range(statement, product)):
        return valid
    return form(row.name, product) if code in SPOKEN_OF_FORM else error_texts.hint(code, product)


def _others(statement: Statement, product: str) -> str:
    """The products for which the first word is that this product lacks; empty where it lacks none."""
    for word in words_of(statement):
        row = lookup(word, product)
        if row is not None and row.products and product not in row.products:
            return f"{row.name} is for {', '.join(sorted(row.products))}"
    return ""


def form(text: str, product: str) -> str:
    """Return the form of the statements with the word at the head of a line; empty where there is no such word."""
    head = next(iter(tokens(text)), None)
    row = lookup(head.text, product) if head is not None and head.kind == "word" else None
    return f"the form is {row.syntax}" if row is not None and row.syntax else ""


def out_of_range(statement: Statement, product: str) -> str:
    """The numbers that a statement's word takes, if its one argument is a number and none of them; else empty."""
    row = lookup(statement.word, product)
    numbers = [each.value for each in statement.arguments if isinstance(each, Number)]
    if row is None or len(numbers) != 1 or len(statement.arguments) != 1:
        return ""
    if row.accepts(numbers[0]) or row.accepts(numbers[0], encoder=True):
        return ""
    return f"{row.name} takes {', '.join(map(str, row.values)) if row.values else f'{row.low} to {row.high}'}"
