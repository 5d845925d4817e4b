"""The replies of a controller in words: status numbers, and refusals with meaning and remedy.

A refusal begins with a question mark; an unknown command follows it. (PMX-2ED-SA manual, tables 7.2, 7.9, 7.12, 9.1.)
"""

from __future__ import annotations

MOVING = 0b111
"""The bits of a motor status that mean that the axis makes pulses."""
LIMIT_PLUS, LIMIT_MINUS = 1 << 7, 1 << 8
LIMIT_ERROR = LIMIT_PLUS | LIMIT_MINUS

BITS: tuple[tuple[int, str], ...] = (
    (1 << 0, "accelerating"),
    (1 << 1, "decelerating"),
    (1 << 2, "at constant speed"),
    (LIMIT_PLUS, "plus limit error"),
    (LIMIT_MINUS, "minus limit error"),
    (1 << 4, "plus limit switch on"),
    (1 << 5, "minus limit switch on"),
    (1 << 6, "home switch on"),
    (1 << 9, "on the Z index"),
    (1 << 10, "joystick on"),
    (1 << 11, "communication time-out"),
)
"""The bits of MSTX and MSTY, the most important for a person first."""

LOOP: dict[int, str] = {
    0: "idle",
    1: "moving",
    2: "correcting",
    3: "stopping",
    4: "aborting",
    5: "jogging",
    6: "homing",
    7: "homing on the Z index",
    8: "error: beyond the correction range",
    9: "error: too many corrections",
    10: "error: stalled",
    11: "error: limit",
    12: "off",
    13: "homing on a limit",
}
"""The values of SLSX and SLSY."""
LOOP_ERRORS = frozenset({8, 9, 10, 11})

PROGRAM: dict[int, str] = {0: "idle", 1: "running", 2: "paused", 4: "stopped by an error"}
"""The values of SASTAT0 and SASTAT1."""


def status_words(status: int) -> tuple[str, ...]:
    """Describe a motor status; `at rest` where the axis makes no pulses."""
    found = tuple(word for bit, word in BITS if status & bit)
    return found if status & MOVING else ("at rest", *found)


def trouble_words(status: int) -> str:
    """Describe what is wrong, for a readout beside `moving` and `stopped`; empty for nothing."""
    wrong = LIMIT_ERROR | 1 << 11
    return ", ".join(word for bit, word in BITS if status & bit & wrong)


def loop_words(state: int) -> str:
    return LOOP.get(state, f"state {state}")


def program_words(state: int) -> str:
    return PROGRAM.get(state, f"state {state}")


MEANINGS: dict[str, tuple[str, str]] = {
    "?ABS/INC is not in operation": (
        "the axis makes no positional move whose target could be changed",
        "T is for X and Y moves under way",
    ),
    "?Clear SNL Error": ("StepNLoop of the axis is in error", "SLSX and SLSY show it; CLRX and CLRY clear it"),
    "?ICommandOn": ("an interpolated move is under way", "its speed cannot be changed on the fly"),
    "?Index out of Range": ("nothing has that number", "/help NAME lists them"),
    "?Invalid Answer": ("it does not take that value", "/help NAME shows the range"),
    "?Low speed out of range": ("the low speed does not fit", "raise LSPD, or LSPDX and LSPDY, for this HSPD"),
    "?Moving": ("the motor is moving", "wait until it is at rest, or STOP or ABORT it"),
    "?S-curve on": ("no speed is changed on the fly with S-curves", "SCVX=0, SCVY=0 switch them off"),
    "?Speed out of range": (
        "the speed is outside the window of SSPDM",
        "choose another window while the axis is at rest",
    ),
    "?SSPD Mode not Initialized": ("no speed window is selected", "SSPDMX=1 to 9 while the axis is at rest"),
    "?Sub not Initialized": ("no subroutine of that number is stored", "download a program that has it"),
}
"""Meaning and remedy by the reply, in the manual's spelling."""
_FOLDED = {reply.casefold().replace(" ", ""): meaning for reply, meaning in MEANINGS.items()}


def meaning(reply: str) -> tuple[str, str] | None:
    """Look up a refusal, whatever its spacing and case; None where it only repeats an unknown command."""
    return _FOLDED.get(reply.casefold().replace(" ", ""))
