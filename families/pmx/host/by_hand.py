"""What a person edits and switches of a PMX: V0 to V63, the digital outputs, both programs.

V32 to V63 are kept by STORE, V0 to V31 are 0 after power-up. (PMX-2ED-SA manual 7.13.2, 7.19.2, 7.19.6, table 7.15.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.by_hand import (
    GO_ON,
    PAUSE,
    RUN,
    STOP,
    ByHand,
    Output,
    PointField,
    PointSetup,
    ProgramSlot,
    Progress,
    Variable,
)
from multidrop.dialects.codec import Procedure
from multidrop.families.pmx.host.codec import PmxState
from multidrop.families.pmx.host.operations import PROGRAMS, number
from multidrop.families.pmx.manual import table

VARIABLES = 64
KEPT_FROM = 32
OUTPUTS = 8
STORE = "STORE"
CONTROLS = {STOP: 0, RUN: 1, PAUSE: 2, GO_ON: 3}
"""The values of SR (7.19.2)."""


LEVEL = {0: "normal", 1: "inverted"}
OF_AXIS = tuple(
    PointField(label, LEVEL, mask)
    for label, mask in (("home switch", 0x20), ("limit switches", 0x40), ("Z index", 0x80))
)
"""The polarities of an axis (table 7.7)."""
OF_ALL = tuple(
    PointField(label, LEVEL, mask)
    for label, mask in (("digital inputs", 0x400), ("digital outputs", 0x800), ("motor drivers", 0x1000))
)


class PmxByHand(ByHand):
    """What a person edits and switches of a PMX."""

    state: PmxState

    def variables(self, progress: Progress) -> Procedure[tuple[Variable, ...]]:
        found = []
        for n in range(VARIABLES):
            progress(n, VARIABLES)
            kept = "kept by STORE" if n >= KEPT_FROM else "0 after power-off"
            found.append(Variable(f"V{n}", (yield from number(self.state, f"V{n}")), kept))
        progress(VARIABLES, VARIABLES)
        return tuple(found)

    def assign(self, variable: Variable, value: str) -> str:
        return f"{variable.name}={value}"

    def keep(self, variable: Variable) -> str:
        return STORE if int(variable.name[1:]) >= KEPT_FROM else ""

    def outputs(self) -> Sequence[Output]:
        return [Output(n, f"DO{n}=1", f"DO{n}=0") for n in range(1, OUTPUTS + 1)]

    def programs(self) -> Sequence[ProgramSlot]:
        return [
            ProgramSlot(f"program {n}", {action: f"SR{n}={value}" for action, value in CONTROLS.items()})
            for n in PROGRAMS
        ]

    def points(self) -> Sequence[PointSetup]:
        """The polarities: bits of POLX and POLY; those of inputs, outputs and drivers are in POLX."""
        both = [PointSetup(f"POL{axis}", f"axis {axis}", OF_AXIS) for axis in table.AXES]
        return [replace(both[0], fields=(*OF_AXIS, *OF_ALL)), *both[1:]]
