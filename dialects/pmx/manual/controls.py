"""The controls of an axis of a controller. (PMX-2ED-SA manual 7.5, 7.7, 7.8, 7.10.)

A number means a position after ABS and a distance after INC, and another client may have sent either. So each move
sends ABS first.
"""

from __future__ import annotations

from multidrop.dialects.controls import BY, DISABLE, ENABLE, HOME_MINUS, HOME_PLUS, STOP, TO, Control, Controls
from multidrop.dialects.pmx.manual.table import AXES
from multidrop.dialects.state import DriveState


def controls(state: DriveState, axis: str) -> Controls:
    """The controls of one axis."""
    name = axis.upper()
    number = AXES.index(name) + 1
    return {
        BY: Control(("ABS", name + "{to}"), "numbers are positions from then on"),
        TO: Control(("ABS", name + "{to}"), "numbers are positions from then on"),
        HOME_MINUS: Control((f"H{name}-",), "on the home input, at high speed"),
        HOME_PLUS: Control((f"H{name}+",), "on the home input, at high speed"),
        STOP: Control((f"STOP{name}",), "slows down; a program goes on"),
        ENABLE: Control((f"EO{number}=1",), "current in the motor"),
        DISABLE: Control((f"EO{number}=0",), "no current: nothing holds the load"),
    }
