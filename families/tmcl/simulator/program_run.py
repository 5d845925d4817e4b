"""A TMCL program file run on one simulated module: the program runs from its first line, or from a label."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.base.text import whole
from multidrop.families.tmcl.manual import program_file
from multidrop.families.tmcl.manual.commands import AxisParameter, Command, SearchAction, TmclCall
from multidrop.families.tmcl.manual.instructions import ProgramWord
from multidrop.families.tmcl.manual.parameters import TARGETS
from multidrop.families.tmcl.manual.program_file import Assembled
from multidrop.families.tmcl.simulator.module import TmclModule, worlds_of
from multidrop.families.tmcl.simulator.program import ALL_PORTS, USERS
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.program_events import BreakPoint, DebugWishes, ProgramEvent, RunRecorder, Summary, Values
from multidrop.simulator.program_run import ProgramRun, Reader

_MOTIONS = frozenset({Command.ROR, Command.ROL, Command.MVP, ProgramWord.MVPA, ProgramWord.ROLA, ProgramWord.RORA})
_SETS = frozenset({Command.SAP, ProgramWord.AAP})


class TmclRun(ProgramRun):
    """One file on one module. Raises Diagnostic for a module that refuses its settings, or holds fewer lines."""

    name = "tmcl"
    title = "TMCL"
    drive = DriveSpec(personality="TMCM", name="1")
    breaks = "LINE, LABEL, or either with ,PASSES"
    watches = "A, X, V0 to V255, AP and a parameter, as AP1"
    complete = "END"

    def __init__(self, spec: DriveSpec, made: Assembled, file: str, source: Sequence[str]) -> None:
        super().__init__(spec, file, source)
        self._made = made
        # without a cell it has the name of another drive
        address = spec.name if spec.name.isdigit() else self.drive.name
        self._device = TmclModule(replace(spec, name=address, program="", program_name=""), worlds_of(spec))
        self._program = self.running = self._device.program
        self._program.load({line.at: line.call for line in made.lines})
        self._lines = {line.at: line.source for line in made.lines}
        self._begun: tuple[float, int] = (0.0, 0)
        self._moves = 0
        self._ended_at = 0.0

    @classmethod
    def parsed(cls, text: str, file: str) -> Assembled:
        return program_file.assembled(program_file.read(text, file))

    def begin(self, start: str, debugging: DebugWishes) -> None:
        """Begin at a label or an address."""
        if not self._made.lines:
            raise Diagnostic("no line to run", self.file, "a program has one command at least")
        address = self._made.labels.get(start.upper(), whole(start or "0", 0, len(self._made.lines) - 1))
        if address is None:
            raise Diagnostic(f"no label {start}", self.file, f"valid: {', '.join(self._made.labels) or '0'}")
        if debugging.wanted:
            self.recorder = self.recording(debugging, RunRecorder)
        self._program.before, self._program.after = self._before, self._after
        self._program.run(0.0, address)

    def deadline(self) -> float | None:
        return self._device.deadline

    def advance(self) -> None:
        self._device.advance(self.now)

    # Debugging

    def line_of(self, point: BreakPoint) -> int:
        at = self._made.labels.get(point.place.upper())
        number = self._lines.get(at, 0) if at is not None else whole(point.place, 0, 999_999)
        if number is None or number not in self._lines.values():
            raise Diagnostic(
                f"no command to break at {point.place}", self.file, "valid: a line of the file, or a label"
            )
        return number

    def reader(self, name: str) -> Reader | None:
        number = whole(name[1:], 0, 255) if name.startswith("V") else None
        axis = whole(name[2:], 0, 255) if name.startswith("AP") else None
        if name in ("A", "X"):
            return lambda: self.unnamed(False)[name]
        if number is not None:
            call = TmclCall(Command.GGP, number, USERS)
        elif axis is not None:
            call = TmclCall(Command.GAP, axis)
        else:
            return None
        return lambda: self._device.carry_out(call, self._begun[0])[1]

    def unnamed(self, trace: bool) -> Values:
        return {"A": self._program.accumulator, "X": self._program.x}

    @staticmethod
    def shown(line: str) -> str:
        return line[: program_file.remark_at(line)].strip()

    # The run

    def _before(self, t: float, at: int) -> bool:
        self._begun = t, self._lines.get(at, 0)
        return self.recorder is not None and self.recorder.reaches(*self._begun)

    def _after(self, t: float, call: TmclCall) -> None:
        self._ended_at = t
        self._moves += _begins_motion(call)
        failed = bool(self._program.failures) and self._program.failures[-1].t == t
        if call.command == ProgramWord.SIO and call.motor == USERS and not failed:
            where = "all outputs" if call.type == ALL_PORTS else f"output {call.type}"
            self.events.append(ProgramEvent(t, {"port": call.type, "value": call.value}, f"{where} = {call.value}"))
        if self.recorder is not None:
            self.recorder.after(t, self._begun[1])

    def happened(self) -> Iterator[ProgramEvent]:
        """What was not carried out."""
        for failure in self._program.failures:
            line = self._lines.get(failure.at, 0)
            text = self.shown(self.source[line - 1]) if line else ""
            facts = {"error": failure.why, "line": line, "text": text}
            yield ProgramEvent(failure.t, facts, f"{text} at {failure.t:.4f} s: {failure.why}", line, problem=True)
            self.errors.append(failure.why)
        self._program.failures.clear()

    def summary(self, ended: str, until: float | None) -> Summary:
        running = self._program.running
        position, velocity = (
            self._device.carry_out(TmclCall(Command.GAP, each), self.now)[1]
            for each in (AxisParameter.ACTUAL_POSITION, AxisParameter.ACTUAL_VELOCITY)
        )
        return self.summed(
            ended,
            until,
            t=self.now if running else self._begun[0] if self.broken else self._ended_at,
            position=position,
            place=f"position {position}",
            moves=self._moves,
            moving=velocity != 0,
            lines_at=tuple(line for line in (self._lines.get(self._program.counter, 0),) if running),
            turning="the motor still turns; WAIT POS before STOP waits for it",
        )


def _begins_motion(call: TmclCall) -> bool:
    if call.command in _SETS:
        return call.type in TARGETS
    return call.command in _MOTIONS or (call.command, call.type) == (Command.RFS, SearchAction.START)
