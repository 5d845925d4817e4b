"""The record of the MCode family: Lexium MDrive and MDrivePlus on a serial line, or MCode/TCP."""

from __future__ import annotations

from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import Codec, Priority, Procedure
from multidrop.dialects.debugging import Debugging
from multidrop.dialects.family import Guard, Hints, Motion, Printed, Programs, Referencing
from multidrop.dialects.motions import Motions
from multidrop.dialects.scanning import Scan
from multidrop.dialects.state import DriveState, Remembered
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.lexium.host.family import LexiumFamily
from multidrop.families.lexium.host.mcode import classify, operations
from multidrop.families.lexium.host.mcode.codec import STOP_BYTES, MCode
from multidrop.families.lexium.host.mcode.identify import identify, remember
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import guards, help
from multidrop.families.lexium.manual.guards import NAMES


def guarded(state: MCodeState, text: str) -> Guard | None:
    party, product, starts = state.codec.party, state.product, classify.starts_motion
    return guards.find(text, address=state.address, party=party, product=product, starts=starts)


def homed(state: MCodeState) -> Procedure[bool]:
    return not (yield from operations.flag(state, "EF"))


class MCodeFamily(LexiumFamily):
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
        return [*(yield from identify(hints))]

    def guard(self, text: str) -> Guard | None:
        return guarded(self.state, text)

    def perform(self, text: str) -> Printed:
        return operations.perform(self.state, text)

    def check(self, text: str) -> None:
        operations.check(self.state, text)

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        return operations.motion(self.state, priority)

    def moving(self) -> Procedure[bool]:
        return operations.flag(self.state, name="MV")

    def busy(self) -> Procedure[bool]:
        return operations.flag(self.state, name="BY")

    def status(self) -> Printed:
        return operations.status(self.state)

    def referencing(self, text: str) -> Referencing | None:
        return classify.referencing(self.state, text)

    def homed(self) -> Procedure[bool]:
        return homed(self.state)

    @property
    def programs(self) -> Programs:
        from multidrop.families.lexium.host.mcode.programs import MCodePrograms

        return MCodePrograms(self.state)

    @classmethod
    def vouched(cls, text: str, product: str) -> bool:
        return classify.vouched(text, product)

    @classmethod
    def addressed(cls, text: str, product: str) -> tuple[str, str] | None:
        return guards.addressed(text, product)

    @property
    def debugging(self) -> Debugging:
        from multidrop.families.lexium.host.mcode.debugging import MCodeDebugging

        return MCodeDebugging(self.state)

    def remember(self) -> Remembered | None:
        return remember(self.state)

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
