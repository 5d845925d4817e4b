"""The numbers of a drive's error register, with meaning and remedy of each (MCode reference, section 10)."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType


class ErrorNumber(IntEnum):
    """The numbers of a drive's error register, named by their meaning on a Lexium MDrive; empty: no general remedy."""

    _value_: int
    meaning: str
    remedy: str

    def __new__(cls, number: int, meaning: str, remedy: str = "") -> ErrorNumber:
        made = int.__new__(cls, number)
        made._value_, made.meaning, made.remedy = number, meaning, remedy
        return made

    NONE = 0, "no error"
    OVERCURRENT_OUTPUT_1 = 1, "overcurrent on output 1"
    OVERCURRENT_OUTPUT_2 = 2, "overcurrent on output 2"
    TYPE_IN_USE = 6, "another input or output already has this type"
    POINT_NOT_SET_UP = 7, "this input or output is not set up for use"
    WRONG_POINT_TYPE = 8, "this type does not fit this input or output"
    NOT_USER_OUTPUT = 9, "not a user output: it cannot be written", "set it up with OS=<n>,16,<active>"
    NO_SUCH_POINT = 10, "no such input or output"
    WRONG_CLOCK_TYPE = 11, "wrong clock type"
    NOT_CAPTURE_INPUT = 12, "input 1 is not of type capture"
    OVERCURRENT_PHASE = 13, "overcurrent in a motor phase"
    HELD_DISABLED = 14, "the enable input holds the module disabled"
    UNKNOWN_VARIABLE = (
        20, "unknown variable or flag",
        "check the name, and that the line has no more than 64 characters",
    )  # fmt: skip
    OUT_OF_RANGE = 21, "value out of range or not allowed", "/help NAME shows the range"
    VI_NOT_BELOW_VM = 22, "VI must be below VM", "lower VI or raise VM first"
    VM_NOT_ABOVE_VI = 23, "VM must be above VI", "lower VI or raise VM first"
    ILLEGAL_DATA = 24, "illegal data", "check the parameters; names that are reserved for the maker give this too"
    READ_ONLY = 25, "read only", "it can only be read"
    NOT_STEPPABLE = 26, "this cannot be incremented or decremented"
    TRIP_NOT_SET_UP = 27, "the trip is not set up", "set the trip up (TI, TP, TC, TT, TR, TA, TM) before TE"
    NAME_EXISTS = (
        28, "the label or global variable exists already",
        "clear the old program with CP first, or choose another name",
    )  # fmt: skip
    NAME_IS_COMMAND = 29, "the name is a command of the drive", "choose another name"
    NO_SUCH_NAME = 30, "no such label or user variable", "check the name; labels of a program exist once it is stored"
    NAME_TABLE_FULL = 31, "no room for more labels and variables"
    LABEL_NOT_SETTABLE = 32, "a label cannot be set"
    INSTRUCTION_NOT_SETTABLE = 33, "an instruction cannot be set"
    NOT_EXECUTABLE = 34, "a variable or flag cannot be executed"
    NOT_PRINTABLE = 35, "this cannot be printed"
    ENCODER_RATIO = 36, "microsteps do not fit the encoder's counts"
    NOT_AVAILABLE = 37, "not available in this drive", "/help NAME lists its products"
    NO_SEPARATOR = 38, "a separator between parameters is missing", "parameters are separated by commas"
    TRIPS_EXCLUSIVE = 39, "trips on position and on relative position exclude each other", "use only one of TP and TR"
    NO_PROGRAM_RUNNING = 40, "no program is running"
    PROGRAM_RUNNING = 41, "a program is running", "end the program first, with E or a stop"
    NO_SUCH_ADDRESS = 42, "no such program address", "check the address or label; L lists the program"
    STACK_FULL = 43, "too many calls within calls", "leave every subroutine with RT"
    PROGRAM_LOCKED = (
        44, "the program is locked",
        "LK=0 opens a lock that was not saved; else CP or FD, which erase the program",
    )  # fmt: skip
    PROGRAM_MEMORY_FULL = 45, "program memory is full", "CP clears program memory"
    NOT_IN_PROGRAM_MODE = 46, "program mode is not on"
    ILLEGAL_FLASH_ADDRESS = 47, "illegal flash address"
    PROGRAM_STOPPED_BY_INPUT = 48, "an input of type stop ended the program"
    UNKNOWN_COMMAND = 60, "unknown command", "check the spelling; /help NAME explains a word"
    NO_SUCH_BAUD = 61, "no such baud rate", "BD takes 48, 96, 19, 38 or 11"
    INPUT_PENDING = 62, "input for a variable is already awaited"
    CHARACTERS_TOO_FAST = 63, "characters came too fast", "leave time between commands"
    POWER_UP_CALIBRATION_FAILED = 64, "calibration at power-up failed"
    INTERNAL_BUS = 65, "internal bus error (SPI)"
    TRANSMIT_BUFFER_FULL = 66, "a program printed more than could be sent", "print less often, or read faster"
    FLASH_DAMAGED = 70, "flash memory is damaged (checksum)"
    TEMPERATURE_WARNING = 71, "warning temperature exceeded"
    OVERTEMPERATURE = (
        72, "too hot: the drive has switched itself off",
        "let it cool down, lower RC, then switch power off and on",
    )  # fmt: skip
    MOVING_SAVE = 73, "not while moving: save, factory defaults, program mode", "stop first (SL 0), then try again"
    MOVING_CLEAR = 74, "not while moving: IP, CP", "stop first (SL 0), then try again"
    POWER_STAGE = 75, "fault in the power stage (current, temperature or other)"
    MAKE_UP_FREQUENCY = 76, "make-up frequency out of range", "MF takes 92 up to VM"
    VELOCITY_TOO_HIGH = 77, "velocity too high for this microstep resolution", "lower the velocity or raise MS"
    AUXILIARY_VOLTAGE = 78, "auxiliary voltage out of range"
    MOTOR_VOLTAGE = 79, "+V out of range", "check the supply; PR VT shows the voltage"
    NO_HOME_INPUT = 80, "no input is of type home", "set one up with IS=<n>,1,<active>"
    NO_HOMING_TYPE = 81, "no homing type given"
    NO_HOME_SWITCH = 82, "both limits reached, and no home switch found", "check the home switch and its wiring"
    PLUS_LIMIT = 83, "plus limit reached", "move in the minus direction to get off it"
    MINUS_LIMIT = 84, "minus limit reached", "move in the plus direction to get off it"
    HOMING_OR_MOVING = 85, "no move while homing, no homing while moving", "wait until the axis is at rest"
    STALL = 86, "stall", "check the load, RC and A; ST=0 clears the flag"
    AS_WHILE_MOVING = 87, "AS cannot change while moving", "stop first (SL 0), then try again"
    MOVE_WHILE_CALIBRATING = 88, "no move during calibration"
    CALIBRATION_WHILE_MOVING = 89, "no calibration while moving"
    VELOCITY_TOO_LOW = 90, "VI or VM too low", "raise VI or VM"
    MOTION_STOPPED_BY_INPUT = 91, "an input of type stop ended the motion"
    POSITION_OFF = 92, "position is off by too much"
    STILL_CORRECTING = 93, "the end of the last move is still being corrected", "wait until MP is 0"
    DRIVE_DISABLED = 94, "the drive is disabled", "DE=1 enables it"
    DIRECTION_WHILE_MOVING = 95, "direction cannot be reversed while moving", "stop first (SL 0), then try again"
    NO_MOTOR_VOLTAGE = 96, "no +V", "switch the motor supply on; PR VT shows the voltage"
    FINAL_VELOCITY_TOO_LOW = 97, "final velocity would be below VI"
    NO_ACCELERATION_FITS = 98, "no S-curve acceleration fits this move"
    NO_DECELERATION_FITS = 99, "no S-curve deceleration fits this move"
    ENCODER_RESOLUTION_WRONG = 100, "configuration test: encoder resolution is wrong"
    ENCODER_DIRECTION_WRONG = 101, "configuration test: encoder direction is wrong"
    ENCODER_BOTH_WRONG = 102, "configuration test: encoder resolution and direction are wrong"
    NOT_TESTED = 103, "configuration test not done: drive not enabled", "DE=1 enables it"
    LOCKED_ROTOR = 104, "locked rotor", "free the shaft, then CF"
    LEAD_LAG_MAXIMUM = 105, "greatest lead or lag reached"
    LEAD_LIMIT = 106, "lead limit reached", "check the load and lower D"
    LAG_LIMIT = 107, "lag limit reached", "check the load and lower A"
    LEAD_LAG_LEFT = 108, "lead or lag left at the end of the move"
    CALIBRATION_FAILED = 109, "hMT calibration failed: drive not enabled", "DE=1 enables it"
    MAKE_UP_OFF = 110, "make-up is off"
    FACTORY_CALIBRATION_FAILED = 111, "factory calibration of hMT failed"


E = ErrorNumber
JOG_IN_CLOCK_MODE, FOLLOWING_ERROR, CF_WHILE_MOVING = E.AS_WHILE_MOVING, E.MOVE_WHILE_CALIBRATING, E.DRIVE_DISABLED
"""Three numbers by their meaning on an MDrivePlus."""
BY_ITSELF = frozenset(
    {
        E.OVERCURRENT_OUTPUT_1, E.OVERCURRENT_OUTPUT_2, E.OVERCURRENT_PHASE, E.PROGRAM_STOPPED_BY_INPUT,
        E.INTERNAL_BUS, E.TRANSMIT_BUFFER_FULL, E.FLASH_DAMAGED, E.TEMPERATURE_WARNING, E.OVERTEMPERATURE,
        E.POWER_STAGE, E.AUXILIARY_VOLTAGE, E.MOTOR_VOLTAGE, E.NO_HOME_SWITCH, E.PLUS_LIMIT, E.MINUS_LIMIT,
        E.STALL, E.MOTION_STOPPED_BY_INPUT, E.POSITION_OFF, E.NO_MOTOR_VOLTAGE, E.ENCODER_RESOLUTION_WRONG,
        E.ENCODER_DIRECTION_WRONG, E.ENCODER_BOTH_WRONG, E.LOCKED_ROTOR, E.LEAD_LAG_MAXIMUM, E.LEAD_LIMIT,
        E.LAG_LIMIT, E.LEAD_LAG_LEFT, E.CALIBRATION_FAILED
    }
)  # fmt: skip
"""Errors without a wrong line: limits, stalls, heat, supply, the end of a homing or a move."""
_MODULE_ONLY = frozenset({E.OVERCURRENT_PHASE, E.HELD_DISABLED})
_DRIVE_ONLY = frozenset(
    {
        E.AUXILIARY_VOLTAGE, E.AS_WHILE_MOVING, E.MOVE_WHILE_CALIBRATING, E.CALIBRATION_WHILE_MOVING,
        E.ENCODER_RESOLUTION_WRONG, E.ENCODER_DIRECTION_WRONG, E.ENCODER_BOTH_WRONG, E.NOT_TESTED,
        E.LOCKED_ROTOR, E.LEAD_LAG_MAXIMUM, E.LEAD_LIMIT, E.LAG_LIMIT, E.LEAD_LAG_LEFT, E.CALIBRATION_FAILED,
        E.MAKE_UP_OFF, E.FACTORY_CALIBRATION_FAILED
    }
)  # fmt: skip
_MDRIVE_LACKS = frozenset(
    {
        E.OVERCURRENT_OUTPUT_1, E.OVERCURRENT_OUTPUT_2, E.POINT_NOT_SET_UP, E.OVERCURRENT_PHASE,
        E.HELD_DISABLED, E.INTERNAL_BUS, E.TRANSMIT_BUFFER_FULL, E.MAKE_UP_FREQUENCY, E.VELOCITY_TOO_HIGH,
        E.AUXILIARY_VOLTAGE, E.MOTOR_VOLTAGE, E.DRIVE_DISABLED, E.DIRECTION_WHILE_MOVING, E.NO_MOTOR_VOLTAGE,
        E.FINAL_VELOCITY_TOO_LOW, E.NO_ACCELERATION_FITS, E.NO_DECELERATION_FITS, E.MAKE_UP_OFF,
        E.FACTORY_CALIBRATION_FAILED
    }
)  # fmt: skip
_LEXIUM_LACKS = E.POWER_UP_CALIBRATION_FAILED
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
_MDRIVE_REMEDIES: dict[int, str] = {
    E.NOT_USER_OUTPUT: "set the point up with S<n>=16,<active>",
    E.NOT_CAPTURE_INPUT: "S13=60,<0/1> makes point 13 a capture input",
    E.POWER_STAGE: "let it cool down",
    E.NO_HOME_INPUT: "set one up with S<n>=1,<active>",
    E.AS_WHILE_MOVING: "CM=0 switches the clock mode off",
    E.MOVE_WHILE_CALIBRATING: "check the load",
    E.DRIVE_DISABLED: "stop first (SL 0), then try again",
}
_REMEDIES: dict[int, str] = {each: each.remedy for each in E}
TEXTS: Mapping[str, Mapping[int, str]] = MappingProxyType(
    {
        "LMD": MappingProxyType({each: each.meaning for each in E if each not in {*_MODULE_ONLY, _LEXIUM_LACKS}}),
        "LMM": MappingProxyType({each: each.meaning for each in E if each not in {*_DRIVE_ONLY, _LEXIUM_LACKS}}),
        "MDI": MappingProxyType(
            {
                each: _MDRIVE_ONLY.get(each, each.meaning)
                for each in E
                if each not in _MDRIVE_LACKS or each in _MDRIVE_ONLY
            }
        ),
    }
)
"""Number to text, for the Lexium MDrive (LMD), the Lexium Motion Module (LMM) and MDrivePlus (MDI)."""

UNKNOWN = "unknown error"


def text(code: int, family: str = "LMD") -> str:
    """Return the meaning of an error number; "unknown error" for a number without one.

    `family` is LMD, LMM or MDI, or the name of a product, which begins with one; LMD for any other text.
    """
    return TEXTS[_family(family)].get(code, UNKNOWN)


def hint(code: int, family: str = "LMD") -> str:
    if _family(family) == "MDI":
        return _MDRIVE_REMEDIES.get(code, _REMEDIES.get(code, "") if code in TEXTS["MDI"] else "")
    return _REMEDIES.get(code, "")


def _family(name: str) -> str:
    return next((family for family in ("LMM", "MDI") if name.upper().startswith(family)), "LMD")
