"""Every ASCII command of the controller: name, values and meaning; its replies in words.

`commands.csv` has the commands, `states.csv` the status numbers, `refusals.csv` the refusals. `shape` is the
continuation of a name: `bare` nothing, `axis` X or Y, `sign` an axis and a direction, `both` a direction for both axes,
`1-8` a number, `place` positions. `access` is R, W or RW for a value (`NAME` reads, `NAME=value` writes), `-` for an
action. The other columns are the fields of `PmxCommand`. Every cell says something, `-` for none, so that a new command
answers every question. (PMX-2ED-SA manual, table 9.0, and the text for J+, J- and CLRS.)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

from multidrop.base.files import rows

AXES = ("X", "Y")
SIGNS = ("+", "-")
PROBE, PROBED = "MULTIDROP", "simulator"
"""The request that distinguishes our simulator from a unit, and its reply."""


class PmxMotion(StrEnum):
    """What a command begins."""

    NONE = "-"
    MOVE = "move"
    JOG = "jog"
    HOMING = "homing"
    PROGRAM = "program"


class PmxRetention(StrEnum):
    """What a value is."""

    NONE = "-"
    """The command has no value that can be written and read."""
    STATE = "state"
    """One of the moment: nothing restores it."""
    SETTING = "setting"
    WIRE = "wire"
    """A setting of communication, which acts after STORE and a power cycle."""


class PmxPosition(StrEnum):
    """What writing a value does to positions."""

    NOTHING = "-"
    SETS = "position"
    COUNTS = "counter"
    """It sets a counter from which StepNLoop takes the position."""
    SCALES = "scale"
    """It changes the length or the direction of a count."""
    RATIO = "ratio"
    """It changes how many pulses StepNLoop makes for a count."""


class Corrects(StrEnum):
    """What may move an axis once a setting is written."""

    NOTHING = "-"
    LOOP = "on"
    """StepNLoop, which it switches on."""
    WHILE_ON = "while on"
    """StepNLoop, if it is on."""
    JOYSTICK = "joystick"
    """The joystick, whose switch cannot be read."""
    POWER_UP = "power-up"
    """A program after power-up."""


@dataclass(frozen=True, kw_only=True)
class PmxCommand:
    """A row of the table."""

    name: str
    shape: str
    access: str
    meaning: str
    takes: str
    """Range and unit of its value, in words."""
    section: str
    note: str
    starts: bool
    """Whether it can start motion or a program; for a value, when written. StepNLoop corrects a position by moving."""
    motion: PmxMotion
    low: float | None
    high: float | None
    """The range of a value that can be written and read; None: it is no number. Whole, unless with a point."""
    unit: str
    """The unit of a setting."""
    kept: PmxRetention
    position: PmxPosition
    corrects: Corrects
    guard: str
    """What a line does to which a person must agree first, a setting where a value is written; empty: it needs none."""
    quiet: frozenset[str]
    """Values that stop a program, a motor or its correction: no address makes them a guarded command."""

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


def _bound(text: str) -> float | None:
    if text == "-":
        return None
    return float(text) if "." in text else int(text)


def record(row: Mapping[str, str]) -> PmxCommand:
    """Make the record of a row. Raises ValueError for a wrong cell."""
    if empty := [column for column, text in row.items() if not text]:
        raise ValueError(f"the row of {row['name']} says nothing of: {', '.join(empty)}")
    said = {column: "" if text == "-" else text for column, text in row.items()}
    return PmxCommand(
        name=row["name"],
        shape=row["shape"],
        access=row["access"],
        meaning=row["meaning"],
        takes=said["takes"],
        section=row["section"],
        note=said["note"],
        starts={"yes": True, "no": False}[row["starts"]],
        motion=PmxMotion(row["motion"]),
        low=_bound(row["low"]),
        high=_bound(row["high"]),
        unit=said["unit"],
        kept=PmxRetention(row["kept"]),
        position=PmxPosition(row["position"]),
        corrects=Corrects(row["corrects"]),
        guard=said["guard"],
        quiet=frozenset(said["quiet"].split()),
    )


ROWS: tuple[PmxCommand, ...] = tuple(map(record, rows(__file__, "commands.csv")))
COMMANDS: Mapping[str, PmxCommand] = {row.name: row for row in ROWS}
WORDS: Mapping[str, PmxCommand] = {word: row for row in ROWS for word in row.words()}
"""Every word, with its axis, direction or number."""

ELSEWHERE: Mapping[str, str] = {
    "HS": "HSPD", "LS": "LSPD", "SSP": "SSPD", "JOG": "J", "HOME": "H", "LHOME": "L", "ZHOME": "ZH", "ZOME": "Z",
    "HLHOME": "HL", "ECLEAR": "CLR", "GOSUB": "GS", "SAP": "POL", "JOYENA": "JO", "JOYHS": "JV", "JOYDEL": "JV",
    "JOYTOL": "JV", "JOYNO": "JL", "JOYNI": "JL", "JOYPI": "JL", "JOYPO": "JL",
}  # fmt: skip
"""Words of programs and of the manual's text that have another name on the line."""
_HEAD = re.compile(r"[A-Za-z]+")
_PLACE = re.compile(r"(X-?\d+(Y-?\d+)?|Y-?\d+|I-?\d+:-?\d+|T[XY]-?\d+)", re.ASCII)

_GROUPED = re.compile(r"[0-9]+(?:(?:\s*,\s*|\s+|['`\\;#])[0-9]{3}(?![0-9]))+")


def grouped(text: str) -> str:
    """Return why a line is refused for a number in groups of three digits (`X200,000`); empty where it has none.

    No command separates numbers by a comma or a space.
    """
    match = _GROUPED.search(text)
    return f"{match[0]} is not one number; write {re.sub(r'[^0-9]', '', match[0])}" if match else ""


def lookup(word: str) -> PmxCommand | None:
    """Find the row of a command, with or without its continuation (`HSPDX`, `X1000`, `DO3=1`), in any case."""
    text = word.strip().upper().partition("=")[0].strip()
    if text in COMMANDS or text in WORDS:
        return COMMANDS.get(text) or WORDS[text]
    if _PLACE.fullmatch(text):
        return COMMANDS[text[0]]
    return None


def head(text: str) -> str:
    """The letters at the head of a line, in capitals."""
    match = _HEAD.match(text.strip())
    return match.group().upper() if match else ""


def reads(text: str) -> bool:
    row = lookup(text)
    return row is not None and "R" in row.access and "=" not in text


def starts_motion(text: str) -> bool:
    """Whether a command can start motion or a program; an unknown command can."""
    row = lookup(text)
    return row is None or (row.starts and not reads(text))


def those(fact: Callable[[PmxCommand], bool]) -> tuple[str, ...]:
    """The commands for which a fact holds, in the order of the table."""
    return tuple(row.name for row in ROWS if fact(row))


MOTIONS = those(lambda row: row.motion in (PmxMotion.MOVE, PmxMotion.JOG, PmxMotion.HOMING))
"""Commands that start one motion. After it nothing moves by itself."""
HOMINGS = those(lambda row: row.motion is PmxMotion.HOMING)
PROGRAMS = those(lambda row: row.motion is PmxMotion.PROGRAM)
WIRE = those(lambda row: row.kept is PmxRetention.WIRE)
"""Settings of communication, which act after STORE and a power cycle."""
SCALES = those(lambda row: row.position is PmxPosition.SCALES)
"""Settings of an axis that give a count its length and its direction."""
RESCALING = those(lambda row: row.position in (PmxPosition.SCALES, PmxPosition.RATIO))
RECOUNTING = those(lambda row: row.position is not PmxPosition.NOTHING)
"""Values that change what positions count, or the positions."""


def axes_of(text: str) -> frozenset[str] | None:
    """The axes of a command that starts no program, in small letters; None: any."""
    row = lookup(text)
    if row is None or row.name in PROGRAMS:
        return None
    rest = text.strip().upper() if "place" in row.shapes else text.strip().upper().removeprefix(row.name)
    return frozenset(axis.lower() for axis in AXES if axis in rest.partition("=")[0]) or None


# Replies in words: status numbers, and refusals with meaning and remedy.
#
# A refusal begins with a question mark; an unknown command follows it. (PMX-2ED-SA manual, tables 7.2, 7.9, 7.12,
# 9.1.)


MOVING = 0b111
"""The bits of a motor status that mean that the axis makes pulses."""
LIMIT_PLUS, LIMIT_MINUS = 1 << 7, 1 << 8
LIMIT_ERROR = LIMIT_PLUS | LIMIT_MINUS


def _states(word: str) -> dict[int, str]:
    return {int(row["value"], 0): row["meaning"] for row in rows(__file__, "states.csv") if row["of"] == word}


BITS = tuple(_states("MST").items())
"""The bits of MSTX and MSTY, the most important for a person first."""

POLARITIES = _states("POL")
"""The bits of POLX and POLY; the two of the decoding are one value."""

LOOP = _states("SLS")
"""The values of SLSX and SLSY."""
LOOP_ERRORS = frozenset({8, 9, 10, 11})

PROGRAM = _states("SASTAT")
"""The values of SASTAT0 and SASTAT1."""


def parts_of(name: str) -> list[tuple[str, str]]:
    """The parts of a command's value, each with its meaning: the bits of a sum, or its numbers; empty for any other."""
    if name in ("MST", "POL"):
        bits = dict(sorted((BITS if name == "MST" else POLARITIES.items()), key=lambda each: each[0]))
        return [
            (_bit_name(bit), f"{bit}: {meaning}" if bit.bit_count() == 1 else meaning) for bit, meaning in bits.items()
        ]
    return [(str(number), meaning) for number, meaning in {"SLS": LOOP, "SASTAT": PROGRAM}.get(name, {}).items()]


def _bit_name(mask: int) -> str:
    low, high = (mask & -mask).bit_length() - 1, mask.bit_length() - 1
    return f"bit {low}" if low == high else f"bits {low}, {high}"


def status_words(status: int) -> tuple[str, ...]:
    """Describe a motor status; `at rest` where the axis makes no pulses."""
    words = tuple(word for bit, word in BITS if status & bit)
    return words if status & MOVING else ("at rest", *words)


def trouble_words(status: int) -> str:
    """Describe what is wrong, for a readout beside `moving` and `stopped`; empty for nothing."""
    wrong = LIMIT_ERROR | 1 << 11
    return ", ".join(word for bit, word in BITS if status & bit & wrong)


def loop_words(state: int) -> str:
    return LOOP.get(state, f"state {state}")


def program_words(state: int) -> str:
    return PROGRAM.get(state, f"state {state}")


MEANINGS = {row["reply"]: (row["meaning"], row["remedy"]) for row in rows(__file__, "refusals.csv")}
"""Meaning and remedy by the reply, in the manual's spelling."""
_FOLDED = {reply.casefold().replace(" ", ""): meaning for reply, meaning in MEANINGS.items()}


def meaning(reply: str) -> tuple[str, str] | None:
    """Look up a refusal, whatever its spacing and case; None where it only repeats an unknown command."""
    return _FOLDED.get(reply.casefold().replace(" ", ""))
