"""The record of the TMCL family: Trinamic modules in direct mode, on RS-485, USB or through a TCP converter.

It has no URL scheme: its frames contain bytes that other drives obey, so nothing tries it on an unknown line before a
person has agreed. A guarded line wears the EEPROM out, forgets what is stored, starts programs later, or changes how
the module is reached. A stop is never guarded. Values have numbers; a word is the name of a parameter (`parameter`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multidrop.base.files import rows
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import Codec, Priority, Procedure
from multidrop.dialects.debugging import Debugging
from multidrop.dialects.family import (
    ADDRESSES,
    EVERYONE,
    Family,
    Guard,
    Hints,
    Motion,
    Printed,
    Programs,
    Referencing,
    to_all,
)
from multidrop.dialects.motions import Motions
from multidrop.dialects.scanning import Scan
from multidrop.dialects.state import DriveState
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.tmcl.host import codec, operations
from multidrop.families.tmcl.host.codec import STOP_BYTES, Tmcl, TmclState
from multidrop.families.tmcl.host.operations import identify
from multidrop.families.tmcl.manual import commands, help
from multidrop.families.tmcl.manual.commands import Command, Global

FIRST = "0"
"""The first motor."""


def move(axis: str, steps: int | str) -> tuple[str, ...]:
    return (f"MVP REL, {axis or FIRST}, {steps}",)


def move_to(axis: str, position: int | str) -> tuple[str, ...]:
    return (f"MVP ABS, {axis or FIRST}, {position}",)


_ROWS = list(rows(__file__, "guards.csv"))
"""The guards on commands, by their word or number, and on setting a global parameter of bank 0, or restoring it from
EEPROM. `switch`: a 0 switches it off, which needs no agreement.
"""
GUARDS: Mapping[str, str] = {
    **{row["name"]: row["what"] for row in _ROWS},
    EVERYONE: "can start every drive of the line",
}
"""Every guard, and what its lines do."""
_COMMANDS: Mapping[int, str] = {
    int(word) if word.isdigit() else Command[word]: row["name"] for row in _ROWS if (word := row["command"])
}
_PARAMETERS: Mapping[int, str] = {Global[row["parameter"]]: row["name"] for row in _ROWS if row["parameter"]}
_SWITCHES = frozenset(Global[row["parameter"]] for row in _ROWS if row["switch"])


def guarded(text: str, address: str) -> Guard | None:
    """Find the guard of a line for a module; None: the line needs no agreement, as an invalid one."""
    line = text.strip()
    if (call := commands.parsed(text)) is None:
        return None
    name = _COMMANDS.get(call.command, "")
    off = call.command == Command.SGP and call.type in _SWITCHES and not call.value
    if call.command in (Command.SGP, Command.RSGP) and call.motor == 0 and not off:
        name = _PARAMETERS.get(call.type, "")
    if name:
        return Guard(name, f"'{line}' {GUARDS[name]}")
    return to_all(line) if address in ADDRESSES and call.moves and not only_ends(text) else None


def only_ends(text: str) -> bool:
    """Whether a line is a command of motion that can only end it: a velocity of 0."""
    call = commands.parsed(text)
    return call is not None and call.command in (Command.ROR, Command.ROL) and call.value == 0


def word_of(text: str) -> str:
    """The word at the head of a line, in capitals; the number of a command without a word."""
    return text.strip().partition(" ")[0].upper()


def only_reads(text: str) -> bool:
    return word_of(text) in (Command.GAP.name, Command.GGP.name, Command.GIO.name)


class TmclFamily(Family):
    """A Trinamic module in direct mode."""

    state: TmclState

    guards = GUARDS

    name = Tmcl.family
    codec = Tmcl()
    language = help.LANGUAGE
    rests_in_place = True
    repairs = True
    stop_bytes = STOP_BYTES

    @classmethod
    def new_state(cls, codec: Codec, address: str) -> DriveState:
        assert isinstance(codec, Tmcl)
        return TmclState(codec, address)

    @classmethod
    def identify(cls, hints: Hints) -> Procedure[list[DriveState]]:
        return [*(yield from identify(hints))]

    def guard(self, text: str) -> Guard | None:
        return guarded(text, self.state.address)

    @classmethod
    def word_of(cls, text: str) -> str:
        return word_of(text)

    @classmethod
    def only_ends(cls, text: str) -> bool:
        return only_ends(text)

    @classmethod
    def only_reads(cls, text: str) -> bool:
        return only_reads(text)

    def perform(self, text: str) -> Printed:
        return operations.perform(self.state, text)

    def check(self, text: str) -> None:
        operations.parsed(self.state, text)

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        return operations.motion(self.state, priority)

    def moving(self) -> Procedure[bool]:
        return operations.moving(self.state)

    def busy(self) -> Procedure[bool]:
        return operations.busy(self.state)

    def status(self) -> Printed:
        return operations.status(self.state)

    def referencing(self, text: str) -> Referencing | None:
        return operations.referencing(self.state, text)

    def homed(self) -> Procedure[bool]:
        return operations.homed(self.state)

    @classmethod
    def question(cls, word: str) -> str | None:
        return commands.asked(word)

    @classmethod
    def move(cls, axis: str, distance: int | str) -> tuple[str, ...]:
        return move(axis, distance)

    @classmethod
    def move_to(cls, axis: str, position: int | str) -> tuple[str, ...]:
        return move_to(axis, position)

    @classmethod
    def assign(cls, word: str, value: str) -> str | None:
        return commands.assigned(word, value)

    @property
    def programs(self) -> Programs:
        from multidrop.families.tmcl.host.programs import TmclPrograms

        return TmclPrograms(self.state)

    @property
    def debugging(self) -> Debugging:
        from multidrop.families.tmcl.host.programs import TmclDebugging

        return TmclDebugging(self.state)

    @property
    def certifying(self) -> Certifying:
        from multidrop.families.tmcl.host.operations import TmclCertifying

        return TmclCertifying(self.state)

    @property
    def motions(self) -> Motions:
        from multidrop.families.tmcl.host.motions import TmclMotions

        return TmclMotions(self.state)

    @property
    def values(self) -> Values:
        from multidrop.families.tmcl.host.values import TmclValues

        return TmclValues(self.state)

    @property
    def units(self) -> Units:
        from multidrop.families.tmcl.host.units import TmclUnits

        return TmclUnits(self.state)

    @classmethod
    def message_moves(cls, messages: bytes) -> bool:
        return codec.moves(messages)

    @classmethod
    def in_frames(cls, data: bytes) -> Sequence[str]:
        return codec.replies_in(data)

    @classmethod
    def scan(cls) -> Scan:
        from multidrop.families.tmcl.host.scan import SCAN

        return SCAN
