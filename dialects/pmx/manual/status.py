"""The status numbers of a controller in words: motor status, StepNLoop, programs.

Source: PMX-2ED-SA manual, tables 7.2, 7.9 and 7.12.
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


def words(status: int) -> tuple[str, ...]:
    """Describe a motor status; `at rest` where the axis makes no pulses."""
    found = tuple(word for bit, word in BITS if status & bit)
    return found if status & MOVING else ("at rest", *found)


def remarkable(status: int) -> str:
    """Describe what is wrong, for a readout beside `moving` and `stopped`; empty for nothing."""
    wrong = LIMIT_ERROR | 1 << 11
    return ", ".join(word for bit, word in BITS if status & bit & wrong)


def loop(state: int) -> str:
    """Describe the state of StepNLoop."""
    return LOOP.get(state, f"state {state}")


def program(state: int) -> str:
    """Describe the state of a program."""
    return PROGRAM.get(state, f"state {state}")
