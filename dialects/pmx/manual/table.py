"""Every ASCII command of the controller: name, values and meaning; its replies in words.

`shape` is the continuation of a name: `bare` nothing, `axis` X or Y, `sign` an axis and a direction, `both` a direction
for both axes, `1-8` a number, `place` positions. `access` is R, W or RW for a value (`NAME` reads, `NAME=value`
writes), `-` for an action. (PMX-2ED-SA manual, table 9.0, and the text for J+, J- and CLRS.)
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

AXES = ("X", "Y")
SIGNS = ("+", "-")
PROBE, PROBED = "MULTIDROP", "simulator"
"""The request that distinguishes our simulator from a unit, and its reply."""
INT32 = "-2147483648 to 2147483647"


@dataclass(frozen=True)
class Command:
    """A row of the table."""

    name: str
    shape: str
    access: str
    meaning: str
    takes: str = ""
    """Range and unit of its value."""
    section: str = ""
    note: str = ""
    starts: bool = False
    """Whether it can start motion or a program; for a value, when written. StepNLoop corrects a position by moving."""

    @property
    def shapes(self) -> list[str]:
        return self.shape.split()

    def words(self) -> Iterator[str]:
        """Every typed form, without positions."""
        for shape in self.shapes:
            if shape == "bare":
                yield self.name
            elif shape in ("axis", "place"):
                yield from (self.name + axis for axis in (AXES if shape == "axis" else ("",)))
            elif shape == "sign":
                yield from (f"{self.name}{axis}{sign}" for axis in AXES for sign in SIGNS)
            elif shape == "both":
                yield from (self.name + sign for sign in SIGNS)
            else:
                low, _, high = shape.partition("-")
                yield from (f"{self.name}{number}" for number in range(int(low), int(high) + 1))


SPEED = "1 to 6000000 pulses/s (encoder counts/s with StepNLoop)"
TIME = "ms; what it may be depends on the speeds (appendix A)"

ROWS: tuple[Command, ...] = (
    # Motion
    Command("X", "place", "-", "move X to a position, or by a distance after INC; X1000Y2000 moves both in a line",
            f"X1000: {INT32} pulses (encoder counts with StepNLoop)", "7.8", starts=True),
    Command("Y", "place", "-", "move Y to a position, or by a distance after INC", f"Y1000: {INT32} pulses", "7.8",
            starts=True),
    Command("I", "place", "-", "move both axes in a straight line", "I1000:-1000, X and Y in pulses", "7.8.2",
            starts=True),
    Command("T", "axis", "-", "change the target of a move that is under way", "TX1000: pulses", "7.9", starts=True),
    Command("ABS", "bare", "-", "targets of moves are positions", "", "7.8"),
    Command("INC", "bare", "-", "targets of moves are distances", "", "7.8"),
    Command("MM", "bare", "R", "how targets are meant", "0 positions (ABS), 1 distances (INC)", "7.8"),
    Command("J", "sign both", "-", "run on in a direction until it is stopped; J+ and J- run both axes", "", "7.6",
            starts=True),
    Command("STOP", "bare axis", "-", "slow down and stop: all axes, or one", "", "7.7"),
    Command("ABORT", "bare axis", "-", "stop at once, without slowing down: all axes, or one", "", "7.7"),
    Command("H", "sign", "-", "home at high speed on the home input", "", "7.10.1", starts=True),
    Command("L", "sign", "-", "home on a limit input, then go back by LCA", "", "7.10.2", starts=True),
    Command("ZH", "sign", "-", "home on the home input, then on the encoder's index", "", "7.10.3", starts=True),
    Command("Z", "sign", "-", "home on the encoder's index, at low speed", "", "7.10.4", starts=True),
    Command("HL", "sign", "-", "home on the home input at high speed, then again at low speed", "", "7.10.5",
            starts=True),
    Command("HCA", "bare axis", "RW", "how far homing (HL) goes past the home switch before it comes back slowly",
            "pulses", "7.10.5"),
    Command("LCA", "bare axis", "RW", "how far homing (L) goes back from the limit", "pulses", "7.10.2"),
    Command("RZ", "bare", "RW", "whether homing ends with a move to 0", "0, 1", "7.10"),
    # Speeds
    Command("HSPD", "bare axis", "RW", "high speed: what a move runs at; an axis's own counts unless it is 0", SPEED,
            "7.1"),
    Command("LSPD", "bare axis", "RW", "low speed: what a move begins and ends at; an axis's own counts unless it is 0",
            SPEED, "7.1"),
    Command("ACC", "bare axis", "RW", "time from low to high speed; an axis's own counts unless it is 0", TIME, "7.1"),
    Command("DEC", "bare axis", "RW", "time from high to low speed, where EDEC is 1", TIME, "7.1"),
    Command("EDEC", "bare", "RW", "whether DEC is used for slowing down, or ACC for both", "0, 1", "7.1"),
    Command("SCV", "axis", "RW", "S-curves in place of straight ramps", "0, 1", "7.1"),
    Command("PS", "bare axis", "R", "speed now", "pulses/s (encoder counts/s with StepNLoop)", "7.2"),
    Command("SSPDM", "axis", "RW", "window of speeds within which SSPD may change the speed; set at rest",
            "0 to 9 (appendix A); 0: none", "7.3"),
    Command("SSPD", "axis", "W", "change the speed of a move that is under way", "pulses/s within SSPDM", "7.3"),
    # Position
    Command("P", "axis", "RW", "position; with StepNLoop the position that it should have now", f"{INT32} pulses",
            "7.4", starts=True),
    Command("E", "axis", "RW", "encoder's position", f"{INT32} counts", "7.4", starts=True),
    Command("POL", "axis", "RW", "polarities and the encoder's decoding, a bit each", "see table 7.7", "7.16"),
    Command("MST", "bare axis", "R", "motor status, a bit each; /status has it in words", "see table 7.2", "7.12"),
    Command("CLR", "axis", "-", "clear limit and StepNLoop errors of an axis", "", "7.11", starts=True),
    Command("CLRS", "axis", "-", "clear StepNLoop errors of an axis", "", "7.17", starts=True),
    Command("IERR", "bare", "RW", "whether a limit stops the motor without an error that must be cleared", "0, 1",
            "7.11"),
    # StepNLoop
    Command("SL", "axis", "RW", "StepNLoop: positions are watched and put right by the encoder", "0, 1", "7.17",
            starts=True),
    Command("SLR", "axis", "RW", "StepNLoop: pulses for an encoder count", "0.001 to 999.999", "7.17", starts=True),
    Command("SLT", "axis", "RW", "StepNLoop: error that counts as in position", "encoder counts", "7.17", starts=True),
    Command("SLE", "axis", "RW", "StepNLoop: error that stops the motor", "encoder counts", "7.17", starts=True),
    Command("SLA", "axis", "RW", "StepNLoop: corrections tried before it gives up", "times", "7.17", starts=True),
    Command("SLS", "axis", "R", "StepNLoop: what it does; /status has it in words", "0 to 13", "7.17"),
    Command("DX", "axis", "R", "StepNLoop: target less actual position", "encoder counts", "7.17",
            "spelt DX and an axis, as DXX, in the manual's table"),
    # Inputs and outputs
    Command("EO", "bare 1-2", "RW", "current of the motors: EO1 X, EO2 Y, or both as bits", "0 to 3; EO1, EO2: 0, 1",
            "7.5", starts=True),
    Command("EOBOOT", "bare", "RW", "EO after power-up", "0 to 3", "7.5"),
    Command("DI", "bare 1-8", "R", "digital inputs, all as bits or one", "0 to 255; DI1 to DI8: 0, 1", "7.13.1"),
    Command("DO", "bare 1-8", "RW", "digital outputs, all as bits or one", "0 to 255; DO1 to DO8: 0, 1", "7.13.2"),
    Command("DOBOOT", "bare", "RW", "DO after power-up", "0 to 255", "7.13.2"),
    Command("AI", "1-2", "R", "analog inputs", "0 to 5000 mV", "7.14"),
    # Joystick
    Command("JO", "bare", "-", "joystick on", "", "7.15", starts=True),
    Command("JF", "bare", "-", "joystick off", "", "7.15"),
    Command("JV", "1-6", "RW", "joystick: 1, 2 highest speeds of X and Y; 3, 4 change of speed; 5, 6 dead zones",
            "pulses/s; dead zones in mV", "7.15"),
    Command("JL", "1-8", "RW", "joystick: outer and inner limits, minus before plus; 1 to 4 of X, 5 to 8 of Y",
            "pulses", "7.15"),
    # Programs
    Command("SR", "0-1", "W", "control a program", "0 stop, 1 start, 2 pause, 3 go on", "7.19.2", starts=True),
    Command("SASTAT", "bare 0-1", "R", "state of a program", "0 idle, 1 running, 2 paused, 4 error", "7.19.3"),
    Command("SPC", "0-1", "R", "line that a program is at", "0 to 1274", "7.19.3"),
    Command("GS", "0-31", "-", "run a stored subroutine", "", "7.19.4", starts=True),
    Command("V", "0-63", "RW", "variables of the programs; V32 to V63 are kept by STORE", INT32, "7.19.6"),
    Command("SA", "0-1274", "RW", "a line of the stored programs, compiled", "", "7.19"),
    Command("SLOAD", "bare", "RW", "programs that run after power-up, a bit each", "0 to 3", "7.19.7"),
    # The controller
    Command("STORE", "bare", "-", "keep the settings that can be kept (table 7.15); speeds cannot", "", "7.20"),
    Command("TOC", "bare", "RW", "watchdog: time without a command after which bit 11 of the motor status is set",
            "ms; 0: off", "7.18", "every command counts, those of a display that polls too"),
    Command("DN", "bare", "RW", "device name; its last two digits are the address", "2ED00 to 2ED99", "6.3",
            "acts after STORE and a power cycle"),
    Command("DB", "bare", "RW", "baud rate", "1 9600, 2 19200, 3 38400, 4 57600, 5 115200", "6.2.2",
            "acts after STORE and a power cycle"),
    Command("ID", "bare", "R", "what the controller is", "", "9.1"),
    Command("VER", "bare", "R", "firmware version", "", "9.1"),
)  # fmt: skip

COMMANDS: Mapping[str, Command] = {row.name: row for row in ROWS}
WORDS: Mapping[str, Command] = {word: row for row in ROWS for word in row.words()}
"""Every word, with its axis, direction or number."""

ELSEWHERE: Mapping[str, str] = {
    "HS": "HSPD", "LS": "LSPD", "SSP": "SSPD", "JOG": "J", "HOME": "H", "LHOME": "L", "ZHOME": "ZH", "ZOME": "Z",
    "HLHOME": "HL", "ECLEAR": "CLR", "GOSUB": "GS", "SAP": "POL", "JOYENA": "JO", "JOYHS": "JV", "JOYDEL": "JV",
    "JOYTOL": "JV", "JOYNO": "JL", "JOYNI": "JL", "JOYPI": "JL", "JOYPO": "JL",
}  # fmt: skip
"""Words of programs and of the manual's text that have another name on the line."""
_HEAD = re.compile(r"[A-Za-z]+")
_PLACE = re.compile(r"(X-?\d+(Y-?\d+)?|Y-?\d+|I-?\d+:-?\d+|T[XY]-?\d+)", re.ASCII)

_GROUPED = re.compile(r"[0-9]+(?:(?:\s*,\s*|\s+|')[0-9]{3}(?![0-9]))+")


def grouped(text: str) -> str:
    """Return why a line is refused for a number in groups of three digits (`X200,000`); empty where it has none.

    No command separates numbers by a comma or a space.
    """
    found = _GROUPED.search(text)
    return f"{found[0]} is not one number; write {re.sub(r'[^0-9]', '', found[0])}" if found else ""


def lookup(word: str) -> Command | None:
    """Find the row of a command, with or without its continuation (`HSPDX`, `X1000`, `DO3=1`), in any case."""
    text = word.strip().upper().partition("=")[0].strip()
    if text in COMMANDS or text in WORDS:
        return COMMANDS.get(text) or WORDS[text]
    if _PLACE.fullmatch(text):
        return COMMANDS[text[0]]
    return None


def head(text: str) -> str:
    """The letters at the head of a line, in capitals."""
    found = _HEAD.match(text.strip())
    return found.group().upper() if found else ""


def reads(text: str) -> bool:
    """Whether a command reads a value."""
    row = lookup(text)
    return row is not None and "R" in row.access and "=" not in text


def starts_motion(text: str) -> bool:
    """Whether a command can start motion or a program; an unknown command can."""
    row = lookup(text)
    return row is None or (row.starts and not reads(text))


# Replies in words: status numbers, and refusals with meaning and remedy.
#
# A refusal begins with a question mark; an unknown command follows it. (PMX-2ED-SA manual, tables 7.2, 7.9, 7.12,
# 9.1.)


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
