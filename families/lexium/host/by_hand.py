"""What a person edits and switches of a Lexium drive or an MDrivePlus: registers, variables with VA, outputs, programs.

S keeps all of them. (MCode reference 5.1.85, 5.1.101, 5.1.107, 5.1.112, 5.1.134, 5.1.136.)
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.by_hand import GO_ON, PAUSE, STOP, ByHand, Output, ProgramSlot, Variable
from multidrop.families.lexium.manual.mnemonic import EXPANDED
from multidrop.families.lexium.manual.point_types import POINTS

REGISTERS = ("R1", "R2", "R3", "R4")
KEPT = "kept by S"
SAVE = "S"
GENERAL = 16
"""The type of an output that a line switches."""


class LexiumByHand(ByHand):
    """What a person edits and switches of a drive with the commands of MCode."""

    def assign(self, variable: Variable, value: str) -> str:
        return f"{variable.name}={value}"

    def keep(self, variable: Variable) -> str:
        return SAVE

    def outputs(self) -> Sequence[Output]:
        product = self.state.product
        group = "expanded" if product in EXPANDED else "mdrive" if product.startswith("MDI") else "lexium"
        numbers = [n for n, point in POINTS[group].items() if GENERAL in point.outputs]
        return [Output(n, f"O{n}=1", f"O{n}=0") for n in sorted(numbers)]

    def programs(self) -> Sequence[ProgramSlot]:
        return [ProgramSlot("program", {STOP: "E", PAUSE: "PS", GO_ON: "RS"})]
