"""Help on a mnemonic: description, completion, a hint while a line is typed, and the remedy for a refused line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache

from multidrop.base.errors import Diagnostic
from multidrop.base.files import rows
from multidrop.dialects.language import Language, labelled, perhaps, remedied
from multidrop.families.lexium.manual import errors
from multidrop.families.lexium.manual.errors import ErrorNumber
from multidrop.families.lexium.manual.grammar import LineError, Number, Statement, parse, parsed, tokens
from multidrop.families.lexium.manual.mnemonic import EVERY, LEXIUM, MDRIVE_PLUS, Mnemonic
from multidrop.families.lexium.manual.statements import condition_of, condition_reading, is_mixed, words_of
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS, lookup, words

ACCESS = {"RW": "read and write", "RO": "read only", "WO": "write only", "RC": "read, and cleared", "-": "not a value"}
_WORD = re.compile(r"[A-Za-z]_|[A-Za-z][A-Za-z0-9]*", re.ASCII)
_LAST = re.compile(r"[A-Za-z][A-Za-z0-9]*$", re.ASCII)
_QUOTED = re.compile(r'"[^"]*"?')
_SPLIT = re.compile(r"([A-Za-z]+)-?\d", re.ASCII)


def _lines_of(name: str, key: str) -> Mapping[str, list[Mapping[str, str]]]:
    by_name: dict[str, list[Mapping[str, str]]] = {}
    for row in rows(__file__, name):
        by_name.setdefault(row[key], []).append(row)
    return by_name


@cache
def details() -> Mapping[str, list[Mapping[str, str]]]:
    """Further lines on words of a Lexium: types, bits, escapes; each with its label."""
    return _lines_of("details.csv", "word")


@cache
def topics() -> Mapping[str, list[Mapping[str, str]]]:
    """What several words do together, by topic."""
    return _lines_of("topics.csv", "topic")


def _topic(word: str) -> str:
    """The topic that a word names, in the plural too; empty: it names none."""
    name = word.strip().lower()
    return next((topic for topic in (name, name.removesuffix("s")) if topic in topics()), "")


class MCodeLanguage(Language):
    """Help on the words of MCode. Without a product it describes a Lexium, and also finds words of other products."""

    def names(self) -> list[str]:
        return sorted({*MNEMONICS, *MDRIVE, *(topic.upper() for topic in topics())})

    def knows(self, word: str) -> bool:
        return lookup(word) is not None or bool(_topic(word))

    def describe(self, word: str, product: str = "") -> list[str]:
        """Describe a mnemonic or operator, line by line. Raises Diagnostic with similar words."""
        row = words(product).get(word.strip().upper()) or lookup(word)
        if row is None and (topic := _topic(word)):
            return [f"{topic} (topic)", *(f"  {each['text']}" for each in topics()[topic])]
        if row is None:
            raise Diagnostic(f"no mnemonic {word.strip()!r}", "", perhaps(_near(word.strip(), product)))
        return page(row, facts(row, product))

    def describe_error(self, code: int, product: str = "") -> list[str]:
        """Return meaning and remedy of an error number, line by line; for each family where no product is named.

        Raises Diagnostic for a number without a meaning.
        """
        by_meaning: dict[tuple[str, str], list[str]] = {}
        for family in [product] if product else errors.TEXTS:
            by_meaning.setdefault((errors.text(code, family), errors.hint(code, family)), []).append(family)
        lines = []
        for (text, advice), families in by_meaning.items():
            where = f" ({', '.join(families)})" if len(by_meaning) > 1 else ""
            lines += remedied(f"error {code}{where}: {text}", advice) if text != errors.UNKNOWN else []
        if not lines:
            what = f"no error {code} on {product}" if product else f"no error {code}"
            raise Diagnostic(what, "", f"they are 0 to {max(map(max, errors.TEXTS.values()))}, with gaps")
        return lines

    def offered(self, product: str, typed: str) -> Iterable[tuple[str, str]]:
        """Return mnemonics; no operators, no reserved words."""
        return ((row.name, row.meaning) for row in rows_offered(product))

    def typing(self, text: str) -> str:
        """Return the word at the end of a line that may be completed; none within quotation marks."""
        match = _LAST.search(text)
        return match.group() if match and text.count('"') % 2 == 0 else ""

    def hint(self, text: str, product: str = "") -> str:
        """Return syntax and meaning of the word being typed; empty where it is unknown."""
        plain = _QUOTED.sub(" ", text).strip()
        first = _WORD.match(plain)
        if first is None:
            return ""
        statement = parsed(text)
        condition = condition_of(statement) if statement is not None else None
        if condition is not None and is_mixed(condition):
            return f"read as {condition_reading(condition)}"
        row = _row_of(first.group(), product)
        if row is not None and row.name == "PR":
            printed = [mnemonic for word in _WORD.findall(plain[first.end() :]) if (mnemonic := _row_of(word, product))]
            row = printed[-1] if printed else row
            return f"{'PR ' + row.name if printed else row.syntax}   {_told(row)}"
        return f"{row.syntax}   {_told(row)}" if row and row.syntax else ""


LANGUAGE = MCodeLanguage()


def facts(row: Mnemonic, product: str = "") -> dict[str, str]:
    """Return what the tables say of a word, by the label of its line in the help; empty where they say nothing."""
    older = row.reserved_on <= MDRIVE_PLUS
    default = "" if row.default is None else str(row.default)
    if row.default is not None and row.default_encoder is not None:
        default += f" (EE=0), {row.default_encoder} (EE=1)"
    use = "immediate only" if row.immediate else "in programs only"
    if row.immediate and row.program:
        use = "immediate and in programs"
    here = ""
    if product in EVERY and product not in row.products:
        here = f"not in an {product}: error 37" if product in row.reserved_on else f"a free name in an {product}"
        here = f"not in an {product}: it prints 0; error 37 for any value" if product in row.zero_on else here
    return {
        "syntax": row.syntax,
        "range": range_of(row),
        "default": default,
        "access": ACCESS[row.access] if row.kind in ("variable", "flag", "keyword") else "",
        "use": use if row.kind not in ("math", "reserved") else "",
        "products": _products(row.name),
        "firmware": f"{row.firmware} or newer" if row.firmware else "",
        "size": "not on NEMA 17" if row.large else "",
        "here": here,
        "note": row.note,
        "manual": f"MCode reference of 2012, page {row.section}" if older else f"MCode reference {row.section}",
    }


def page(row: Mnemonic, said: Mapping[str, str]) -> list[str]:
    """Lay out the help on a word, with a line for each fact, and for each detail before the last fact."""
    older = row.reserved_on <= MDRIVE_PLUS
    *facts, manual = said.items()
    more = [] if older else [(each["label"], each["text"]) for each in details().get(row.name, ())]
    lines = labelled((*facts, *more, manual))
    return [f"{row.name}: {row.title} ({row.kind})", f"  {row.meaning}", *lines]


def rows_offered(product: str = "") -> list[Mnemonic]:
    """Return the mnemonics of a product that completion offers."""
    return [row for row in words(product).values() if _offered(row, product)]


def _told(row: Mnemonic) -> str:
    older = row.reserved_on <= MDRIVE_PLUS
    return f"{row.meaning}; manual {'page ' if older else ''}{row.section}" if row.section else row.meaning


def _row_of(word: str, product: str) -> Mnemonic | None:
    """The row of a word, also where its number follows without a space (`MR512`)."""
    row = lookup(word, product)
    split = _SPLIT.match(word) if row is None else None
    return lookup(split.group(1), product) if split else row


def _offered(row: Mnemonic, product: str = "") -> bool:
    there = product in row.products or product not in EVERY
    return there and row.name[0].isalpha() and row.kind != "reserved"


def _near(word: str, product: str) -> list[str]:
    """Mnemonics similar to the word, or with the word in their title."""
    upper, rows = word.upper(), words(product)
    state = [name for name, row in rows.items() if _offered(row)]
    titled = [name for name in state if len(word) > 2 and upper in rows[name].title.upper()]
    import difflib  # send never needs it

    alike = sorted(difflib.get_close_matches(upper, state, n=20, cutoff=0.5))
    alike.sort(key=lambda name: name[0] != upper[:1])
    return list(dict.fromkeys(titled + alike))[:6]


def range_of(row: Mnemonic) -> str:
    """Return the numbers that a word takes or shows, with their unit; empty where they are unstated."""
    if row.values:
        return f"{', '.join(map(str, row.values))} {row.unit}".strip()
    plain = _span(row, encoder=False)
    closed = _span(row, encoder=True)
    return f"{plain} (EE=0), {closed} (EE=1)" if closed != plain else plain


def _span(row: Mnemonic, encoder: bool) -> str:
    low, high = row.bounds(encoder)
    unit = row.unit_encoder if encoder and row.unit_encoder else row.unit
    if low is None or high is None:
        return ""
    return f"{low:g} to {high:g} {unit}".strip() if isinstance(high, float) else f"{low} to {high} {unit}".strip()


def _products(name: str) -> str:
    """The products that have a word, from all tables."""
    products = frozenset().union(*(table[name].products for table in (MNEMONICS, MDRIVE) if name in table))
    if products == EVERY:
        return "all"
    parts = []
    for everyone, family in ((LEXIUM, "Lexium MDrive and Motion Module"), (MDRIVE_PLUS, "MDrivePlus")):
        parts += [family] if everyone <= products else sorted(products & everyone)
    return ", ".join(parts)


# What to do about a line that a drive refuses: the word's range, its form or its products, else the error's remedy.


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
        return errors.hint(code, product)
    if code == ErrorNumber.NOT_AVAILABLE:
        return _others(statement, product) or errors.hint(code, product)
    if code == ErrorNumber.OUT_OF_RANGE and (valid := out_of_range(statement, product)):
        return valid
    return form_of(row.name, product) if code in SPOKEN_OF_FORM else errors.hint(code, product)


def _others(statement: Statement, product: str) -> str:
    """The products for which the first word is that this product lacks; empty where it lacks none."""
    for word in words_of(statement):
        row = lookup(word, product)
        printed = row is not None and product in row.zero_on and word != statement.word
        if row is not None and row.products and product not in row.products and not printed:
            return f"{row.name} is for {', '.join(sorted(row.products))}"
    return ""


def form_of(text: str, product: str) -> str:
    """Return the form of the statements with the word at the head of a line; empty where there is no such word."""
    head = next(iter(tokens(text)), None)
    row = lookup(head.text, product) if head is not None and head.kind == "word" else None
    return f"the form is {row.syntax}" if row is not None and row.syntax else ""


def out_of_range(statement: Statement, product: str) -> str:
    """The numbers that a statement's word takes, if its one argument is a number and none of them; else empty."""
    row = lookup(statement.word, product)
    numbers = [argument.value for argument in statement.arguments if isinstance(argument, Number)]
    if row is None or len(numbers) != 1 or len(statement.arguments) != 1:
        return ""
    if row.accepts(numbers[0]) or row.accepts(numbers[0], encoder=True):
        return ""
    return f"{row.name} takes {', '.join(map(str, row.values)) if row.values else f'{row.low} to {row.high}'}"
