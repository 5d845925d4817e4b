"""An A-SCRIPT file run on one simulated PMX-2ED-SA, in virtual time: no clock, no wire, no event loop.

Every program of the file is started at time 0, or one that is chosen. The run ends when no program runs any more, when
nothing can ever happen any more, or when its time is over.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf

from multidrop.base.errors import Diagnostic
from multidrop.base.files import SourceLine, split_lines
from multidrop.base.text import counted, whole
from multidrop.families.pmx.manual import program_file, script_compiler
from multidrop.families.pmx.manual.script_parser import PROGRAMS, VARIABLES
from multidrop.families.pmx.manual.table import lookup
from multidrop.families.pmx.simulator.device import PmxDevice
from multidrop.families.pmx.simulator.programs import Failure
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.program_run import (
    NO_DEBUGGING,
    BreakPoint,
    Debugging,
    Event,
    Load,
    Programs,
    Recorder,
    Summary,
    Value,
    Values,
    break_point,
    looks,
)

# What a person follows in the run of A-SCRIPT: which statement comes next, what variables and registers hold.


LAST_LINE = 999_999
_NAMES = {f"V{n}": n for n in range(VARIABLES)}


@dataclass
class Statement:
    """A statement under way: when it began, its line in the file, what it has changed so far."""

    t: float
    line: int
    changed: dict[str, Value] = field(default_factory=dict)


class Watcher(Recorder):
    """Looks at each compiled line that a program executes. Raises Diagnostic for a line or a name that is not there.

    A statement of the file has several compiled lines, so it is reported when the next one begins. `source` gives the
    line of the file for a compiled line.
    """

    def __init__(
        self, device: PmxDevice, debugging: Debugging, source: Mapping[int, int], text: Sequence[str], file: str
    ) -> None:
        self._device, self._lines, self._file = device, source, file
        self._now = 0.0
        self._open: dict[int, Statement] = {}
        names = [name.upper() for name in debugging.watch]
        for name in names:
            self._check(name)
        valid = "LINE, or LINE,PASSES"
        points = {self._line_of(point := break_point(each, file, valid)): point for each in debugging.breaks}
        watched = names or ([*_NAMES] if debugging.trace else [])
        super().__init__(debugging, text, points, partial(self._read, watched))

    def before(self, t: float, program: int, line: int) -> bool:
        self._now = t
        number = self._lines.get(line, 0)
        if line and self._lines.get(line - 1) == number and program in self._open:
            return False  # within a statement
        self._close(program)
        self._open[program] = Statement(t, number)
        if not self.reaches(t, number):
            return False
        del self._open[program]
        return True

    def executed(self, t: float, program: int) -> None:
        if not self.full:
            self._open[program].changed.update(self.changed())

    @property
    def open_since(self) -> float:
        """When the first statement under way began; infinite where there is none."""
        return min((each.t for each in self._open.values()), default=inf)

    def end(self) -> None:
        """Record the statements under way: the run is over."""
        for program in sorted(self._open):
            self._close(program)

    def _close(self, program: int) -> None:
        done = self._open.pop(program, None)
        if done is not None:
            self.after(done.t, done.line, done.changed, program)

    def _read(self, names: Sequence[str]) -> Values:
        variables = self._device.programs.variables
        return {name: variables[_NAMES[name]] if name in _NAMES else self._register(name) for name in names}

    def _register(self, name: str) -> int:
        return int(self._device.controller.ask(name, self._now))

    def _check(self, name: str) -> None:
        """Refuse a name that reads no number: another command could move an axis."""
        row = lookup(name)
        if name in _NAMES:
            return
        if row is not None and "R" in row.access:
            with suppress(ValueError):
                self._register(name)
                return
        hint = "valid: V0 to V63, or a command that reads one number, such as PX"
        raise Diagnostic(f"no variable {name} to watch", self._file, hint)

    def _line_of(self, point: BreakPoint) -> int:
        number = whole(point.place, 0, LAST_LINE)
        if number not in self._lines.values() or number is None:
            raise Diagnostic(
                f"no statement to break at {point.given}", self._file, "valid: the number of a line of the file"
            )
        return number


_MOTION = re.compile(r"X-?\d+(?:Y-?\d+)?|Y-?\d+|(?:J|HL?|L|ZH?)[XY][+-]", re.ASCII)


class ProgramRun:
    """One file on one controller. Raises Diagnostic for a controller that refuses its settings."""

    def __init__(self, spec: DriveSpec, lines: Sequence[SourceLine], name: str, source: Sequence[str] = ()) -> None:
        if spec.personality != "PMX":
            raise Diagnostic(f"a {spec.personality} does not run A-SCRIPT", name, "valid: PMX")
        self._name = name
        bare = replace(spec, program="", program_name="")
        self._device = PmxDevice(bare)
        stored = program_file.compiled(lines)
        held = {at: token for _, at, token in stored}
        self._source = {at: number for number, at, _ in stored}
        last = max(held, default=-1)
        self._programs = self._device.programs
        self._programs.memory.load([held.get(at) or script_compiler.ERASED for at in range(last + 1)])
        self._programs.on_command = self._hear
        self._program_lines = source
        self._watcher: Watcher | None = None
        self._moves = 0
        self._last = self._device.controller.outputs
        self._outputs: list[Event] = []
        self._later: list[Event] = []
        self._errors: list[str] = []
        self.now, self._stuck = 0.0, False

    def run(
        self, program: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING
    ) -> Iterator[Event]:
        """Run program 0 or 1, or all; a Summary is the last event. Raises Diagnostic if there is nothing to run."""
        if debugging.wanted:
            self._watcher = Watcher(self._device, debugging, self._source, self._program_lines, self._name)
            self._programs.watch(self._watcher.before, self._watcher.executed)
        for each in self._chosen(program):
            self._programs.control(each, 1, 0.0)
        programs = self._programs
        for self.now, self._stuck in looks(programs, lambda: programs.deadline, until):
            self._device.advance(self.now)
            if self._broken:
                self.now = self._programs.ended_at
            if self._watcher is not None and self._watcher.done:
                self._programs.watch(None, None)
            yield from self._news()
        yield from self._news(last=True)
        yield self._summary(until)

    def _chosen(self, program: str) -> list[int]:
        there = [each for each in range(PROGRAMS) if self._programs.memory.start_of(each) is not None]
        chosen = [each for each in there if program in ("", str(each))]
        if not chosen:
            valid = ", ".join(str(each) for each in there) or "none"
            raise Diagnostic(f"no program {program}".rstrip(), self._name, f"valid: {valid}")
        return chosen

    def _hear(self, t: float, program: int, text: str) -> None:
        self._moves += _MOTION.fullmatch(text) is not None
        if self._device.controller.outputs != self._last:
            self._last = self._device.controller.outputs
            facts = {"program": program, "outputs": self._last}
            self._outputs.append(Event(t, facts, f"DO={self._last} (program {program})"))

    def _news(self, last: bool = False) -> Iterator[Event]:
        """Yield what was executed, switched and what failed since the last look, in the order of time.

        What follows the start of an unfinished statement waits for its end. `last`: the run is over.
        """
        news: list[Event] = [*self._later, *self._outputs]
        begun = inf
        if self._watcher is not None:
            if last:
                self._watcher.end()
            news += self._watcher.take()
            begun = self._watcher.open_since
        for each in self._programs.failures:
            news.append(self._failed(each))
            if not each.handled:
                self._errors.append(each.why)
        self._outputs.clear()
        self._programs.failures.clear()
        news.sort(key=lambda each: (each.t, each.problem or each.line is None))  # an executed line first
        self._later = [each for each in news if each.t >= begun]
        yield from (each for each in news if each.t < begun)

    def _failed(self, failure: Failure) -> Event:
        """An error in a program, its cause, and whether SUB 31 has handled it."""
        line, more = self._source.get(failure.line, 0), {"handled": True} if failure.handled else {}
        facts = {"program": failure.program, "error": failure.why, "line": line, **more}
        handled = " (SUB 31 has handled it)" if failure.handled else ""
        text = f"program {failure.program} at {failure.t:.4f} s: {failure.why}{handled}"
        return Event(failure.t, facts, text, line, problem=True)

    def _summary(self, until: float | None) -> Summary:
        running = self._programs.running
        standing = [self._programs.counter(n) for n in range(PROGRAMS) if self._programs.status(n) in (1, 2)]
        x, y = (int(self._device.execute(f"P{axis}", self.now)) for axis in "XY")
        moving, errors, lines = (
            any(self._device.controller.moving(axis) for axis in "XY"),
            tuple(self._errors),
            self._programs.executed,
        )
        ended = "break" if self._broken else "until" if running else "error" if errors else "END"
        failed = counted(len(errors), "error") if errors else "no errors"
        return Summary(
            ended=ended,
            t=self._programs.ended_at if not running else self.now,
            position=(x, y),
            moves=self._moves,
            instructions=lines,
            errors=errors,
            lines_at=tuple(self._source.get(at, 0) for at in standing),
            moving=moving,
            given_up=running and until is None,
            stuck=running and self._stuck,
            counts=f"X {x}, Y {y}, {counted(self._moves, 'motion')}, {counted(lines, 'compiled line')}, {failed}",
            turning="a motor still turns; WAITX or WAITY before END waits for it" if moving and ended == "END" else "",
        )

    @property
    def _broken(self) -> bool:
        return self._watcher is not None and self._watcher.broken


def read(text: str, file: str) -> Load:
    lines, source = program_file.read(text, file), split_lines(text)
    return lambda spec: ProgramRun(spec, lines, file, source)


RUNS = Programs(drive=DriveSpec(personality="PMX", name="00"), read=read)
