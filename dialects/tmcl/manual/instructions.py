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

from multidrop.dialects.tmcl.manual import commands
from multidrop.dialects.tmcl.manual.commands import BYTE, INT32, MOTOR, STARTING_PARAMETERS, TYPE, VALUE, Call, Command

MEMORY = 2048
"""Lines that a module holds; some hold fewer."""
STACK = 8
"""The deepest nesting of subroutines; a call beyond it is ignored."""
EMPTY = 0
"""The number of a line that was never stored; it ends a program."""
CONTROL = 128
"""The first number of the control commands."""


class Word(IntEnum):
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


class Operation(IntEnum):
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


class Condition(IntEnum):
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
class Field:
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
class Row:
    """One word. `moves`: it can start motion."""

    number: int
    fields: tuple[Field, ...]
    title: str
    word: str
    moves: bool = False

    @property
    def syntax(self) -> str:
        return f"{self.word} {', '.join(each.title for each in self.fields)}".strip()


def _words(of: type[IntEnum], *without: IntEnum) -> Mapping[str, int]:
    return {each.name: each.value for each in of if each not in without}


_NUMBER = re.compile(r"[+-]?(?:\d{1,11}|0[xX][0-9A-Fa-f]{1,8})", re.ASCII)
_MOTOR, _BANK = Field("motor", MOTOR, BYTE), Field("bank", MOTOR, BYTE)
_PARAMETER, _PORT, _VALUE = Field("parameter", TYPE, BYTE), Field("port", TYPE, BYTE), Field("value", VALUE, INT32)
_COORDINATE, _INTERRUPT = Field("coordinate", TYPE, range(21)), Field("interrupt", TYPE, BYTE)
_ADDRESS = Field("label", VALUE, range(MEMORY), label=True)
_VARIABLE, _OTHER = Field("variable", MOTOR, BYTE), Field("variable", VALUE, BYTE)
_COUNTER = Field("variable", TYPE, BYTE)
_CONDITION = Field("condition", TYPE, BYTE, _words(Condition))
_ALL = Field("operation", TYPE, BYTE, _words(Operation))
_NO_SWAP = Field("operation", TYPE, BYTE, _words(Operation, Operation.SWAP))
_WITH_X = Field("operation", TYPE, BYTE, _words(Operation, Operation.COMP))
_WITH_VALUE = Field("operation", TYPE, BYTE, _words(Operation, Operation.SWAP, Operation.COMP))
_MOVE = Field("move", TYPE, BYTE, commands.MOVES)

_TABLE: tuple[tuple[Word, tuple[Field, ...], str], ...] = (
    (Word.SIO, (_PORT, _BANK, _VALUE), "Set an output; port 255: all of them, value -1: as the accumulator says"),
    (Word.GIO, (_PORT, _BANK), "Read an input or an output into the accumulator"),
    (Word.CALC, (_WITH_VALUE, _VALUE), "Calculate with the accumulator and a value"),
    (Word.COMP, (_VALUE,), "Compare the accumulator with a value"),
    (Word.JC, (_CONDITION, _ADDRESS), "Jump where a condition is met"),
    (Word.JA, (_ADDRESS,), "Jump"),
    (Word.CSUB, (_ADDRESS,), f"Call a subroutine; {STACK} deep at most"),
    (Word.RSUB, (), "Return from a subroutine"),
    (Word.EI, (_INTERRUPT,), "Enable an interrupt; 255: interrupts as a whole"),
    (Word.DI, (_INTERRUPT,), "Disable an interrupt; 255: interrupts as a whole"),
    (
        Word.WAIT,
        (Field("condition", TYPE, BYTE, _words(Wait)), _MOTOR, Field("ticks", VALUE, range(-1, INT32.stop))),
        "Wait for a time or an event: ticks of 10 ms, 0: without an end, -1: as the accumulator says",
    ),
    (Word.STOP, (), "End the program"),
    (Word.SCO, (_COORDINATE, _MOTOR, _VALUE), "Set a coordinate"),
    (Word.GCO, (_COORDINATE, _MOTOR), "Read a coordinate into the accumulator"),
    (Word.CCO, (_COORDINATE, _MOTOR), "Store the actual position as a coordinate"),
    (Word.CALCX, (_WITH_X,), "Calculate with the accumulator and the X register; LOAD copies to X"),
    (Word.AAP, (_PARAMETER, _MOTOR), "Set an axis parameter to the accumulator; 0 and 2 start a motion"),
    (Word.AGP, (_PARAMETER, _BANK), "Set a global parameter to the accumulator"),
    (Word.CLE, (Field("flag", TYPE, BYTE, _words(Flag)),), "Clear an error flag"),
    (Word.VECT, (_INTERRUPT, _ADDRESS), "Name the routine of an interrupt"),
    (Word.RETI, (), "Return from an interrupt"),
    (Word.ACO, (_COORDINATE, _MOTOR), "Set a coordinate to the accumulator"),
    (Word.CALCVV, (_ALL, _VARIABLE, _OTHER), "Calculate with two user variables; the first takes the result"),
    (Word.CALCVA, (_ALL, _VARIABLE), "Calculate with a user variable and the accumulator; the variable takes it"),
    (Word.CALCAV, (_ALL, _VARIABLE), "Calculate with the accumulator and a user variable; the accumulator takes it"),
    (Word.CALCVX, (_ALL, _VARIABLE), "Calculate with a user variable and the X register; the variable takes it"),
    (Word.CALCXV, (_ALL, _VARIABLE), "Calculate with the X register and a user variable; X takes it"),
    (Word.CALCV, (_NO_SWAP, _VARIABLE, _VALUE), "Calculate with a user variable and a value"),
    (Word.MVPA, (_MOVE, _MOTOR), "Move to the position, or by the distance, in the accumulator"),
    (Word.RST, (_ADDRESS,), "Reset the program, and begin again at a label"),
    (Word.DJNZ, (_COUNTER, _ADDRESS), "Count a user variable down, and jump unless it is 0"),
    (Word.ROLA, (_MOTOR,), "Rotate left at the velocity in the accumulator"),
    (Word.RORA, (_MOTOR,), "Rotate right at the velocity in the accumulator"),
    (Word.SIV, (_VALUE,), "Set the user variable whose number is in X"),
    (Word.GIV, (), "Read the user variable whose number is in X into the accumulator"),
    (Word.AIV, (), "Set the user variable whose number is in X to the accumulator"),
    (Word.CALL, (_CONDITION, _ADDRESS), f"Call a subroutine where a condition is met; {STACK} deep at most"),
)
_STARTS = frozenset({Word.MVPA, Word.ROLA, Word.RORA, Word.AAP})


def _direct(row: commands.Row) -> Row:
    """The row of a word of the direct mode."""
    fields = (
        Field(name, MOTOR if name == commands.BANK else name, commands.RANGES[name], row.types if name == TYPE else {})
        for name in row.fields
    )
    return Row(int(row.command), tuple(fields), row.title, row.word, row.moves)


ROWS: Mapping[int, Row] = {
    int(number): Row(int(number), fields, title, number.name, number in _STARTS) for number, fields, title in _TABLE
} | {int(row.command): _direct(row) for row in commands.ROWS}
"""Every word by its number."""
WORDS: Mapping[str, Row] = {row.word: row for row in ROWS.values()}
JUMPS = frozenset(number for number, row in ROWS.items() if any(each.label for each in row.fields))
"""The lines whose value is an address."""
ENDS = frozenset({EMPTY, Word.JA, Word.RSUB, Word.STOP, Word.RETI, Word.RST})
"""The lines after which the next one is not executed."""
BY_NUMBER = (Field("type", TYPE, BYTE), Field("motor", MOTOR, BYTE), _VALUE)
WEARS = frozenset({Command.STAP, Command.STGP})
"""The lines that write to the EEPROM."""


def number_of(text: str) -> int | None:
    """A decimal number, or a hexadecimal one (`0x1F`); None for any other text."""
    return int(text, 16 if "x" in text.lower() else 10) if _NUMBER.fullmatch(text) else None


def unknown(word: str) -> tuple[str, str]:
    """What is wrong with a word that no row has, and what is valid."""
    near = difflib.get_close_matches(word.upper(), list(WORDS), 1, 0.6)
    return f"no command {word!r}", f"is {near[0]} meant?" if near else "help and completion list the words"


def fields_of(word: str) -> tuple[int, tuple[Field, ...]] | None:
    """The number of a word, or of a line by its number, and its fields; None: there is no such word."""
    row = WORDS.get(word.upper())
    if row is not None:
        return row.number, row.fields
    return (int(word), BY_NUMBER) if word.isascii() and word.isdigit() and int(word) < CONTROL else None


def call_with(number: int, fields: tuple[Field, ...], values: tuple[int, ...]) -> Call:
    placed = {each.place: value for each, value in zip(fields, values, strict=True)}
    return Call(number, placed.get(TYPE, 0), placed.get(MOTOR, 0), placed.get(VALUE, 0))


def spelled(call: Call, label: str = "") -> str:
    """A line as a person writes it; `label`: in place of its address. By its number where no word gives it."""
    row, placed = ROWS.get(call.command), {TYPE: call.type, MOTOR: call.motor, VALUE: call.value}
    if row is not None:
        given = [(each, placed.pop(each.place)) for each in row.fields]
        texts = [label if label and each.label else each.spelled(number) for each, number in given]
        known = [text for text in texts if text is not None]
        if len(known) == len(texts) and not any(placed.values()):
            return f"{row.word} {', '.join(known)}".strip()
    return f"{call.command} {call.type}, {call.motor}, {call.value}"


def moves(call: Call) -> bool:
    """Whether a line of a program can start motion."""
    if call.command == Word.AAP:
        return call.type in STARTING_PARAMETERS
    row = ROWS.get(call.command)
    return call.moves if row is None or row.word in commands.WORDS else row.moves
