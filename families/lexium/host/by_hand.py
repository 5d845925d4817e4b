"""What a person edits and switches of a Lexium drive or an MDrivePlus: registers, variables with VA, outputs, programs.

S keeps all of them. (MCode reference 5.1.85, 5.1.101, 5.1.107, 5.1.112, 5.1.134, 5.1.136.)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from multidrop.dialects.by_hand import (
    GO_ON,
    PAUSE,
    STOP,
    ByHand,
    Output,
    PointField,
    PointSetup,
    ProgramSlot,
    Variable,
)
from multidrop.families.lexium.manual.mnemonic import CLOSED_LOOP, EXPANDED
from multidrop.families.lexium.manual.point_types import POINTS
from multidrop.families.lexium.manual.points import FUNCTIONS

REGISTERS = ("R1", "R2", "R3", "R4")
KEPT = "kept by S"
SAVE = "S"
GENERAL = 16
"""The type of an output that a line switches."""


FEW_TYPES = 2
"""A point of so few types is no digital one."""
WORDS: Mapping[int, str] = {
    **FUNCTIONS,
    0: "general use",
    4: "go: run the program at 1",
    5: "soft stop",
    6: "pause",
    13: "step and direction",
    14: "encoder A and B",
    15: "step up and down",
    16: "general use",
    24: "hMT active",
    25: "make-up steps",
}
"""What each type is for, in a few words."""
LEVEL = PointField("active", {0: "low", 1: "high"})
DRIVE = PointField("drive", {0: "sinking", 1: "sourcing"})


def _types(numbers: Iterable[int]) -> PointField:
    return PointField("function", {number: WORDS.get(number, f"type {number}") for number in sorted(numbers)})


class LexiumByHand(ByHand):
    """What a person edits and switches of a drive with the commands of MCode."""

    outputs_by_type = True

    def assign(self, variable: Variable, value: str) -> str:
        return f"{variable.name}={value}"

    def keep(self, variable: Variable) -> str:
        return SAVE

    def outputs(self) -> Sequence[Output]:
        product = self.state.product
        group = "expanded" if product in EXPANDED else "mdrive" if product.startswith("MDI") else "lexium"
        numbers = [n for n, point in POINTS[group].items() if GENERAL in point.outputs]
        return [Output(n, f"O{n}=1", f"O{n}=0") for n in sorted(numbers)]

    def points(self) -> Sequence[PointSetup]:
        """The set-ups IS and OS of a Lexium; S of an MDrivePlus, whose points are either."""
        product = self.state.product
        if product.startswith("MDI"):
            table = POINTS["expanded" if product in EXPANDED else "mdrive"]
            return [
                PointSetup(f"S{n}", f"point {n}", (_types(each.inputs | each.outputs), LEVEL, DRIVE))
                for n, each in sorted(table.items())
                if len(each.inputs | each.outputs) > FEW_TYPES
            ]
        rows = sorted(POINTS["module" if product == "LMM" else "lexium"].items())
        ins = [
            PointSetup(f"IS{n}", f"input {n}", (_types(each.inputs), LEVEL))
            for n, each in rows
            if len(each.inputs) > FEW_TYPES
        ]
        hmt = product in CLOSED_LOOP
        outs = [
            PointSetup(f"OS{n}", f"output {n}", (_types(each.outputs | (each.hmt if hmt else frozenset())), LEVEL))
            for n, each in rows
            if each.outputs
        ]
        return [*ins, *outs]

    def programs(self) -> Sequence[ProgramSlot]:
        return [ProgramSlot("program", {STOP: "E", PAUSE: "PS", GO_ON: "RS"})]
