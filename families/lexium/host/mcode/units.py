"""What positions and velocities of a drive count, read over MCode."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure
from multidrop.dialects.units import Basis
from multidrop.families.lexium.host.mcode.before_request import value_of
from multidrop.families.lexium.host.mcode.state import MCodeState, refuse_in_program
from multidrop.families.lexium.host.units import LexiumUnits, counted, rests_on


class MCodeUnits(LexiumUnits):
    """The quantities in lines of MCode, and what they count over MCode."""

    state: MCodeState

    def basis(self, axis: str, full_steps: int | None) -> Procedure[Basis]:
        """Read the settings in one print, with the error flag and whether a program runs."""
        refuse_in_program(self.state, "type the line again")
        values: dict[str, str] = {}
        # A print may find the product.
        while missing := [word for word in rests_on(self.state.product) if word not in values]:
            asked = [*missing, "EF", "BY"]
            printed = yield from value_of(self.state, '," ",'.join(asked), " ".join([r"\d+(?:\.\d+)?"] * len(asked)))
            *numbers, error, runs = printed.split()
            self.state.program_read(error=error == "1", running=runs == "1")
            values |= dict(zip(missing, numbers, strict=True))
        return counted(self.state.product, values, full_steps)
