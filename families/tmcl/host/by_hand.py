"""What a person edits and switches of a TMCL module: the user variables of bank 2, the digital outputs.

(TMCL firmware manuals, "Global parameters", "SIO".)
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base.errors import Refused
from multidrop.dialects.by_hand import ByHand, Output, PointField, PointSetup, Progress, Variable
from multidrop.dialects.codec import Procedure
from multidrop.families.tmcl.host.codec import TmclState
from multidrop.families.tmcl.host.operations import read
from multidrop.families.tmcl.manual.commands import Command, TmclCall
from multidrop.families.tmcl.manual.modules import USERS, module_of

BANK = 2
"""The bank of user variables, and of the outputs of SIO."""


STOPS = PointField("limit switch", {0: "stops the motor", 1: "is ignored"})


class TmclByHand(ByHand):
    """What a person edits and switches of a module."""

    state: TmclState

    def variables(self, progress: Progress) -> Procedure[tuple[Variable, ...]]:
        """Read the user variables up to the first that the module refuses: it has no more of them."""
        found: list[Variable] = []
        for n in USERS:
            progress(n, len(USERS))
            try:
                value = yield from read(self.state, TmclCall(Command.GGP, n, BANK))
            except Refused:
                if not found:
                    raise
                break
            found.append(Variable(f"U{n}", value, "kept by STGP"))
        progress(len(USERS), len(USERS))
        return tuple(found)

    def assign(self, variable: Variable, value: str) -> str:
        return f"SGP {variable.name[1:]}, {BANK}, {value}"

    def keep(self, variable: Variable) -> str:
        return f"STGP {variable.name[1:]}, {BANK}"

    def outputs(self) -> Sequence[Output]:
        ports = module_of(self.state.product).outputs
        return [Output(n, f"SIO {n}, {BANK}, 1", f"SIO {n}, {BANK}, 0") for n in ports]

    def points(self) -> Sequence[PointSetup]:
        """The limit switches of each motor: whether they stop it (axis parameters 12 and 13)."""
        return [
            PointSetup(f"{number}{f'_{motor}' if motor else ''}", f"{side} limit switch of motor {motor}", (STOPS,))
            for motor in range(self.state.motors or 1)
            for number, side in ((12, "right"), (13, "left"))
        ]
