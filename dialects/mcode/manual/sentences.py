"""The lines of MCode that the product writes by itself: moves, assignments, controls. The drive has one axis."""

from __future__ import annotations

from multidrop.dialects.state import DriveState
from multidrop.dialects.values import BY, DISABLE, ENABLE, HOME_MINUS, HOME_PLUS, STOP, TO, Control, Controls


def move(axis: str, steps: int) -> tuple[str, ...]:
    return (f"MR {steps}",)


def move_to(axis: str, position: int) -> tuple[str, ...]:
    return (f"MA {position}",)


def assign(word: str, value: str) -> str:
    return f"{word}={value}"


# The controls of an MCode drive, the same over Modbus. (MCode reference 5.1.30, 5.1.54, 5.1.80, 5.1.84, 5.1.117.)


CONTROLS: Controls = {
    BY: Control(("MR {by}",)),
    TO: Control(("MA {to}",)),
    HOME_MINUS: Control(("HM 1",), "seek it in minus, creep off in plus"),
    HOME_PLUS: Control(("HM 3",), "seek it in plus, creep off in minus"),
    STOP: Control(("SL 0",), "slows down with D; a program goes on"),
    ENABLE: Control(("DE=1",), "current in the motor"),
    DISABLE: Control(("DE=0",), "no current: nothing holds the load"),
}


def controls(state: DriveState, axis: str) -> Controls:
    return CONTROLS
