"""A program file run on one simulated drive, in virtual time: no clock, no wire, no event loop.

The file is loaded as by a download: declarations are carried out at time 0, the program is stored; S is skipped, since
nothing is to be kept. Then the drive's time goes from event to event, so that ten minutes of holding cost nothing, and
up to `SLICE` further, so that a line of the program costs little. The run ends with the program, when nothing can ever
happen any more, or when its time is over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any, NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import split_lines
from multidrop.dialects.mcode.manual import program_file
from multidrop.dialects.mcode.manual.errors import ErrorNumber
from multidrop.dialects.mcode.manual.errors import text as text_of_error
from multidrop.dialects.mcode.manual.grammar import LineError, Name, Number, Statement, parse, words
from multidrop.dialects.mcode.manual.help import remedy
from multidrop.dialects.mcode.manual.program_file import ProgramLine
from multidrop.dialects.mcode.manual.statements import size_of
from multidrop.dialects.program_files import Problem, errors
from multidrop.dialects.text import whole
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.lexium.device import MCodeDevice
from multidrop.simulator.lexium.state.errors import Failure, Fault
from multidrop.simulator.lexium.state.expressions import Read
from multidrop.simulator.lexium.state.models import MODELS
from multidrop.simulator.lexium.state.program_memory import SPACE
from multidrop.simulator.lexium.state.timeline import CRLF
from multidrop.simulator.program_run import (
    LONGEST,
    MOST_LINES,
    NO_DEBUGGING,
    SLICE,
    BreakPoint,
    Debugging,
    Followed,
    Line,
    Load,
    Programs,
    Recorder,
    Value,
    Values,
    remark,
    split_break,
)
from multidrop.simulator.world import World

# What a person follows in the run of an MCode program: which line of the file comes next, what variables hold.


LAST_LINE = 999_999


@dataclass(frozen=True)
class Subject:
    """The parts of a drive that are looked at: its time, its variables, labels and lines by address."""

    now: Callable[[], float]
    reader: Callable[[str], Read | None]
    values: Values
    labels: Mapping[str, int]
    index: Mapping[int, int]


class Watcher:
    """Looks at each line that the interpreter executes. Raises Diagnostic for a place or a name that is not there.

    `lines` are the lines of the file by line of the interpreter, `stored` by address.
    """

    def __init__(
        self,
        subject: Subject,
        debugging: Debugging,
        lines: Mapping[int, ProgramLine],
        stored: Mapping[int, ProgramLine],
        source: Sequence[str],
        file: str,
    ) -> None:
        self._subject, self._lines, self._source, self._file = subject, lines, source, file
        readers = {name.upper(): self._reader(name.upper()) for name in debugging.watch}
        everything = debugging.trace and not readers
        self.recorder = Recorder(
            debugging,
            source,
            {self._broken_line(each, stored): self._point(each) for each in debugging.breaks},
            (lambda: subject.values) if everything else partial(_values, readers),
        )

    def before(self, line: int) -> bool:
        """See Observer."""
        found = self._lines.get(line)
        if found is None or not self.recorder.reaches(found.number):
            return False
        self.recorder.breaks(self._subject.now(), found.number, self._text(found))
        return True

    def after(self, line: int) -> None:
        """See Observer."""
        if self.recorder.full or (found := self._lines.get(line)) is None:
            return
        self.recorder.after(self._subject.now(), found.number, self._text(found), self.recorder.changed())

    def take(self) -> list[Followed]:
        """Return the events since the last time."""
        return self.recorder.take()

    def _text(self, line: ProgramLine) -> str:
        return self._source[line.number - 1].strip()

    def _reader(self, name: str) -> Read:
        read = self._subject.reader(name)
        if read is None:
            raise Diagnostic(f"no variable {name} to watch", self._file, "valid: a variable or flag, or a name with VA")
        return read

    def _point(self, text: str) -> BreakPoint:
        found = split_break(text)
        if found is None:
            hint = "valid: LINE or LABEL, or with ,PASSES from 1 to 65535"
            raise Diagnostic(f"no break point {text}", self._file, hint)
        return BreakPoint(*found)

    def _broken_line(self, text: str, stored: Mapping[int, ProgramLine]) -> int:
        """The line of the file before which the run ends."""
        place, index = self._point(text).place, self._subject.index
        number = whole(place, 0, LAST_LINE)
        if number is None:
            address = self._subject.labels.get(place.upper())
        else:
            address = next((at for at, line in stored.items() if line.number == number), None)
        found = self._lines.get(index.get(address, -1)) if address is not None else None
        if found is None:
            labels = ", ".join(sorted(self._subject.labels)) or "none"
            hint = f"valid: a line of the program, or a label ({labels})"
            raise Diagnostic(f"no line to break at {place}", self._file, hint)
        return found.number


def _values(readers: Mapping[str, Read]) -> Values:
    """Read what is watched; a variable that is not declared yet is left out."""
    found: dict[str, Value] = {}
    for name, read in readers.items():
        try:
            found[name] = read()
        except Fault:
            continue
    return found


# What the run of an MCode program reports: as values, as JSON objects, and as lines for a person.


ENDS = {"E": "ended at E", "error": "ended by an error", "until": "stopped", "break": "stopped at a break point"}


class Printed(NamedTuple):
    """A line that the drive has printed, and when it was complete; seconds from the start of the program."""

    t: float
    text: str

    @property
    def failed(self) -> bool:
        """Return False: only a summary says that a test has failed."""
        return False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        return {"t": round(self.t, 6), "print": self.text}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        yield Line(f"{self.t:10.4f}  {_visible(self.text)}")


@dataclass(frozen=True)
class Failed:
    """An error of the drive: its time, its code, the line of the file; whether a subroutine of OE handled it.

    `loading`: the drive refused the line when the file was loaded.
    """

    t: float
    code: int
    line: int
    text: str
    handled: bool = False
    loading: bool = False
    personality: str = field(default="LMDCM", compare=False)
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        more = {"handled": True} if self.handled else {}
        return {"t": round(self.t, 6), "error": self.code, "line": self.line, **more}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        when = "refused" if self.loading else f"at {self.t:.4f} s"
        handled = " (OE has handled it)" if self.handled else ""
        yield Line(f"{file}:{self.line}: {self.text}: {when}: {self.meaning}{handled}", problem=True)

    @property
    def meaning(self) -> str:
        """The error's code and its meaning."""
        return f"error {self.code}, {text_of_error(self.code, self.personality)}"


@dataclass(frozen=True)
class Summary:
    """How a run ended: "E", "error", "break" or "until". `errors` are the codes that no subroutine handled.

    `line` is where the program is or has ended (0: nowhere). `moving` is the velocity at the end, steps/s.
    `given_up`: no time was set, and the program was still running. `stuck`: nothing would ever have happened any more.
    """

    ended: str
    t: float
    position: int
    moves: int
    instructions: int
    errors: tuple[int, ...]
    line: int
    moving: int
    given_up: bool
    stuck: bool

    @property
    def failed(self) -> bool:
        """See Event."""
        return bool(self.errors or self.given_up)

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        return {
            "summary": {
                "position": self.position,
                "moves": self.moves,
                "errors": list(self.errors),
                "instructions": self.instructions,
                "virtual_s": round(self.t, 6),
                "real_s": round(real, 3),
                "ended": self.ended,
            }
        }

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        failed = f"errors {', '.join(str(each) for each in self.errors)}" if self.errors else "no errors"
        counts = f"{_count(self.moves, 'motion')}, {_count(self.instructions, 'line')}"
        how = f"{ENDS[self.ended]} after {self.t:.4f} s" if self.line else "not run"
        yield Line(f"{how}: position {self.position}, {counts}, {failed} ({real:.2f} s real)")
        turns = self.moving and self.ended == "E"
        turning = f"the motor still turns, {self.moving} steps/s; H before E waits for it" if turns else ""
        if text := remark(stuck=self.stuck, given_up=self.given_up, turning=turning):
            yield Line(f"{file}:{self.line}: {text}", problem=True)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _visible(text: str) -> str:
    """Escape what would act on a terminal."""
    return "".join(each if each.isprintable() or each == "\t" else f"\\x{ord(each):02x}" for each in text)


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

    def refusals(self) -> Iterator[Failed]:
        """Load the file without running it; give the refused lines. A refused PG counts as PG 1."""
        return (each for each in self._load(anywhere=True) if isinstance(each, Failed))

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
                    device.core.mode.address = FIRST_ADDRESS
            elif address is not None:
                self._stored[address] = line
        self._failures.clear()

    def _start(self, label: str) -> None:
        device = self._device
        if not device.running or label:
            device.core.thread.finish()
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
        self._interpreter.watch(self._watcher.before, self._watcher.after)

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
                self._interpreter.watch(None, None)
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
            moves=device.language.motions.begun,
            instructions=self._interpreter.executed,
            errors=tuple(self._errors),
            line=self._at(self._interpreter.line()).number if self._executed else 0,
            moving=device.velocity(device.now),
            given_up=given_up,
            stuck=stuck,
        )


def read(text: str, file: str) -> Load:
    """Read the text of a file. Raises Diagnostic."""
    lines, source = program_file.read(text, file), split_lines(text)
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
        if failed.code == ErrorNumber.PROGRAM_MEMORY_FULL:  # the drive takes none of the others either
            problems.append(_too_big(line, lines, personality))
            break
        if line.number not in wrong and not missing & words(line.text):
            what = f"{failed.text}: {failed.meaning}"
            problems.append(Problem(line.number, line.column, what, remedy(failed.code, failed.text, personality)))
        missing.add(line.declares)
    return problems


def _statement(text: str) -> Statement | None:
    try:
        return parse(text)
    except LineError:
        return None


def _too_big(line: ProgramLine, lines: Sequence[ProgramLine], personality: str) -> Problem:
    """The first line that has no room in the drive."""
    inside = [each for each in lines if each.section == "program" and each.mark is None]
    size = sum(size_of(statement, personality) for each in inside if (statement := _statement(each.text)) is not None)
    what = f"program too big: {len(inside)} lines take {size} bytes, the drive holds {SPACE}"
    return Problem(line.number, line.column, what, "shorten the program; this line is the first without room")


RUNS = Programs(drive=DriveSpec(), read=read, refusals=refusals)
