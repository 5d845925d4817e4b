"""The record of the MCode family: Lexium MDrive and MDrivePlus on a serial line, or MCode/TCP."""

from __future__ import annotations

from multidrop.base.errors import Inexpressible
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import Codec, Procedure
from multidrop.dialects.debugging import Debugging
from multidrop.dialects.family import Guard, Hints, Programs
from multidrop.dialects.motions import Motions
from multidrop.dialects.scanning import Scan
from multidrop.dialects.state import DriveState, Remembered
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.family import LexiumFamily
from multidrop.families.lexium.host.mcode.codec import STOP_BYTES, TO_PARTY, MCode
from multidrop.families.lexium.host.mcode.identify import (
    IN_TEXT,
    expected_places,
    expected_state,
    look_around,
    wake,
)
from multidrop.families.lexium.host.mcode.identity import overflow, write_stop
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import guards, help
from multidrop.families.lexium.manual.guards import NAMES
from multidrop.families.lexium.manual.statements import UNNAMED


class MCodeFamily(MCodeOperations, LexiumFamily):
    """A Lexium MDrive or MDrivePlus on a serial line, or over MCode/TCP."""

    state: MCodeState

    guards = NAMES

    name = MCode.family
    codec = MCode()
    language = help.LANGUAGE
    repairs = True
    stop_bytes = STOP_BYTES

    @classmethod
    def new_state(cls, codec: Codec, address: str) -> DriveState:
        assert isinstance(codec, MCode)
        return MCodeState(codec, address)

    @classmethod
    def identify(cls, hints: Hints) -> Procedure[list[DriveState]]:
        """Find the drives on a line, in the order of `hints.drives`. Raises NoAnswer where no drive replies.

        Raises Inexpressible, before anything is sent, for a name longer than one character: a drive would take the
        second character for the beginning of a command.
        """
        for name in hints.drives:
            if len(name) != 1:
                raise Inexpressible(f"no drive name '{name}'; valid: one letter or digit each, as in drives=a,b")
        if hints.lazy and not (hints.cut or hints.owed) and (expected := expected_places(hints)):
            if expected[0].place.party:
                yield from wake(TO_PARTY if expected[0].stated else IN_TEXT)
            return [expected_state(place, hints) for place in expected]
        if not hints.cut:
            return [*(yield from look_around(hints))]
        yield from overflow(hints.drives or (UNNAMED,))
        states = yield from look_around(hints)
        for state in states:  # their stops are known now, and an error's subroutine may have started since
            yield from write_stop(state.codec.stop([state.address or state.name], sure=not state.settings_unknown))
        return [*states]

    def guard(self, text: str) -> Guard | None:
        state, starts = self.state, classify.starts_motion
        return guards.find(text, address=state.address, party=state.codec.party, product=state.product, starts=starts)

    @property
    def programs(self) -> Programs:
        from multidrop.families.lexium.host.mcode.programs import MCodePrograms

        return MCodePrograms(self.state)

    @classmethod
    def addressed(cls, text: str, product: str) -> tuple[str, str] | None:
        return guards.addressed(text, product)

    @property
    def debugging(self) -> Debugging:
        from multidrop.families.lexium.host.mcode.debugging import MCodeDebugging

        return MCodeDebugging(self.state)

    def remember(self) -> Remembered | None:
        """Return what the next use of the port may expect; None where the drive or its settings are not known."""
        state = self.state
        if state.unconfirmed is not None:
            return state.unconfirmed.last
        if not state.product or state.settings_unknown:
            return None
        mode = state.codec
        identity = (state.name, state.product, state.version, state.part, state.serial)
        return Remembered(state.address, *identity, mode.party, mode.checksum, mode.em)

    @classmethod
    def scan(cls) -> Scan:
        from multidrop.families.lexium.host.mcode.scan import SCAN

        return SCAN

    @property
    def certifying(self) -> Certifying:
        from multidrop.families.lexium.host.mcode.programs import MCodeCertifying

        return MCodeCertifying(self.state)

    @property
    def values(self) -> Values:
        from multidrop.families.lexium.host.mcode.values import MCodeValues

        return MCodeValues(self.state)

    @property
    def units(self) -> Units:
        from multidrop.families.lexium.host.mcode.units import MCodeUnits

        return MCodeUnits(self.state)

    @property
    def motions(self) -> Motions:
        from multidrop.families.lexium.host.mcode.motions import MCodeMotions

        return MCodeMotions(self.state)
