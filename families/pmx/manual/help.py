"""Help on a command: description, completion, and a hint while a line is typed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.dialects.language import Language, labelled, perhaps, remedied
from multidrop.families.pmx.manual import script_parser
from multidrop.families.pmx.manual.table import (
    COMMANDS,
    ELSEWHERE,
    ROWS,
    WORDS,
    PmxCommand,
    head,
    lookup,
    meaning,
    parts_of,
)

ACCESS = {"R": "read only", "W": "write only", "RW": "read and write"}
EXAMPLES = {"X": ["X1000", "X1000Y2000"], "Y": ["Y1000"], "I": ["I1000:-1000"], "T": ["TX1000", "TY1000"]}
SPELT_OUT = 8
"""Number of numbered words up to which completion offers each."""


class PmxLanguage(Language):
    """Help on the words of a controller; there is one product. Only the first word of a line is a command."""

    def names(self) -> list[str]:
        return list(COMMANDS)

    def knows(self, word: str) -> bool:
        """Return whether a command, a word of programs, or a refusal (`?Moving`) has help."""
        return lookup(word) is not None or meaning(word) is not None or script_parser.find(word) != ""

    def describe(self, word: str, product: str = "") -> list[str]:
        """Describe a command, a word of programs or a refusal, line by line. Raises Diagnostic with similar words."""
        refusal = meaning(word)
        if refusal is not None:
            return remedied(f"{word}: {refusal[0]}", refusal[1])
        row = lookup(word)
        stored = script_parser.find(word)
        if row is None and stored:
            only = [("use", "in programs only")] * (stored in script_parser.KEYWORDS)
            return [*script_parser.describe(stored), *labelled(only)]
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
        return [f"{row.name}: {row.meaning}", *labelled((*facts, *parts_of(row.name)))]

    def describe_error(self, code: int, product: str = "") -> list[str]:
        """Raise Diagnostic: a controller has no error numbers."""
        raise Diagnostic(f"no error {code} on a PMX-2ED", "", 'it replies in words: /help "?Moving" explains one')

    def offered(self, product: str, typed: str) -> Iterable[tuple[str, str]]:
        """Return the words: the controller reads only capitals. One with many numbers is spelt out once it is begun."""
        for row in ROWS:
            words = list(row.words())
            if len(words) > 2 * SPELT_OUT and not (typed.startswith(row.name) and typed != row.name):
                words = [row.name]
            yield from ((word, row.meaning) for word in words)

    def hint(self, text: str, product: str = "") -> str:
        """Return syntax and meaning of the command at the head of a line; empty where there is none."""
        row = lookup(text) or lookup(head(text))
        if row is None:
            return suggestion(text) if text.strip() and lookup(text.upper()) is not None else ""
        capitals = "   (capitals only)" if text != text.upper() else ""
        place = f"; manual {row.section}" if row.section else ""
        return f"{syntax(row)}   {row.meaning}{place}{capitals}"


LANGUAGE = PmxLanguage()


def syntax(row: PmxCommand) -> str:
    forms = list(EXAMPLES.get(row.name, ()))
    for shape in () if forms else row.shapes:
        words = list(replace(row, shape=shape).words())
        forms.append(", ".join(words) if len(words) <= 4 else f"{words[0]} to {words[-1]}")
    if row.access == "W":
        forms = [f"{form}=VALUE" for form in forms]
    return ", ".join(forms) + ("; =VALUE sets it" if row.access == "RW" else "")


def suggestion(text: str) -> str:
    """Suggest words similar to an unknown one; empty where none is similar."""
    word = head(text)
    axis = word[-1:] if word[-1:] in ("X", "Y") else ""
    for name in (word, word.removesuffix(axis) if axis else word):
        if name in ELSEWHERE:
            return f"on the line it is {ELSEWHERE[name]}"
    words = list(dict.fromkeys([*COMMANDS, *WORDS]))
    return perhaps(difflib.get_close_matches(text.strip().upper().partition("=")[0], words, 4, 0.6))
