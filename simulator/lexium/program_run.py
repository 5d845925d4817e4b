"""A program file run on one simulated drive, in virtual time: no clock, no wire, no event loop.

The file is loaded as by a download: declarations are carried out at time 0, the program is stored; S is skipped, since
nothing is to be kept. Then the drive's time goes from event to event, so that ten minutes of holding cost nothing, and
up to `SLICE` further, so that a line of the program costs little. The run ends with the program, when nothing can ever
happen any more, or when its time is over.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

from dialects import Diagnostic
from dialects.mcode.manual import program_file
from dialects.mcode.manual.grammar import Name, Number, words
from dialects.mcode.manual.program_file import ProgramLine
from dialects.mcode.manual.remedies import remedy
from dialects.numbers import whole
from dialects.problems import Problem, errors
from simulator.cell.spec import DriveSpec
from simulator.lexium.device import MCodeDevice
from simulator.lexium.program_events import Failed, Printed, Summary
from simulator.lexium.program_watch import Subject, Watcher
from simulator.lexium.state.errors import Failure, Fault
from simulator.lexium.state.models import MODELS
from simulator.lexium.state.printer import CRLF
from simulator.program_run import LONGEST, MOST_LINES, NO_DEBUGGING, SLICE, Debugging, Load, Programs
from simulator.program_watch import Followed, source_lines
from simulator.world import World

FIRST_ADDRESS = 1
LAST_ADDRESS = 99_999
FIRST = Number(FIRST_ADDRESS)


class ProgramRun:
    """One file on one drive. Raises Diagnostic for a drive that refuses its settings."""

    def __init__(self, spec: DriveSpec, lines: Sequence[ProgramLine], name: str, source: Sequence[str] = ()) -> None:
        if spec.personality not in MODELS:
            raise Diagnostic(f"a {spec.personality} does not run MCode", name, f"valid: {', '.join(MODELS)}")
        self._lines, self._name, self._personality = lines, name, spec.personality
        self._source = source
        self._watcher: Watcher | None = None
        self._device = MCodeDevice(replace(spec, program="", program_name=""), World(spec.world))
        self._interpreter, self._program = self._device.interpreter, self._device.program
        self._failures: list[Failure] = []
        self._last: Failure | None = None
        self._device.errors.failures = self._failures
        self._device.prints()
        self._stored: dict[int, ProgramLine] = {}
        self._executed: dict[int, ProgramLine] = {}
        self._held = ""
        self._errors: list[int] = []

    def run(
        self, label: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING
    ) -> Iterator[Printed | Failed | Followed | Summary]:
        """Load the file and run it from a label or an address (SU, else address 1), for `until` seconds at most.

        The last event is a Summary. A file with a refused line is not run. Raises Diagnostic if there is nothing to
        run.
        """
        yield from self._load()
        if self._errors:
            yield self._summary("error")
            return
        self._start(label)
        if debugging.wanted:
            self._follow(debugging)
        yield from self._execute(until)

    def refusals(self) -> list[Failed]:
        """Load the file without running it; give the refused lines. A refused PG counts as PG 1."""
        return [each for each in self._load(anywhere=True) if isinstance(each, Failed)]

    # Loading.

    def _load(self, anywhere: bool = False) -> Iterator[Printed | Failed]:
        device = self._device
        for line in self._lines:
            address = device.programming
            if address is None and line.text.upper() == "S":
                continue
            answer = device.execute(line.text, 0.0)
            for text in answer.lines:
                yield Printed(0.0, text)
            self._held += answer.tail
            if answer.refused:
                code = self._failures[-1].code
                self._errors.append(code)
                yield Failed(0.0, code, line.number, line.text, loading=True, personality=self._personality)
                if address is None and line.section == "program":
                    if not anywhere:
                        return
                    device.mode.address = FIRST_ADDRESS
            elif address is not None:
                self._stored[address] = line
        self._failures.clear()

    def _start(self, label: str) -> None:
        device = self._device
        if not device.running or label:
            self._interpreter.finish()
            target = self._target(label)
            try:
                self._interpreter.start(target, 0.0)
            except Fault:
                raise self._nowhere(label) from None
        index = self._interpreter.linked.index
        self._executed = {index[at]: line for at, line in sorted(self._stored.items()) if at in index}

    def _follow(self, debugging: Debugging) -> None:
        device, linked = self._device, self._interpreter.linked
        subject = Subject(
            now=lambda: device.now,
            reader=device.language.reader,
            values=device.memory.values,
            labels=self._program.labels,
            index=linked.index,
        )
        self._watcher = Watcher(subject, debugging, self._executed, self._stored, self._source, self._name)
        self._interpreter.observer = self._watcher

    def _target(self, label: str) -> Name | Number:
        if (address := whole(label, 0, LAST_ADDRESS)) is not None:
            return Number(address)
        if label:
            return Name(label.upper())
        return Name("SU") if "SU" in self._program.labels else FIRST

    def _nowhere(self, label: str) -> Diagnostic:
        labels = ", ".join(sorted(self._program.labels)) or "it has none"
        what = f"nothing to run at {label}" if label else "no SU, and nothing at address 1"
        return Diagnostic(what, self._name, f"valid for --run: an address, or a label of the program ({labels})")

    # Running.

    def _execute(self, until: float | None) -> Iterator[Printed | Failed | Followed | Summary]:
        device, interpreter = self._device, self._interpreter
        limit = LONGEST if until is None else until
        most = MOST_LINES if until is None else inf
        stuck = False
        while device.running and device.now < limit and interpreter.executed < most:
            due = device.deadline
            stuck = due is None
            device.advance(limit if due is None else min(max(due, device.now) + SLICE, limit), program=True)
            yield from self._news()
            if self._watcher is not None and self._watcher.recorder.done:
                self._interpreter.observer = None
        if self._held:
            yield Printed(device.now, self._held)
        if device.running:
            yield self._summary("until", given_up=until is None, stuck=stuck)
        elif self._watcher is not None and self._watcher.recorder.broken:
            yield self._summary("break")
        else:
            last = self._last
            failed = last is not None and last.t == device.now and not last.handled
            yield self._summary("error" if failed else "E")

    def _news(self) -> Iterator[Printed | Failed | Followed]:
        """Yield what was executed, printed and what failed since the last look, in order."""
        news: list[Printed | Failed | Followed] = [] if self._watcher is None else [*self._watcher.take()]
        for t, text in self._device.prints():
            *whole, self._held = (self._held + text).split(CRLF)
            news += [Printed(t, each) for each in whole]
        for failure in self._failures:
            news.append(self._failed(failure))
            if not failure.handled:
                self._errors.append(failure.code)
        self._last = self._failures[-1] if self._failures else self._last
        self._failures.clear()
        news.sort(key=lambda each: each.t)
        yield from news

    def _failed(self, failure: Failure) -> Failed:
        line = self._at(failure.line)
        return Failed(failure.t, failure.code, line.number, line.text, failure.handled, personality=self._personality)

    def _at(self, index: int) -> ProgramLine:
        """Find the line of the file for a line of the interpreter; after the program's end, the last one before."""
        while index > 0 and index not in self._executed:
            index -= 1
        return self._executed.get(index, self._lines[0])

    def _summary(self, ended: str, given_up: bool = False, stuck: bool = False) -> Summary:
        device = self._device
        return Summary(
            ended=ended,
            t=device.now,
            position=device.position(device.now),
            moves=device.motions.begun,
            instructions=self._interpreter.executed,
            errors=tuple(self._errors),
            line=self._at(self._interpreter.line()).number if self._executed else 0,
            moving=device.velocity(device.now),
            given_up=given_up,
            stuck=stuck,
        )


def read(text: str, file: str) -> Load:
    """Read the text of a file. Raises Diagnostic."""
    lines, source = program_file.read(text, file), source_lines(text)
    return lambda spec: ProgramRun(spec, lines, file, source)


def refusals(text: str, file: str, personality: str, found: Sequence[Problem]) -> list[Problem]:
    """Find what a simulated drive refuses of the lines without a problem so far."""
    lines, unready = program_file.scan(text)
    wrong = {each.line for each in errors(found)}
    tried = [line for line in lines if line.number not in wrong or line.mark is not None]
    if all(line.section != "program" for line in lines):  # what follows its first line is of the program, not typed
        begins = min((each.line for each in errors(unready)), default=inf)
        tried = [line for line in tried if line.number < begins]
    missing = {line.declares for line in lines if line.number in wrong}
    problems, numbered = [], {line.number: line for line in lines}
    for failed in ProgramRun(DriveSpec(personality=personality), tried, file).refusals():
        line = numbered[failed.line]
        if line.number not in wrong and not missing & words(line.text):
            what = f"{failed.text}: {failed.meaning}"
            problems.append(Problem(line.number, line.column, what, remedy(failed.code, failed.text, personality)))
        missing.add(line.declares)
    return problems


RUNS = Programs(drive=DriveSpec(), read=read, refusals=refusals)
