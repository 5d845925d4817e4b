"""The products that have all words of a program, and a warning of a program for other ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multidrop.dialects.mcode.manual.grammar import FUNCTIONS, Argument, Binary, Compare, Name, Statement, Unary
from multidrop.dialects.mcode.manual.mnemonic import EVERY
from multidrop.dialects.mcode.manual.program_file import ProgramLine
from multidrop.dialects.mcode.manual.table import lookup
from multidrop.dialects.problems import Problem

AT_POWER_UP = "SU"
"""The one word that a label may have."""
Read = Sequence[tuple[ProgramLine, Statement]]
"""The lines of a file that can be parsed, each with its statement."""
LISTED = 4
"""Words that a message names."""


def names_in(part: Argument | None) -> Iterator[Name]:
    """Yield the names in an argument, from left to right."""
    match part:
        case Name():
            yield part
        case Unary(_, operand):
            yield from names_in(operand)
        case Binary(_, left, right) | Compare(_, left, right):
            yield from names_in(left)
            yield from names_in(right)


def check(read: Read, names: frozenset[str], product: str) -> Iterator[Problem]:
    """Report that a program is for other products than this one, if it is for any. `names` are the user's."""
    used = dict[str, ProgramLine]()
    for line, statement in read:
        for word in words_of(statement):
            if lookup(word) is not None:
                used.setdefault(word, line)
    own, drives = [word for word in used if word in names], [word for word in used if word not in names]
    missing = [word for word in drives if _lacks(product, word)]
    taken = [word for word in own if _takes(product, word)]
    kin = sorted(EVERY, key=lambda each: (each[:2] != product[:2], each))
    fit = [each for each in kin if not any(_lacks(each, word) for word in drives)]
    fit = [each for each in fit if not any(_takes(each, word) for word in own)]
    if not fit or not (missing or taken):
        return
    reasons = [f"no {product} has {_some(missing)}"] if missing else []
    reasons += [f"{product} has {_some(taken)} as its own"] if taken else []
    line = used[(missing or taken)[0]]
    what = f"this is a program for {_choice(fit)}: {', and '.join(reasons)}"
    yield Problem(line.number, line.column, what, f"check it with --personality {fit[0]}", warning=True)


def words_of(statement: Statement) -> Iterator[str]:
    """Yield the words of a statement: its head, and the names in its arguments."""
    if statement.word:
        yield statement.word
    for argument in statement.arguments:
        yield from (each.word for each in names_in(argument))
        yield from _functions(argument)


def _functions(part: Argument | None) -> Iterator[str]:
    """Yield the function words in an argument."""
    match part:
        case Unary(op, operand):
            yield from (op,) if op in FUNCTIONS else ()
            yield from _functions(operand)
        case Binary(_, left, right) | Compare(_, left, right):
            yield from _functions(left)
            yield from _functions(right)


def _lacks(product: str, word: str) -> bool:
    """Whether a product does not execute a word."""
    row = lookup(word, product)
    return row is None or product not in row.products


def _takes(product: str, name: str) -> bool:
    """Whether a product has a word of its own where a user has a name."""
    return name != AT_POWER_UP and lookup(name, product) is not None


def _some(words: Sequence[str]) -> str:
    return ", ".join(words[:LISTED]) + (" and others" if len(words) > LISTED else "")


def _choice(products: Sequence[str]) -> str:
    *others, last = products
    return f"{', '.join(others)} or {last}" if others else last
