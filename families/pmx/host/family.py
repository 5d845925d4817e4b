"""The record of the PMX family: Performax controllers on a serial line or through a gateway.

Guarded commands are in the PMX-2ED-SA manual 6.2.2, 6.3, 7.20; a stop is never guarded. A move follows its mode, which
stays set.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.base.errors import Inexpressible, NoAnswer
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
from multidrop.dialects.scanning import Scan
from multidrop.dialects.state import DriveState, who
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.pmx.host.codec import FACTORY, STOP_BYTES, Pmx, PmxState
from multidrop.families.pmx.host.operations import SEARCH, PmxCertifying, PmxOperations, find
from multidrop.families.pmx.manual import help
from multidrop.families.pmx.manual.table import COMMANDS, PmxMotion, head, lookup, reads, starts_motion

FIRST_AXIS = "X"
"""The first axis."""


GUARDS: Mapping[str, str] = {
    **{row.name: row.guard for row in COMMANDS.values() if row.guard},
    EVERYONE: "can start every drive of the line",
}
"""Every guard, and what its commands do."""
_NUMBER = re.compile(r"\A\s*@\d{2}", re.ASCII)
_ADDRESSED = re.compile(r"\s*@?(\d{2})\s*(?=[A-Za-z])", re.ASCII)


class PmxFamily(PmxOperations, Family):
    """A Performax controller on a serial line or through a gateway."""

    state: PmxState

    guards = GUARDS

    name = Pmx.family
    codec = Pmx()
    language = help.LANGUAGE
    stop_bytes = STOP_BYTES

    @classmethod
    def new_state(cls, codec: Codec, address: str) -> DriveState:
        assert isinstance(codec, Pmx)
        return PmxState(codec, address)

    @classmethod
    def identify(cls, hints: Hints) -> Procedure[list[DriveState]]:
        """Find the controllers on a line, in the order of `hints.drives`. Raises NoAnswer where none replies.

        Without numbers, try the factory's number, then none, as on a gateway.
        """
        if hints.checksum is not None or hints.em is not None:
            raise Inexpressible("checksum= and em= are for MCode; this controller has neither")
        if not hints.addressed:
            alone = yield from find(PmxState(Pmx(addressed=False)))
            if alone is None:
                raise NoAnswer("no controller replies without an address")
            return [alone]
        if wrong := [name for name in hints.drives if not re.fullmatch(r"\d\d", name, re.ASCII)]:
            raise Inexpressible(f"no device number '{wrong[0]}'; valid: 00 to 99, as in drives=00,01")
        named = tuple(name for name in hints.tried if re.fullmatch(r"\d\d", name, re.ASCII))
        states: list[DriveState] = []
        for name in hints.drives or named or (FACTORY,):
            state = PmxState(Pmx(), name)
            if (yield from find(state)) is None:
                state.note(f"{who(state)} does not reply")
            states.append(state)
        if any(state.product for state in states):
            return states
        if not hints.drives:
            alone = yield from find(PmxState(Pmx(addressed=False)))
            if alone is not None:
                return [alone]
        tried = ", ".join(state.address for state in states)
        raise NoAnswer(f"no controller replies at {tried}; drives=00,01,... names others; {SEARCH}")

    def guard(self, text: str) -> Guard | None:
        line = text.strip()
        word, value = self.word_of(line), line.partition("=")[2].strip()
        row = COMMANDS.get(word)
        if row is not None and row.guard and (value or row.access == "-"):
            return Guard(word, f"'{line}' {row.guard}")
        quiet = row is not None and value in row.quiet
        return to_all(line) if self.state.address in ADDRESSES and starts_motion(line) and not quiet else None

    @classmethod
    def word_of(cls, text: str) -> str:
        """The name of a command without its axis or number, and without a device number before it, in capitals."""
        command = _NUMBER.sub("", text)
        row = lookup(command)
        return row.name if row is not None else head(command)

    @classmethod
    def only_ends(cls, text: str) -> bool:
        """Whether a command of motion can only end it: that ends a program (SR)."""
        row = COMMANDS.get(cls.word_of(text.strip()))
        return row is not None and row.motion is PmxMotion.PROGRAM and text.partition("=")[2].strip() in row.quiet

    @classmethod
    def only_reads(cls, text: str) -> bool:
        return reads(text)

    @classmethod
    def question(cls, word: str) -> str | None:
        return word if reads(word) else None

    @classmethod
    def move(cls, axis: str, distance: int | str) -> tuple[str, ...]:
        return "INC", f"{axis.upper() or FIRST_AXIS}{distance}"

    @classmethod
    def move_to(cls, axis: str, position: int | str) -> tuple[str, ...]:
        return "ABS", f"{axis.upper() or FIRST_AXIS}{position}"

    @classmethod
    def assign(cls, word: str, value: str) -> str | None:
        return f"{word}={value}"

    @property
    def programs(self) -> Programs:
        from multidrop.families.pmx.host.programs import PmxPrograms

        return PmxPrograms(self.state)

    @classmethod
    def scan(cls) -> Scan:
        from multidrop.families.pmx.host.scan import SCAN

        return SCAN

    @property
    def debugging(self) -> Debugging:
        from multidrop.families.pmx.host.programs import PmxDebugging

        return PmxDebugging(self.state)

    @property
    def certifying(self) -> Certifying:
        return PmxCertifying(self.state)

    @property
    def motions(self) -> Motions:
        from multidrop.families.pmx.host.motions import PmxMotions

        return PmxMotions(self.state)

    @property
    def values(self) -> Values:
        from multidrop.families.pmx.host.values import PmxValues

        return PmxValues(self.state)

    @property
    def units(self) -> Units:
        from multidrop.families.pmx.host.units import PmxUnits

        return PmxUnits(self.state)

    @classmethod
    def addressed(cls, text: str, product: str) -> tuple[str, str] | None:
        """Split a line into a device number and a command (`01PX`, as on the wire, with its @ or without)."""
        match = _ADDRESSED.match(text)
        rest = text[match.end() :] if match is not None else ""
        return (match[1], rest) if match is not None and lookup(rest.upper()) is not None else None
