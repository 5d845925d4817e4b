"""The lines of a stored TMCL program: a table of their words, one line as a command, a command as a line.

A line has seven bytes, as a command of the direct mode: number, type, motor or bank, value. The words of the direct
mode are valid in a program; the words below are for programs alone. The program of a module is a row of such lines
from address 0, and a jump names an address. A number of 128 or more is a control command, which no program holds. A
line that no word gives (`64 1, 0, 5`) is written by its number. (TMCM-1290 TMCL firmware manual, "TMCL command
overview", "TMCL control commands"; numbers as in the maker's library.)
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from multidrop.base.files import rows
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.commands import BYTE, MOTOR, TYPE, VALUE, Command, TmclCall
from multidrop.families.tmcl.manual.parameters import INT32, STARTING

MEMORY = 2048
"""Lines that a module holds; some hold fewer."""
STACK = 8
"""The deepest nesting of subroutines; a call beyond it is ignored."""
EMPTY = 0
"""The number of a line that was never stored; it ends a program."""
CONTROL = 128
"""The first number of the control commands."""


class ProgramWord(IntEnum):
    """The number of a line that only a program has."""

    SIO = 14
    GIO = 15
    CALC = 19
    COMP = 20
    JC = 21
    JA = 22
    CSUB = 23
    RSUB = 24
    EI = 25
    DI = 26
    WAIT = 27
    STOP = 28
    SCO = 30
    GCO = 31
    CCO = 32
    CALCX = 33
    AAP = 34
    AGP = 35
    CLE = 36
    VECT = 37
    RETI = 38
    ACO = 39
    CALCVV = 40
    CALCVA = 41
    CALCAV = 42
    CALCVX = 43
    CALCXV = 44
    CALCV = 45
    MVPA = 46
    RST = 48
    DJNZ = 49
    ROLA = 50
    RORA = 51
    SIV = 55
    GIV = 56
    AIV = 57
    CALL = 80


class Calculation(IntEnum):
    """The types of the words that calculate."""

    ADD = 0
    SUB = 1
    MUL = 2
    DIV = 3
    MOD = 4
    AND = 5
    OR = 6
    XOR = 7
    NOT = 8
    LOAD = 9
    SWAP = 10
    COMP = 11


class JumpCondition(IntEnum):
    """The types of JC and CALL: the last value, the last comparison, an error flag."""

    ZE = 0
    NZ = 1
    EQ = 2
    NE = 3
    GT = 4
    GE = 5
    LT = 6
    LE = 7
    ETO = 8
    EAL = 9
    EDV = 10
    EPO = 11
    ESD = 12


class Wait(IntEnum):
    """The types of WAIT."""

    TICKS = 0
    POS = 1
    REFSW = 2
    LIMSW = 3
    RFS = 4


class Flag(IntEnum):
    """The types of CLE."""

    ALL = 0
    ETO = 1
    EAL = 2
    EDV = 3
    EPO = 4
    ESD = 5


@dataclass(frozen=True)
class InstructionField:
    """One field of a line: its name, the byte or value that it becomes, what is valid. `label`: it is an address."""

    name: str
    place: str
    valid: range
    words: Mapping[str, int] = field(default_factory=dict)
    label: bool = False

    @property
    def title(self) -> str:
        return "|".join(self.words) if self.words else self.name

    @property
    def hint(self) -> str:
        """What is valid, for a person."""
        if self.words:
            return f"valid: {', '.join(self.words)}"
        return f"valid: {'a label, or ' * self.label}{self.valid[0]} to {self.valid[-1]}"

    def read(self, text: str) -> int | None:
        """The number that a text gives; None where it gives none."""
        if (known := self.words.get(text.upper())) is not None:
            return known
        number = number_of(text)
        return number if number is not None and number in (self.words.values() or self.valid) else None

    def spelled(self, number: int) -> str | None:
        """The text for a number; None where no text gives it."""
        if self.words:
            return next((word for word, value in self.words.items() if value == number), None)
        return str(number) if number in self.valid else None


@dataclass(frozen=True)
class InstructionRow:
    """One word. `moves`: it can start motion."""

    number: int
    fields: tuple[InstructionField, ...]
    title: str
    word: str
    moves: bool = False

    @property
    def syntax(self) -> str:
        return f"{self.word} {', '.join(each.title for each in self.fields)}".strip()


def _words(of: type[IntEnum], *without: IntEnum) -> Mapping[str, int]:
    return {member.name: member.value for member in of if member not in without}


_NUMBER = re.compile(r"[+-]?(?:\d{1,11}|0[xX][0-9A-Fa-f]{1,8})", re.ASCII)
_FIELDS: Mapping[str, InstructionField] = {
    **{name: InstructionField(name, TYPE, BYTE) for name in ("parameter", "port", "interrupt")},
    **{name: InstructionField(name, MOTOR, BYTE) for name in ("motor", "bank", "variable")},
    "counter": InstructionField("variable", TYPE, BYTE),
    "other": InstructionField("variable", VALUE, BYTE),
    "value": InstructionField("value", VALUE, INT32),
    "ticks": InstructionField("ticks", VALUE, range(-1, INT32.stop)),
    "coordinate": InstructionField("coordinate", TYPE, range(21)),
    "address": InstructionField("label", VALUE, range(MEMORY), label=True),
    "condition": InstructionField("condition", TYPE, BYTE, _words(JumpCondition)),
    "event": InstructionField("condition", TYPE, BYTE, _words(Wait)),
    "flag": InstructionField("flag", TYPE, BYTE, _words(Flag)),
    "move": InstructionField("move", TYPE, BYTE, commands.MOVES),
    "all": InstructionField("operation", TYPE, BYTE, _words(Calculation)),
    "no_swap": InstructionField("operation", TYPE, BYTE, _words(Calculation, Calculation.SWAP)),
    "with_x": InstructionField("operation", TYPE, BYTE, _words(Calculation, Calculation.COMP)),
    "with_value": InstructionField("operation", TYPE, BYTE, _words(Calculation, Calculation.SWAP, Calculation.COMP)),
}
"""The fields that `program.csv` names."""
_STARTS = frozenset({ProgramWord.MVPA, ProgramWord.ROLA, ProgramWord.RORA, ProgramWord.AAP})


def _direct(row: commands.CommandRow) -> InstructionRow:
    fields = (
        InstructionField(
            name, MOTOR if name == commands.BANK else name, commands.RANGES[name], row.types if name == TYPE else {}
        )
        for name in row.fields
    )
    return InstructionRow(int(row.command), tuple(fields), row.title, row.word, row.moves)


ROWS: Mapping[int, InstructionRow] = {
    int(number): InstructionRow(
        int(number),
        tuple(_FIELDS[each] for each in row["fields"].split()),
        row["title"],
        number.name,
        number in _STARTS,
    )
    for row in rows(__file__, "program.csv")
    for number in (ProgramWord[row["word"]],)
} | {int(row.command): _direct(row) for row in commands.ROWS}
"""Every word by its number."""
WORDS: Mapping[str, InstructionRow] = {row.word: row for row in ROWS.values()}
JUMPS = frozenset(number for number, row in ROWS.items() if any(each.label for each in row.fields))
"""The lines whose value is an address."""
ENDS = frozenset({EMPTY, ProgramWord.JA, ProgramWord.RSUB, ProgramWord.STOP, ProgramWord.RETI, ProgramWord.RST})
"""The lines after which the next one is not executed."""
BY_NUMBER = (InstructionField("type", TYPE, BYTE), InstructionField("motor", MOTOR, BYTE), _FIELDS["value"])
WEARS = frozenset({Command.STAP, Command.STGP})
"""The lines that write to the EEPROM."""


def number_of(text: str) -> int | None:
    """A decimal number, or a hexadecimal one (`0x1F`); None for any other text."""
    return int(text, 16 if "x" in text.lower() else 10) if _NUMBER.fullmatch(text) else None


def unknown(word: str) -> tuple[str, str]:
    """What is wrong with a word that no row has, and what is valid."""
    near = difflib.get_close_matches(word.upper(), list(WORDS), 1, 0.6)
    return f"no command {word!r}", f"is {near[0]} meant?" if near else "help and completion list the words"


def fields_of(word: str) -> tuple[int, tuple[InstructionField, ...]] | None:
    """The number of a word, or of a line by its number, and its fields; None: there is no such word."""
    row = WORDS.get(word.upper())
    if row is not None:
        return row.number, row.fields
    return (int(word), BY_NUMBER) if word.isascii() and word.isdigit() and int(word) < CONTROL else None


def call_with(number: int, fields: tuple[InstructionField, ...], values: tuple[int, ...]) -> TmclCall:
    placed = {each.place: value for each, value in zip(fields, values, strict=True)}
    return TmclCall(number, placed.get(TYPE, 0), placed.get(MOTOR, 0), placed.get(VALUE, 0))


def spelled(call: TmclCall, label: str = "") -> str:
    """A line as a person writes it; `label`: in place of its address. By its number where no word gives it."""
    row, placed = ROWS.get(call.command), {TYPE: call.type, MOTOR: call.motor, VALUE: call.value}
    if row is not None:
        given = [(each, placed.pop(each.place)) for each in row.fields]
        texts = [label if label and each.label else each.spelled(number) for each, number in given]
        known = [text for text in texts if text is not None]
        if len(known) == len(texts) and not any(placed.values()):
            return f"{row.word} {', '.join(known)}".strip()
    return f"{call.command} {call.type}, {call.motor}, {call.value}"


def moves(call: TmclCall) -> bool:
    """Whether a line of a program can start motion."""
    if call.command == ProgramWord.AAP:
        return call.type in STARTING
    row = ROWS.get(call.command)
    return call.moves if row is None or row.word in commands.WORDS else row.moves
