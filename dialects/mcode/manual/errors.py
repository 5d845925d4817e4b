"""The numbers of a drive's error register, with meaning and remedy of each (MCode reference, section 10)."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType

# The numbers of a drive's error register (MCode reference, section 10).


class ErrorNumber(IntEnum):
    """The numbers of a drive's error register, named by their meaning on a Lexium MDrive."""

    NONE = 0
    OVERCURRENT_OUTPUT_1 = 1
    OVERCURRENT_OUTPUT_2 = 2
    TYPE_IN_USE = 6
    POINT_NOT_SET_UP = 7
    WRONG_POINT_TYPE = 8
    NOT_USER_OUTPUT = 9
    NO_SUCH_POINT = 10
    WRONG_CLOCK_TYPE = 11
    NOT_CAPTURE_INPUT = 12
    OVERCURRENT_PHASE = 13
    HELD_DISABLED = 14
    UNKNOWN_VARIABLE = 20
    OUT_OF_RANGE = 21
    VI_NOT_BELOW_VM = 22
    VM_NOT_ABOVE_VI = 23
    ILLEGAL_DATA = 24
    READ_ONLY = 25
    NOT_STEPPABLE = 26
    TRIP_NOT_SET_UP = 27
    NAME_EXISTS = 28
    NAME_IS_COMMAND = 29
    NO_SUCH_NAME = 30
    NAME_TABLE_FULL = 31
    LABEL_NOT_SETTABLE = 32
    INSTRUCTION_NOT_SETTABLE = 33
    NOT_EXECUTABLE = 34
    NOT_PRINTABLE = 35
    ENCODER_RATIO = 36
    NOT_AVAILABLE = 37
    NO_SEPARATOR = 38
    TRIPS_EXCLUSIVE = 39
    NO_PROGRAM_RUNNING = 40
    PROGRAM_RUNNING = 41
    NO_SUCH_ADDRESS = 42
    STACK_FULL = 43
    PROGRAM_LOCKED = 44
    PROGRAM_MEMORY_FULL = 45
    NOT_IN_PROGRAM_MODE = 46
    ILLEGAL_FLASH_ADDRESS = 47
    PROGRAM_STOPPED_BY_INPUT = 48
    UNKNOWN_COMMAND = 60
    NO_SUCH_BAUD = 61
    INPUT_PENDING = 62
    CHARACTERS_TOO_FAST = 63
    POWER_UP_CALIBRATION_FAILED = 64
    INTERNAL_BUS = 65
    TRANSMIT_BUFFER_FULL = 66
    FLASH_DAMAGED = 70
    TEMPERATURE_WARNING = 71
    OVERTEMPERATURE = 72
    MOVING_SAVE = 73
    MOVING_CLEAR = 74
    POWER_STAGE = 75
    MAKE_UP_FREQUENCY = 76
    VELOCITY_TOO_HIGH = 77
    AUXILIARY_VOLTAGE = 78
    MOTOR_VOLTAGE = 79
    NO_HOME_INPUT = 80
    NO_HOMING_TYPE = 81
    NO_HOME_SWITCH = 82
    PLUS_LIMIT = 83
    MINUS_LIMIT = 84
    HOMING_OR_MOVING = 85
    STALL = 86
    AS_WHILE_MOVING = 87
    MOVE_WHILE_CALIBRATING = 88
    CALIBRATION_WHILE_MOVING = 89
    VELOCITY_TOO_LOW = 90
    MOTION_STOPPED_BY_INPUT = 91
    POSITION_OFF = 92
    STILL_CORRECTING = 93
    DRIVE_DISABLED = 94
    DIRECTION_WHILE_MOVING = 95
    NO_MOTOR_VOLTAGE = 96
    FINAL_VELOCITY_TOO_LOW = 97
    NO_ACCELERATION_FITS = 98
    NO_DECELERATION_FITS = 99
    ENCODER_RESOLUTION_WRONG = 100
    ENCODER_DIRECTION_WRONG = 101
    ENCODER_BOTH_WRONG = 102
    NOT_TESTED = 103
    LOCKED_ROTOR = 104
    LEAD_LAG_MAXIMUM = 105
    LEAD_LIMIT = 106
    LAG_LIMIT = 107
    LEAD_LAG_LEFT = 108
    CALIBRATION_FAILED = 109
    MAKE_UP_OFF = 110
    FACTORY_CALIBRATION_FAILED = 111


JOG_IN_CLOCK_MODE = ErrorNumber.AS_WHILE_MOVING
FOLLOWING_ERROR = ErrorNumber.MOVE_WHILE_CALIBRATING
CF_WHILE_MOVING = ErrorNumber.DRIVE_DISABLED
"""Three numbers by their meaning on an MDrivePlus."""

BY_ITSELF = frozenset(
    {
        ErrorNumber.OVERCURRENT_OUTPUT_1,
        ErrorNumber.OVERCURRENT_OUTPUT_2,
        ErrorNumber.OVERCURRENT_PHASE,
        ErrorNumber.PROGRAM_STOPPED_BY_INPUT,
        ErrorNumber.INTERNAL_BUS,
        ErrorNumber.TRANSMIT_BUFFER_FULL,
        ErrorNumber.FLASH_DAMAGED,
        ErrorNumber.TEMPERATURE_WARNING,
        ErrorNumber.OVERTEMPERATURE,
        ErrorNumber.POWER_STAGE,
        ErrorNumber.AUXILIARY_VOLTAGE,
        ErrorNumber.MOTOR_VOLTAGE,
        ErrorNumber.NO_HOME_SWITCH,
        ErrorNumber.PLUS_LIMIT,
        ErrorNumber.MINUS_LIMIT,
        ErrorNumber.STALL,
        ErrorNumber.MOTION_STOPPED_BY_INPUT,
        ErrorNumber.POSITION_OFF,
        ErrorNumber.NO_MOTOR_VOLTAGE,
        ErrorNumber.ENCODER_RESOLUTION_WRONG,
        ErrorNumber.ENCODER_DIRECTION_WRONG,
        ErrorNumber.ENCODER_BOTH_WRONG,
        ErrorNumber.LOCKED_ROTOR,
        ErrorNumber.LEAD_LAG_MAXIMUM,
        ErrorNumber.LEAD_LIMIT,
        ErrorNumber.LAG_LIMIT,
        ErrorNumber.LEAD_LAG_LEFT,
        ErrorNumber.CALIBRATION_FAILED,
    }
)
"""Errors without a wrong line: limits, stalls, heat, supply, the end of a homing or a move."""


# Meaning and remedy of each number of a drive's error register (MCode reference, section 10).


_COMMON: dict[int, str] = {
    ErrorNumber.NONE: "no error",
    ErrorNumber.OVERCURRENT_OUTPUT_1: "overcurrent on output 1",
    ErrorNumber.OVERCURRENT_OUTPUT_2: "overcurrent on output 2",
    ErrorNumber.TYPE_IN_USE: "another input or output already has this type",
    ErrorNumber.POINT_NOT_SET_UP: "this input or output is not set up for use",
    ErrorNumber.WRONG_POINT_TYPE: "this type does not fit this input or output",
    ErrorNumber.NOT_USER_OUTPUT: "not a user output: it cannot be written",
    ErrorNumber.NO_SUCH_POINT: "no such input or output",
    ErrorNumber.WRONG_CLOCK_TYPE: "wrong clock type",
    ErrorNumber.NOT_CAPTURE_INPUT: "input 1 is not of type capture",
    ErrorNumber.UNKNOWN_VARIABLE: "unknown variable or flag",
    ErrorNumber.OUT_OF_RANGE: "value out of range or not allowed",
    ErrorNumber.VI_NOT_BELOW_VM: "VI must be below VM",
    ErrorNumber.VM_NOT_ABOVE_VI: "VM must be above VI",
    ErrorNumber.ILLEGAL_DATA: "illegal data",
    ErrorNumber.READ_ONLY: "read only",
    ErrorNumber.NOT_STEPPABLE: "this cannot be incremented or decremented",
    ErrorNumber.TRIP_NOT_SET_UP: "the trip is not set up",
    ErrorNumber.NAME_EXISTS: "the label or global variable exists already",
    ErrorNumber.NAME_IS_COMMAND: "the name is a command of the drive",
    ErrorNumber.NO_SUCH_NAME: "no such label or user variable",
    ErrorNumber.NAME_TABLE_FULL: "no room for more labels and variables",
    ErrorNumber.LABEL_NOT_SETTABLE: "a label cannot be set",
    ErrorNumber.INSTRUCTION_NOT_SETTABLE: "an instruction cannot be set",
    ErrorNumber.NOT_EXECUTABLE: "a variable or flag cannot be executed",
    ErrorNumber.NOT_PRINTABLE: "this cannot be printed",
    ErrorNumber.ENCODER_RATIO: "microsteps do not fit the encoder's counts",
    ErrorNumber.NOT_AVAILABLE: "not available in this drive",
    ErrorNumber.NO_SEPARATOR: "a separator between parameters is missing",
    ErrorNumber.TRIPS_EXCLUSIVE: "trips on position and on relative position exclude each other",
    ErrorNumber.NO_PROGRAM_RUNNING: "no program is running",
    ErrorNumber.PROGRAM_RUNNING: "a program is running",
    ErrorNumber.NO_SUCH_ADDRESS: "no such program address",
    ErrorNumber.STACK_FULL: "too many calls within calls",
    ErrorNumber.PROGRAM_LOCKED: "the program is locked",
    ErrorNumber.PROGRAM_MEMORY_FULL: "program memory is full",
    ErrorNumber.NOT_IN_PROGRAM_MODE: "program mode is not on",
    ErrorNumber.ILLEGAL_FLASH_ADDRESS: "illegal flash address",
    ErrorNumber.PROGRAM_STOPPED_BY_INPUT: "an input of type stop ended the program",
    ErrorNumber.UNKNOWN_COMMAND: "unknown command",
    ErrorNumber.NO_SUCH_BAUD: "no such baud rate",
    ErrorNumber.INPUT_PENDING: "input for a variable is already awaited",
    ErrorNumber.CHARACTERS_TOO_FAST: "characters came too fast",
    ErrorNumber.INTERNAL_BUS: "internal bus error (SPI)",
    ErrorNumber.TRANSMIT_BUFFER_FULL: "a program printed more than could be sent",
    ErrorNumber.FLASH_DAMAGED: "flash memory is damaged (checksum)",
    ErrorNumber.TEMPERATURE_WARNING: "warning temperature exceeded",
    ErrorNumber.OVERTEMPERATURE: "too hot: the drive has switched itself off",
    ErrorNumber.MOVING_SAVE: "not while moving: save, factory defaults, program mode",
    ErrorNumber.MOVING_CLEAR: "not while moving: IP, CP",
    ErrorNumber.POWER_STAGE: "fault in the power stage (current, temperature or other)",
    ErrorNumber.MAKE_UP_FREQUENCY: "make-up frequency out of range",
    ErrorNumber.VELOCITY_TOO_HIGH: "velocity too high for this microstep resolution",
    ErrorNumber.MOTOR_VOLTAGE: "+V out of range",
    ErrorNumber.NO_HOME_INPUT: "no input is of type home",
    ErrorNumber.NO_HOMING_TYPE: "no homing type given",
    ErrorNumber.NO_HOME_SWITCH: "both limits reached, and no home switch found",
    ErrorNumber.PLUS_LIMIT: "plus limit reached",
    ErrorNumber.MINUS_LIMIT: "minus limit reached",
    ErrorNumber.HOMING_OR_MOVING: "no move while homing, no homing while moving",
    ErrorNumber.STALL: "stall",
    ErrorNumber.VELOCITY_TOO_LOW: "VI or VM too low",
    ErrorNumber.MOTION_STOPPED_BY_INPUT: "an input of type stop ended the motion",
    ErrorNumber.POSITION_OFF: "position is off by too much",
    ErrorNumber.STILL_CORRECTING: "the end of the last move is still being corrected",
    ErrorNumber.DRIVE_DISABLED: "the drive is disabled",
    ErrorNumber.DIRECTION_WHILE_MOVING: "direction cannot be reversed while moving",
    ErrorNumber.NO_MOTOR_VOLTAGE: "no +V",
    ErrorNumber.FINAL_VELOCITY_TOO_LOW: "final velocity would be below VI",
    ErrorNumber.NO_ACCELERATION_FITS: "no S-curve acceleration fits this move",
    ErrorNumber.NO_DECELERATION_FITS: "no S-curve deceleration fits this move",
}
_DRIVE_ONLY: dict[int, str] = {
    ErrorNumber.AUXILIARY_VOLTAGE: "auxiliary voltage out of range",
    ErrorNumber.AS_WHILE_MOVING: "AS cannot change while moving",
    ErrorNumber.MOVE_WHILE_CALIBRATING: "no move during calibration",
    ErrorNumber.CALIBRATION_WHILE_MOVING: "no calibration while moving",
    ErrorNumber.ENCODER_RESOLUTION_WRONG: "configuration test: encoder resolution is wrong",
    ErrorNumber.ENCODER_DIRECTION_WRONG: "configuration test: encoder direction is wrong",
    ErrorNumber.ENCODER_BOTH_WRONG: "configuration test: encoder resolution and direction are wrong",
    ErrorNumber.NOT_TESTED: "configuration test not done: drive not enabled",
    ErrorNumber.LOCKED_ROTOR: "locked rotor",
    ErrorNumber.LEAD_LAG_MAXIMUM: "greatest lead or lag reached",
    ErrorNumber.LEAD_LIMIT: "lead limit reached",
    ErrorNumber.LAG_LIMIT: "lag limit reached",
    ErrorNumber.LEAD_LAG_LEFT: "lead or lag left at the end of the move",
    ErrorNumber.CALIBRATION_FAILED: "hMT calibration failed: drive not enabled",
    ErrorNumber.MAKE_UP_OFF: "make-up is off",
    ErrorNumber.FACTORY_CALIBRATION_FAILED: "factory calibration of hMT failed",
}
_MDRIVE_LACKS = frozenset(
    {
        ErrorNumber.OVERCURRENT_OUTPUT_1,
        ErrorNumber.OVERCURRENT_OUTPUT_2,
        ErrorNumber.POINT_NOT_SET_UP,
        ErrorNumber.INTERNAL_BUS,
        ErrorNumber.TRANSMIT_BUFFER_FULL,
        ErrorNumber.MAKE_UP_FREQUENCY,
        ErrorNumber.VELOCITY_TOO_HIGH,
        ErrorNumber.AUXILIARY_VOLTAGE,
        ErrorNumber.MOTOR_VOLTAGE,
        ErrorNumber.DRIVE_DISABLED,
        ErrorNumber.DIRECTION_WHILE_MOVING,
        ErrorNumber.NO_MOTOR_VOLTAGE,
        ErrorNumber.FINAL_VELOCITY_TOO_LOW,
        ErrorNumber.NO_ACCELERATION_FITS,
        ErrorNumber.NO_DECELERATION_FITS,
        ErrorNumber.MAKE_UP_OFF,
        ErrorNumber.FACTORY_CALIBRATION_FAILED,
    }
)
_MDRIVE_ONLY: dict[int, str] = {
    ErrorNumber.UNKNOWN_VARIABLE: "unknown variable, flag or command",
    ErrorNumber.NOT_CAPTURE_INPUT: "the trip or capture is not set up for this point",
    ErrorNumber.PROGRAM_RUNNING: "a program is running, or too many calls within calls",
    ErrorNumber.POWER_UP_CALIBRATION_FAILED: "calibration at power-up failed",
    ErrorNumber.POWER_STAGE: "fault in the power stage (temperature)",
    ErrorNumber.AS_WHILE_MOVING: "no jog while the clock mode is on",
    ErrorNumber.MOVE_WHILE_CALIBRATING: "following error",
    ErrorNumber.CALIBRATION_WHILE_MOVING: "not during calibration",
    ErrorNumber.VELOCITY_TOO_LOW: "VI or VM too low to be counted by the encoder",
    ErrorNumber.POSITION_OFF: "position is off by too much after three tries",
    ErrorNumber.DRIVE_DISABLED: "CF not while moving",
}
"""Meanings of the same numbers on an MDrivePlus. Most above 100 are a Hybrid's."""
_MODULE_ONLY: dict[int, str] = {
    ErrorNumber.OVERCURRENT_PHASE: "overcurrent in a motor phase",
    ErrorNumber.HELD_DISABLED: "the enable input holds the module disabled",
}


def _mdrive() -> dict[int, str]:
    state = {code: text for code, text in {**_COMMON, **_DRIVE_ONLY}.items() if code not in _MDRIVE_LACKS}
    return dict(sorted({**state, **_MDRIVE_ONLY}.items()))


TEXTS: Mapping[str, Mapping[int, str]] = MappingProxyType(
    {
        "LMD": MappingProxyType(dict(sorted({**_COMMON, **_DRIVE_ONLY}.items()))),
        "LMM": MappingProxyType(dict(sorted({**_COMMON, **_MODULE_ONLY}.items()))),
        "MDI": MappingProxyType(_mdrive()),
    }
)
"""Number to text, for the Lexium MDrive (LMD), the Lexium Motion Module (LMM) and MDrivePlus (MDI)."""

_HINTS: dict[int, str] = {
    ErrorNumber.NOT_USER_OUTPUT: "set it up with OS=<n>,16,<active>",
    ErrorNumber.UNKNOWN_VARIABLE: "check the name, and that the line has no more than 64 characters",
    ErrorNumber.OUT_OF_RANGE: "/help NAME shows the range",
    ErrorNumber.VI_NOT_BELOW_VM: "lower VI or raise VM first",
    ErrorNumber.VM_NOT_ABOVE_VI: "lower VI or raise VM first",
    ErrorNumber.ILLEGAL_DATA: "check the parameters; names that are reserved for the maker give this too",
    ErrorNumber.READ_ONLY: "it can only be read",
    ErrorNumber.TRIP_NOT_SET_UP: "set the trip up (TI, TP, TC, TT, TR, TA, TM) before TE",
    ErrorNumber.NAME_EXISTS: "clear the old program with CP first, or choose another name",
    ErrorNumber.NAME_IS_COMMAND: "choose another name",
    ErrorNumber.NO_SUCH_NAME: "check the name; labels of a program exist once it is stored",
    ErrorNumber.NOT_AVAILABLE: "/help NAME lists its products",
    ErrorNumber.NO_SEPARATOR: "parameters are separated by commas",
    ErrorNumber.TRIPS_EXCLUSIVE: "use only one of TP and TR",
    ErrorNumber.PROGRAM_RUNNING: "end the program first, with E or a stop",
    ErrorNumber.NO_SUCH_ADDRESS: "check the address or label; L lists the program",
    ErrorNumber.STACK_FULL: "leave every subroutine with RT",
    ErrorNumber.PROGRAM_LOCKED: "LK=0 opens a lock that was not saved; else CP or FD, which erase the program",
    ErrorNumber.PROGRAM_MEMORY_FULL: "CP clears program memory",
    ErrorNumber.UNKNOWN_COMMAND: "check the spelling; /help NAME explains a word",
    ErrorNumber.NO_SUCH_BAUD: "BD takes 48, 96, 19, 38 or 11",
    ErrorNumber.CHARACTERS_TOO_FAST: "leave time between commands",
    ErrorNumber.TRANSMIT_BUFFER_FULL: "print less often, or read faster",
    ErrorNumber.OVERTEMPERATURE: "let it cool down, lower RC, then switch power off and on",
    ErrorNumber.MOVING_SAVE: "stop first (SL 0), then try again",
    ErrorNumber.MOVING_CLEAR: "stop first (SL 0), then try again",
    ErrorNumber.MAKE_UP_FREQUENCY: "MF takes 92 up to VM",
    ErrorNumber.VELOCITY_TOO_HIGH: "lower the velocity or raise MS",
    ErrorNumber.MOTOR_VOLTAGE: "check the supply; PR VT shows the voltage",
    ErrorNumber.NO_HOME_INPUT: "set one up with IS=<n>,1,<active>",
    ErrorNumber.NO_HOME_SWITCH: "check the home switch and its wiring",
    ErrorNumber.PLUS_LIMIT: "move in the minus direction to get off it",
    ErrorNumber.MINUS_LIMIT: "move in the plus direction to get off it",
    ErrorNumber.HOMING_OR_MOVING: "wait until the axis is at rest",
    ErrorNumber.STALL: "check the load, RC and A; ST=0 clears the flag",
    ErrorNumber.AS_WHILE_MOVING: "stop first (SL 0), then try again",
    ErrorNumber.VELOCITY_TOO_LOW: "raise VI or VM",
    ErrorNumber.STILL_CORRECTING: "wait until MP is 0",
    ErrorNumber.DRIVE_DISABLED: "DE=1 enables it",
    ErrorNumber.DIRECTION_WHILE_MOVING: "stop first (SL 0), then try again",
    ErrorNumber.NO_MOTOR_VOLTAGE: "switch the motor supply on; PR VT shows the voltage",
    ErrorNumber.NOT_TESTED: "DE=1 enables it",
    ErrorNumber.LOCKED_ROTOR: "free the shaft, then CF",
    ErrorNumber.LEAD_LIMIT: "check the load and lower D",
    ErrorNumber.LAG_LIMIT: "check the load and lower A",
    ErrorNumber.CALIBRATION_FAILED: "DE=1 enables it",
}
_MDRIVE_HINTS: dict[int, str] = {
    ErrorNumber.NOT_USER_OUTPUT: "set the point up with S<n>=16,<active>",
    ErrorNumber.NOT_CAPTURE_INPUT: "S13=60,<0/1> makes point 13 a capture input",
    ErrorNumber.POWER_STAGE: "let it cool down",
    ErrorNumber.NO_HOME_INPUT: "set one up with S<n>=1,<active>",
    ErrorNumber.AS_WHILE_MOVING: "CM=0 switches the clock mode off",
    ErrorNumber.MOVE_WHILE_CALIBRATING: "check the load",
    ErrorNumber.DRIVE_DISABLED: "stop first (SL 0), then try again",
}

UNKNOWN = "unknown error"


def text(code: int, family: str = "LMD") -> str:
    """Return the meaning of an error number; "unknown error" for a number without one.

    `family` is LMD, LMM or MDI, or the name of a product, which begins with one; LMD for any other text.
    """
    return TEXTS[_family(family)].get(code, UNKNOWN)


def hint(code: int, family: str = "LMD") -> str:
    if _family(family) == "MDI":
        return _MDRIVE_HINTS.get(code, _HINTS.get(code, "") if code in TEXTS["MDI"] else "")
    return _HINTS.get(code, "")


def _family(name: str) -> str:
    return next((family for family in ("LMM", "MDI") if name.upper().startswith(family)), "LMD")
