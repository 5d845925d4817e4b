"""The comparison after the fact: positions in a log beside those of simulated drives at the same times."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from multidrop.dialects.family import Motion
from multidrop.drives.drive import Drive
from multidrop.drives.events import Sample
from multidrop.shell.comparing.compared import Compared
from multidrop.shell.comparing.differences import DIFFERENCE_LIMIT, Verdict
from multidrop.shell.events import Diverged
from multidrop.shell.line_syntax import EVERYONE, join_target
from multidrop.shell.log.decoding import Decoding, MeasuredPosition, printed
from multidrop.shell.log.steps import LoggedPoll, LoggedStep
from multidrop.shell.log.targets import Place
from multidrop.simulator.family import Shadow

LONGEST_SEND_DELAY = 0.05
"""Seconds by which a line may have left later than the log says that it was typed."""
Reading = tuple[Shadow, float]
"""A simulated drive, and its time."""


@dataclass(frozen=True)
class Divergence:
    """The first difference of an axis beyond the limit."""

    drive: str
    at: datetime
    difference: int
    limit: int
    causes: tuple[str, ...]

    @property
    def text(self) -> str:
        steps = f"{abs(self.difference)} steps from the simulated drive since {self.at:%H:%M:%S.%f}"[:-5]
        return f"{self.drive}: {steps} (limit {self.limit}): {', '.join(self.causes)}"


class _Simulated:
    """A simulated drive that runs by itself: it is read when it is asked, whatever time is given."""

    def __init__(self, read: Callable[[], Reading]) -> None:
        self._read = read

    def motion(self, at: float) -> dict[str, Motion]:
        shadow, now = self._read()
        return {of_axis.axis: of_axis for of_axis in shadow.motion(now)}

    def align(self, axis: str, position: int, at: float) -> None:
        shadow, now = self._read()
        shadow.align(axis, position, now)


class _Place:
    """One drive of the log."""

    def __init__(self, place: Place, drive: Drive, read: Callable[[], Reading]) -> None:
        self.name = join_target(*place)
        self.address, self.drive = place[1], drive
        self.decoding = Decoding(drive)
        self.compared = Compared(_Simulated(read))
        self.counts: dict[str, int] = {}
        """The positions that were compared, by axis."""
        self._moved = False
        """Whether a line that can start motion was replayed."""

    def disturbed(self, at: float, line: str) -> None:
        """Note a line or a stop (empty) that acts on the drive now."""
        self._moved = self._moved or (bool(line) and self.drive.starts(line))
        self.compared.disturbed(at)

    def take(self, found: MeasuredPosition, at: float) -> Iterator[Diverged]:
        """Compare a position; the simulated drive begins at one that was measured before the first motion."""
        expected = self.compared.twin.motion(at).get(found.axis)
        if expected is None:
            return
        velocity = expected.velocity if found.velocity is None else found.velocity
        if found.axis not in self.counts and not (self._moved or velocity or expected.velocity):
            self.compared.twin.align(found.axis, found.position, at)
        self.counts[found.axis] = self.counts.get(found.axis, 0) + 1
        self.compared.comparison(found.axis).lag = LONGEST_SEND_DELAY
        sample = Sample(at, self.address, found.position, velocity, found.axis)
        yield from (
            finding for finding in self.compared.sample(sample, DIFFERENCE_LIMIT) if isinstance(finding, Diverged)
        )

    def end(self) -> Iterator[Diverged]:
        for axis, comparison in self.compared.axes.items():
            if comparison.settle() is Verdict.DIVERGED:
                news = self.compared.news(Verdict.DIVERGED, comparison, self.address, axis, DIFFERENCE_LIMIT)
                assert isinstance(news, Diverged)
                yield news

    def shown(self, axis: str) -> str:
        return f"{self.name}.{axis}" if axis else self.name


class LoggedPositions:
    """The measured positions of a log, each compared when its time has come."""

    def __init__(
        self,
        targets: Mapping[Place, Drive],
        polls: Sequence[LoggedPoll],
        steps: Sequence[LoggedStep],
        read: Callable[[Drive], Reading],
        found: Callable[[Divergence], None],
    ) -> None:
        """`read`: of the simulated drive in the part of one; `found`: called with the first divergence of each axis."""
        self._places = {
            place: _Place(place, drive, lambda drive=drive: read(drive))  # type: ignore[misc]
            for place, drive in targets.items()
            if place[1] not in EVERYONE
        }
        self._found = found
        self._first = steps[0].at
        self.diverged: dict[str, Divergence] = {}
        """The first divergence of each axis, by its name."""
        everything: list[LoggedPoll | LoggedStep] = [*polls, *steps]
        self._all = sorted(everything, key=lambda each: each.at)

    async def run(self, began: float) -> None:
        """Compare each position at its time. `began`: the time of the first step."""
        loop = asyncio.get_running_loop()
        for step in self._all:
            at = (step.at - self._first).total_seconds()
            if began + at > loop.time():
                await asyncio.sleep(began + at - loop.time())
            if isinstance(step, LoggedStep) and (not step.text or step.drive in EVERYONE):  # a stop, or a line for all
                for (bus, _), place in self._places.items():
                    if step.bus in ("", bus):
                        place.disturbed(at, step.text)
            elif (own := self._places.get((step.bus, step.drive))) is not None:
                measured = list(own.decoding.take(step) if isinstance(step, LoggedPoll) else printed(step, own.drive))
                if isinstance(step, LoggedStep) and not measured:
                    own.disturbed(at, step.text)
                for position in measured:
                    self._report(own, own.take(position, at))
        for place in self._places.values():
            self._report(place, place.end())

    def _report(self, place: _Place, news: Iterator[Diverged]) -> None:
        for event in news:
            name = place.shown(event.axis)
            if name not in self.diverged:
                at = self._first + timedelta(seconds=event.at)
                self.diverged[name] = Divergence(name, at, event.difference, event.limit, event.causes)
                self._found(self.diverged[name])

    @property
    def compared(self) -> dict[str, int]:
        return {place.shown(axis): n for place in self._places.values() for axis, n in place.counts.items()}

    @property
    def largest(self) -> dict[str, int]:
        return {
            place.shown(axis): abs(comparison.furthest.difference)
            for place in self._places.values()
            for axis, comparison in place.compared.axes.items()
            if comparison.furthest is not None
        }
