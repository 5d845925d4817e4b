"""The numbers of a drive's error register; `errors.csv` has meaning and remedy of each (MCode reference, section 10).

A row is as a Lexium MDrive means it: `lacking` are the products without that number (LMD, LMM for the Motion Module,
MDI for an MDrivePlus), `by_itself` an error without a wrong line; then what it means on an MDrivePlus, where that is
another thing. Most above 100 are a Hybrid's there. Without a remedy there is no general one.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from multidrop.base.files import rows


class ErrorNumber(IntEnum):
    """The numbers that code names, by their meaning on a Lexium MDrive."""

    TYPE_IN_USE = 6
    WRONG_POINT_TYPE = 8
    NOT_USER_OUTPUT = 9
    NO_SUCH_POINT = 10
    WRONG_CLOCK_TYPE = 11
    NOT_CAPTURE_INPUT = 12
    UNKNOWN_VARIABLE = 20
    OUT_OF_RANGE = 21
    VI_NOT_BELOW_VM = 22
    VM_NOT_ABOVE_VI = 23
    ILLEGAL_DATA = 24
    READ_ONLY = 25
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
    PROGRAM_STOPPED_BY_INPUT = 48
    UNKNOWN_COMMAND = 60
    NO_SUCH_BAUD = 61
    INPUT_PENDING = 62
    TRANSMIT_BUFFER_FULL = 66
    TEMPERATURE_WARNING = 71
    OVERTEMPERATURE = 72
    MOVING_SAVE = 73
    MOVING_CLEAR = 74
    MAKE_UP_FREQUENCY = 76
    VELOCITY_TOO_HIGH = 77
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
    FINAL_VELOCITY_BELOW_VI = 97
    NO_ACCELERATION_FITS = 98
    NO_DECELERATION_FITS = 99
    ENCODER_RESOLUTION_WRONG = 100
    NOT_TESTED = 103
    LOCKED_ROTOR = 104
    LEAD_LIMIT = 106
    LAG_LIMIT = 107
    LEAD_LAG_LEFT = 108
    CALIBRATION_FAILED = 109
    MAKE_UP_OFF = 110


E = ErrorNumber
JOG_IN_CLOCK_MODE, FOLLOWING_ERROR, CF_WHILE_MOVING = E.AS_WHILE_MOVING, E.MOVE_WHILE_CALIBRATING, E.DRIVE_DISABLED
"""Three numbers by their meaning on an MDrivePlus."""
_ROWS = {int(row["number"]): row for row in rows(__file__, "errors.csv")}
BY_ITSELF = frozenset(number for number, row in _ROWS.items() if row["by_itself"])
"""Errors without a wrong line: limits, stalls, heat, supply, the end of a homing or a move."""


def _texts(family: str) -> Mapping[int, str]:
    own = {number: row for number, row in _ROWS.items() if family not in row["lacking"].split()}
    return {number: (row["mdi_meaning"] if family == "MDI" else "") or row["meaning"] for number, row in own.items()}


TEXTS: Mapping[str, Mapping[int, str]] = {family: _texts(family) for family in ("LMD", "LMM", "MDI")}
"""Number to text, for the Lexium MDrive (LMD), the Lexium Motion Module (LMM) and MDrivePlus (MDI)."""

UNKNOWN = "unknown error"


def text(code: int, family: str = "LMD") -> str:
    """Return the meaning of an error number; "unknown error" for a number without one.

    `family` is LMD, LMM or MDI, or the name of a product, which begins with one; LMD for any other text.
    """
    return TEXTS[_family(family)].get(code, UNKNOWN)


def hint(code: int, family: str = "LMD") -> str:
    row = _ROWS.get(code)
    if row is None:
        return ""
    if _family(family) == "MDI":
        return row["mdi_remedy"] or (row["remedy"] if code in TEXTS["MDI"] else "")
    return row["remedy"]


def _family(name: str) -> str:
    return next((family for family in ("LMM", "MDI") if name.upper().startswith(family)), "LMD")
