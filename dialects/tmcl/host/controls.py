"""The controls of a motor of a module. (TMCL firmware manuals, commands MST, MVP, RFS; axis parameters 127, 193.)"""

from __future__ import annotations

from multidrop.dialects.controls import BY, DISABLE, ENABLE, HOME_MINUS, HOME_PLUS, STOP, TO, Control, Controls
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.parameters import RELATIVE_FROM

NO_ENABLE = "direct mode has no command for it"
ONE_WAY = "axis parameter 193 chooses the direction of a reference search"


def controls(state: TmclState, axis: str) -> Controls:
    """The controls of one motor."""
    motor = axis or "0"
    counted = RELATIVE_FROM.get(state.relative.get(int(motor), -1), "from where it counts is not known")
    return {
        BY: Control((f"MVP REL, {motor}, {{by}}",), counted),
        TO: Control((f"MVP ABS, {motor}, {{to}}",)),
        HOME_MINUS: Control((f"RFS START, {motor}",), "reference search, in the mode of axis parameter 193"),
        HOME_PLUS: Control(absent=ONE_WAY),
        STOP: Control((f"MST {motor}",), "slows down"),
        ENABLE: Control(absent=NO_ENABLE),
        DISABLE: Control(absent=NO_ENABLE),
    }
