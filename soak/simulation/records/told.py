"""What was told to run by itself, and what else the acts at the prompt promise: for the judge.

A macro, a script, a download and a restore are a `Run` each. Their lines are commands like typed ones, except for those
of a macro that plays several times, which `Told.repeated` has with the number of times.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from math import inf

from soak.simulation.records.commands import Command

NEAR = 2
"""How far from its target a drive may rest, in its own units."""
SHORT = re.compile(r"stopped at -?\d+ of \d+")
"""The words for a motion that ended short of its target."""
Line = tuple[str, str, str]
"""A line of drives, a drive on it, and a text."""


@dataclass
class Download:
    """A program file for a drive. `old` and `new`: what the drive held as it began, and at its end."""

    line: str
    drive: str
    file: str
    text: str
    old: tuple[str, ...] = ()
    new: tuple[str, ...] = ()
    restarts: int = 0
    """How often the drive had lost what it held, as it began."""
    restarted: bool = False
    """The drive has begun again while it ran."""


@dataclass
class Run:
    """Something that sends lines by itself. `typed`: the line that begins it."""

    name: str
    typed: str
    texts: dict[Line, None] = field(default_factory=dict)
    """What it may send."""
    moves: dict[Line, None] = field(default_factory=dict)
    """Those of them that start motion."""
    on_early_end: dict[Line, None] = field(default_factory=dict)
    """What it may send after its early end."""
    download: Download | None = None
    began: float = -1.0
    latches: int = 0
    """The number of latches before it began: a stop may come in the same moment."""
    executed: int = 0
    """The number of lines that drives had executed before it began: one may have been so in the same moment."""
    ended: float = -1.0
    automatic: bool = False
    """A macro or a script, which a stop keeps from beginning until `/resume`."""
    failure: str = ""
    """Why it ended early; empty: it did not."""


@dataclass
class Awaited:
    """A script that moved a drive, waited, and then sent `after`. `position`: the drive's own, as the script ended."""

    run: Run
    after: Line
    goal: int
    position: int = 0


@dataclass
class Guarded:
    """Lines that are sent after a yes only. `asks` False: nobody is asked."""

    typed: float
    texts: tuple[Line, ...]
    asks: bool = True


@dataclass
class Put:
    """A line that a drive stores or a port takes as it is. `sent` None: no word yet."""

    at: float
    line: str
    drive: str
    text: str
    sent: bool | None = None


@dataclass
class Quit:
    """A quit that was typed, and the commands that were typed right after it."""

    at: float
    after: list[Command]
    accepted: float = inf
    """When the session ended by it; infinite: it went on."""


@dataclass
class Strange:
    """A Modbus device that did not identify itself. A message is its function and its register: `10 0043`."""

    typed: list[str] = field(default_factory=list)
    """The messages of the lines that were typed for it, by a person or by automation."""
    heard: list[tuple[float, str]] = field(default_factory=list)
    """The messages that have reached it, without the questions what it is."""
    stops: list[float] = field(default_factory=list)
    """When the stop key was pressed."""


@dataclass(frozen=True)
class Fact:
    """What a session promised of its drives, compared with what they did. `rule`: the rule of the judge for it."""

    rule: str
    words: str
    holds: bool


@dataclass
class Told:
    """All of it, in its order."""

    backups: dict[str, str] = field(default_factory=dict)
    """The backups of programs that are on the disk at the end, by path."""
    runs: dict[str, Run] = field(default_factory=dict)
    """By the typed line."""
    repeated: dict[Line, int] = field(default_factory=dict)
    """How often a drive may execute a line."""
    guarded: list[Guarded] = field(default_factory=list)
    yes: list[float] = field(default_factory=list)
    """When a yes was typed."""
    programs: dict[str, float] = field(default_factory=dict)
    """When the first program of a line was started that prints."""
    started: list[tuple[float, str, str]] = field(default_factory=list)
    """When an input started a program that prints, on which line and in which drive: that clears the error flag."""
    latches: list[tuple[float, bool]] = field(default_factory=list)
    """When the thread of a stop had done its work, and when `/resume` or the next session let automation run again."""
    awaited: list[Awaited] = field(default_factory=list)
    """What scripts waited for whose motions may have failed."""
    quits: list[Quit] = field(default_factory=list)
    strangers: list[Strange] = field(default_factory=list)
    halts: list[float] = field(default_factory=list)
    """When everything was stopped."""
    stored: list[Put] = field(default_factory=list)
    """Lines for a drive in program mode."""
    half: set[tuple[str, str]] = field(default_factory=set)
    """Lines that a client of a shared port has begun, and never ended."""
    raw: list[Put] = field(default_factory=list)
    """Texts for a line in raw mode."""
    raw_written: dict[str, bytearray] = field(default_factory=dict)
    raw_stops: dict[str, dict[bytes, None]] = field(default_factory=dict)
    """The parts of a stop of a line in raw mode."""
    unexamined: dict[str, Run] = field(default_factory=dict)
    """Runs that ended early, whose drives were not looked at yet."""
    unstopped: list[str] = field(default_factory=list)
    """Drives that went on after the early end of what had moved them."""
    unspared: list[str] = field(default_factory=list)
    """Drives that the early end of what had started nothing has stopped."""
    stopped_too: list[str] = field(default_factory=list)
    """Drives that an early end stopped, although it had not moved them."""
    facts: list[Fact] = field(default_factory=list)
    """The comparisons of the workshops."""
