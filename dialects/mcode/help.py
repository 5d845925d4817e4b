"""What a person is told about a mnemonic: help, completion, and a hint while a line is typed."""

from __future__ import annotations

import difflib
import re

from dialects.errors import Diagnostic
from dialects.mcode.conditions import condition_of, is_mixed, reading
from dialects.mcode.lines import LineError, parse
from dialects.mcode.table import EVERY, LEXIUM, MDRIVE_PLUS, MNEMONICS, Mnemonic, lookup

ACCESS = {
    "RW": "read and write",
    "RO": "read only",
    "WO": "write only",
    "RC": "read, and cleared",
    "-": "not a value",
}
_WORD = re.compile(r"[A-Za-z]_|[A-Za-z][A-Za-z0-9]*", re.ASCII)
_LAST = re.compile(r"[A-Za-z][A-Za-z0-9]*$", re.ASCII)
_QUOTED = re.compile(r'"[^"]*"?')
_SPLIT = re.compile(r"([A-Za-z]+)-?\d", re.ASCII)


def names() -> list[str]:
    """The words that help is there for."""
    return list(MNEMONICS)


def knows(word: str) -> bool:
    """Whether there is help on a word."""
    return lookup(word) is not None


def describe(word: str) -> list[str]:
    """The help on a mnemonic or operator, line by line. Raises Diagnostic with what was perhaps meant."""
    row = lookup(word)
    if row is None:
        near = _near(word.strip())
        raise Diagnostic(f"no mnemonic {word.strip()!r}", "", f"perhaps {', '.join(near)}" if near else "")
    facts = (
        ("syntax", row.syntax),
        ("range", _range(row)),
        ("default", _default(row)),
        ("access", ACCESS[row.access] if row.kind in ("variable", "flag", "keyword") else ""),
        ("use", _use(row)),
        ("products", _products(row)),
        ("note", row.note),
        ("manual", f"MCode reference {row.section}" if row.section else ""),
    )
    lines = [f"  {label:<10} {fact}" for label, fact in facts if fact]
    return [f"{row.name}: {row.title} ({row.kind})", f"  {row.meaning}", *lines]


def complete(prefix: str) -> list[tuple[str, str]]:
    """Mnemonics that begin with what was typed, each with its meaning; no operators, no reserved words."""
    head = prefix.strip().upper()
    return [(name, row.meaning) for name, row in MNEMONICS.items() if name.startswith(head) and _offered(row)]


def typing(text: str) -> str:
    """The word at the end of a line that may be completed; none within quotation marks."""
    found = _LAST.search(text)
    return found.group() if found and text.count('"') % 2 == 0 else ""


def hint(text: str) -> str:
    """Syntax and meaning of what a line being typed is about; an empty string where that is not known."""
    plain = _QUOTED.sub(" ", text).strip()
    first = _WORD.match(plain)
    if first is None:
        return ""
    if read := _reading(text):
        return read
    row = _row_of(first.group())
    if row is not None and row.name == "PR":
        printed = [found for found in map(_row_of, _WORD.findall(plain[first.end() :])) if found]
        row = printed[-1] if printed else row
        return f"PR {row.name}   {row.meaning}" if printed else f"{row.syntax}   {row.meaning}"
    return f"{row.syntax}   {row.meaning}" if row and row.syntax else ""


def _reading(text: str) -> str:
    """How a condition that mixes comparison and logic is read, while it is typed; empty for any other line."""
    try:
        statement = parse(text)
    except LineError:
        return ""
    condition = condition_of(statement) if statement is not None else None
    return f"read as {reading(condition)}" if condition is not None and is_mixed(condition) else ""


def _row_of(word: str) -> Mnemonic | None:
    """The row of a word, also where its number follows without a space (`MR512`)."""
    row = lookup(word)
    split = _SPLIT.match(word) if row is None else None
    return lookup(split.group(1)) if split else row


def _offered(row: Mnemonic) -> bool:
    return row.name[0].isalpha() and row.kind != "reserved"


def _near(word: str) -> list[str]:
    """Mnemonics that look like the word, or whose title has it."""
    upper = word.upper()
    words = [name for name, row in MNEMONICS.items() if _offered(row)]
    titled = [name for name in words if len(word) > 2 and upper in MNEMONICS[name].title.upper()]
    alike = sorted(difflib.get_close_matches(upper, words, n=20, cutoff=0.5))
    alike.sort(key=lambda name: name[0] != upper[:1])
    return list(dict.fromkeys(titled + alike))[:6]


def _range(row: Mnemonic) -> str:
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


def _default(row: Mnemonic) -> str:
    if row.default is None:
        return ""
    if row.default_encoder is not None:
        return f"{row.default} (EE=0), {row.default_encoder} (EE=1)"
    return str(row.default)


def _use(row: Mnemonic) -> str:
    if row.kind in ("math", "reserved"):
        return ""
    both = "immediate and in programs"
    return both if row.immediate and row.program else "immediate only" if row.immediate else "in programs only"


def _products(row: Mnemonic) -> str:
    if row.products == EVERY:
        return "all"
    if row.products == LEXIUM:
        return "Lexium MDrive and Motion Module"
    return "MDrivePlus" if row.products == MDRIVE_PLUS else ", ".join(sorted(row.products))
