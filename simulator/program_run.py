"""Runs of program files on simulated drives in virtual time: limits, and what families share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import inf
from typing import Any, ClassVar, Protocol, TypeVar, cast

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.base.text import counted
from multidrop.dialects.program_files import Problem
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.declared import simulated
from multidrop.simulator.program_events import (
    NO_DEBUGGING,
    BreakPoint,
    DebugWishes,
    ProgramEvent,
    RunRecorder,
    Summary,
    Value,
    Values,
    break_point,
)

LONGEST_RUN = 3600.0
"""Virtual seconds after which a run without a time of its own is given up."""
MOST_LINES = 20_000_000
"""Executed lines after which it is given up as well: a program that never waits, on a drive set up to be fast."""
RUN_SLICE = 1.0
"""Virtual seconds between two looks at what the drive has done: some thousand lines."""


class RunningProgram(Protocol):
    """A program that runs on a simulated drive: how many lines it has carried out."""

    executed: int

    @property
    def running(self) -> bool: ...  # noqa: D102


def looks(
    program: RunningProgram, deadline: Callable[[], float | None], until: float | None
) -> Iterator[tuple[float, bool]]:
    """Yield the times up to which a run advances at once, while its program runs: `RUN_SLICE` beyond the next event.

    The second value: nothing would ever happen any more.
    """
    now, limit, most = 0.0, LONGEST_RUN if until is None else until, MOST_LINES if until is None else inf
    while program.running and now < limit and program.executed < most:
        due = deadline()
        now = limit if due is None else min(max(due, now) + RUN_SLICE, limit)
        yield now, due is None


# The run of a file: what a family need not say of its own.

Reader = Callable[[], Value]
Kind = TypeVar("Kind", bound=RunRecorder)


class ProgramRun(ABC):
    """A program file on a simulated drive, run in virtual time: no clock, no wire, no event loop.

    The class stands for the program files of a family; an instance is one file on one drive. The drive's time goes from
    event to event, so that ten minutes of holding cost nothing, and up to `RUN_SLICE` further, so that a line of the
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
    by_product: ClassVar[bool] = False
    """Whether the check of a file depends on the product, because `refusals` finds something."""
    unit: ClassVar[str] = "line"
    """What it counts as carried out."""
    complete: ClassVar[str]
    """How a run ends with its program: a key of `ENDS`."""

    running: RunningProgram
    """What runs in the drive."""

    def __init__(self, spec: DriveSpec, file: str, source: Sequence[str]) -> None:
        """Raises Diagnostic for a drive of another family; a family, too, for one that refuses its settings."""
        valid = simulated()[self.name].personalities
        if spec.personality not in valid:
            raise Diagnostic(f"a {spec.personality} does not run {self.title}", file, f"valid: {', '.join(valid)}")
        self.file, self.source = file, source
        self.recorder: RunRecorder | None = None
        self.events: list[ProgramEvent] = []
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

    def run(
        self, start: str = "", until: float | None = None, debugging: DebugWishes = NO_DEBUGGING
    ) -> Iterator[ProgramEvent]:
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

    def load(self) -> Iterator[ProgramEvent]:
        """Load what is not loaded yet; `errors` gets what the drive refuses."""
        yield from ()

    @abstractmethod
    def begin(self, start: str, debugging: DebugWishes) -> None:
        """Start what is to run, and record it where that is wanted. Raises Diagnostic if there is nothing to run."""

    @abstractmethod
    def deadline(self) -> float | None:
        """When something will happen next; None: never."""

    @abstractmethod
    def advance(self) -> None:
        """Let the drive come to `now`."""

    def news(self) -> list[ProgramEvent]:
        """What was executed and what happened since the last look, in the order of time."""
        news, self.events = self.events, []
        if self.recorder is not None:
            news += self.recorder.take()
        news += self.happened()
        news.sort(key=self.order)
        return news

    @abstractmethod
    def happened(self) -> Iterator[ProgramEvent]:
        """What went wrong in the drive since the last look, and what else it tells only then."""

    @staticmethod
    def order(event: ProgramEvent) -> Any:
        return event.t

    def rest(self) -> Iterator[ProgramEvent]:
        """What is told when the run is over."""
        yield from ()

    def ended(self) -> str:
        """How a run ended whose program runs no more."""
        return "error" if self.errors else self.complete

    @property
    def broken(self) -> bool:
        return self.recorder is not None and self.recorder.broken

    # The trace, and break points

    def recording(self, debugging: DebugWishes, kind: Callable[..., Kind]) -> Kind:
        """Look at the lines that a person follows. Raises Diagnostic for a place or a name that is not there."""
        readers = {name.upper(): self._reader(name.upper()) for name in debugging.watch}
        points = {self.line_of(at := break_point(place, self.file, self.breaks)): at for place in debugging.breaks}
        values = partial(self.values, readers) if readers else partial(self.unnamed, debugging.trace)
        return kind(debugging, self.source, points, values, self.shown)

    def _reader(self, name: str) -> Reader:
        if (read := self.reader(name)) is None:
            raise Diagnostic(f"no variable {name} to watch", self.file, f"valid: {self.watches}")
        return read

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
