"""What a program file's run tells: its events, their lines for a person, and the trace."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

from multidrop.base.errors import Diagnostic


class ReportLine(NamedTuple):
    """A line for a person. `problem`: it belongs on standard error."""

    text: str
    problem: bool = False


@dataclass(frozen=True)
class DebugWishes:
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


NO_DEBUGGING = DebugWishes()


@dataclass(frozen=True)
class ProgramEvent:
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

    def lines(self, file: str, real: float) -> Iterator[ReportLine]:
        place = f"{file}: " if self.problem else ""
        place = place if self.line is None else f"{file}:{self.line}: "
        yield ReportLine(f"{'' if self.problem else f'{self.t:10.4f}  '}{place}{self.text}", self.problem)


ENDS = {
    "E": "ended at E",
    "END": "ended",
    "error": "ended by an error",
    "until": "stopped",
    "break": "stopped at a break point",
}


@dataclass(frozen=True, kw_only=True)
class Summary(ProgramEvent):
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

    def lines(self, file: str, real: float) -> Iterator[ReportLine]:
        how = f"{ENDS[self.ended]} after {self.t:.4f} s" if self.ran else "not run"
        yield ReportLine(f"{how}: {self.counts} ({real:.2f} s real)")
        remark = self.turning
        if self.stuck:
            remark = "the program waits here for ever: no further event is possible"
        elif self.given_up:
            remark = "the program still runs; --until SECONDS sets the time limit"
        for line in self.lines_at or (0,):
            if remark:
                yield ReportLine(f"{file}:{line}: {remark}" if line else f"{file}: {remark}", problem=True)


# The trace of a program file's run: a family names the next line of the file and its variables; `RunRecorder` makes
# events of that, `MOST_TRACED` at most.

MOST_TRACED = 10_000
"""Traced lines after which a trace ends."""
AROUND = 3
"""Lines of the file that are shown before and after a break point."""
Value = int | float
Values = Mapping[str, Value]


@dataclass(frozen=True)
class Broken(ProgramEvent):
    """The end of a run before the line of a break point: its place as given, and the lines of the file."""

    place: str = ""
    source: Sequence[str] = field(default=(), repr=False)

    def lines(self, file: str, real: float) -> Iterator[ReportLine]:
        assert self.line is not None
        yield ReportLine(f"{self.t:10.4f}  break point {self.place}: {file}:{self.line}: {self.text}")
        first, last = max(self.line - AROUND, 1), min(self.line + AROUND, len(self.source))
        width = len(str(last))
        for n in range(first, last + 1):
            yield ReportLine(f"{'->' if n == self.line else '  '} {n:{width}}  {self.source[n - 1]}".rstrip())


def _trace_full(t: float) -> ProgramEvent:
    """The end of a trace that has become too long. The run goes on."""
    ends = f"ends after {MOST_TRACED} lines"
    hint = "--until and --break end the run earlier, --watch shows fewer lines"
    return ProgramEvent(t, {"trace": ends}, f"the trace {ends}; {hint}", problem=True)


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


class RunRecorder:
    """Makes events of the lines of one run. `values` reads what is watched, `points` are by line of the file.

    `shown` makes the text of an event from a line of the file. `broken`: a break point has ended the run.
    """

    def __init__(
        self,
        debugging: DebugWishes,
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
        self._events: list[ProgramEvent] = []

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

    def _executed(self, t: float, line: int, changed: Values, program: int | None) -> ProgramEvent:
        text, number = self._text(line), {} if program is None else {"program": program}
        facts = {**number, "line": line, "text": text, "changed": dict(changed)}
        of = "" if program is None else f" (program {program})"
        return ProgramEvent(t, facts, f"{text}{of}{shown(changed)}", line)

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

    def take(self) -> list[ProgramEvent]:
        taken, self._events = self._events, []
        return taken
