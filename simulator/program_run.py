"""Runs of program files on simulated drives in virtual time: limits, events, the trace, and what families share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar, cast

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.base.text import counted
from multidrop.dialects.program_files import Problem
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.declared import simulated

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
    or either with `,PASSES`. `watch` names variables. `outputs`: report changes of outputs.
    """

    trace: bool = False
    breaks: Sequence[str] = ()
    watch: Sequence[str] = ()
    outputs: bool = False

    @property
    def wanted(self) -> bool:
        return bool(self.trace or self.breaks or self.watch)


NO_DEBUGGING = Debugging()


@dataclass(frozen=True)
class Event:
    """Something that a run reports at a time, s: its facts, and a line for a person. The last event is the Summary.

    `line`: that of the file which it is about. `problem`: it belongs on standard error, where the file is named first.
    """

    t: float
    facts: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    text: str = ""
    line: int | None = None
    problem: bool = False

    @property
    def failed(self) -> bool:
        return False

    def fact(self, real: float) -> dict[str, Any]:
        """Return the JSON object; `real` is how many seconds the run has taken."""
        return {"t": round(self.t, 6), **self.facts}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        place = f"{file}: " if self.problem else ""
        place = place if self.line is None else f"{file}:{self.line}: "
        yield Line(f"{'' if self.problem else f'{self.t:10.4f}  '}{place}{self.text}", self.problem)


ENDS = {
    "E": "ended at E",
    "END": "ended",
    "error": "ended by an error",
    "until": "stopped",
    "break": "stopped at a break point",
}


@dataclass(frozen=True, kw_only=True)
class Summary(Event):
    """How a run ended: "E", "END", "error", "break" or "until"; position, motions begun, lines executed, errors.

    `errors` are those that the program has not handled. `lines_at` are the lines of the file at which a program stands
    or has ended. `given_up`: no time was set, and the program was still running. `stuck`: nothing would ever have
    happened any more. `counts` says it for a person, `turning` is the remark on a motor that still turns.
    """

    ended: str
    position: int | tuple[int, ...]
    moves: int
    instructions: int
    errors: tuple[int | str, ...]
    lines_at: tuple[int, ...]
    moving: int
    given_up: bool
    stuck: bool
    ran: bool = True
    counts: str = ""
    turning: str = ""

    @property
    def failed(self) -> bool:
        return bool(self.errors or self.given_up)

    def fact(self, real: float) -> dict[str, Any]:
        place = self.position
        return {
            "summary": {
                "position": place if isinstance(place, int) else dict(zip("XY", place, strict=True)),
                "moves": self.moves,
                "errors": list(self.errors),
                "instructions": self.instructions,
                "virtual_s": round(self.t, 6),
                "real_s": round(real, 3),
                "ended": self.ended,
            }
        }

    def lines(self, file: str, real: float) -> Iterator[Line]:
        how = f"{ENDS[self.ended]} after {self.t:.4f} s" if self.ran else "not run"
        yield Line(f"{how}: {self.counts} ({real:.2f} s real)")
        remark = self.turning
        if self.stuck:
            remark = "the program waits here for ever: no further event is possible"
        elif self.given_up:
            remark = "the program still runs; --until SECONDS sets the time limit"
        for line in self.lines_at or (0,):
            if remark:
                yield Line(f"{file}:{line}: {remark}" if line else f"{file}: {remark}", problem=True)


class Running(Protocol):
    """A program that runs on a simulated drive: how many lines it has carried out."""

    executed: int

    @property
    def running(self) -> bool: ...  # noqa: D102


def looks(program: Running, deadline: Callable[[], float | None], until: float | None) -> Iterator[tuple[float, bool]]:
    """Yield the times up to which a run advances at once, while its program runs: `SLICE` beyond the next event.

    The second value: nothing would ever happen any more.
    """
    now, limit, most = 0.0, LONGEST if until is None else until, MOST_LINES if until is None else inf
    while program.running and now < limit and program.executed < most:
        due = deadline()
        now = limit if due is None else min(max(due, now) + SLICE, limit)
        yield now, due is None


# The trace of a program file's run: a family names the next line of the file and its variables; `Recorder` makes events
# of that, `MOST_TRACED` at most.

MOST_TRACED = 10_000
"""Traced lines after which a trace ends."""
AROUND = 3
"""Lines of the file that are shown before and after a break point."""
Value = int | float
Values = Mapping[str, Value]


@dataclass(frozen=True)
class Broken(Event):
    """The end of a run before the line of a break point: its place as given, and the lines of the file."""

    place: str = ""
    source: Sequence[str] = field(default=(), repr=False)

    def lines(self, file: str, real: float) -> Iterator[Line]:
        assert self.line is not None
        yield Line(f"{self.t:10.4f}  break point {self.place}: {file}:{self.line}: {self.text}")
        first, last = max(self.line - AROUND, 1), min(self.line + AROUND, len(self.source))
        width = len(str(last))
        for n in range(first, last + 1):
            yield Line(f"{'->' if n == self.line else '  '} {n:{width}}  {self.source[n - 1]}".rstrip())


def _trace_full(t: float) -> Event:
    """The end of a trace that has become too long. The run goes on."""
    ends = f"ends after {MOST_TRACED} lines"
    hint = "--until and --break end the run earlier, --watch shows fewer lines"
    return Event(t, {"trace": ends}, f"the trace {ends}; {hint}", problem=True)


def shown(values: Values) -> str:
    return "".join(f"   {name}={value}" for name, value in values.items())


@dataclass
class BreakPoint:
    """A break point: as it was given, its place, and how many passes are still to come."""

    given: str
    place: str
    passes: int = 1


def break_point(text: str, file: str, valid: str) -> BreakPoint:
    """Read `PLACE` or `PLACE,PASSES`. Raises Diagnostic for a wrong number of passes."""
    place, comma, passes = text.partition(",")
    number = passes.strip()
    if comma and not (number.isascii() and number.isdigit() and 1 <= int(number) <= 65535):
        raise Diagnostic(f"no break point {text}", file, f"valid: {valid} from 1 to 65535")
    return BreakPoint(text, place.strip(), int(number) if comma else 1)


class Recorder:
    """Makes events of the lines of one run. `values` reads what is watched, `points` are by line of the file.

    `shown` makes the text of an event from a line of the file. `broken`: a break point has ended the run.
    """

    def __init__(
        self,
        debugging: Debugging,
        source: Sequence[str],
        points: Mapping[int, BreakPoint],
        values: Callable[[], Values],
        shown: Callable[[str], str] = str.strip,
    ) -> None:
        self.broken = False
        self._shown = shown
        self._debugging, self._source, self._points, self._values = debugging, source, points, values
        self._last = dict(values())
        self._traced = 0
        self._events: list[Event] = []

    @property
    def full(self) -> bool:
        """Whether no line is recorded any more."""
        return self._traced > MOST_TRACED

    @property
    def done(self) -> bool:
        """Whether nothing is recorded any more, and no break point can end the run."""
        return self.full and not self._points

    def reaches(self, t: float, line: int) -> bool:
        """Count a pass of the break point at a line, if there is one; the last one ends the run before that line."""
        point = self._points.get(line)
        if point is None:
            return False
        point.passes -= 1
        if point.passes > 0:
            return False
        self.broken = True
        values = self._values() if self._debugging.watch else {}
        text = self._text(line)
        facts = {"break": point.place, "line": line, "text": text, "values": dict(values)}
        self._events.append(Broken(t, facts, text + shown(values), line, place=point.place, source=self._source))
        return True

    def after(self, t: float, line: int, changed: Values | None = None, program: int | None = None) -> None:
        """Record an executed line that began at `t`, if it is wanted. `changed` None: see what it has changed."""
        if self.full:
            return
        changed = self.changed() if changed is None else changed
        if self._debugging.trace or changed:
            self._traced += 1
            self._events.append(_trace_full(t) if self.full else self._executed(t, line, changed, program))

    def _executed(self, t: float, line: int, changed: Values, program: int | None) -> Event:
        text, number = self._text(line), {} if program is None else {"program": program}
        facts = {**number, "line": line, "text": text, "changed": dict(changed)}
        of = "" if program is None else f" (program {program})"
        return Event(t, facts, f"{text}{of}{shown(changed)}", line)

    def _text(self, line: int) -> str:
        return self._shown(self._source[line - 1]) if 0 < line <= len(self._source) else ""

    def changed(self) -> dict[str, Value]:
        """Return the values that have changed since the last time."""
        now = self._values()
        if now == self._last:
            return {}
        changed = {name.upper(): value for name, value in now.items() if self._last.get(name) != value}
        self._last = dict(now)
        return changed

    def take(self) -> list[Event]:
        taken, self._events = self._events, []
        return taken


# The run of a file: what a family need not say of its own.

Reader = Callable[[], Value]
Kind = TypeVar("Kind", bound=Recorder)


class ProgramRun(ABC):
    """A program file on a simulated drive, run in virtual time: no clock, no wire, no event loop.

    The class stands for the program files of a family; an instance is one file on one drive. The drive's time goes from
    event to event, so that ten minutes of holding cost nothing, and up to `SLICE` further, so that a line of the
    program costs little. The run ends with the program, when nothing can ever happen any more, or when its time is
    over.
    """

    name: ClassVar[str]
    """That of the language on the host's side."""
    title: ClassVar[str]
    """The name of the language, for a person."""
    drive: ClassVar[DriveSpec]
    """The default drive."""
    breaks: ClassVar[str]
    """What a break point may be, for a person."""
    watches: ClassVar[str]
    """What may be watched, for a person."""
    unit: ClassVar[str] = "line"
    """What it counts as carried out."""
    complete: ClassVar[str]
    """How a run ends with its program: a key of `ENDS`."""

    running: Running
    """What runs in the drive."""

    def __init__(self, spec: DriveSpec, file: str, source: Sequence[str]) -> None:
        """Raises Diagnostic for a drive of another family; a family, too, for one that refuses its settings."""
        valid = simulated()[self.name].personalities
        if spec.personality not in valid:
            raise Diagnostic(f"a {spec.personality} does not run {self.title}", file, f"valid: {', '.join(valid)}")
        self.file, self.source = file, source
        self.recorder: Recorder | None = None
        self.events: list[Event] = []
        self.errors: list[int | str] = []
        self.now, self._stuck = 0.0, False

    # Of the family

    @classmethod
    @abstractmethod
    def parsed(cls, text: str, file: str) -> Any:
        """Read a file as `__init__` takes it. Raises Diagnostic."""

    @classmethod
    def read(cls, text: str, file: str) -> Load:
        """Read a text, once; `file` is the name of its file. Raises Diagnostic."""
        made, source, run = cls.parsed(text, file), split_lines(text), cast(Callable[..., ProgramRun], cls)
        return lambda spec: run(spec, made, file, source)

    @classmethod
    def refusals(cls, text: str, file: str, personality: str, found: Sequence[Problem]) -> list[Problem]:
        """Find what a drive refuses beside these problems; by default the check of the text finds all of it."""
        return []

    # The run

    def run(self, start: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING) -> Iterator[Event]:
        """Run it from `start`, for `until` virtual seconds at most; the last event is a Summary.

        A file with a refused line is not run. Raises Diagnostic if there is nothing to run.
        """
        yield from self.load()
        if self.errors:
            yield self.summary("error", until)
            return
        self.begin(start, debugging)
        for now, stuck in looks(self.running, self.deadline, until):
            self.now, self._stuck = now, stuck
            self.advance()
            if self.recorder is not None and self.recorder.done:
                self.unwatch()
            yield from self.news()
        yield from self.rest()
        ended = "until" if self.running.running else "break" if self.broken else self.ended()
        yield self.summary(ended, until)

    def load(self) -> Iterator[Event]:
        """Load what is not loaded yet; `errors` gets what the drive refuses."""
        yield from ()

    @abstractmethod
    def begin(self, start: str, debugging: Debugging) -> None:
        """Start what is to run, and record it where that is wanted. Raises Diagnostic if there is nothing to run."""

    @abstractmethod
    def deadline(self) -> float | None:
        """When something will happen next; None: never."""

    @abstractmethod
    def advance(self) -> None:
        """Let the drive come to `now`."""

    def news(self) -> list[Event]:
        """What was executed and what happened since the last look, in the order of time."""
        news, self.events = self.events, []
        if self.recorder is not None:
            news += self.recorder.take()
        news += self.happened()
        news.sort(key=self.order)
        return news

    @abstractmethod
    def happened(self) -> Iterator[Event]:
        """What went wrong in the drive since the last look, and what else it tells only then."""

    @staticmethod
    def order(event: Event) -> Any:
        return event.t

    def rest(self) -> Iterator[Event]:
        """What is told when the run is over."""
        yield from ()

    def ended(self) -> str:
        """How a run ended whose program runs no more."""
        return "error" if self.errors else self.complete

    @property
    def broken(self) -> bool:
        return self.recorder is not None and self.recorder.broken

    # The trace, and break points

    def recording(self, debugging: Debugging, kind: Callable[..., Kind]) -> Kind:
        """Look at the lines that a person follows. Raises Diagnostic for a place or a name that is not there."""
        readers = {name.upper(): self._reader(name.upper()) for name in debugging.watch}
        points = {self.line_of(at := break_point(each, self.file, self.breaks)): at for each in debugging.breaks}
        values = partial(self.values, readers) if readers else partial(self.unnamed, debugging.trace)
        return kind(debugging, self.source, points, values, self.shown)

    def _reader(self, name: str) -> Reader:
        if (found := self.reader(name)) is None:
            raise Diagnostic(f"no variable {name} to watch", self.file, f"valid: {self.watches}")
        return found

    @abstractmethod
    def reader(self, name: str) -> Reader | None:
        """What reads a variable; None: there is none of that name."""

    @abstractmethod
    def line_of(self, point: BreakPoint) -> int:
        """The line of the file before which the run ends. Raises Diagnostic."""

    def values(self, readers: Mapping[str, Reader]) -> Values:
        return {name: read() for name, read in readers.items()}

    def unnamed(self, trace: bool) -> Values:
        """The values to look at where none is named."""
        return {}

    @staticmethod
    def shown(line: str) -> str:
        """A line of the file as an event shows it."""
        return line.strip()

    def unwatch(self) -> None:  # noqa: B027
        """Nothing is recorded any more, so nothing need tell of each line."""

    # Its end

    @abstractmethod
    def summary(self, ended: str, until: float | None) -> Summary:
        """How the run ended, of `summed`."""

    def summed(
        self,
        ended: str,
        until: float | None,
        *,
        t: float,
        position: int | tuple[int, ...],
        place: str,
        moves: int,
        moving: int,
        lines_at: tuple[int, ...],
        turning: str,
        ran: bool = True,
    ) -> Summary:
        """Make the summary: `place` is the position for a person, `turning` what to say where it still moves."""
        errors, instructions, runs = tuple(self.errors), self.running.executed, ended == "until"
        counts = f"{place}, {counted(moves, 'motion')}, {counted(instructions, self.unit)}"
        return Summary(
            ended=ended,
            t=t,
            position=position,
            moves=moves,
            instructions=instructions,
            errors=errors,
            lines_at=lines_at,
            moving=moving,
            given_up=runs and until is None,
            stuck=runs and self._stuck,
            ran=ran,
            counts=f"{counts}, {self.failed() if errors else 'no errors'}",
            turning=turning if moving and ended == self.complete else "",
        )

    def failed(self) -> str:
        return counted(len(self.errors), "error")


Load = Callable[[DriveSpec], ProgramRun]
"""Loads a program file, which was read once, into a simulated drive, as often as it is called. Raises Diagnostic."""
