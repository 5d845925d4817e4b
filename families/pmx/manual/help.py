"""Help on a command: description, completion, and a hint while a line is typed."""

from __future__ import annotations

import difflib
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.families.pmx.manual import script_parser
from multidrop.families.pmx.manual.table import (
    COMMANDS,
    ELSEWHERE,
    ROWS,
    WORDS,
    Command,
    head,
    lookup,
    meaning,
    parts_of,
)

ACCESS = {"R": "read only", "W": "write only", "RW": "read and write"}
EXAMPLES = {"X": ["X1000", "X1000Y2000"], "Y": ["Y1000"], "I": ["I1000:-1000"], "T": ["TX1000", "TY1000"]}
SPELT_OUT = 8
"""Number of numbered words up to which completion offers each."""


def names() -> list[str]:
    return list(COMMANDS)


def knows(word: str) -> bool:
    """Whether a command, a word of programs, or a refusal (`?Moving`) has help."""
    return lookup(word) is not None or meaning(word) is not None or script_parser.find(word) != ""


def describe_error(code: int, product: str = "") -> list[str]:
    """Raise Diagnostic: a controller has no error numbers."""
    raise Diagnostic(f"no error {code} on a PMX-2ED", "", 'it replies in words: /help "?Moving" explains one')


def describe(word: str, product: str = "") -> list[str]:
    """Describe a command, a word of programs or a refusal, line by line; there is one product.

    Raises Diagnostic with similar words.
    """
    refusal = meaning(word)
    if refusal is not None:
        return [f"{word}: {refusal[0]}", f"  do         {refusal[1]}"]
    row = lookup(word)
    stored = script_parser.find(word)
    if row is None and stored:
        only = [f"  {'use':<10} in programs only"] * (stored in script_parser.KEYWORDS)
        return [*script_parser.describe(stored), *only]
    if row is None:
        raise Diagnostic(f"no command {word.strip()!r}", "", suggestion(word))
    facts = (
        ("syntax", syntax(row)),
        ("value", row.takes),
        ("access", ACCESS.get(row.access, "")),
        ("in program", script_parser.use(stored)),
        ("note", row.note),
        ("manual", f"PMX-2ED-SA {row.section}"),
    )
    lines = [f"{row.name}: {row.meaning}", *(f"  {label:<10} {fact}" for label, fact in facts if fact)]
    return [*lines, *(f"  {label:<10} {text}" for label, text in parts_of(row.name))]


def syntax(row: Command) -> str:
    forms = list(EXAMPLES.get(row.name, ()))
    for shape in () if forms else row.shapes:
        words = list(replace(row, shape=shape).words())
        forms.append(", ".join(words) if len(words) <= 4 else f"{words[0]} to {words[-1]}")
    if row.access == "W":
        forms = [f"{form}=VALUE" for form in forms]
    return ", ".join(forms) + ("; =VALUE sets it" if row.access == "RW" else "")


def complete(prefix: str, product: str = "") -> list[tuple[str, str]]:
    """Words that begin with the prefix, each with its meaning, in capitals: the controller reads no others."""
    typed = prefix.strip().upper()
    found: list[tuple[str, str]] = []
    for row in ROWS:
        words = list(row.words())
        if len(words) > 2 * SPELT_OUT and not (typed.startswith(row.name) and typed != row.name):
            words = [row.name]
        found += [(word, row.meaning) for word in words if word.startswith(typed)]
    return found


def typing(text: str) -> str:
    """The word at the end of a line that may be completed: only the first is a command."""
    word = text.strip()
    return word if word.isascii() and word.isalnum() else ""


def hint(text: str, product: str = "") -> str:
    """Syntax and meaning of the command at the head of a line; empty where there is none."""
    row = lookup(text) or lookup(head(text))
    if row is None:
        return suggestion(text) if text.strip() and lookup(text.upper()) is not None else ""
    capitals = "   (capitals only)" if text != text.upper() else ""
    place = f"; manual {row.section}" if row.section else ""
    return f"{syntax(row)}   {row.meaning}{place}{capitals}"


def suggestion(text: str) -> str:
    """Suggest words similar to an unknown one; empty where none is similar."""
    word = head(text)
    axis = word[-1:] if word[-1:] in ("X", "Y") else ""
    for name in (word, word.removesuffix(axis) if axis else word):
        if name in ELSEWHERE:
            return f"on the line it is {ELSEWHERE[name]}"
    words = list(dict.fromkeys([*COMMANDS, *WORDS]))
    near = difflib.get_close_matches(text.strip().upper().partition("=")[0], words, 4, 0.6)
    return f"perhaps {', '.join(near)}" if near else ""
