"""The controls of a motor of a module. (TMCL firmware manuals, commands MST, MVP, RFS.)"""

from __future__ import annotations

from dialects.controls import BY, DISABLE, ENABLE, HOME_MINUS, HOME_PLUS, STOP, TO, Control, Controls
from dialects.state import DriveState

NO_ENABLE = "direct mode has no command for it"
ONE_WAY = "axis parameter 193 chooses the direction of a reference search"


def controls(state: DriveState, axis: str) -> Controls:
    """The controls of one motor."""
    motor = axis or "0"
    return {
        BY: Control((f"MVP REL, {motor}, {{by}}",)),
        TO: Control((f"MVP ABS, {motor}, {{to}}",)),
        HOME_MINUS: Control((f"RFS START, {motor}",), "reference search, in the mode of axis parameter 193"),
        HOME_PLUS: Control(absent=ONE_WAY),
        STOP: Control((f"MST {motor}",), "slows down"),
        ENABLE: Control(absent=NO_ENABLE),
        DISABLE: Control(absent=NO_ENABLE),
    }
