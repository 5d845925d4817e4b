"""What the numbers in a drive's error register mean, and what to do about them (MCode reference, section 10)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

_COMMON = {
    0: "no error",
    1: "overcurrent on output 1",
    2: "overcurrent on output 2",
    6: "another input or output already has this type",
    7: "this input or output is not set up for use",
    8: "this type does not fit this input or output",
    9: "the output is no user output, so it cannot be written",
    10: "no such input or output",
    11: "wrong clock type",
    12: "input 1 is not of type capture",
    20: "unknown variable or flag",
    21: "value out of range or not allowed",
    22: "VI must be below VM",
    23: "VM must be above VI",
    24: "illegal data",
    25: "read only",
    26: "this cannot be incremented or decremented",
    27: "the trip is not set up",
    28: "the label or global variable exists already",
    29: "the name is a command of the drive",
    30: "no such label or user variable",
    31: "no room for more labels and variables",
    32: "a label cannot be set",
    33: "an instruction cannot be set",
    34: "a variable or flag cannot be executed",
    35: "this cannot be printed",
    36: "microsteps do not fit the encoder's counts",
    37: "not available in this drive",
    38: "a separator between parameters is missing",
    39: "trips on position and on relative position exclude each other",
    40: "no program is running",
    41: "a program is running",
    42: "no such program address",
    43: "too many calls within calls",
    44: "the program is locked",
    45: "program memory is full",
    46: "program mode is not on",
    47: "illegal flash address",
    48: "an input of type stop ended the program",
    60: "unknown command",
    61: "no such baud rate",
    62: "input for a variable is already awaited",
    63: "characters came too fast",
    65: "internal bus error (SPI)",
    66: "a program printed more than could be sent",
    70: "flash memory is damaged (checksum)",
    71: "warning temperature exceeded",
    72: "too hot: the drive has switched itself off",
    73: "not while moving: save, factory defaults, program mode",
    74: "not while moving: IP, CP",
    75: "fault in the power stage (current, temperature or other)",
    76: "make-up frequency out of range",
    77: "velocity too high for this microstep resolution",
    79: "+V out of range",
    80: "no input is of type home",
    81: "no homing type given",
    82: "both limits reached, and no home switch found",
    83: "plus limit reached",
    84: "minus limit reached",
    85: "no move while homing, no homing while moving",
    86: "stall",
    90: "VI or VM too low",
    91: "an input of type stop ended the motion",
    92: "position is off by too much",
    93: "the end of the last move is still being corrected",
    94: "the drive is disabled",
    95: "direction cannot be reversed while moving",
    96: "no +V",
    97: "final velocity would be below VI",
    98: "no S-curve acceleration fits this move",
    99: "no S-curve deceleration fits this move",
}
_DRIVE_ONLY = {
    78: "auxiliary voltage out of range",
    87: "AS cannot change while moving",
    88: "no move during calibration",
    89: "no calibration while moving",
    100: "configuration test: encoder resolution is wrong",
    101: "configuration test: encoder direction is wrong",
    102: "configuration test: encoder resolution and direction are wrong",
    103: "configuration test not done: drive not enabled",
    104: "locked rotor",
    105: "greatest lead or lag reached",
    106: "lead limit reached",
    107: "lag limit reached",
    108: "lead or lag left at the end of the move",
    109: "hMT calibration failed: drive not enabled",
    110: "make-up is off",
    111: "factory calibration of hMT failed",
}
_MDRIVE_LACKS = frozenset({1, 2, 7, 65, 66, 76, 77, 78, 79, *range(94, 100), 110, 111})
_MDRIVE_ONLY = {
    20: "unknown variable, flag or command",
    12: "the trip or capture is not set up for this point",
    41: "a program is running, or too many calls within calls",
    64: "calibration at power-up failed",
    75: "fault in the power stage (temperature)",
    87: "no jog while the clock mode is on",
    88: "following error",
    89: "not during calibration",
    90: "VI or VM too low to be counted by the encoder",
    92: "position is off by too much after three tries",
    94: "CF not while moving",
}
"""MDrivePlus: the same numbers for other things. Most above 100 are a Hybrid's."""
_MODULE_ONLY = {13: "overcurrent in a motor phase", 14: "the enable input holds the module disabled"}


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

_HINTS = {
    9: "set it up with OS=<n>,16,<active>",
    20: "check the name, and that the line has no more than 64 characters",
    21: "/help NAME tells the range",
    22: "lower VI or raise VM first",
    23: "lower VI or raise VM first",
    24: "check the parameters; names that are reserved for the maker give this too",
    25: "it can only be read",
    27: "set the trip up (TI, TP, TC, TT, TR, TA, TM) before TE",
    28: "clear the old program with CP first, or choose another name",
    29: "choose another name",
    30: "check the name; labels of a program exist once it is stored",
    37: "/help NAME tells which products have it",
    38: "parameters are separated by commas",
    39: "use only one of TP and TR",
    41: "end the program first, with E or a stop",
    42: "check the address or label; L lists the program",
    43: "leave every subroutine with RT",
    44: "CP of everything, or FD, unlocks it and erases it",
    45: "CP clears program memory",
    60: "check the spelling; /help NAME tells what a word does",
    61: "BD takes 48, 96, 19, 38 or 11",
    63: "leave time between commands",
    66: "print less often, or read faster",
    72: "let it cool down, lower RC, then switch power off and on",
    73: "stop first (SL 0), then try again",
    74: "stop first (SL 0), then try again",
    76: "MF takes 92 up to VM",
    77: "lower the velocity or raise MS",
    79: "check the supply; PR VT tells the voltage",
    80: "set one up with IS=<n>,1,<active>",
    82: "check the home switch and its wiring",
    83: "move in the minus direction to get off it",
    84: "move in the plus direction to get off it",
    85: "wait until the axis stands",
    86: "check the load, RC and A; ST=0 clears the flag",
    87: "stop first (SL 0), then try again",
    90: "raise VI or VM",
    93: "wait until MP is 0",
    94: "DE=1 enables it",
    95: "stop first (SL 0), then try again",
    96: "switch the motor supply on; PR VT tells the voltage",
    103: "DE=1 enables it",
    104: "free the shaft, then CF",
    106: "check the load and lower D",
    107: "check the load and lower A",
    109: "DE=1 enables it",
}
_MDRIVE_HINTS = {
    9: "set the point up with S<n>=16,<active>",
    12: "S13=60,<0/1> makes point 13 a capture input",
    75: "let it cool down",
    80: "set one up with S<n>=1,<active>",
    87: "CM=0 switches the clock mode off",
    88: "check the load",
    94: "stop first (SL 0), then try again",
}

BY_ITSELF = frozenset(
    {1, 2, 13, 48, 65, 66, 70, 71, 72, 75, 78, 79, 82, 83, 84, 86, 91, 92, 96, *range(100, 103), *range(104, 110)}
)
"""What happens to a drive without a line being wrong: limits, stalls, heat, supply, the end of a homing or a move."""


UNKNOWN = "unknown error"


def text(code: int, family: str = "LMD") -> str:
    """What an error number means, in a few words; "unknown error" if it means nothing.

    `family` is LMD, LMM or MDI, or a product's name, which begins with one; anything else is read as LMD.
    """
    return TEXTS[_family(family)].get(code, UNKNOWN)


def hint(code: int, family: str = "LMD") -> str:
    """What to do about an error, where something can be said in general, else an empty string."""
    if _family(family) == "MDI":
        return _MDRIVE_HINTS.get(code, _HINTS.get(code, "") if code in TEXTS["MDI"] else "")
    return _HINTS.get(code, "")


def _family(name: str) -> str:
    return next((family for family in ("LMM", "MDI") if name.upper().startswith(family)), "LMD")
