"""Axis and global parameters that the one-axis stepper modules have in common.

Source: TMCL firmware manuals, "Axis parameters" and "Global parameters".

Positions are microsteps. Velocities and accelerations are microsteps/s and microsteps/s2 on modules with a TMC5130,
TMC5160 or TMC4361; older ones (TMC428, TMC429) count in units of the chip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType

from multidrop.dialects.tmcl.manual.commands import INT32

STEPS, SPEED, RATE = "microsteps", "microsteps/s", "microsteps/s2"
FLAG = range(2)


class Axis(IntEnum):
    """The number of an axis parameter."""

    TARGET_POSITION = 0
    ACTUAL_POSITION = 1
    TARGET_VELOCITY = 2
    ACTUAL_VELOCITY = 3
    MAXIMUM_VELOCITY = 4
    MAXIMUM_ACCELERATION = 5
    RUN_CURRENT = 6
    STANDBY_CURRENT = 7
    POSITION_REACHED = 8
    HOME_SWITCH = 9
    RIGHT_SWITCH = 10
    LEFT_SWITCH = 11
    RIGHT_LIMIT_OFF = 12
    LEFT_LIMIT_OFF = 13
    RELATIVE_FROM = 127
    MICROSTEPS = 140
    SEARCH_MODE = 193
    SEARCH_SPEED = 194
    SWITCH_SPEED = 195
    SWITCH_DISTANCE = 196
    FREEWHEELING = 204
    LOAD = 206
    ERROR_FLAGS = 207
    DRIVER_FLAGS = 208


class Global(IntEnum):
    """The number of a global parameter in bank 0."""

    BAUD = 65
    ADDRESS = 66
    PAUSE = 75
    HOST_ADDRESS = 76
    AUTOSTART = 77
    PROGRAM_STATUS = 128


@dataclass(frozen=True)
class Parameter:
    """One parameter. `limits`: the values that can be set; empty for one that is only read."""

    title: str
    limits: range = range(0)
    unit: str = ""
    fresh: int = 0

    @property
    def writable(self) -> bool:
        """Whether it can be set."""
        return len(self.limits) > 0


SPEEDS = range(2**23)
AXIS: Mapping[int, Parameter] = MappingProxyType(
    {
        Axis.TARGET_POSITION: Parameter("target position; setting it starts a move", INT32, STEPS),
        Axis.ACTUAL_POSITION: Parameter("actual position; set it at rest, and 0 as well", INT32, STEPS),
        Axis.TARGET_VELOCITY: Parameter("target velocity; setting it starts a rotation", range(-(2**23), 2**23), SPEED),
        Axis.ACTUAL_VELOCITY: Parameter("actual velocity", unit=SPEED),
        Axis.MAXIMUM_VELOCITY: Parameter("maximum positioning velocity", SPEEDS, SPEED, 51_200),
        Axis.MAXIMUM_ACCELERATION: Parameter("maximum acceleration", range(1, 2**24), RATE, 51_200),
        Axis.RUN_CURRENT: Parameter("current while it runs", range(256), "of 255", 128),
        Axis.STANDBY_CURRENT: Parameter("current at standstill", range(256), "of 255", 8),
        Axis.POSITION_REACHED: Parameter("1 when the actual position is the target"),
        Axis.HOME_SWITCH: Parameter("home switch: 1 is active"),
        Axis.RIGHT_SWITCH: Parameter("right limit switch: 1 is active"),
        Axis.LEFT_SWITCH: Parameter("left limit switch: 1 is active"),
        Axis.RIGHT_LIMIT_OFF: Parameter("1 switches the right limit switch off", FLAG),
        Axis.LEFT_LIMIT_OFF: Parameter("1 switches the left limit switch off", FLAG),
        Axis.RELATIVE_FROM: Parameter("MVP REL counts from: 0 the last target, 1 here, 2 the encoder", range(3)),
        Axis.MICROSTEPS: Parameter("microsteps of a full step: 2 to the power of it", range(9), "", 8),
        Axis.SEARCH_MODE: Parameter(
            "reference search: 1 left; 2 right, then left; 3 right, then home", range(1, 4), "", 1
        ),
        Axis.SEARCH_SPEED: Parameter("reference search: velocity of the search", SPEEDS, SPEED, 51_200),
        Axis.SWITCH_SPEED: Parameter("reference search: velocity near the switch", SPEEDS, SPEED, 12_800),
        Axis.SWITCH_DISTANCE: Parameter("distance of the end switches, after mode 2", unit=STEPS),
        Axis.FREEWHEELING: Parameter("delay at standstill until the current is off; 0: it stays", range(2**16)),
        Axis.LOAD: Parameter("load of the motor, as the driver measures it"),
        Axis.ERROR_FLAGS: Parameter("extended error flags; reading clears them"),
        Axis.DRIVER_FLAGS: Parameter("error flags of the driver"),
    }
)
RELATIVE_FROM: Mapping[int, str] = MappingProxyType(
    {0: "counts from the last target", 1: "counts from here", 2: "counts from the encoder's position"}
)
"""The values of axis parameter 127; only some modules have it (in the maker's tables 1240, 1241 and 1276)."""
GLOBAL: Mapping[int, Parameter] = MappingProxyType(
    {
        Global.BAUD: Parameter("baud code of the serial port; it acts on the next message", range(12)),
        Global.ADDRESS: Parameter("address of the module; it acts on the next message", range(1, 256), "", 1),
        Global.PAUSE: Parameter("pause before a reply", range(256), "ms"),
        Global.HOST_ADDRESS: Parameter("address of the host in replies", range(256), "", 2),
        Global.AUTOSTART: Parameter("1 starts the stored program at power-up", FLAG),
        Global.PROGRAM_STATUS: Parameter("the program: 0 halted, 1 runs, 2 steps, 3 reset"),
    }
)
BAUDS: Mapping[int, int] = MappingProxyType(
    {0: 9600, 1: 14400, 2: 19200, 3: 28800, 4: 38400, 5: 57600, 6: 76800, 7: 115200}
)
"""Baud rates by the code in global parameter 65. The codes beyond 9600 are common knowledge, read in no manual."""
