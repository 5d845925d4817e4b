"""The commands of TMCL's direct mode, and how a person writes each (TMCL firmware manuals, "TMCL commands").

`fields` are written after the word, in this order. A word's type is fixed unless `type` is one of its fields;
`types` are the names that a type may be written with.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from types import MappingProxyType


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
    STOP_PROGRAM = 128
    RUN = 129
    STEP = 130
    RESET_PROGRAM = 131
    DOWNLOAD = 132
    END_DOWNLOAD = 133
    PROGRAM_STATUS = 135
    VERSION = 136
    FACTORY = 137
    NOTIFY = 138


class Move(IntEnum):
    """The types of MVP."""

    ABS = 0
    REL = 1
    COORD = 2


class Search(IntEnum):
    """The types of RFS."""

    START = 0
    STOP = 1
    STATUS = 2


class Running(IntEnum):
    """What a program does: the value of command 135, and of global parameter 128."""

    HALTED = 0
    RUNS = 1
    STEPS = 2
    RESET = 3


class Version(IntEnum):
    """The types of command 136."""

    TEXT = 0
    BINARY = 1


FACTORY_CODE = 1234
"""The value that command 137 needs."""
TYPE, MOTOR, BANK, VALUE = "type", "motor", "bank", "value"
INT32 = range(-(2**31), 2**31)
MOTORS = range(256)


@dataclass(frozen=True)
class Row:
    """One word. `prints`: its reply's value is what was asked for. `moves`: it can start motion."""

    command: Command
    fields: tuple[str, ...]
    title: str
    unit: str = ""
    types: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    prints: bool = False
    moves: bool = False

    @property
    def word(self) -> str:
        """How it is typed."""
        return self.command.name

    @property
    def syntax(self) -> str:
        """How it is typed, with its fields."""
        names = ["|".join(self.types) if name == TYPE and self.types else name for name in self.fields]
        return f"{self.word} {', '.join(names)}".strip()


MOVES: Mapping[str, int] = MappingProxyType({each.name: each.value for each in Move})
SEARCHES: Mapping[str, int] = MappingProxyType({each.name: each.value for each in Search})
_AXIS, _GLOBAL = (TYPE, MOTOR), (TYPE, BANK)

ROWS = (
    Row(Command.ROR, (MOTOR, VALUE), "Rotate right at a velocity; a negative one turns left", moves=True),
    Row(Command.ROL, (MOTOR, VALUE), "Rotate left at a velocity; a negative one turns right", moves=True),
    Row(Command.MST, (MOTOR,), "Stop a motor with the deceleration of its ramp"),
    Row(
        Command.MVP,
        (TYPE, MOTOR, VALUE),
        "Move to a position, or by a distance (from where: axis parameter 127)",
        types=MOVES,
        moves=True,
    ),
    Row(Command.SAP, (TYPE, MOTOR, VALUE), "Set an axis parameter; 0 and 2 start a motion", moves=True),
    Row(Command.GAP, _AXIS, "Print an axis parameter", prints=True),
    Row(Command.STAP, _AXIS, "Store an axis parameter in EEPROM"),
    Row(Command.RSAP, _AXIS, "Restore an axis parameter from EEPROM", moves=True),
    Row(Command.SGP, (TYPE, BANK, VALUE), "Set a global parameter"),
    Row(Command.GGP, _GLOBAL, "Print a global parameter", prints=True),
    Row(Command.STGP, _GLOBAL, "Store a global parameter in EEPROM"),
    Row(Command.RSGP, _GLOBAL, "Restore a global parameter from EEPROM"),
    Row(
        Command.RFS,
        (TYPE, MOTOR),
        "Start or stop a reference search, or print whether one runs",
        types=SEARCHES,
        moves=True,
    ),
)
WORDS: Mapping[str, Row] = MappingProxyType({row.word: row for row in ROWS})


@dataclass(frozen=True)
class Call:
    """One command with its numbers, as bytes 1 to 7 of a request carry them."""

    command: int
    type: int = 0
    motor: int = 0
    value: int = 0

    def __str__(self) -> str:
        """The command in TMCL's notation."""
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
    def row(self) -> Row | None:
        """The word for it; None for a command that is called by its number only."""
        return next((row for row in ROWS if row.command == self.command), None)

    @property
    def prints(self) -> bool:
        """Whether the value of its reply is what was asked for."""
        if self.command == Command.RFS:
            return self.type == Search.STATUS
        return self.command in (Command.VERSION, Command.PROGRAM_STATUS) or (self.row is not None and self.row.prints)

    @property
    def moves(self) -> bool:
        """Whether it can start motion; a command without a word may."""
        return _moves(self)


STARTING_PARAMETERS = frozenset({0, 1, 2, 4})
"""Axis parameters that can start a motion when they are set.

0 and 2 are target position and velocity. 1 starts one where 0 differs from it, 4 where a move waits at velocity 0.
"""


NEVER_MOVE = frozenset(
    {
        Command.STOP_PROGRAM,
        Command.RESET_PROGRAM,
        Command.DOWNLOAD,
        Command.END_DOWNLOAD,
        Command.PROGRAM_STATUS,
        Command.VERSION,
        Command.NOTIFY,
    }
)
"""Commands without a word that start neither a motion nor a program; 129 and 130 do."""


def _moves(call: Call) -> bool:
    if call.command in NEVER_MOVE:
        return False
    if call.command in (Command.SAP, Command.RSAP):
        return call.type in STARTING_PARAMETERS
    if call.command == Command.RFS:
        return call.type == Search.START
    return call.row is None or call.row.moves
