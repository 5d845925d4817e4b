"""A session log as steps that can be taken again: the lines that drives got, with what they printed then.

Polls, and verbs that only show or that run other lines, are no steps: a macro's lines stand in the log themselves. A
line that was never sent, such as one that a person did not agree to, is none either.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.base.text import real, visible
from multidrop.shell.line_syntax import WAITS
from multidrop.shell.log.files import BEGIN, TRAFFIC, LogEntry, LogLine, whole
from multidrop.shell.secrets import HIDDEN

WORLD = "/sim"
"""The verb that acts on simulated drives; it is a step for those only."""
RUNS_LINES = ("/play", "/call")
"""The verbs whose lines stand in the log after them."""


@dataclass
class LoggedStep:
    """A line, or a stop (`text` is empty), with what came of it."""

    where: str
    """`file:line`."""
    at: datetime
    text: str
    """Without an address; of a verb with its slash."""
    bus: str = ""
    drive: str = ""
    printed: list[str] = field(default_factory=list)
    failed: str = ""
    sent: bool = False
    """Bytes were sent for it."""

    @property
    def is_verb(self) -> bool:
        return self.text.startswith("/")


@dataclass
class LoggedPoll:
    """A poll: the bytes that were sent, and those that were received until the next request of the bus."""

    where: str
    at: datetime
    bus: str
    drive: str
    sent: bytes
    received: bytes = b""


@dataclass
class LoggedSteps:
    """The steps of a session, and what is left out."""

    steps: list[LoggedStep] = field(default_factory=list)
    skipped: dict[str, None] = field(default_factory=dict)
    """Verbs and others that are no steps."""
    unsent: int = 0
    """The lines that were never sent."""
    polls: list[LoggedPoll] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    """The places of lines that cannot be read."""


def read(path: Path) -> LoggedSteps:
    """Read the last session of a log. Raises Diagnostic where it has none, or where a line cannot be sent again."""
    lines: list[LogLine] = []
    for line in whole(path):
        if line.entry is not None and line.entry.kind == "log" and line.entry.text.startswith(BEGIN):
            lines = []
        lines.append(line)
    if not any(line.entry for line in lines):
        raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")
    reader = _StepReader()
    for line in lines:
        if line.entry is not None:
            reader.take(line.where, line.entry)
    whole_ = reader.whole()
    whole_.damaged = [line.where for line in lines if line.entry is None and line.data.strip()]
    return whole_


class _StepReader:
    """Gives each result to its line: what a drive prints belongs to the last line for it."""

    def __init__(self) -> None:
        self._found = LoggedSteps()
        self._last: dict[tuple[str, str], LoggedStep] = {}
        self._newest: LoggedStep | None = None
        self._polled: dict[str, LoggedPoll] = {}
        """The last request of each bus, where that is a poll."""

    def take(self, where: str, entry: LogEntry) -> None:
        place = (entry.bus, entry.drive)
        if entry.kind in TRAFFIC:
            self._traffic(where, entry)
        if entry.kind == "typed":
            self._typed(where, entry)
        elif entry.kind == "stop":
            self._found.steps.append(LoggedStep(where, entry.time, "", sent=True))
        elif entry.kind == "printed" and place in self._last:
            self._last[place].printed.append(entry.text)
        elif entry.kind == "sent" and not entry.poll and place in self._last:
            self._last[place].sent = True
        elif entry.kind == "failed":
            step = self._last.get(place) if entry.drive else self._newest
            if step is not None and not step.printed and not step.failed:
                step.failed = entry.text

    def _typed(self, where: str, entry: LogEntry) -> None:
        text = entry.text.strip()
        if entry.bus and text.startswith("@"):
            text = text.partition(" ")[2].strip()
        if not text:
            return
        if visible(text, tabs=True) != text:
            raise Diagnostic("holds control characters", where, "a line is sent as one line of text")
        self._newest = step = LoggedStep(where, entry.time, text, entry.bus, entry.drive)
        verb = "" if entry.bus else text.split()[0]
        if entry.raw:
            self._found.skipped["lines in raw mode"] = None
        elif entry.bus:
            self._last[entry.bus, entry.drive] = step
            self._found.steps.append(step)
        elif verb in (*WAITS, WORLD):
            step.sent = True
            self._found.steps.append(step)
        elif verb not in RUNS_LINES:
            self._found.skipped[verb] = None

    def _traffic(self, where: str, entry: LogEntry) -> None:
        data = entry.text.encode("latin-1")
        if entry.kind == "received":
            if (poll := self._polled.get(entry.bus)) is not None:
                poll.received += data
            return
        self._polled.pop(entry.bus, None)
        if entry.poll:
            self._polled[entry.bus] = poll = LoggedPoll(where, entry.time, entry.bus, entry.drive, data)
            self._found.polls.append(poll)

    def whole(self) -> LoggedSteps:
        steps = self._found
        sent = [step for step in steps.steps if step.sent]
        for step in sent:
            if HIDDEN in step.text:
                raise Diagnostic("holds a secret that the log does not have", step.where, "the log ends before it")
        steps.steps, steps.unsent = sent, len(steps.steps) - len(sent)
        return steps


def compared(step: LoggedStep, printed: list[str], failed: str, moving: bool) -> str:
    """The difference between what came then and now; empty where there is none.

    `moving`: the drive may move, so a number may be another number.
    """
    if errors_differ(step.failed, failed):
        return f"then {step.failed or 'no error'}; now {failed or 'no error'}"

    def alike(then: str, now: str) -> bool:
        return then == now or (moving and None not in (real(then), real(now)))

    if len(printed) == len(step.printed) and all(map(alike, step.printed, printed)):
        return ""
    return f"then {_quoted(step.printed)}; now {_quoted(printed)}"


def errors_differ(then: str, now: str) -> bool:
    """Whether one failed and the other did not, or with another error number."""
    numbers = [_number_of_error(text) for text in (then, now)]
    return bool(then) != bool(now) or (all(numbers) and numbers[0] != numbers[1])


def _number_of_error(text: str) -> str:
    after = text.partition(" error ")[2]
    return after[: len(after) - len(after.lstrip("0123456789"))]


def _quoted(lines: Iterable[str]) -> str:
    return ", ".join(lines) or "nothing"
