"""Meaning and remedy of each number of a drive's error register (MCode reference, section 10)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E

_COMMON: dict[int, str] = {
    E.NONE: "no error",
    E.OVERCURRENT_OUTPUT_1: "overcurrent on output 1",
    E.OVERCURRENT_OUTPUT_2: "overcurrent on output 2",
    E.TYPE_IN_USE: "another input or output already has this type",
    E.POINT_NOT_SET_UP: "this input or output is not set up for use",
    E.WRONG_POINT_TYPE: "this type does not fit this input or output",
    E.NOT_USER_OUTPUT: "not a user output: it cannot be written",
    E.NO_SUCH_POINT: "no such input or output",
    E.WRONG_CLOCK_TYPE: "wrong clock type",
    E.NOT_CAPTURE_INPUT: "input 1 is not of type capture",
    E.UNKNOWN_VARIABLE: "unknown variable or flag",
    E.OUT_OF_RANGE: "value out of range or not allowed",
    E.VI_NOT_BELOW_VM: "VI must be below VM",
    E.VM_NOT_ABOVE_VI: "VM must be above VI",
    E.ILLEGAL_DATA: "illegal data",
    E.READ_ONLY: "read only",
    E.NOT_STEPPABLE: "this cannot be incremented or decremented",
    E.TRIP_NOT_SET_UP: "the trip is not set up",
    E.NAME_EXISTS: "the label or global variable exists already",
    E.NAME_IS_COMMAND: "the name is a command of the drive",
    E.NO_SUCH_NAME: "no such label or user variable",
    E.NAME_TABLE_FULL: "no room for more labels and variables",
    E.LABEL_NOT_SETTABLE: "a label cannot be set",
    E.INSTRUCTION_NOT_SETTABLE: "an instruction cannot be set",
    E.NOT_EXECUTABLE: "a variable or flag cannot be executed",
    E.NOT_PRINTABLE: "this cannot be printed",
    E.ENCODER_RATIO: "microsteps do not fit the encoder's counts",
    E.NOT_AVAILABLE: "not available in this drive",
    E.NO_SEPARATOR: "a separator between parameters is missing",
    E.TRIPS_EXCLUSIVE: "trips on position and on relative position exclude each other",
    E.NO_PROGRAM_RUNNING: "no program is running",
    E.PROGRAM_RUNNING: "a program is running",
    E.NO_SUCH_ADDRESS: "no such program address",
    E.STACK_FULL: "too many calls within calls",
    E.PROGRAM_LOCKED: "the program is locked",
    E.PROGRAM_MEMORY_FULL: "program memory is full",
    E.NOT_IN_PROGRAM_MODE: "program mode is not on",
    E.ILLEGAL_FLASH_ADDRESS: "illegal flash address",
    E.PROGRAM_STOPPED_BY_INPUT: "an input of type stop ended the program",
    E.UNKNOWN_COMMAND: "unknown command",
    E.NO_SUCH_BAUD: "no such baud rate",
    E.INPUT_PENDING: "input for a variable is already awaited",
    E.CHARACTERS_TOO_FAST: "characters came too fast",
    E.INTERNAL_BUS: "internal bus error (SPI)",
    E.TRANSMIT_BUFFER_FULL: "a program printed more than could be sent",
    E.FLASH_DAMAGED: "flash memory is damaged (checksum)",
    E.TEMPERATURE_WARNING: "warning temperature exceeded",
    E.OVERTEMPERATURE: "too hot: the drive has switched itself off",
    E.MOVING_SAVE: "not while moving: save, factory defaults, program mode",
    E.MOVING_CLEAR: "not while moving: IP, CP",
    E.POWER_STAGE: "fault in the power stage (current, temperature or other)",
    E.MAKE_UP_FREQUENCY: "make-up frequency out of range",
    E.VELOCITY_TOO_HIGH: "velocity too high for this microstep resolution",
    E.MOTOR_VOLTAGE: "+V out of range",
    E.NO_HOME_INPUT: "no input is of type home",
    E.NO_HOMING_TYPE: "no homing type given",
    E.NO_HOME_SWITCH: "both limits reached, and no home switch found",
    E.PLUS_LIMIT: "plus limit reached",
    E.MINUS_LIMIT: "minus limit reached",
    E.HOMING_OR_MOVING: "no move while homing, no homing while moving",
    E.STALL: "stall",
    E.VELOCITY_TOO_LOW: "VI or VM too low",
    E.MOTION_STOPPED_BY_INPUT: "an input of type stop ended the motion",
    E.POSITION_OFF: "position is off by too much",
    E.STILL_CORRECTING: "the end of the last move is still being corrected",
    E.DRIVE_DISABLED: "the drive is disabled",
    E.DIRECTION_WHILE_MOVING: "direction cannot be reversed while moving",
    E.NO_MOTOR_VOLTAGE: "no +V",
    E.FINAL_VELOCITY_TOO_LOW: "final velocity would be below VI",
    E.NO_ACCELERATION_FITS: "no S-curve acceleration fits this move",
    E.NO_DECELERATION_FITS: "no S-curve deceleration fits this move",
}
_DRIVE_ONLY: dict[int, str] = {
    E.AUXILIARY_VOLTAGE: "auxiliary voltage out of range",
    E.AS_WHILE_MOVING: "AS cannot change while moving",
    E.MOVE_WHILE_CALIBRATING: "no move during calibration",
    E.CALIBRATION_WHILE_MOVING: "no calibration while moving",
    E.ENCODER_RESOLUTION_WRONG: "configuration test: encoder resolution is wrong",
    E.ENCODER_DIRECTION_WRONG: "configuration test: encoder direction is wrong",
    E.ENCODER_BOTH_WRONG: "configuration test: encoder resolution and direction are wrong",
    E.NOT_TESTED: "configuration test not done: drive not enabled",
    E.LOCKED_ROTOR: "locked rotor",
    E.LEAD_LAG_MAXIMUM: "greatest lead or lag reached",
    E.LEAD_LIMIT: "lead limit reached",
    E.LAG_LIMIT: "lag limit reached",
    E.LEAD_LAG_LEFT: "lead or lag left at the end of the move",
    E.CALIBRATION_FAILED: "hMT calibration failed: drive not enabled",
    E.MAKE_UP_OFF: "make-up is off",
    E.FACTORY_CALIBRATION_FAILED: "factory calibration of hMT failed",
}
_MDRIVE_LACKS = frozenset(
    {
        E.OVERCURRENT_OUTPUT_1,
        E.OVERCURRENT_OUTPUT_2,
        E.POINT_NOT_SET_UP,
        E.INTERNAL_BUS,
        E.TRANSMIT_BUFFER_FULL,
        E.MAKE_UP_FREQUENCY,
        E.VELOCITY_TOO_HIGH,
        E.AUXILIARY_VOLTAGE,
        E.MOTOR_VOLTAGE,
        E.DRIVE_DISABLED,
        E.DIRECTION_WHILE_MOVING,
        E.NO_MOTOR_VOLTAGE,
        E.FINAL_VELOCITY_TOO_LOW,
        E.NO_ACCELERATION_FITS,
        E.NO_DECELERATION_FITS,
        E.MAKE_UP_OFF,
        E.FACTORY_CALIBRATION_FAILED,
    }
)
_MDRIVE_ONLY: dict[int, str] = {
    E.UNKNOWN_VARIABLE: "unknown variable, flag or command",
    E.NOT_CAPTURE_INPUT: "the trip or capture is not set up for this point",
    E.PROGRAM_RUNNING: "a program is running, or too many calls within calls",
    E.POWER_UP_CALIBRATION_FAILED: "calibration at power-up failed",
    E.POWER_STAGE: "fault in the power stage (temperature)",
    E.AS_WHILE_MOVING: "no jog while the clock mode is on",
    E.MOVE_WHILE_CALIBRATING: "following error",
    E.CALIBRATION_WHILE_MOVING: "not during calibration",
    E.VELOCITY_TOO_LOW: "VI or VM too low to be counted by the encoder",
    E.POSITION_OFF: "position is off by too much after three tries",
    E.DRIVE_DISABLED: "CF not while moving",
}
"""Meanings of the same numbers on an MDrivePlus. Most above 100 are a Hybrid's."""
_MODULE_ONLY: dict[int, str] = {
    E.OVERCURRENT_PHASE: "overcurrent in a motor phase",
    E.HELD_DISABLED: "the enable input holds the module disabled",
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
    E.NOT_USER_OUTPUT: "set it up with OS=<n>,16,<active>",
    E.UNKNOWN_VARIABLE: "check the name, and that the line has no more than 64 characters",
    E.OUT_OF_RANGE: "/help NAME shows the range",
    E.VI_NOT_BELOW_VM: "lower VI or raise VM first",
    E.VM_NOT_ABOVE_VI: "lower VI or raise VM first",
    E.ILLEGAL_DATA: "check the parameters; names that are reserved for the maker give this too",
    E.READ_ONLY: "it can only be read",
    E.TRIP_NOT_SET_UP: "set the trip up (TI, TP, TC, TT, TR, TA, TM) before TE",
    E.NAME_EXISTS: "clear the old program with CP first, or choose another name",
    E.NAME_IS_COMMAND: "choose another name",
    E.NO_SUCH_NAME: "check the name; labels of a program exist once it is stored",
    E.NOT_AVAILABLE: "/help NAME lists its products",
    E.NO_SEPARATOR: "parameters are separated by commas",
    E.TRIPS_EXCLUSIVE: "use only one of TP and TR",
    E.PROGRAM_RUNNING: "end the program first, with E or a stop",
    E.NO_SUCH_ADDRESS: "check the address or label; L lists the program",
    E.STACK_FULL: "leave every subroutine with RT",
    E.PROGRAM_LOCKED: "LK=0 opens a lock that was not saved; else CP or FD, which erase the program",
    E.PROGRAM_MEMORY_FULL: "CP clears program memory",
    E.UNKNOWN_COMMAND: "check the spelling; /help NAME explains a word",
    E.NO_SUCH_BAUD: "BD takes 48, 96, 19, 38 or 11",
    E.CHARACTERS_TOO_FAST: "leave time between commands",
    E.TRANSMIT_BUFFER_FULL: "print less often, or read faster",
    E.OVERTEMPERATURE: "let it cool down, lower RC, then switch power off and on",
    E.MOVING_SAVE: "stop first (SL 0), then try again",
    E.MOVING_CLEAR: "stop first (SL 0), then try again",
    E.MAKE_UP_FREQUENCY: "MF takes 92 up to VM",
    E.VELOCITY_TOO_HIGH: "lower the velocity or raise MS",
    E.MOTOR_VOLTAGE: "check the supply; PR VT shows the voltage",
    E.NO_HOME_INPUT: "set one up with IS=<n>,1,<active>",
    E.NO_HOME_SWITCH: "check the home switch and its wiring",
    E.PLUS_LIMIT: "move in the minus direction to get off it",
    E.MINUS_LIMIT: "move in the plus direction to get off it",
    E.HOMING_OR_MOVING: "wait until the axis is at rest",
    E.STALL: "check the load, RC and A; ST=0 clears the flag",
    E.AS_WHILE_MOVING: "stop first (SL 0), then try again",
    E.VELOCITY_TOO_LOW: "raise VI or VM",
    E.STILL_CORRECTING: "wait until MP is 0",
    E.DRIVE_DISABLED: "DE=1 enables it",
    E.DIRECTION_WHILE_MOVING: "stop first (SL 0), then try again",
    E.NO_MOTOR_VOLTAGE: "switch the motor supply on; PR VT shows the voltage",
    E.NOT_TESTED: "DE=1 enables it",
    E.LOCKED_ROTOR: "free the shaft, then CF",
    E.LEAD_LIMIT: "check the load and lower D",
    E.LAG_LIMIT: "check the load and lower A",
    E.CALIBRATION_FAILED: "DE=1 enables it",
}
_MDRIVE_HINTS: dict[int, str] = {
    E.NOT_USER_OUTPUT: "set the point up with S<n>=16,<active>",
    E.NOT_CAPTURE_INPUT: "S13=60,<0/1> makes point 13 a capture input",
    E.POWER_STAGE: "let it cool down",
    E.NO_HOME_INPUT: "set one up with S<n>=1,<active>",
    E.AS_WHILE_MOVING: "CM=0 switches the clock mode off",
    E.MOVE_WHILE_CALIBRATING: "check the load",
    E.DRIVE_DISABLED: "stop first (SL 0), then try again",
}

UNKNOWN = "unknown error"


def text(code: int, family: str = "LMD") -> str:
    """Return the meaning of an error number; "unknown error" for a number without one.

    `family` is LMD, LMM or MDI, or the name of a product, which begins with one; LMD for any other text.
    """
    return TEXTS[_family(family)].get(code, UNKNOWN)


def hint(code: int, family: str = "LMD") -> str:
    """Return the remedy of an error; empty where there is no general one."""
    if _family(family) == "MDI":
        return _MDRIVE_HINTS.get(code, _HINTS.get(code, "") if code in TEXTS["MDI"] else "")
    return _HINTS.get(code, "")


def _family(name: str) -> str:
    return next((family for family in ("LMM", "MDI") if name.upper().startswith(family)), "LMD")
