"""TMCL's direct mode: commands, how a person writes each, the status byte of a reply; axis and global parameters.

A line in TMCL's own notation, `MVP ABS, 0, 51200`, is a word, then its fields with commas between them. A command
without a word is called by its number, then type, motor and value: `138 0, 0, 1`. Numbers are decimal. Words and types
may be written in small letters. (TMCL firmware manuals, "TMCL commands", "Reply format".)
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

from multidrop.base.files import rows
from multidrop.base.text import counted
from multidrop.families.tmcl.manual.parameters import CLEARED_BY_READING, INT32, STARTING, TARGETS


class Command(IntEnum):
    """The number of a command in byte 1 of a request."""

    ROR = 1
    ROL = 2
    MST = 3
    MVP = 4
    SAP = 5
    GAP = 6
    STAP = 7
    RSAP = 8
    SGP = 9
    GGP = 10
    STGP = 11
    RSGP = 12
    RFS = 13
    SIO = 14
    GIO = 15
    STOP_PROGRAM = 128
    RUN = 129
    STEP = 130
    RESET_PROGRAM = 131
    DOWNLOAD = 132
    END_DOWNLOAD = 133
    READ_PROGRAM = 134
    PROGRAM_STATUS = 135
    VERSION = 136
    FACTORY = 137
    NOTIFY = 138


class MoveType(IntEnum):
    """The types of MVP."""

    ABS = 0
    REL = 1
    COORD = 2


class SearchAction(IntEnum):
    """The types of RFS."""

    START = 0
    STOP = 1
    STATUS = 2


class ProgramStatus(IntEnum):
    """What a program does: the value of command 135, and of global parameter 128."""

    HALTED = 0
    RUNS = 1
    STEPS = 2
    RESET = 3
    STORES = 4


class Version(IntEnum):
    """The types of command 136."""

    TEXT = 0
    BINARY = 1


FACTORY_CODE = 1234
"""The value that command 137 needs."""
TYPE, MOTOR, BANK, VALUE = "type", "motor", "bank", "value"
BLANKS = " \t"
MOTORS = range(256)


@dataclass(frozen=True)
class CommandRow:
    """One word. `prints`: its reply's value is what was asked for. `moves`: it can start motion."""

    command: Command
    fields: tuple[str, ...]
    title: str
    types: Mapping[str, int]
    prints: bool
    moves: bool

    @property
    def word(self) -> str:
        return self.command.name

    @property
    def syntax(self) -> str:
        names = ["|".join(self.types) if name == TYPE and self.types else name for name in self.fields]
        return f"{self.word} {', '.join(names)}".strip()


MOVES: Mapping[str, int] = {move.name: move.value for move in MoveType}
SEARCHES: Mapping[str, int] = {search.name: search.value for search in SearchAction}
_TYPES = {"MVP": MOVES, "RFS": SEARCHES}
ROWS = tuple(
    CommandRow(
        Command[row["word"]],
        tuple(row["fields"].split()),
        row["title"],
        types=_TYPES.get(row["word"], {}),
        prints=bool(row["prints"]),
        moves=bool(row["moves"]),
    )
    for row in rows(__file__, "direct.csv")
)
WORDS: Mapping[str, CommandRow] = {row.word: row for row in ROWS}


@dataclass(frozen=True)
class TmclCall:
    """One command with its numbers, as bytes 1 to 7 of a request carry them."""

    command: int
    type: int = 0
    motor: int = 0
    value: int = 0

    def __str__(self) -> str:
        row = self.row
        if row is None:
            return f"{self.command} {self.type}, {self.motor}, {self.value}"
        names = {number: name for name, number in row.types.items()}
        given = {
            TYPE: names.get(self.type, str(self.type)),
            MOTOR: str(self.motor),
            BANK: str(self.motor),
            VALUE: str(self.value),
        }
        return f"{row.word} {', '.join(given[name] for name in row.fields)}"

    @property
    def row(self) -> CommandRow | None:
        """The word for it; None for a command that is called by its number only."""
        return next((row for row in ROWS if row.command == self.command), None)

    @property
    def prints(self) -> bool:
        """Whether the value of its reply is what was asked for."""
        if self.command == Command.RFS:
            return self.type == SearchAction.STATUS
        asks = (Command.VERSION, Command.PROGRAM_STATUS, Command.READ_PROGRAM)
        return self.command in asks or (self.row is not None and self.row.prints)

    @property
    def changed_by_reading(self) -> bool:
        """Whether it reads the error flags, which that clears: never sent but for a person, and never twice."""
        return self.command == Command.GAP and self.type in CLEARED_BY_READING

    @property
    def moves(self) -> bool:
        """Whether it can start motion; a command without a word may."""
        if self.command in NEVER_MOVE:
            return False
        if self.command in (Command.SAP, Command.RSAP):
            return self.type in STARTING
        if self.command == Command.RFS:
            return self.type == SearchAction.START
        return self.row is None or self.row.moves

    @property
    def lasts(self) -> bool:
        """Whether what it starts may move the motor again, once that was at rest."""
        return self.command in (Command.SAP, Command.RSAP) and self.type not in TARGETS


NEVER_MOVE = frozenset(
    {
        Command.STOP_PROGRAM,
        Command.RESET_PROGRAM,
        Command.DOWNLOAD,
        Command.END_DOWNLOAD,
        Command.READ_PROGRAM,
        Command.PROGRAM_STATUS,
        Command.VERSION,
        Command.NOTIFY,
    }
)
"""Commands without a word that start neither a motion nor a program; 129 and 130 do."""


BYTE = range(256)
RANGES = {TYPE: BYTE, MOTOR: MOTORS, BANK: BYTE, VALUE: INT32}
NUMBER = re.compile(r"[+-]?\d{1,11}", re.ASCII)
BY_NUMBER = (TYPE, MOTOR, VALUE)
"""Fields after the number of a command."""


class TmclLineError(ValueError):
    """An invalid TMCL line; the text says why and what is valid."""


def parse(text: str) -> TmclCall:
    """The command in a line. Raises TmclLineError."""
    read_call = _read(text)
    if isinstance(read_call, TmclLineError):
        raise TmclLineError(*read_call.args)  # one that is kept would gather tracebacks
    return read_call


def parsed(text: str) -> TmclCall | None:
    """The command in a line; None for an invalid line."""
    read_call = _read(text)
    return None if isinstance(read_call, TmclLineError) else read_call


@lru_cache(maxsize=4096)
def _read(text: str) -> TmclCall | TmclLineError:
    try:
        return _parsed(text)
    except TmclLineError as error:
        return error


def _parsed(text: str) -> TmclCall:
    word, *rest = re.split(r"[ \t]+", text.strip(BLANKS), maxsplit=1)
    fields = [field.strip(BLANKS) for field in "".join(rest).split(",")] if rest else []
    if word.isascii() and word.isdigit():
        if int(word) not in BYTE:
            raise TmclLineError(f"no command {word}; valid: 0 to 255")
        if len(fields) != len(BY_NUMBER):
            raise TmclLineError(f"a command by its number takes 3 fields: {word} {', '.join(BY_NUMBER)}")
        return TmclCall(int(word), *(_number(name, field) for name, field in zip(BY_NUMBER, fields, strict=True)))
    row = WORDS.get(word.upper())
    if row is None:
        near = difflib.get_close_matches(word.upper(), list(WORDS), 3, 0.6)
        hint = f"did you mean {' or '.join(near)}?" if near else f"valid: {', '.join(WORDS)}"
        raise TmclLineError(f"no command {word!r}; {hint}")
    if len(fields) != len(row.fields):
        raise TmclLineError(f"{row.word} takes {counted(len(row.fields), 'field')}: {row.syntax}")
    values = {}
    for name, field in zip(row.fields, fields, strict=True):
        known = row.types.get(field.upper()) if name == TYPE else None
        if known is None and name == TYPE and row.types and not NUMBER.fullmatch(field):
            raise TmclLineError(f"{row.word} has no type {field!r}; valid: {', '.join(row.types)}")
        values[name] = _number(name, field) if known is None else known
    return TmclCall(row.command, values.get(TYPE, 0), values.get(MOTOR, values.get(BANK, 0)), values.get(VALUE, 0))


def _number(name: str, field: str) -> int:
    valid = RANGES[name]
    if not NUMBER.fullmatch(field) or int(field) not in valid:
        raise TmclLineError(f"{name} cannot be {field!r}; valid: {valid[0]} to {valid[-1]}")
    return int(field)


class Status(IntEnum):
    """Byte 2 of a reply. Below 100 the command was refused and changed nothing; 101 is as good as a refusal."""

    WRONG_CHECKSUM = 1
    INVALID_COMMAND = 2
    WRONG_TYPE = 3
    INVALID_VALUE = 4
    EEPROM_LOCKED = 5
    NOT_AVAILABLE = 6
    MAXIMUM_EXCEEDED = 9
    DONE = 100
    STORED = 101
    TARGET_REACHED = 128


def accepted(status: int) -> bool:
    return status >= Status.DONE and status != Status.STORED


REFUSALS: Mapping[int, tuple[str, str]] = {
    int(row["status"]): (row["meaning"], row["remedy"]) for row in rows(__file__, "refusals.csv")
}
"""Meaning of a refusing status and what to do, for a person."""


class AxisParameter(IntEnum):
    """The number of an axis parameter."""

    TARGET_POSITION = 0
    ACTUAL_POSITION = 1
    TARGET_VELOCITY = 2
    ACTUAL_VELOCITY = 3
    MAXIMUM_VELOCITY = 4
    MAXIMUM_ACCELERATION = 5
    RUN_CURRENT = 6
    STANDBY_CURRENT = 7
    POSITION_REACHED = 8
    HOME_SWITCH = 9
    RIGHT_SWITCH = 10
    LEFT_SWITCH = 11
    RIGHT_LIMIT_OFF = 12
    LEFT_LIMIT_OFF = 13
    RELATIVE_FROM = 127
    MICROSTEPS = 140
    RAMP_DIVISOR = 153
    PULSE_DIVISOR = 154
    STALL_VELOCITY = 181
    SEARCH_MODE = 193
    SEARCH_SPEED = 194
    SWITCH_SPEED = 195
    SWITCH_DISTANCE = 196
    SEARCH_POSITION = 197
    FREEWHEELING = 204
    LOAD = 206
    ERROR_FLAGS = 207
    DRIVER_FLAGS = 208
    UNIT_MODE = 255


class Global(IntEnum):
    """The number of a global parameter in bank 0."""

    BAUD = 65
    ADDRESS = 66
    TEXT_MODE = 67
    HEARTBEAT = 68
    PAUSE = 75
    HOST_ADDRESS = 76
    AUTOSTART = 77
    COORDINATES = 84
    PROGRAM_STATUS = 128
    DOWNLOAD_MODE = 129
    PROGRAM_COUNTER = 130
    TICK_TIMER = 132
    """Milliseconds since power-up, of 32 bits; a client can set it."""
    SUPPRESS_REPLY = 255


_NAMES: Mapping[str, AxisParameter | Global] = {
    member.name.replace("_", ""): member for member in (*Global, *AxisParameter)
}
_PARAMETER = re.compile(r"(?:(AP|G)?(0|[1-9]\d{0,2})|([A-Z]\w*?[A-Z]))(?:[_/](\d))?", re.ASCII)


def parameter(name: str) -> TmclCall | None:
    """The command that reads a parameter: `4`, `AP4` or `maximum_velocity`; `G75` or `pause` is a global one.

    `4_1` or `AP4/1` is that of motor 1. None: no parameter has that name.
    """
    match = _PARAMETER.fullmatch(name.strip().upper())
    if match is None:
        return None
    named = _NAMES.get(match[3].replace("_", "")) if match[3] else None
    number = named if named is not None else int(match[2] or len(BYTE))
    of_module = isinstance(named, Global) or match[1] == "G"
    if number not in BYTE or (of_module and match[4]):
        return None
    return TmclCall(Command.GGP if of_module else Command.GAP, int(number), int(match[4] or 0))


def setting_name(name: str) -> str:
    """The name of a setting as files have it, `4`, `4_1` or `G75`, however a person spells it."""
    call = parameter(name)
    if call is None:
        return name.upper()
    return f"{'G' if call.command == Command.GGP else ''}{call.type}{f'_{call.motor}' if call.motor else ''}"


def asked(name: str) -> str | None:
    """The line that prints a parameter; None for none, and for one that reading changes."""
    call = parameter(name)
    return str(call) if call is not None and not call.changed_by_reading else None


def assigned(name: str, value: str) -> str | None:
    call = parameter(name)
    word = "SGP" if call is not None and call.command == Command.GGP else "SAP"
    return f"{word} {call.type}, {call.motor}, {value}" if call is not None else None
