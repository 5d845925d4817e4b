"""An A-SCRIPT file run on one simulated PMX-2ED-SA, in virtual time: no clock, no wire, no event loop.

Every program of the file is started at time 0, or one that is chosen. The run ends when no program runs any more, when
nothing can ever happen any more, or when its time is over.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

from dialects import Diagnostic
from dialects.files import SourceLine
from dialects.pmx.manual import program_file, script_compiler
from dialects.pmx.manual.script_words import PROGRAMS
from simulator.cell.spec import DriveSpec
from simulator.pmx.device import PmxDevice
from simulator.pmx.program_events import Failed, Output, Summary
from simulator.pmx.program_watch import Watcher
from simulator.program_run import LONGEST, MOST_LINES, NO_DEBUGGING, SLICE, Debugging, Load, Programs
from simulator.program_watch import Followed, Traced, source_lines

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
        self._outputs: list[Output] = []
        self._later: list[Output | Failed | Followed] = []
        self._errors: list[str] = []
        self.now = 0.0

    def run(
        self, program: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING
    ) -> Iterator[Output | Failed | Followed | Summary]:
        """Run program 0 or 1, or all; a Summary is the last event. Raises Diagnostic if there is nothing to run."""
        if debugging.wanted:
            self._watcher = Watcher(self._device, debugging, self._source, self._program_lines, self._name)
            self._programs.observer = self._watcher
        for each in self._chosen(program):
            self._programs.control(each, 1, 0.0)
        limit = LONGEST if until is None else until
        most = MOST_LINES if until is None else inf
        stuck = False
        while self._programs.running and self.now < limit and self._programs.executed < most:
            due = self._programs.deadline
            stuck = due is None
            self.now = limit if due is None else min(max(due, self.now) + SLICE, limit)
            self._device.advance(self.now)
            if self._broken:
                self.now = self._programs.ended_at
            if self._watcher is not None and self._watcher.recorder.done:
                self._programs.observer = None
            yield from self._news()
        yield from self._news(last=True)
        yield self._summary(until, stuck)

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
            self._outputs.append(Output(t, program, self._last))

    def _news(self, last: bool = False) -> Iterator[Output | Failed | Followed]:
        """Yield what was executed, switched and what failed since the last look, in the order of time.

        What follows the start of an unfinished statement waits for its end. `last`: the run is over.
        """
        news, begun = [*self._later, *self._outputs], inf
        if self._watcher is not None:
            news += self._watcher.take(last)
            begun = self._watcher.open_since
        for each in self._programs.failures:
            news.append(Failed(each.t, each.program, self._line(each.line), each.why, each.handled))
            if not each.handled:
                self._errors.append(each.why)
        self._outputs.clear()
        self._programs.failures.clear()
        news.sort(key=lambda each: (each.t, not isinstance(each, Traced)))
        self._later = [each for each in news if each.t >= begun]
        yield from (each for each in news if each.t < begun)

    def _line(self, at: int) -> int:
        return self._source.get(at, 0)

    def _summary(self, until: float | None, stuck: bool) -> Summary:
        running = self._programs.running
        standing = [self._programs.counter(n) for n in range(PROGRAMS) if self._programs.status(n) in (1, 2)]
        position = [int(self._device.execute(f"P{axis}", self.now)) for axis in "XY"]
        return Summary(
            ended=self._ended(running),
            t=self._programs.ended_at if not running else self.now,
            position=(position[0], position[1]),
            moves=self._moves,
            instructions=self._programs.executed,
            errors=tuple(self._errors),
            lines_at=tuple(self._line(at) for at in standing),
            moving=any(self._device.commanded.moving(axis) for axis in "XY"),
            given_up=running and until is None,
            stuck=running and stuck,
        )

    @property
    def _broken(self) -> bool:
        return self._watcher is not None and self._watcher.recorder.broken

    def _ended(self, running: bool) -> str:
        if self._broken:
            return "break"
        return "until" if running else "error" if self._errors else "END"


def read(text: str, file: str) -> Load:
    """Read the text of a file. Raises Diagnostic."""
    lines, source = program_file.read(text, file), source_lines(text)
    return lambda spec: ProgramRun(spec, lines, file, source)


RUNS = Programs(drive=DriveSpec(personality="PMX", name="00"), read=read)
