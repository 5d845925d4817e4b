"""What was typed, what the host said of it, and what the drives did: the history of one seed, for the judge.

A command is known by its text, which is unique in a history. The drives' own record (`soak.judge.Witness`) says what
they executed; the host's word is what the line's caller got, or the notice that it was not sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from math import inf
from typing import NamedTuple

from soak.simulation.records.commands import Command, Outcome
from soak.simulation.records.told import Told

KILLED = "killed before it was said"
NUMBER = r"\d{7,8}"
"""A unique value, as a pattern."""
UNSENT = re.compile(r"^not sent, as (?:'.*?' failed|.*?): (.*)$")


@dataclass
class Stop:
    """A read that held the stop key. `forms`: by line that could be written, the bytes of which one had to go first."""

    at: float
    forms: dict[str, tuple[bytes, ...]]
    who: str = ""
    """Whose stop it was; empty: this person's."""
    written: int = 0
    """The number of writes before it."""
    done: int = 0
    """The number of writes once its thread had done its work."""
    own: dict[str, tuple[int, int]] = field(default_factory=dict)
    """By line, the number of writes before its thread's first one, and the bytes of a message that had begun to leave,
    which leave before it."""
    lost: tuple[str, ...] = ()
    """The lines that were lost, and being tried again."""
    pieces: dict[str, tuple[bytes, ...]] = field(default_factory=dict)
    """By line that could be written, what has to leave again once it is quiet."""
    parts: dict[str, tuple[bytes, ...]] = field(default_factory=dict)
    """By line that could be written, the bytes that a stop is made of."""
    reaches: dict[str, dict[str, Callable[[bytes], bool]]] = field(default_factory=dict)
    """By line that could be written, and by drive: whether bytes hold the stop of that drive."""


@dataclass(frozen=True)
class Executed:
    """A line that a drive executed."""

    at: float
    line: str
    drive: str
    text: str


@dataclass(frozen=True)
class Damage:
    """Bytes on a wire that noise changed."""

    at: float
    before: bytes
    after: bytes


@dataclass
class Held:
    """A value that a drive held. `restarts`: those of the drive so far."""

    line: str
    drive: str
    number: str
    at: float
    restarts: int
    until: float = inf


@dataclass(frozen=True)
class Shown:
    """A value that was shown as a drive's. `began`: when the question began that it answers; `form`: its print."""

    line: str
    drive: str
    text: str
    form: str
    began: float
    at: float
    restarts: int


class Peak(NamedTuple):
    """The most of something that has waited, and how much may wait at most."""

    seen: int
    most: int


@dataclass
class History:
    """Everything that happened, in its order."""

    commands: dict[str, Command] = field(default_factory=dict)
    executed: list[Executed] = field(default_factory=list)
    stops: list[Stop] = field(default_factory=list)
    """The reads that held the stop key."""
    untrue: list[str] = field(default_factory=list)
    """Drives that were said to stand, and moved."""
    written: list[tuple[float, str, bytes]] = field(default_factory=list)
    """Time, port and bytes of each write that the kernel took."""
    full: list[tuple[float, str]] = field(default_factory=list)
    """Time and port of each write of which the kernel took nothing."""
    opened: list[tuple[float, str, int]] = field(default_factory=list)
    """Time and line of each descriptor that was opened, and the number of writes before it."""
    passed: list[tuple[float, str]] = field(default_factory=list)
    """Time and line of each stop, or piece of one, that a computer which lends the line has passed on."""
    received: dict[str, list[tuple[float, bytes]]] = field(default_factory=dict)
    """Time and bytes of each read, by line."""
    damage: dict[str, list[Damage]] = field(default_factory=dict)
    """What noise changed, by line."""
    questions: dict[str, str] = field(default_factory=dict)
    """Typed lines that ask for a value, and what they print: `{}` stands for the value."""
    asked: int = 0
    """The number of times that one was typed."""
    held: list[Held] = field(default_factory=list)
    shown: list[Shown] = field(default_factory=list)
    peaks: dict[str, Peak] = field(default_factory=dict)
    """The most of each that has waited, by name: see `watching.bounds`."""
    exchanges: int = 0
    """Requests that have ended."""
    notices: list[tuple[float, str]] = field(default_factory=list)
    deaths: list[float] = field(default_factory=list)
    """When a process was killed, or lost its terminal."""
    unshown: list[str] = field(default_factory=list)
    """What a terminal has neither shown nor counted."""
    began: list[float] = field(default_factory=list)
    """When each process began."""
    power: bool = False
    """The kill that is armed is a power cut."""
    unreadable: list[str] = field(default_factory=list)
    """Files that a session could not read at its start."""
    owing: list[str] = field(default_factory=list)
    """Drives to which something is owed after the last session."""
    logged: list[str] = field(default_factory=list)
    """Breaches that the session logs show."""
    told: Told = field(default_factory=Told)
    """What was told to run by itself."""
    sent: set[tuple[str, str]] = field(default_factory=set)
    """The lines of drives and texts of requests that a session has passed to a port."""
    defects: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    lines: list[tuple[float, str, str]] = field(default_factory=list)
    """The trace: times, kinds and texts."""
    keep: bool = False
    folder: str = ""
    """The folder of the world's files, which has another name in each run: the trace leaves it out."""
    _hash: object = field(default_factory=sha256)

    def note(self, at: float, kind: str, text: str) -> None:
        """Add to the trace."""
        row = f"{at:.6f} {kind} {text.replace(self.folder, '~') if self.folder else text}"
        self._hash.update(row.encode())  # type: ignore[attr-defined]
        if self.keep:
            self.lines.append((at, kind, text))

    @property
    def lives(self) -> int:
        """The number of processes that have run."""
        return len(self.began)

    @property
    def trace(self) -> str:
        """A number of the trace: equal for equal histories."""
        return str(self._hash.hexdigest()[:16])  # type: ignore[attr-defined]

    def count(self, kind: str) -> None:
        """Count a fault or an event."""
        self.counts[kind] = self.counts.get(kind, 0) + 1

    def holds(self, held: Held) -> None:
        """Note the value that a drive holds from now on."""
        for each in self.held:
            if (each.line, each.drive, each.until) == (held.line, held.drive, inf):
                each.until = held.at
        self.held.append(held)

    def killed(self, at: float) -> None:
        """Nobody says any more what became of the lines that were typed."""
        self.deaths.append(at)
        for command in self.commands.values():
            if command.outcome is Outcome.OPEN and not command.who:
                command.outcome, command.said, command.ended = Outcome.UNKNOWN, KILLED, at

    def unsent(self, notice: str) -> None:
        """Take a notice that a line was not sent."""
        if (found := UNSENT.match(notice)) is not None and (command := self.commands.get(found[1])) is not None:
            command.outcome, command.said = Outcome.NOT_SENT, notice
