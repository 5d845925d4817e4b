"""An MCode file run on one simulated drive.

The file is loaded as by a download: declarations are carried out at time 0, the program is stored; S is skipped, since
nothing is to be kept.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from math import inf

from multidrop.base.errors import Diagnostic
from multidrop.base.text import whole
from multidrop.dialects.program_files import Problem, errors
from multidrop.families.lexium.manual import program_file
from multidrop.families.lexium.manual.errors import ErrorNumber
from multidrop.families.lexium.manual.errors import text as text_of_error
from multidrop.families.lexium.manual.grammar import NameTerm, Number, parsed, words
from multidrop.families.lexium.manual.help import remedy
from multidrop.families.lexium.manual.program_file import ProgramLine
from multidrop.families.lexium.manual.statements import size_of
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.state.errors import CRLF, DriveFault, RecordedError
from multidrop.families.lexium.simulator.state.program_memory import PROGRAM_BYTES, ProgramContents
from multidrop.families.lexium.simulator.stored_setups import refused_later
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
from multidrop.simulator.world import World

FIRST_ADDRESS = 1
LAST_ADDRESS = 99_999
LAST_LINE = 999_999


def printed(t: float, text: str) -> ProgramEvent:
    """A line that the drive has printed, and when it was complete; what would act on a terminal is escaped."""
    shown = text
    if not text.isprintable():
        shown = "".join(
            character if character.isprintable() or character == "\t" else f"\\x{ord(character):02x}"
            for character in text
        )
    return ProgramEvent(t, {"print": text}, shown)


class MCodeRun(ProgramRun):
    """One file on one drive. Raises Diagnostic for a drive that refuses its settings."""

    name = "mcode"
    title = "MCode"
    drive = DriveSpec()
    breaks = "LINE or LABEL, or with ,PASSES"
    watches = "a variable or flag, or a name with VA"
    complete = "E"
    by_product = True

    def __init__(self, spec: DriveSpec, lines: Sequence[ProgramLine], file: str, source: Sequence[str] = ()) -> None:
        super().__init__(spec, file, source)
        self._lines, self._personality = lines, spec.personality
        self._device = MCodeDevice(replace(spec, program="", program_name=""), World(spec.world))
        self._interpreter, self._program = self._device.interpreter, self._device.program
        self.running = self._device.thread
        self._failures: list[RecordedError] = []
        self._last: RecordedError | None = None
        self._device.errors.failures = self._failures
        self._device.prints()
        self._stored: dict[int, ProgramLine] = {}
        self._executed: dict[int, ProgramLine] = {}
        self._held = ""
        self._active: tuple[int, ...] = ()

    @classmethod
    def parsed(cls, text: str, file: str) -> Sequence[ProgramLine]:
        return program_file.read(text, file)

    @classmethod
    def refusals(cls, text: str, file: str, personality: str, found: Sequence[Problem]) -> list[Problem]:
        return refusals(text, file, personality, found)

    def refused(self) -> Iterator[ProgramEvent]:
        """Load the file without running it; return the refused lines. A refused PG counts as PG 1."""
        return (event for event in self.load(anywhere=True) if event.problem)

    @property
    def program(self) -> ProgramContents:
        """The program that was stored."""
        return self._program

    # Loading.

    def load(self, anywhere: bool = False) -> Iterator[ProgramEvent]:
        device = self._device
        for line in self._lines:
            if anywhere and device.programming is None and line.section == "program" and line.mark is None:
                device.core.mode.address = FIRST_ADDRESS
            address = device.programming
            if address is None and line.text.upper() == "S":
                continue
            answer = device.execute(line.text, 0.0)
            for text in answer.lines:
                yield printed(0.0, text)
            self._held += answer.tail
            if answer.refused:
                code = self._failures[-1].code
                self.errors.append(code)
                yield self._failed(RecordedError(0.0, code, 0), line, "refused")
                if address is None and line.section == "program" and not anywhere:
                    return
            elif address is not None:
                self._stored[address] = line
        self._failures.clear()

    def begin(self, label: str, debugging: DebugWishes) -> None:
        """Start at a label or an address (SU, else address 1).

        A download takes longer than a calibration that its header has begun (AS).
        """
        device = self._device
        device.motor.hmt.settle(0.0)
        if not device.running or label:
            device.core.thread.finish()
            labels, address = self._program.labels, whole(label, 0, LAST_ADDRESS)
            default = NameTerm("SU") if "SU" in labels else Number(FIRST_ADDRESS)
            try:
                named = Number(address) if address is not None else NameTerm(label.upper())
                self._interpreter.start(named if label else default, 0.0)
            except DriveFault:
                what = f"nothing to run at {label}" if label else "no SU, and nothing at address 1"
                there = ", ".join(sorted(labels)) or "it has none"
                hint = f"valid for --run: an address, or a label of the program ({there})"
                raise Diagnostic(what, self.file, hint) from None
        index = self._interpreter.linked.index
        self._executed = {index[at]: line for at, line in sorted(self._stored.items()) if at in index}
        if debugging.wanted:
            self.recorder = self.recording(debugging, RunRecorder)
            self._interpreter.watch(self._before, self._after)
        elif debugging.outputs:
            self._interpreter.watch(None, self._switched)

    # The trace, and break points.

    def reader(self, name: str) -> Reader | None:
        return self._device.language.reader(name)

    def values(self, readers: Mapping[str, Reader]) -> Values:
        values: dict[str, Value] = {}
        for name, read in readers.items():
            with suppress(DriveFault):  # a variable that is not declared yet is left out
                values[name] = read()
        return values

    def unnamed(self, trace: bool) -> Values:
        return self._device.memory.values if trace else {}

    def line_of(self, point: BreakPoint) -> int:
        labels, number = self._program.labels, whole(point.place, 0, LAST_LINE)
        if number is None:
            address = labels.get(point.place.upper())
        else:
            address = next((at for at, line in self._stored.items() if line.number == number), None)
        index = self._interpreter.linked.index
        executed = self._executed.get(index.get(address, -1)) if address is not None else None
        if executed is None:
            hint = f"valid: a line of the program, or a label ({', '.join(sorted(labels)) or 'none'})"
            raise Diagnostic(f"no line to break at {point.place}", self.file, hint)
        return executed.number

    def _before(self, line: int) -> bool:
        executed, recorder = self._executed.get(line), self.recorder
        return executed is not None and recorder is not None and recorder.reaches(self._device.now, executed.number)

    def _after(self, line: int) -> None:
        executed, recorder = self._executed.get(line), self.recorder
        if executed is not None and recorder is not None:
            recorder.after(self._device.now, executed.number)

    def unwatch(self) -> None:
        self._interpreter.watch(None, None)

    def _switched(self, line: int) -> None:
        device = self._device
        active = tuple(n for n, on in device.output_lines.driven.items() if on)
        if active != self._active:
            self._active = active
            text = f"active outputs: {', '.join(map(str, active)) or 'none'}"
            self.events.append(ProgramEvent(device.now, {"outputs": list(active)}, text))

    # Running.

    def deadline(self) -> float | None:
        return self._device.deadline

    def advance(self) -> None:
        self._device.advance(self.now, program=True)

    def happened(self) -> Iterator[ProgramEvent]:
        for t, text in self._device.prints():
            *whole, self._held = (self._held + text).split(CRLF)
            yield from (printed(t, line) for line in whole)
        for failure in self._failures:
            yield self._failed(failure, self._at(failure.line), f"at {failure.t:.4f} s")
            if not failure.handled:
                self.errors.append(failure.code)
        self._last = self._failures[-1] if self._failures else self._last
        self._failures.clear()

    def rest(self) -> Iterator[ProgramEvent]:
        if self._held:
            yield printed(self._device.now, self._held)

    def ended(self) -> str:
        last = self._last
        return "error" if last is not None and last.t == self._device.now and not last.handled else self.complete

    def _failed(self, failure: RecordedError, line: ProgramLine, when: str) -> ProgramEvent:
        """An error of the drive; `handled` is one that a subroutine of OE took."""
        facts = {"error": failure.code, "line": line.number, **({"handled": True} if failure.handled else {})}
        handled = " (OE has handled it)" if failure.handled else ""
        text = f"{line.text}: {when}: {meaning(failure.code, self._personality)}{handled}"
        return ProgramEvent(failure.t, facts, text, line.number, problem=True)

    def _at(self, index: int) -> ProgramLine:
        """Find the line of the file for a line of the interpreter; after the program's end, the last one before."""
        while index > 0 and index not in self._executed:
            index -= 1
        return self._executed.get(index, self._lines[0])

    def failed(self) -> str:
        return f"errors {', '.join(str(error) for error in self.errors)}"

    def summary(self, ended: str, until: float | None) -> Summary:
        device = self._device
        end = device.motion(device.now)
        line = self._at(self._interpreter.line()).number if self._executed else 0
        return self.summed(
            ended,
            until,
            t=device.now,
            position=end.position,
            place=f"position {end.position}",
            moves=device.language.motions.begun,
            moving=end.velocity,
            lines_at=(line,),
            turning=f"the motor still turns, {end.velocity} steps/s; H before E waits for it",
            ran=line > 0,
        )


def meaning(code: int, personality: str) -> str:
    return f"error {code}, {text_of_error(code, personality)}"


def refusals(text: str, file: str, personality: str, found: Sequence[Problem]) -> list[Problem]:
    """Find what a simulated drive refuses of the lines without a problem so far."""
    lines, unready = program_file.scan(text)
    wrong = {error.line for error in errors(found)}
    tried = [line for line in lines if line.number not in wrong or line.mark is not None]
    if all(line.section != "program" for line in lines):  # what follows its first line is of the program, not typed
        begins = min((error.line for error in errors(unready)), default=inf)
        tried = [line for line in tried if line.number < begins]
    missing = {line.declares for line in lines if line.number in wrong}
    problems, numbered = [], {line.number: line for line in lines}
    run = MCodeRun(DriveSpec(personality=personality), tried, file)
    for failed in run.refused():
        line, code = numbered[failed.facts["line"]], failed.facts["error"]
        if code == ErrorNumber.PROGRAM_MEMORY_FULL:  # the drive takes none of the others either
            problems.append(_too_big(line, lines, personality))
            break
        if line.number not in wrong and not missing & words(line.text):
            what = f"{line.text}: {meaning(code, personality)}"
            problems.append(Problem(line.number, line.column, what, remedy(code, line.text, personality)))
        missing.add(line.declares)
    told = {error.line for error in errors([*found, *problems])}
    return [*problems, *_refused_later(run, lines, personality, told)]


def _refused_later(
    run: MCodeRun, lines: Sequence[ProgramLine], personality: str, told: Container[int]
) -> Iterator[Problem]:
    """Warn of the set-ups of a program that a drive stores and refuses when it executes them."""
    for line, code, alone in refused_later(lines, run.program, personality, told):
        after = "" if alone else ", after the set-ups before it"
        what = f"{line.text}: a drive refuses it when it executes it{after} ({meaning(code, personality)})"
        yield Problem(line.number, line.column, what, remedy(code, line.text, personality), warning=True)


def _too_big(line: ProgramLine, lines: Sequence[ProgramLine], personality: str) -> Problem:
    inside = [each for each in lines if each.section == "program" and each.mark is None]
    size = sum(size_of(statement, personality) for each in inside if (statement := parsed(each.text)) is not None)
    what = f"program too big: {len(inside)} lines take {size} bytes, the drive holds {PROGRAM_BYTES}"
    return Problem(line.number, line.column, what, "shorten the program; this line is the first without room")
