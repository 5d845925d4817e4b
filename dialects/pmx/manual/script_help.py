"""Help on the words of A-SCRIPT: its own meanings, and those of the ASCII commands that its registers equal."""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects.pmx.manual.script_words import AXES, INT32, PROGRAMS, SUBROUTINES, VARIABLES, WORDS, Word
from multidrop.dialects.pmx.manual.table import lookup

KEYWORDS: Mapping[str, tuple[str, str]] = {
    "PRG": (f"PRG 0 to PRG {PROGRAMS - 1}", "begins a program; END ends it"),
    "END": ("END", "ends a program"),
    "SUB": (f"SUB 0 to SUB {SUBROUTINES - 1}", "begins a subroutine; SUB 31 runs after an error of a program"),
    "ENDSUB": ("ENDSUB", "ends a subroutine: the program goes on after its GOSUB"),
    "GOSUB": ("GOSUB n", "calls the subroutine SUB n"),
    "IF": ("IF V1<10", "executes the lines up to ELSEIF, ELSE or ENDIF if two values compare so"),
    "ELSEIF": ("ELSEIF V1=5", "another condition of an IF, tried where those before it do not hold"),
    "ELSE": ("ELSE", "begins the lines of an IF for which no condition holds"),
    "ENDIF": ("ENDIF", "ends an IF"),
    "WHILE": ("WHILE DI1=0", "repeats the lines up to ENDWHILE as long as two values compare so"),
    "ENDWHILE": ("ENDWHILE", "ends a WHILE: its condition is tried again"),
    "DELAY": ("DELAY=250, DELAY=V1", "waits a number of milliseconds"),
    "X": ("X1000, XV1, X1000Y2000", "moves X, or both axes in a straight line; WAITX waits for its end"),
    "Y": ("Y1000, YV1", "moves Y; WAITY waits for its end"),
    **{f"WAIT{axis}": (f"WAIT{axis}", f"waits for the end of the motion of {axis}") for axis in AXES},
}
"""The words of programs alone: syntax and meaning."""


def meaning(word: str) -> str:
    """Return the meaning of a word in one line; empty for an unknown one."""
    if word in KEYWORDS:
        return KEYWORDS[word][1]
    found = WORDS.get(word)
    row = lookup(found.ascii) if found is not None else None
    return row.meaning if row is not None else ""


def describe(word: str) -> list[str]:
    """Describe a word, line by line; empty for an unknown one."""
    if word in KEYWORDS:
        syntax, what = KEYWORDS[word]
        return [f"{word}: {what}", f"  {'syntax':<10} {syntax}"]
    found = WORDS.get(word)
    row = lookup(found.ascii) if found is not None else None
    if found is None or row is None:
        return []
    facts = (
        ("value", row.takes),
        ("constants", _constants(found)),
        ("in programs", _use(found)),
        ("as command", found.ascii if found.ascii != word else ""),
        ("note", row.note),
        ("manual", f"PMX-2ED-SA {row.section}"),
    )
    return [f"{word}: {row.meaning}", *(f"  {label:<11} {fact}" for label, fact in facts if fact)]


def offered() -> list[tuple[str, Word | None]]:
    """Return every word, but the numbered variables; None for those of programs alone."""
    registers = [(name, word) for name, word in WORDS.items() if name not in VARIABLE_NAMES]
    return [*((name, None) for name in KEYWORDS), *registers]


VARIABLE_NAMES = frozenset(f"V{number}" for number in range(VARIABLES))


def _constants(word: Word) -> str:
    return f"{word.low} to {word.high}" if word.settable and word.high < INT32[1] else ""


def _use(word: Word) -> str:
    if word.command:
        return "executed"
    return " and ".join(use for use, can in (("read", word.readable), ("set", word.settable)) if can)
