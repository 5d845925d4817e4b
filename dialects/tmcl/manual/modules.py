"""The parameters of TMCL modules: one table a module, with the numbers that the maker's library lists for it.

Positions are microsteps. Velocities and accelerations are microsteps/s and microsteps/s2 on modules with a TMC5130,
TMC5160 or TMC4361; those with a TMC428 or TMC429 count in units of that chip. A parameter of which only number and name
are known takes any value of 32 bits. (TMCL firmware manuals, "Axis parameters", "Global parameters".)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from multidrop.dialects.tmcl.manual.commands import INT32, Axis, Global, Status

STEPS, SPEED, RATE = "microsteps", "microsteps/s", "microsteps/s2"
FLAG = range(2)
MIRRORED, INVERTED = 64, 128
"""Added to a mode of the reference search: the right switch in place of the left one; the home switch inverted."""
LIMIT_MODES, HOME_MODES = range(1, 5), range(5, 9)
SEARCH_MODES = (
    *LIMIT_MODES,
    *HOME_MODES,
    *(mode + MIRRORED for mode in LIMIT_MODES),
    *(mode + INVERTED for mode in HOME_MODES),
)


@dataclass(frozen=True)
class Parameter:
    """One parameter. `limits`: the values that can be set, in order; empty for one that is only read."""

    title: str
    limits: Sequence[int] = range(0)
    unit: str = ""
    fresh: int = 0
    live: bool = False
    """It shows a state of the moment: it is no setting, and nothing restores it."""
    known: bool = True
    """More than its number and its name is public."""

    @property
    def writable(self) -> bool:
        """Whether it can be set."""
        return len(self.limits) > 0

    @property
    def valid(self) -> str:
        """The values that can be set, in words."""
        if not self.known:
            return "range not known"
        if isinstance(self.limits, range):
            return f"{self.limits[0]} to {self.limits[-1]}"
        ends = [n for n in self.limits if n - 1 not in self.limits or n + 1 not in self.limits]
        return ", ".join(f"{low} to {high}" for low, high in zip(ends[::2], ends[1::2], strict=True))


SPEEDS = range(2**23)
AXIS: Mapping[int, Parameter] = MappingProxyType(
    {
        Axis.TARGET_POSITION: Parameter("target position; setting it starts a move", INT32, STEPS, live=True),
        Axis.ACTUAL_POSITION: Parameter("actual position; set it at rest, and 0 as well", INT32, STEPS, live=True),
        Axis.TARGET_VELOCITY: Parameter(
            "target velocity; setting it starts a rotation", range(-(2**23), 2**23), SPEED, live=True
        ),
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
            "reference search: 1 left; 2 right, left; 3 right, left twice; 4 left twice; 5, 8 home to the left; "
            "6, 7 home to the right; +64 right for left; +128 home inverted",
            SEARCH_MODES,
            "",
            1,
        ),
        Axis.SEARCH_SPEED: Parameter("reference search: velocity of the search", SPEEDS, SPEED, 51_200),
        Axis.SWITCH_SPEED: Parameter("reference search: velocity near the switch", SPEEDS, SPEED, 12_800),
        Axis.SWITCH_DISTANCE: Parameter("distance of the end switches, after modes 2 and 3", unit=STEPS),
        Axis.FREEWHEELING: Parameter("freewheeling: how, or after which time, the current is off at rest", INT32),
        Axis.LOAD: Parameter("load of the motor, as the driver measures it"),
        Axis.ERROR_FLAGS: Parameter("extended error flags; reading clears them"),
        Axis.DRIVER_FLAGS: Parameter("error flags of the driver"),
        Axis.UNIT_MODE: Parameter("unit of velocity and acceleration: 1 microsteps, 0 the chip's", INT32, "", 1),
    }
)
"""What manuals print of a parameter, on modules that count in microsteps."""
CHIP: Mapping[int, Parameter] = MappingProxyType(
    {
        Axis.TARGET_VELOCITY: replace(AXIS[Axis.TARGET_VELOCITY], limits=range(-2047, 2048), unit="of 2047"),
        Axis.ACTUAL_VELOCITY: replace(AXIS[Axis.ACTUAL_VELOCITY], unit="of 2047"),
        Axis.MAXIMUM_VELOCITY: replace(AXIS[Axis.MAXIMUM_VELOCITY], limits=range(2048), unit="of 2047", fresh=1000),
        Axis.MAXIMUM_ACCELERATION: replace(
            AXIS[Axis.MAXIMUM_ACCELERATION], limits=range(2048), unit="of 2047", fresh=500
        ),
        Axis.SEARCH_SPEED: replace(AXIS[Axis.SEARCH_SPEED], limits=range(2048), unit="of 2047", fresh=500),
        Axis.SWITCH_SPEED: replace(AXIS[Axis.SWITCH_SPEED], limits=range(2048), unit="of 2047", fresh=200),
        Axis.RAMP_DIVISOR: Parameter("ramp divisor: a power of 2 in the unit of acceleration", range(14), "", 7),
        Axis.PULSE_DIVISOR: Parameter("pulse divisor: a power of 2 in the unit of velocity", range(14), "", 3),
    }
)
"""The same on modules that count in units of a TMC428 or TMC429."""
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
        Global.DOWNLOAD_MODE: Parameter("1: the module stores every command as a line of its program"),
        Global.PROGRAM_COUNTER: Parameter("the address of the program's next line"),
    }
)
USER = Parameter("user variable; STGP keeps it without power", INT32)
USERS = range(256)
"""The numbers of the user variables, in bank 2."""
BAUDS: Mapping[int, int] = MappingProxyType(
    {0: 9600, 1: 14400, 2: 19200, 3: 28800, 4: 38400, 5: 57600, 6: 76800, 7: 115200}
)
"""Baud rates by the code in global parameter 65. The codes beyond 9600 are common knowledge, read in no manual."""

# Parameters of which number and name are public, and nothing else.

_NAMED: Mapping[int, str] = MappingProxyType(
    {
        14: "swap limit switches",
        15: "acceleration A1",
        16: "velocity V1",
        17: "maximum deceleration",
        18: "deceleration D1",
        19: "start velocity",
        20: "stop velocity",
        21: "ramp wait time",
        22: "high speed threshold",
        23: "minimum speed for dcStep",
        24: "right limit switch polarity",
        25: "left limit switch polarity",
        26: "soft stop",
        27: "high speed chopper mode",
        28: "high speed fullstep mode",
        29: "measured speed",
        31: "power down ramp",
        32: "dcStep time",
        33: "dcStep stallGuard",
        130: "minimum speed",
        135: "actual acceleration",
        138: "ramp mode",
        141: "reference switch tolerance",
        149: "soft stop flag",
        150: "end switch power down",
        160: "step interpolation",
        161: "double edge steps",
        162: "chopper blank time",
        163: "constant TOff mode",
        164: "disable fast decay comparator",
        165: "chopper hysteresis end",
        166: "chopper hysteresis start",
        167: "chopper off time",
        168: "smart energy current minimum",
        169: "smart energy current down step",
        170: "smart energy hysteresis",
        171: "smart energy current up step",
        172: "smart energy hysteresis start",
        173: "stallGuard2 filter enable",
        174: "stallGuard2 threshold",
        175: "slope control high side",
        176: "slope control low side",
        177: "short to ground protection",
        178: "short detection time",
        179: "VSense",
        180: "smart energy actual current",
        181: "smart energy stall velocity",
        182: "smart energy threshold speed",
        183: "smart energy slow run current",
        184: "random TOff mode",
        185: "chopper synchronization",
        186: "PWM threshold speed",
        187: "PWM gradient",
        188: "PWM amplitude",
        189: "PWM scale",
        190: "PWM mode",
        191: "PWM frequency",
        192: "PWM autoscale",
        197: "last reference switch position",
        200: "boost current",
        201: "encoder mode",
        202: "fullstep resolution",
        209: "encoder position",
        210: "encoder resolution",
        212: "maximum encoder deviation",
        213: "group index",
        214: "power down delay",
        215: "absolute resolver value",
        216: "external encoder position",
        217: "external encoder resolution",
        218: "external encoder maximum deviation",
        251: "reverse shaft",
        254: "step/direction mode",
    }
)
_NAMED_GLOBAL: Mapping[int, str] = MappingProxyType(
    {
        67: "ASCII mode",
        68: "serial heartbeat",
        69: "CAN bit rate",
        70: "CAN send ID",
        71: "CAN receive ID",
        79: "end switch polarity",
        81: "program protection",
        82: "CAN heartbeat",
        83: "CAN secondary address",
        84: "coordinates in EEPROM",
        85: "zero user variables",
        87: "serial secondary address",
        90: "reverse shaft direction",
        131: "last TMCL error",
        132: "tick timer",
        133: "random number",
        255: "suppress reply",
    }
)
_LIVE = frozenset({29, 135, 180, 189, 197, 209, 215, 216})
_LIVE_GLOBAL = frozenset({131, 132, 133})


def _interrupt(number: int) -> str:
    """The name of a parameter of bank 3: timers, stop switches of motors, inputs."""
    if number < 27:
        return f"interrupt: timer {number}"
    motor, right = divmod(number - 27, 2)
    return (
        f"interrupt: input {number - 39}" if number > 38 else f"interrupt: {'right' if right else 'left'} stop {motor}"
    )


@dataclass(frozen=True)
class Module:
    """One module. `banks` are its global parameters; ports of `inputs`, `analog` and `outputs` are as GIO and SIO take.

    `wrong_motor`: its status for a motor that it lacks. `chip_units`: it counts in units of its chip.
    """

    version: str
    axis: Mapping[int, Parameter]
    banks: Mapping[int, Mapping[int, Parameter]]
    motors: int = 1
    inputs: Sequence[int] = ()
    outputs: Sequence[int] = ()
    analog: Sequence[int] = ()
    chip_units: bool = False
    wrong_motor: Status = Status.WRONG_TYPE


def _numbers(text: str) -> Iterator[int]:
    for part in text.split(","):
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)


VOLTAGE, TEMPERATURE = 8, 9
"""Analog ports of every module: its supply voltage and its temperature."""


def _module(
    version: str,
    axis: str,
    bank_0: str,
    bank_3: str,
    inputs: Sequence[int],
    outputs: int,
    *,
    motors: int = 1,
    analog: Sequence[int] = (),
    chip_units: bool = False,
) -> Module:
    known = {**AXIS, **CHIP} if chip_units else AXIS

    return Module(
        version,
        {
            number: known.get(number) or Parameter(_NAMED[number], INT32, live=number in _LIVE, known=False)
            for number in _numbers(axis)
        },
        {
            0: {
                number: GLOBAL.get(number)
                or Parameter(_NAMED_GLOBAL[number], INT32, live=number in _LIVE_GLOBAL, known=False)
                for number in _numbers(bank_0)
            },
            2: dict.fromkeys(USERS, USER),
            3: {number: Parameter(_interrupt(number), INT32, known=False) for number in _numbers(bank_3)},
        },
        motors,
        inputs,
        range(outputs),
        (*analog, VOLTAGE, TEMPERATURE),
        chip_units,
        Status.INVALID_VALUE if chip_units else Status.WRONG_TYPE,
    )


_CHIP = "0-13,130,135,138,140-141,149-150,153-154,160-184,193-197,200,204,206-208"
_STEPS = "0-29,31-33,127,140,162-174,180-182,184-197,202,204,206-210,212,214,255"
_ONE_AXIS = "0-2,27-28,39-42"
MODULES: Mapping[str, Module] = MappingProxyType(
    {
        "1140": _module(
            "1140V127",
            f"{_CHIP},209-210,212,214-218",
            "65-66,68-71,75-77,79,81-85,87,90,128,130,132-133,255",
            _ONE_AXIS,
            range(4),
            2,
            chip_units=True,
        ),
        "1141": _module(
            "1141V115",
            f"{_CHIP},214",
            "65-68,75-77,79,81,84-85,87,90,128-133,255",
            _ONE_AXIS,
            (0, 1, 2, 4),
            2,
            chip_units=True,
        ),
        "1161": _module(
            "1161V115",
            f"{_CHIP},209-210,212,214-215,254",
            "65-66,68,75-77,79,81,84-85,87,90,128-130,132-133,255",
            _ONE_AXIS,
            range(4),
            2,
            chip_units=True,
        ),
        "1240": _module(
            "1240V145",
            f"{_STEPS},160-161,178,215-218,251,254",
            "65-66,68-71,75-77,81-85,87,128-130,132-133,255",
            _ONE_AXIS,
            range(2),
            2,
        ),
        "1241": _module(
            "1241V115",
            f"{_STEPS},160-161,178,215-218,251,254",
            "65-66,68-71,75-77,81-85,87,128-130,132-133,255",
            _ONE_AXIS,
            range(2),
            2,
        ),
        "1276": _module(
            "1276V115", f"{_STEPS},177,201", "69-71,77,81-85,128,130,132-133,255", "0-2,27-28,39-41", range(3), 0
        ),
        "3110": _module(
            "3110V115",
            f"{_CHIP},201,209-210,212-214,254",
            "65-66,68-71,75-77,79,81-85,87,90,128,130,132-133,255",
            "0-2,27-32,39-46",
            range(8),
            8,
            motors=3,
            analog=(0, 4),
            chip_units=True,
        ),
        "6110": _module(
            "6110V146",
            f"{_CHIP},213-214",
            "65-66,68-71,75-77,79,81-85,87,90,128,130,132-133,255",
            "0-2,27-46",
            range(8),
            8,
            motors=6,
            analog=(0, 4),
            chip_units=True,
        ),
    }
)
"""By the number in the module's name."""
COMMON = Module("", {number: row for number, row in AXIS.items() if number != Axis.UNIT_MODE}, {0: GLOBAL})
"""What one-axis modules have in common; for a module without a table."""
PREFIX = "TMCM"


def module_of(product: str) -> Module:
    """The table of a product such as `TMCM-1241`; `TMCM` is that one, any other product has what all have in common."""
    return MODULES["1241"] if product == PREFIX else MODULES.get(product.removeprefix(f"{PREFIX}-"), COMMON)
