"""What the motor of a PMX's axis is doing, at which pace, and the bits of the motor status (table 7.2)."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from multidrop.simulator.kinematics.profile import Shape
from multidrop.simulator.kinematics.segments import LINEAR, TRIANGLE
from multidrop.simulator.pmx.settings import Refusal, Settings, rate, window

ACCELERATING, DECELERATING, CONSTANT = 1, 2, 4
PLUS, MINUS, HOME = 16, 32, 64
PLUS_ERROR, MINUS_ERROR, INDEX, JOYSTICK, TIMED_OUT = 128, 256, 512, 1024, 2048


class Doing(Enum):
    """What the motor of an axis is doing."""

    NOTHING = "nothing"
    MOVE = "move"
    JOG = "jog"
    LINE = "line"
    HOMING = "homing"
    STOPPING = "stopping"
    CORRECTING = "correcting"
    STICK = "stick"


class Pace(NamedTuple):
    """The pace of a motion: low and high speed, pulses/s, and both rates, pulses/s2."""

    low: float
    high: float
    up: float
    down: float
    shape: Shape = Shape()


def paced(
    settings: Settings, axis: str, speeds: tuple[float, float], times: tuple[int, int], *, strict: bool = True
) -> Pace:
    """Work out the pace of an axis from low and high speed, pulses/s, and both acceleration times, ms.

    Raises Refusal for a low speed that does not fit the high one; not `strict`: a low speed that fits is used.
    """
    low, high = speeds
    if not strict:
        low = min(low, high)
    elif low > high or low < min(window(high).slowest, high):
        raise Refusal("?Low speed out of range")
    up = rate(low, high, times[0])
    down = rate(low, high, times[1]) if settings["EDEC"] else up
    return Pace(low, high, up, down, Shape(TRIANGLE if settings["SCV" + axis] else LINEAR))


def own_pace(settings: Settings, axis: str, scale: float, *, strict: bool = True) -> Pace:
    """Work out the pace of one axis alone: its own speeds, or the global ones where those are 0 (7.1).

    `scale`: pulses for a unit of speed.
    """
    low, high = (settings.of(name, axis) * scale for name in ("LSPD", "HSPD"))
    return paced(settings, axis, (low, high), (settings.of("ACC", axis), settings.of("DEC", axis)), strict=strict)
