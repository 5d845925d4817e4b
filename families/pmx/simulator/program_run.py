"""An A-SCRIPT file run on one simulated PMX-2ED-SA: every program of it is started at time 0, or one that is chosen.

The run ends when no program runs any more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import SourceLine
from multidrop.base.text import whole
from multidrop.families.pmx.manual import program_file, script_compiler
from multidrop.families.pmx.manual.script_parser import PROGRAMS, VARIABLES
from multidrop.families.pmx.manual.table import lookup
from multidrop.families.pmx.simulator.device import PmxDevice
from multidrop.families.pmx.simulator.programs import ProgramError
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.program_events import (
    BreakPoint,
    DebugWishes,
    ProgramEvent,
    RunRecorder,
    Summary,
    Value,
    Values,
)
from multidrop.simulator.program_run import ProgramRun, Reader

LAST_LINE = 999_999
_NAMES = {f"V{n}": n for n in range(VARIABLES)}
_MOTION = re.compile(r"X-?\d+(?:Y-?\d+)?|Y-?\d+|(?:J|HL?|L|ZH?)[XY][+-]", re.ASCII)


@dataclass
class RunningStatement:
    """A statement under way: when it began, its line in the file, what it has changed so far."""

    t: float
    line: int
    changed: dict[str, Value] = field(default_factory=dict)


class Statements(RunRecorder):
    """A statement of the file has several compiled lines, so it is reported when the next one begins."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.under_way: dict[int, RunningStatement] = {}  # by program

    def begin(self, t: float, program: int, line: int) -> bool:
        """A program begins a statement; whether a break point ends the run before it."""
        self.close(program)
        if not self.reaches(t, line):
            self.under_way[program] = RunningStatement(t, line)
            return False
        return True

    def executed(self, t: float, program: int) -> None:
        if not self.full:
            self.under_way[program].changed.update(self.changed())

    @property
    def open_since(self) -> float:
        """When the first statement under way began; infinite where there is none."""
        return min((statement.t for statement in self.under_way.values()), default=inf)

    def end(self) -> None:
        """Record the statements under way: the run is over."""
        for program in sorted(self.under_way):
            self.close(program)

    def close(self, program: int) -> None:
        done = self.under_way.pop(program, None)
        if done is not None:
            self.after(done.t, done.line, done.changed, program)


class AScriptRun(ProgramRun):
    """One file on one controller. Raises Diagnostic for a controller that refuses its settings."""

    name = "pmx"
    title = "A-SCRIPT"
    drive = DriveSpec(personality="PMX", name="00")
    breaks = "LINE, or LINE,PASSES"
    watches = "V0 to V63, or a command that reads one number, such as PX"
    unit = "compiled line"
    complete = "END"
    recorder: Statements | None

    def __init__(self, spec: DriveSpec, lines: Sequence[SourceLine], file: str, source: Sequence[str] = ()) -> None:
        super().__init__(spec, file, source)
        self._device = PmxDevice(replace(spec, program="", program_name=""))
        stored = program_file.compiled(lines)
        held = {at: token for _, at, token in stored}
        self._lines = {at: number for number, at, _ in stored}
        last = max(held, default=-1)
        self._programs = self.running = self._device.programs
        self._programs.memory.load([held.get(at) or script_compiler.ERASED for at in range(last + 1)])
        self._programs.on_command = self._hear
        self._moves = 0
        self._outputs = self._device.controller.outputs
        self._at = 0.0

    @classmethod
    def parsed(cls, text: str, file: str) -> Sequence[SourceLine]:
        return program_file.read(text, file)

    def begin(self, start: str, debugging: DebugWishes) -> None:
        """Start program 0 or 1, or all."""
        if debugging.wanted:
            self.recorder = self.recording(debugging, Statements)
            self._programs.watch(self._before, self.recorder.executed)
        there = [program for program in range(PROGRAMS) if self._programs.memory.start_of(program) is not None]
        chosen = [program for program in there if start in ("", str(program))]
        if not chosen:
            valid = ", ".join(str(program) for program in there) or "none"
            raise Diagnostic(f"no program {start}".rstrip(), self.file, f"valid: {valid}")
        for program in chosen:
            self._programs.control(program, 1, 0.0)

    def deadline(self) -> float | None:
        return self._programs.deadline

    def advance(self) -> None:
        self._device.advance(self.now)
        if self.broken:
            self.now = self._programs.ended_at

    # Debugging

    def _before(self, t: float, program: int, line: int) -> bool:
        assert self.recorder is not None
        self._at = t
        number = self._lines.get(line, 0)
        if line and self._lines.get(line - 1) == number and program in self.recorder.under_way:
            return False  # within a statement
        return self.recorder.begin(t, program, number)

    def unwatch(self) -> None:
        self._programs.watch(None, None)

    def reader(self, name: str) -> Reader | None:
        """A name that reads no number has none: another command could move an axis."""
        if (variable := _NAMES.get(name)) is not None:
            return lambda: self._programs.variables[variable]
        row = lookup(name)
        if row is not None and "R" in row.access:
            with suppress(ValueError):
                self._register(name)
                return partial(self._register, name)
        return None

    def _register(self, name: str) -> int:
        return int(self._device.controller.ask(name, self._at))

    def unnamed(self, trace: bool) -> Values:
        return {name: self._programs.variables[n] for name, n in _NAMES.items()} if trace else {}

    def line_of(self, point: BreakPoint) -> int:
        number = whole(point.place, 0, LAST_LINE)
        if number not in self._lines.values() or number is None:
            hint = "valid: the number of a line of the file"
            raise Diagnostic(f"no statement to break at {point.given}", self.file, hint)
        return number

    # The run

    def _hear(self, t: float, program: int, text: str) -> None:
        self._moves += _MOTION.fullmatch(text) is not None
        if self._device.controller.outputs != self._outputs:
            self._outputs = self._device.controller.outputs
            facts = {"program": program, "outputs": self._outputs}
            self.events.append(ProgramEvent(t, facts, f"DO={self._outputs} (program {program})"))

    def news(self) -> list[ProgramEvent]:
        """What follows the start of an unfinished statement waits for its end."""
        news, begun = super().news(), inf if self.recorder is None else self.recorder.open_since
        self.events = [event for event in news if event.t >= begun]
        return [event for event in news if event.t < begun]

    @staticmethod
    def order(event: ProgramEvent) -> tuple[float, bool]:
        return event.t, event.problem or event.line is None  # an executed line first

    def happened(self) -> Iterator[ProgramEvent]:
        for failure in self._programs.failures:
            yield self._failed(failure)
            if not failure.handled:
                self.errors.append(failure.why)
        self._programs.failures.clear()

    def rest(self) -> Iterator[ProgramEvent]:
        if self.recorder is not None:
            self.recorder.end()
        yield from self.news()

    def _failed(self, failure: ProgramError) -> ProgramEvent:
        """An error in a program, its cause, and whether SUB 31 has handled it."""
        line, more = self._lines.get(failure.line, 0), {"handled": True} if failure.handled else {}
        facts = {"program": failure.program, "error": failure.why, "line": line, **more}
        handled = " (SUB 31 has handled it)" if failure.handled else ""
        text = f"program {failure.program} at {failure.t:.4f} s: {failure.why}{handled}"
        return ProgramEvent(failure.t, facts, text, line, problem=True)

    def summary(self, ended: str, until: float | None) -> Summary:
        programs = self._programs
        standing = [programs.counter(n) for n in range(PROGRAMS) if programs.status(n) in (1, 2)]
        x, y = (int(self._device.execute(f"P{axis}", self.now)) for axis in "XY")
        return self.summed(
            ended,
            until,
            t=self.now if programs.running else programs.ended_at,
            position=(x, y),
            place=f"X {x}, Y {y}",
            moves=self._moves,
            moving=any(self._device.controller.moving(axis) for axis in "XY"),
            lines_at=tuple(self._lines.get(at, 0) for at in standing),
            turning="a motor still turns; WAITX or WAITY before END waits for it",
        )
