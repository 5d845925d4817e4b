"""What runs of program files on simulated drives, in virtual time, have in common: their limits and their events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from multidrop.dialects.program_files import Problem
from multidrop.simulator.cell.spec import DriveSpec

LONGEST = 3600.0
"""Virtual seconds after which a run without a time of its own is given up."""
MOST_LINES = 20_000_000
"""Executed lines after which it is given up as well: a program that never waits, on a drive set up to be fast."""
SLICE = 1.0
"""Virtual seconds between two looks at what the drive has done: some thousand lines."""


class Line(NamedTuple):
    """A line for a person. `problem`: it belongs on standard error."""

    text: str
    problem: bool = False


@dataclass(frozen=True)
class Debugging:
    """Wishes of a person who debugs a program.

    `trace`: report every executed line; otherwise only those that change a watched value. `breaks` are `LINE`, `LABEL`,
    or either with `,PASSES`. `watch` names variables.
    """

    trace: bool = False
    breaks: Sequence[str] = ()
    watch: Sequence[str] = ()

    @property
    def wanted(self) -> bool:
        """Whether there is anything to follow."""
        return bool(self.trace or self.breaks or self.watch)


NO_DEBUGGING = Debugging()


class Event(Protocol):
    """Something that a run reports. The last event is the summary."""

    @property
    def failed(self) -> bool:
        """Whether the test has failed; only a summary says so."""

    def fact(self, real: float) -> dict[str, Any]:
        """Give the JSON object; `real` is how many seconds the run has taken."""

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """Yield the lines for a person about a run of this file."""


class ProgramRun(Protocol):
    """A program file that is loaded into a simulated drive."""

    def run(self, start: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING) -> Iterator[Event]:
        """Run it from `start`, for `until` virtual seconds at most. Raises Diagnostic if there is nothing to run."""


Load = Callable[[DriveSpec], ProgramRun]
"""Loads a program file, which was read once, into a simulated drive, as often as it is called. Raises Diagnostic."""


class Programs(NamedTuple):
    """The runs of a family's program files on a simulated drive, in virtual time.

    `drive` is the default drive. `read` takes a text and its file's name. `refusals` finds the lines that a drive
    refuses. It takes a text, its file's name, the personality, and the problems found already. None: the check of the
    text finds them all.
    """

    drive: DriveSpec
    read: Callable[[str, str], Load]
    refusals: Callable[[str, str, str, Sequence[Problem]], list[Problem]] | None = None


def remark(*, stuck: bool, given_up: bool, turning: str = "") -> str:
    """Explain how a run ended where that needs a remark; `turning` is the one for a motor that still turns."""
    if stuck:
        return "the program waits here for ever: no further event is possible"
    if given_up:
        return "the program still runs; --until SECONDS sets the time limit"
    return turning


# The trace of a program file's run: executed lines, break points, the values of variables.
#
# A family names the next line of the file and its variables; `Recorder` makes events of that, `MOST_TRACED` at most.


MOST_TRACED = 10_000
"""Traced lines after which a trace ends."""
AROUND = 3
"""Lines of the file that are shown before and after a break point."""
Value = int | float
Values = Mapping[str, Value]


@dataclass(frozen=True)
class Traced:
    """A line that was executed: when it began, its number, the program of a controller, and the values it changed."""

    t: float
    line: int
    text: str
    changed: Values
    program: int | None = None
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        number = {} if self.program is None else {"program": self.program}
        return {"t": round(self.t, 6), **number, "line": self.line, "text": self.text, "changed": dict(self.changed)}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        number = "" if self.program is None else f" (program {self.program})"
        yield Line(f"{self.t:10.4f}  {file}:{self.line}: {self.text}{number}{shown(self.changed)}")


@dataclass(frozen=True)
class Broken:
    """The end of a run before the line of a break point: its name as given, and the values that are watched."""

    t: float
    place: str
    line: int
    text: str
    values: Values
    source: Sequence[str] = field(default=(), repr=False)
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        place = {"break": self.place, "line": self.line, "text": self.text}
        return {"t": round(self.t, 6), **place, "values": dict(self.values)}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """Yield the break point, and the lines of the file around it."""
        yield Line(f"{self.t:10.4f}  break point {self.place}: {file}:{self.line}: {self.text}{shown(self.values)}")
        for row in around(self.source, self.line):
            yield Line(row)


@dataclass(frozen=True)
class TraceFull:
    """The end of a trace that has become too long. The run goes on."""

    t: float
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        return {"t": round(self.t, 6), "trace": f"ends after {MOST_TRACED} lines"}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        hint = "--until and --break end the run earlier, --watch shows fewer lines"
        yield Line(f"{file}: the trace ends after {MOST_TRACED} lines; {hint}", problem=True)


Followed = Traced | Broken | TraceFull


def shown(values: Values) -> str:
    """Values as a person reads them, with blanks before."""
    return "".join(f"   {name}={value}" for name, value in values.items())


def around(source: Sequence[str], line: int) -> list[str]:
    """The lines of a file around one of them, which an arrow marks."""
    first, last = max(line - AROUND, 1), min(line + AROUND, len(source))
    width = len(str(last))
    return [f"{'->' if n == line else '  '} {n:{width}}  {source[n - 1]}".rstrip() for n in range(first, last + 1)]


@dataclass
class BreakPoint:
    """A break point: its name, and how many passes are still to come."""

    place: str
    passes: int = 1

    def reached(self) -> bool:
        """Count a pass; return whether it was the last."""
        self.passes -= 1
        return self.passes <= 0


class Recorder:
    """Makes events of the lines of one run. `values` reads what is watched, `points` are by line of the file."""

    def __init__(
        self,
        debugging: Debugging,
        source: Sequence[str],
        points: Mapping[int, BreakPoint],
        values: Callable[[], Values],
    ) -> None:
        self.broken = False
        self._debugging, self._source, self._points, self._values = debugging, source, points, values
        self._last = dict(values())
        self._traced = 0
        self._events: list[Followed] = []

    @property
    def full(self) -> bool:
        """Whether no line is recorded any more."""
        return self._traced > MOST_TRACED

    @property
    def done(self) -> bool:
        """Whether nothing is recorded any more, and no break point can end the run."""
        return self.full and not self._points

    def reaches(self, line: int) -> bool:
        """Count a pass of the break point at a line, if there is one; return whether it was the last."""
        point = self._points.get(line)
        return point is not None and point.reached()

    def breaks(self, t: float, line: int, text: str) -> None:
        """Record the end of the run before a line."""
        point = self._points[line]
        self.broken = True
        values = self._values() if self._debugging.watch else {}
        self._events.append(Broken(t, point.place, line, text, dict(values), self._source))

    def after(self, t: float, line: int, text: str, changed: Values, program: int | None = None) -> None:
        """Record an executed line that began at `t`, if it is wanted."""
        if self.full or not (self._debugging.trace or changed):
            return
        self._traced += 1
        self._events.append(TraceFull(t) if self.full else Traced(t, line, text, changed, program))

    def changed(self) -> dict[str, Value]:
        """Return the values that have changed since the last time."""
        now = self._values()
        if now == self._last:
            return {}
        changed = {name.upper(): value for name, value in now.items() if self._last.get(name) != value}
        self._last = dict(now)
        return changed

    def take(self) -> list[Followed]:
        """Return the events since the last time."""
        taken, self._events = self._events, []
        return taken


def split_break(text: str) -> tuple[str, int] | None:
    """Split `PLACE` or `PLACE,PASSES`; None for a wrong number of passes."""
    place, comma, passes = text.partition(",")
    if not comma:
        return place.strip(), 1
    if not (passes.strip().isascii() and passes.strip().isdigit()) or not 1 <= int(passes) <= 65535:
        return None
    return place.strip(), int(passes)
