"""A TMCL program file run on one simulated module, in virtual time: no clock, no wire, no event loop.

The program runs from its first line, or from a label. The run ends when the program ends, when nothing can ever happen
any more, or when its time is over.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.base.text import counted, whole
from multidrop.families.tmcl.manual import program_file
from multidrop.families.tmcl.manual.commands import Axis, Call, Command, Search
from multidrop.families.tmcl.manual.instructions import Word
from multidrop.families.tmcl.manual.program_file import Assembled
from multidrop.families.tmcl.simulator.module import TmclModule, worlds_of
from multidrop.families.tmcl.simulator.program import ALL_PORTS, USERS
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.program_run import (
    NO_DEBUGGING,
    Debugging,
    Event,
    Load,
    Programs,
    Recorder,
    Summary,
    Values,
    break_point,
    looks,
)

_MOTIONS = frozenset({Command.ROR, Command.ROL, Command.MVP, Word.MVPA, Word.ROLA, Word.RORA})
_SETS = frozenset({Command.SAP, Word.AAP})


class ProgramRun:
    """One file on one module. Raises Diagnostic for a module that refuses its settings, or holds fewer lines."""

    def __init__(self, spec: DriveSpec, made: Assembled, name: str, source: Sequence[str]) -> None:
        from multidrop.simulator.declared import simulated

        if spec.personality not in simulated()["tmcl"].personalities:
            valid = ", ".join(simulated()["tmcl"].personalities)
            raise Diagnostic(f"a {spec.personality} does not run TMCL", name, f"valid: {valid}")
        self._name, self._made, self._text = name, made, source
        # without a cell it has the name of another drive
        address = spec.name if spec.name.isdigit() else RUNS.drive.name
        self._device = TmclModule(replace(spec, name=address, program="", program_name=""), worlds_of(spec))
        self._program = self._device.program
        self._program.load({each.at: each.call for each in made.lines})
        self._source = {each.at: each.source for each in made.lines}
        self._recorder: Recorder | None = None
        self._begun: tuple[float, int] = (0.0, 0)
        self._events: list[Event] = []
        self._moves = 0
        self._errors: list[str] = []
        self._ended_at = 0.0
        self.now, self._stuck = 0.0, False

    def run(self, start: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING) -> Iterator[Event]:
        """Run from a label or an address; a Summary is the last event. Raises Diagnostic."""
        if not self._made.lines:
            raise Diagnostic("no line to run", self._name, "a program has one command at least")
        address = self._made.labels.get(start.upper(), whole(start or "0", 0, len(self._made.lines) - 1))
        if address is None:
            raise Diagnostic(f"no label {start}", self._name, f"valid: {', '.join(self._made.labels) or '0'}")
        if debugging.wanted:
            self._recorder = self._recorded(debugging)
        program, device = self._program, self._device
        program.before, program.after = self._before, self._after
        program.run(0.0, address)
        for self.now, self._stuck in looks(program, lambda: device.deadline, until):
            device.advance(self.now)
            yield from self._news()
        yield self._summary(until)

    # Debugging

    def _recorded(self, debugging: Debugging) -> Recorder:
        points = {}
        for each in debugging.breaks:
            point = break_point(each, self._name, "LINE, LABEL, or either with ,PASSES")
            points[self._line_of(point.place)] = point
        names = {name.upper(): self._reader(name.upper()) for name in debugging.watch}
        values = partial(self._values, names or {"A": "A", "X": "X"})
        return Recorder(debugging, self._text, points, values, _shown)

    def _line_of(self, place: str) -> int:
        at = self._made.labels.get(place.upper())
        number = self._source.get(at, 0) if at is not None else whole(place, 0, 999_999)
        if number not in self._source.values():
            raise Diagnostic(f"no command to break at {place}", self._name, "valid: a line of the file, or a label")
        assert number is not None
        return number

    def _reader(self, name: str) -> Call | str:
        """How a watched name is read: a register by its name, else by a command. Raises Diagnostic."""
        number = whole(name[1:], 0, 255) if name.startswith("V") else None
        axis = whole(name[2:], 0, 255) if name.startswith("AP") else None
        if name in ("A", "X"):
            return name
        if number is not None:
            return Call(Command.GGP, number, USERS)
        if axis is not None:
            return Call(Command.GAP, axis)
        hint = "valid: A, X, V0 to V255, AP and a parameter, as AP1"
        raise Diagnostic(f"no variable {name} to watch", self._name, hint)

    def _values(self, names: Mapping[str, Call | str]) -> Values:
        registers = {"A": self._program.accumulator, "X": self._program.x}
        t, read = self._begun[0], self._device.carry_out
        return {name: registers[how] if isinstance(how, str) else read(how, t)[1] for name, how in names.items()}

    # The run

    def _before(self, t: float, at: int) -> bool:
        self._begun = t, self._source.get(at, 0)
        return self._recorder is not None and self._recorder.reaches(*self._begun)

    def _after(self, t: float, call: Call) -> None:
        self._ended_at = t
        self._moves += _begins_motion(call)
        failed = bool(self._program.failures) and self._program.failures[-1].t == t
        if call.command == Word.SIO and call.motor == USERS and not failed:
            where = "all outputs" if call.type == ALL_PORTS else f"output {call.type}"
            self._events.append(Event(t, {"port": call.type, "value": call.value}, f"{where} = {call.value}"))
        if self._recorder is not None:
            self._recorder.after(t, self._begun[1])

    def _news(self) -> Iterator[Event]:
        """Yield what was executed, set and not carried out since the last look, in the order of time."""
        news, self._events = self._events, []
        if self._recorder is not None:
            news += self._recorder.take()
        for each in self._program.failures:
            line = self._source.get(each.at, 0)
            text = _shown(self._text[line - 1]) if line else ""
            facts = {"error": each.why, "line": line, "text": text}
            news.append(Event(each.t, facts, f"{text} at {each.t:.4f} s: {each.why}", line, problem=True))
            self._errors.append(each.why)
        self._program.failures.clear()
        yield from sorted(news, key=lambda each: each.t)

    def _summary(self, until: float | None) -> Summary:
        running, errors = self._program.running, tuple(self._errors)
        broken = self._recorder is not None and self._recorder.broken
        t = self.now if running else self._begun[0] if broken else self._ended_at
        position, velocity = (
            self._device.carry_out(Call(Command.GAP, each), self.now)[1]
            for each in (Axis.ACTUAL_POSITION, Axis.ACTUAL_VELOCITY)
        )
        moving = velocity != 0
        ended = "break" if broken else "until" if running else "error" if errors else "END"
        failed = counted(len(errors), "error") if errors else "no errors"
        lines = self._program.executed
        return Summary(
            ended=ended,
            t=t,
            position=position,
            moves=self._moves,
            instructions=lines,
            errors=errors,
            lines_at=tuple(each for each in (self._source.get(self._program.counter, 0),) if running),
            moving=moving,
            given_up=running and until is None,
            stuck=running and self._stuck,
            counts=f"position {position}, {counted(self._moves, 'motion')}, {counted(lines, 'line')}, {failed}",
            turning="the motor still turns; WAIT POS before STOP waits for it" if moving and ended == "END" else "",
        )


def _shown(line: str) -> str:
    return line[: program_file.remark_at(line)].strip()


def _begins_motion(call: Call) -> bool:
    if call.command in _SETS:
        return call.type in (Axis.TARGET_POSITION, Axis.TARGET_VELOCITY)
    return call.command in _MOTIONS or (call.command, call.type) == (Command.RFS, Search.START)


def read(text: str, file: str) -> Load:
    made, source = program_file.assembled(program_file.read(text, file)), split_lines(text)
    return lambda spec: ProgramRun(spec, made, file, source)


RUNS = Programs(drive=DriveSpec(personality="TMCM", name="1"), read=read)
