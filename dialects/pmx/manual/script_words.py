"""The words of A-SCRIPT (manual 10.1; the joystick's are in 7.15): access, ASCII command, help, their places in a line.

A-SCRIPT and the ASCII commands are two languages: `HOMEX-` is `HX-` there, `ECLEARX` is `CLRX`. The axes are X and Y.
Z, U, EO3 and programs 2 and 3, which the manual mentions in places, belong to a bigger controller.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from multidrop.dialects.pmx.manual.table import lookup
from multidrop.dialects.program_editing import Word
from multidrop.dialects.program_files import Entry, Part

AXES = "XY"
PROGRAMS = 2
SUBROUTINES = 32
VARIABLES = 64
KEPT_VARIABLES = range(32, VARIABLES)
"""The variables that STORE keeps; a start of a program sets the others to 0."""
HANDLER = 31
"""The subroutine that runs after a failure."""
INT32 = (-(2**31), 2**31 - 1)

OPERATORS = ("+", "-", "*", "/", "%", ">>", "<<", "&", "|")
"""Operations between two values; `~` precedes one."""
COMPARISONS = (">", "<", "=", ">=", "<=", "!=")
BLOCKS = ("PRG", "END", "SUB", "ENDSUB", "IF", "ELSEIF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "GOSUB", "DELAY")


@dataclass(frozen=True)
class Register:
    """A register or a command: its ASCII command, access, and the constants it accepts."""

    ascii: str
    readable: bool = False
    settable: bool = False
    low: int = INT32[0]
    high: int = INT32[1]

    @property
    def command(self) -> bool:
        """Whether it is executed, neither read nor set."""
        return not (self.readable or self.settable)


def _words() -> dict[str, Register]:
    found: dict[str, Register] = {}
    for name in ("HSPD", "LSPD", "ACC", "DEC"):
        found[name] = Register(name, True, True, 1)
        for axis in AXES:  # 0: the global value applies to this axis
            found[name + axis] = Register(name + axis, True, True, 0)
    for axis in AXES:
        for name in ("E", "P"):
            found[name + axis] = Register(name + axis, True, True)
        for name in ("PS", "MST", "SLS"):
            found[name + axis] = Register(name + axis, True)
        found["SCV" + axis] = Register("SCV" + axis, True, True, 0, 1)
        found["SL" + axis] = Register("SL" + axis, False, True, 0, 1)
        found["SSPDM" + axis] = Register("SSPDM" + axis, False, True, 0, 9)
        found["SSPD" + axis] = Register("SSPD" + axis, False, True, 0)
    found |= {"DI": Register("DI", True), "TOC": Register("TOC", False, True, 0)}
    found |= {f"DI{n}": Register(f"DI{n}", True) for n in range(1, 9)}
    found |= {f"AI{n}": Register(f"AI{n}", True) for n in (1, 2)}
    for name, bits in (("DO", 8), ("EO", len(AXES))):
        found[name] = Register(name, True, True, 0, 2**bits - 1)
        found |= {f"{name}{n}": Register(f"{name}{n}", True, True, 0, 1) for n in range(1, bits + 1)}
    found |= {f"SR{n}": Register(f"SR{n}", False, True, 0, 3) for n in range(PROGRAMS)}
    found |= {f"V{n}": Register(f"V{n}", True, True) for n in range(VARIABLES)}
    found["JOYENA"] = Register("JOYENA", False, True, 0, 3)
    for index, axis in enumerate(AXES):
        for number, name in ((1, "JOYHS"), (3, "JOYDEL"), (5, "JOYTOL")):
            found[name + axis] = Register(f"JV{number + index}", False, True, 0, 5000 if name == "JOYTOL" else INT32[1])
        for number, name in enumerate(("JOYNO", "JOYNI", "JOYPI", "JOYPO"), 1):
            found[name + axis] = Register(f"JL{number + 4 * index}", False, True)
    found |= {name: Register(name) for name in ("ABORT", "ABS", "INC", "STOP", "STORE")}
    for axis in AXES:
        found |= {f"ABORT{axis}": Register(f"ABORT{axis}"), f"STOP{axis}": Register(f"STOP{axis}")}
        found[f"ECLEAR{axis}"] = Register(f"CLR{axis}")
        homing = {"HOME": "H", "HLHOME": "HL", "LHOME": "L", "ZHOME": "ZH", "ZOME": "Z", "JOG": "J"}
        for name, short in homing.items():
            found |= {f"{name}{axis}{way}": Register(f"{short}{axis}{way}") for way in "+-"}
    return found


WORDS: Mapping[str, Register] = _words()


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
    use = " and ".join(use for use, can in (("read", found.readable), ("set", found.settable)) if can) or "executed"
    facts = (
        ("value", row.takes),
        ("constants", f"{found.low} to {found.high}" if found.settable and found.high < INT32[1] else ""),
        ("in programs", use),
        ("as command", found.ascii if found.ascii != word else ""),
        ("note", row.note),
        ("manual", f"PMX-2ED-SA {row.section}"),
    )
    return [f"{word}: {row.meaning}", *(f"  {label:<11} {fact}" for label, fact in facts if fact)]


def offered() -> list[tuple[str, Register | None]]:
    """Return every word, but the numbered variables; None for those of programs alone."""
    registers = [(name, word) for name, word in WORDS.items() if name not in VARIABLE_NAMES]
    return [*((name, None) for name in KEYWORDS), *registers]


VARIABLE_NAMES = frozenset(f"V{number}" for number in range(VARIABLES))


_WORD = re.compile(r"[A-Za-z]\w*[+-]?", re.ASCII)
MOVE = re.compile(rf"([{AXES}](V?\d+)?)+", re.ASCII)
_PROGRAM = re.compile(r"PRG\s*(\d+)", re.ASCII)
_STARTS = re.compile(r"(HOME|HLHOME|LHOME|ZHOME|ZOME|JOG)[XY]|SR\d|JOYENA", re.ASCII)
_NUMBERED = ("PRG", "SUB", "GOSUB")


def parts(line: str) -> list[Part]:
    """Return the parts of a line that differ from plain text. Never fails."""
    code, semicolon, _ = line.partition(";")
    found = [
        Part(word.start, word.stop, kind)
        for word in words(line)
        if (kind := kind_of(word.text, not code[: word.start].strip()))
    ]
    return [*found, Part(len(code), len(line), "remark")] if semicolon else found


def words(line: str) -> list[Word]:
    """Return the words of a line; a sign at the end belongs to the words that have one."""
    found = []
    for match in _WORD.finditer(line.partition(";")[0]):
        text = match[0] if match[0] in WORDS else match[0].rstrip("+-")
        found.append(Word(match.start(), match.start() + len(text), text))
    return found


def kind_of(word: str, first: bool) -> str:
    """Return the kind of a word; `first`: it begins its line. Empty for an unknown word."""
    if first and (_STARTS.match(word) or MOVE.fullmatch(word)):
        return "starts"
    if word in BLOCKS:
        return "label" if word in _NUMBERED else "word"
    return "word" if word in WORDS or word[:4] == "WAIT" else ""


def entries(text: str) -> list[Entry]:
    """Return the numbers of the programs in a file, in order; lines without a PRG are program 0."""
    lines = [line.partition(";")[0].strip() for line in re.split(r"\r\n|\n|\r", text)]
    found = [
        Entry(match[1], number, f"SR{match[1]}=1")
        for number, line in enumerate(lines, 1)
        if (match := _PROGRAM.fullmatch(line))
    ]
    first = next((number for number, line in enumerate(lines, 1) if line), 0)
    return found or ([Entry("0", first, "SR0=1")] if first else [])
