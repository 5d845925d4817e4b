"""The registers and the user variables of an MCode drive. (MCode reference 5.1.107, 5.1.134, 5.1.136.)"""

from __future__ import annotations

from multidrop.dialects.by_hand import Progress, Variable
from multidrop.dialects.codec import Procedure
from multidrop.families.lexium.host.by_hand import KEPT, REGISTERS, LexiumByHand
from multidrop.families.lexium.host.mcode.before_request import value_of
from multidrop.families.lexium.host.mcode.settings import USER, listed
from multidrop.families.lexium.host.mcode.state import MCodeState, refuse_in_program

GLOBAL = "G"
"""The scope of a variable that is of no program."""


class MCodeByHand(LexiumByHand):
    """What a person edits and switches of an MCode drive."""

    state: MCodeState

    def variables(self, progress: Progress) -> Procedure[tuple[Variable, ...]]:
        """Read R1 to R4, then the variables that are listed by PR UV; those of a program have another scope."""
        refuse_in_program(self.state)
        progress(0, 2)
        form = " ".join(r"-?\d{1,10}" for _ in REGISTERS)
        values = (yield from value_of(self.state, '," ",'.join(REGISTERS), form)).split()
        found = [Variable(name, int(value), KEPT) for name, value in zip(REGISTERS, values, strict=True)]
        progress(1, 2)
        for line in (yield from listed(self.state, "PR UV")):
            row = USER.fullmatch(line.strip())
            if row is not None and (row[2] or "").upper() == GLOBAL:
                number = float(row[3]) if "." in row[3] else int(row[3])
                found.append(Variable(row[1].upper(), number, KEPT))
        progress(2, 2)
        return tuple(found)
