"""The record of the TMCL family: Trinamic modules in direct mode, on RS-485, USB or through a TCP converter.

It has no URL scheme: its frames contain bytes that other drives obey, so nothing tries it on an unknown line before a
person has agreed. A guarded line wears the EEPROM out, forgets what is stored, starts programs later, or changes how
the module is reached. A stop is never guarded. Values have numbers; a word is the name of a parameter (`parameter`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multidrop.base.errors import Inexpressible, NoAnswer
from multidrop.base.files import rows
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import Codec, Procedure
from multidrop.dialects.debugging import Debugging
from multidrop.dialects.family import (
    ADDRESSES,
    EVERYONE,
    Family,
    Guard,
    Hints,
    Programs,
    to_all,
)
from multidrop.dialects.motions import Motions
from multidrop.dialects.owed_settings import repaired
from multidrop.dialects.scanning import Scan
from multidrop.dialects.state import DriveState, who
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.tmcl.host import codec
from multidrop.families.tmcl.host.codec import FACTORY, STOP_BYTES, Tmcl, TmclState, number_of
from multidrop.families.tmcl.host.operations import TmclCertifying, TmclOperations, count_line, end_download, find
from multidrop.families.tmcl.manual import commands, help
from multidrop.families.tmcl.manual.commands import Command, Global

FIRST_AXIS = "0"
"""The first motor."""


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


class TmclFamily(TmclOperations, Family):
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
        """The modules at the addresses of `hints.drives`; without any, those tried, or the one at the factory's.

        Raises NoAnswer where none replies, and Inexpressible for hints of other families.
        """
        if hints.checksum is not None or hints.em is not None or not hints.addressed:
            raise Inexpressible("checksum=, em= and address=none are for other families: a module has none of them")
        named = [name for name in hints.tried if name.isdecimal()]
        names = tuple(dict.fromkeys(hints.drives or named)) or (FACTORY,)
        for name in names:  # all, before the first is asked
            number_of(name)
        states: list[TmclState] = []
        for name in names:
            state = TmclState(Tmcl(), name)
            state.named(name)
            if any(owed.name == name and not owed.lines for owed in hints.owed):
                yield from end_download(state, "the last session left it in download mode")
            if not (yield from find(state)):
                state.note(f"{who(state)} does not reply")
            states.append(state)
        count_line(states)
        for state in states:
            yield from repaired(state, hints.owed, TmclOperations(state).perform)
        if not any(state.product for state in states):
            tried = ", ".join(state.address for state in states)
            raise NoAnswer(f"no module replies at {tried}; drives=1,2,... names others")
        return [*states]

    def guard(self, text: str) -> Guard | None:
        line = text.strip()
        if (call := commands.parsed(text)) is None:
            return None
        name = _COMMANDS.get(call.command, "")
        off = call.command == Command.SGP and call.type in _SWITCHES and not call.value
        if call.command in (Command.SGP, Command.RSGP) and call.motor == 0 and not off:
            name = _PARAMETERS.get(call.type, "")
        if name:
            return Guard(name, f"'{line}' {GUARDS[name]}")
        return to_all(line) if self.state.address in ADDRESSES and call.moves and not self.only_ends(text) else None

    @classmethod
    def only_ends(cls, text: str) -> bool:
        """Whether a line is a command of motion that can only end it: a velocity of 0."""
        call = commands.parsed(text)
        return call is not None and call.command in (Command.ROR, Command.ROL) and call.value == 0

    @classmethod
    def only_reads(cls, text: str) -> bool:
        return cls.word_of(text) in (Command.GAP.name, Command.GGP.name, Command.GIO.name)

    @classmethod
    def question(cls, word: str) -> str | None:
        return commands.asked(word)

    @classmethod
    def move(cls, axis: str, distance: int | str) -> tuple[str, ...]:
        return (f"MVP REL, {axis or FIRST_AXIS}, {distance}",)

    @classmethod
    def move_to(cls, axis: str, position: int | str) -> tuple[str, ...]:
        return (f"MVP ABS, {axis or FIRST_AXIS}, {position}",)

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
