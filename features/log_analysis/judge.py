"""The judge of a session log: rules that its entries alone can decide.

A line of a log has what multidrop typed, sent, received and said, and nothing of what a drive did. So a rule compares
these with each other. What an entry does not show breaks no rule. A gap in the log, and each new session, begins anew.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import FAMILIES
from multidrop.features.log_analysis.moments import BACK
from multidrop.shell.events import By
from multidrop.shell.line_syntax import EVERYONE, DriveLine, parse
from multidrop.shell.log.files import BEGIN, LogEntry, LogLine

RULES = {
    "twice": "A typed command is sent once; again only after a NAK and a question, three times at most.",
    "not sent": "A command that is said to be not sent is not sent.",
    "after a stop": "A command that was typed before a stop is not sent after it.",
    "first": "What is sent first on a line after a stop is its stop.",
    "stopped": "A drive is said to have stopped after two replies since the stop, or since one before it.",
    "credited": "A printed line was received after its drive was asked, and from a drive of no other name.",
    "silence": "A command that a person typed, to which nothing was received, is reported.",
}
MOST_KEPT_EXCHANGES = 20
"""The exchanges of a drive in which a printed line is looked for."""
NAK_REPEATS = 3
"""How often a command that was rejected as damaged is sent again."""
READINGS = 2
OTHER_TAB_DELAY = timedelta(seconds=5)
"""The time in which a line may be typed in another tab, while the one before waits for its reply."""
MOMENT = timedelta(seconds=0.1)
"""The time after a stop in which the confirmation of an earlier one may still be said."""
NAK = "\x15"
UNSENT = re.compile(
    r"'(.+?)'(?: was typed; it| was stopped; it)? was not sent|^not sent, as (?:'.*?' failed|.*?): (.*)$"
)
STOPPED = re.compile(r"(?:.*: )?stopped, velocity 0 at ")
Place = tuple[str, str]
"""A bus, and a drive on it."""


class Breach(NamedTuple):
    """A broken rule, and the line that shows it."""

    rule: str
    line: LogLine
    entry: LogEntry
    text: str


@dataclass(eq=False)
class Typed:
    """A line for a drive that was typed, and what was sent and received for its drive since."""

    text: str
    stops: int
    """The stops before it."""
    sent: int = 0
    """How often it was sent."""
    asked: int = 0
    """The questions that were sent since it was sent last."""
    heard: str = ""
    """What was received since it was sent last."""
    reported: bool = False
    at: datetime = datetime.min.replace(tzinfo=UTC)
    """When it, or a question about it, was sent last."""


class _Session:
    """The entries of one session, as far as the rules need them."""

    def __init__(self, marked: bool = False) -> None:
        self.marked = marked
        self._stops = 0
        self._stop: datetime | None = None
        self._before: datetime | None = None
        """The time of the entry before."""
        self._due: set[str] = set()
        """Buses on which the stop is sent next."""
        self._buses: set[str] = set()
        self._typed: dict[tuple[str, str, str], Typed] = {}
        """By bus, drive and text: the last of each."""
        self._last: dict[tuple[str, str, str], Typed] = {}
        """The last line for a drive of each origin; a person and a macro may have one at a time."""
        self._silent: list[tuple[Place, Typed]] = []
        """Commands to which nothing was received as another tab typed a line for their drive."""
        self._exchanges: dict[Place, deque[list[str]]] = {}
        """What was sent to a drive, and what was received on its bus until it was sent more."""
        self._unsent: set[tuple[str, str, str]] = set()
        """Commands that are said to be not sent, and not typed since."""
        self._lines: set[tuple[str, str, str]] = set()
        """All that was typed for drives: what fails beside is a command of multidrop's own, which comes again."""
        self._asked: dict[str, str] = {}
        """By bus, the drive that was asked last and has not replied."""
        self._replies: Counter[Place] = Counter()
        """Replies of drives since a stop after which they got no command."""
        self._begun = False
        """Its beginning is in the log."""
        self._early: dict[str, str] = {}
        """By bus, what was received before anything was sent: it may answer what was sent before the log began."""
        self._sent_on: set[str] = set()
        self._earlier: Counter[Place] = Counter()
        """Those before the last stop, which an earlier one may be confirmed by in this moment."""
        self._commanded: set[Place] = set()

    def take(self, entry: LogEntry) -> Iterator[tuple[str, str]]:
        """Take an entry, where commands and stops are marked; yield each rule that it breaks, and how."""
        self._keep_time(entry.time)
        if entry.kind == "log":
            self.marked, self._begun = entry.marks, self._begun or entry.text.startswith(BEGIN)
        elif not self.marked:
            return
        elif entry.kind == "bus":
            self._report(entry.bus)
            self._buses.add(entry.bus)
            if entry.text == "closed":
                self._buses.discard(entry.bus)
                self._due.discard(entry.bus)
        elif entry.kind == "typed":
            yield from self._line_typed(entry)
        elif entry.kind == "stop":
            self._stops, self._stop, self._due = self._stops + 1, entry.time, set(self._buses)
            self._earlier = Counter(self._replies) if self._stops > 1 else Counter()
            for bus, drive in [*self._replies]:
                if self._stops == 1 or self._commanded & {(bus, drive), *((bus, address) for address in EVERYONE)}:
                    del self._replies[bus, drive]
            self._commanded.clear()
            self._report("")
        elif entry.kind == "sent":
            yield from self._sent(entry)
        elif entry.kind == "received":
            if (
                entry.drive
                and self._asked.get(entry.bus) == entry.drive
                or (not entry.drive and entry.bus in self._asked)
            ):
                self._replies[entry.bus, entry.drive] += 1
                del self._asked[entry.bus]
            if not self._begun and entry.bus not in self._sent_on:
                self._early[entry.bus] = self._early.get(entry.bus, "") + entry.text
            for (bus, *_), typed in self._last.items():
                typed.heard += entry.text * (bus == entry.bus)
            for (bus, _), typed in self._silent:
                typed.heard += entry.text * (bus == entry.bus)
            for (bus, _), exchanges in self._exchanges.items():
                exchanges[-1][1] += entry.text * (bus == entry.bus)
        elif entry.kind == "printed":
            yield from self._printed(entry)
        elif entry.kind in ("notice", "failed"):
            yield from self._said(entry)

    def _keep_time(self, now: datetime) -> None:
        """Move the time of the last stop with a clock that was set back."""
        back = (self._before or now) - now
        if self._stop is not None and back >= BACK:
            self._stop -= back
        self._before = now

    def _report(self, bus: str) -> None:
        """Something was said of a bus; empty: of all."""
        for (place, *_), typed in self._last.items():
            typed.reported = typed.reported or bus in ("", place)
        self._silent = [(place, typed) for place, typed in self._silent if bus not in ("", place[0])]

    def _line_typed(self, entry: LogEntry) -> Iterator[tuple[str, str]]:
        if not entry.bus:  # a verb may send the same texts by itself
            self._last.clear()
            self._typed.clear()
            self._silent.clear()
        if entry.raw or not entry.bus:
            return
        origin = entry.bus, entry.drive, entry.by
        before = self._last.get(origin) if entry.by == By.OPERATOR.value else None  # several macros may play at once
        if before is not None and before.sent and not (before.heard or before.reported or entry.drive in EVERYONE):
            if entry.time - before.at < OTHER_TAB_DELAY:
                self._silent.append(((entry.bus, entry.drive), before))
            else:
                yield _silence(before)
        text = _text(entry.text)
        self._last[origin] = self._typed[entry.bus, entry.drive, text] = Typed(text, self._stops)
        self._lines.add((entry.bus, entry.drive, text))
        self._unsent.discard((entry.bus, entry.drive, text))

    def _sent(self, entry: LogEntry) -> Iterator[tuple[str, str]]:
        place, earlier = (entry.bus, entry.drive), self._stop is not None and entry.time < self._stop
        self._sent_on.add(entry.bus)
        if entry.bus in self._due and not earlier:
            self._due.discard(entry.bus)
            if not entry.stop:
                yield "first", f"{entry.text!r} was sent before the stop"
        if entry.stop or entry.poll:
            self._asked[entry.bus] = "" if entry.stop else entry.drive
            return
        self._asked[entry.bus] = entry.drive
        self._exchanges.setdefault(place, deque(maxlen=MOST_KEPT_EXCHANGES)).append([entry.text, ""])
        last = [each for key, each in self._last.items() if key[:2] == place]
        for last_typed in last:
            last_typed.asked += not entry.command
            last_typed.at = entry.time
        if not entry.command:
            return
        yield from self._over(place)
        self._commanded.add(place)
        key = (*place, entry.command)
        if key in self._unsent:
            yield "not sent", f"{entry.command!r} was said to be not sent, and not typed since"
        typed = self._typed.get(key)
        if typed is not None and typed.stops != self._stops and not earlier:
            yield "after a stop", f"{entry.command!r} was typed before the stop"
        if typed not in last or typed is None:
            return
        again = NAK in typed.heard and typed.asked and typed.sent <= NAK_REPEATS
        if typed.sent and not again:
            yield "twice", f"{entry.command!r} was sent {typed.sent + 1} times"
        typed.sent, typed.asked, typed.heard = typed.sent + 1, 0, ""

    def _over(self, place: Place) -> Iterator[tuple[str, str]]:
        """The next command leaves for a drive: what was sent to it before is over."""
        for at, typed in self._silent:
            if at == place and not typed.heard:
                yield _silence(typed)
        self._silent = [(at, typed) for at, typed in self._silent if at != place]

    def _printed(self, entry: LogEntry) -> Iterator[tuple[str, str]]:
        exchanges = self._exchanges.get((entry.bus, entry.drive))
        asked = any(key[:2] == (entry.bus, entry.drive) for key in self._last)
        if exchanges is None or not asked or entry.text in self._early.get(entry.bus, ""):
            return  # what it answers was typed, or sent, before the log began
        named = [_named(sent, received, entry.text) for sent, received in exchanges]
        names = {name for names_of in named if names_of is not None for name in names_of}
        if all(names_of is None for names_of in named):
            yield "credited", f"{entry.text!r} was printed and not received"
        elif names and entry.drive not in names:
            yield "credited", f"{entry.text!r} came from {', '.join(sorted(names))}"

    def _said(self, entry: LogEntry) -> Iterator[tuple[str, str]]:
        self._report(entry.bus)
        for match in UNSENT.finditer(entry.text):
            target = _target(match[1] or match[2], entry)
            typed = self._typed.get(target)
            if entry.kind == "failed" and typed is not None and typed.sent:
                yield "not sent", f"{typed.text!r} was sent"
            if match[2] or target in self._lines:
                self._unsent.add(target)
        if entry.kind == "notice" and self._stop is not None and STOPPED.match(entry.text):
            drive = _stopped_drive(entry)
            moment = entry.time - self._stop < MOMENT
            if moment and self._stops == 1 and not self._begun:
                return  # of a stop before this log
            earlier = self._earlier[entry.bus, drive] * moment
            if (replies := max(self._replies[entry.bus, drive], earlier)) < READINGS:
                yield "stopped", f"{entry.text!r}, after {replies} replies"


def _stopped_drive(entry: LogEntry) -> str:
    """The address in a report of a stop: `press: 01 X: stopped, ...`; without an address, `press X: stopped, ...`."""
    name = entry.text.removeprefix(f"{entry.bus}: ").rpartition("stopped, ")[0].removesuffix(": ").partition(" ")[0]
    return "" if name == entry.bus else name


def _silence(typed: Typed) -> tuple[str, str]:
    return "silence", f"{typed.text!r} was sent, nothing was received, and nothing was said of it"


def _text(typed: str) -> str:
    """The text of a typed line, without its address."""
    try:
        parsed = parse(typed)
    except Diagnostic:
        return typed
    return str(parsed.text) if isinstance(parsed, DriveLine) else typed


def _target(typed: str, entry: LogEntry) -> tuple[str, str, str]:
    """The bus, the drive and the text of a line that an entry names."""
    try:
        parsed = parse(typed)
    except Diagnostic:
        parsed = None
    if not isinstance(parsed, DriveLine) or parsed.address is None and not entry.bus:
        return "", "", typed
    drive = entry.drive if parsed.address is None else parsed.address
    return parsed.bus or entry.bus, drive, str(parsed.text)


def _named(sent: str, received: str, printed: str) -> set[str] | None:
    """The drives that a reply names beside a printed line; empty: it names none. None: there is no such reply."""
    raw = sent.encode("latin-1"), received.encode("latin-1")
    for family in FAMILIES.values():
        if (replied := family.codec.replied(*raw)) is not None:
            return set() if replied else None
    if printed not in received and printed not in received.replace("\n", ""):  # some drives ignore LF within a line
        return None
    if '"~"' in sent:  # the mark of a drive alone: a value may follow it
        return set()
    whole = rf'(?:\A|[\r\n\x06\x15>?]){re.escape(printed)}["~]([!0-9A-Za-z])'  # not the end of a longer value
    return set(re.findall(whole, received))


@dataclass
class Judgement:
    """What was judged, and what broke a rule."""

    sessions: int = 0
    """Sessions and parts of sessions."""
    commands: int = 0
    stops: int = 0
    unmarked: int = 0
    """Sessions of a version whose logs cannot be judged."""
    unreadable: list[str] = field(default_factory=list)
    """The places of lines that are not entries: nothing is known of what they held."""
    gaps: int = 0
    """The places where the log says that entries are missing."""
    breaches: list[Breach] = field(default_factory=list)


def judged(lines: Iterable[LogLine]) -> Judgement:
    """Judge the lines of a log."""
    judgement, session = Judgement(), _Session()
    for line in lines:
        entry = line.entry
        if entry is None or entry.kind == "missing" or (entry.kind == "log" and entry.text.startswith(BEGIN)):
            session = _Session(session.marked)
        if entry is None and line.data.strip():
            judgement.unreadable.append(line.where)
        if entry is not None:
            judgement.gaps += entry.kind == "missing"
            judgement.commands += bool(entry.command)
            judgement.stops += entry.kind == "stop"
            judgement.sessions += entry.kind == "log"
            judgement.unmarked += entry.kind == "log" and not entry.marks
            judgement.breaches += (Breach(rule, line, entry, text) for rule, text in session.take(entry))
    return judgement
