"""Long jobs: their progress, published for every front end."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from multidrop.dialects import Procedure
from multidrop.shell.events import Progressed

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.channel import Channel

T = TypeVar("T")

PERIOD = 0.1
"""The shortest time between two reports of a job, s."""
EARLIEST = 0.5
"""The time after which the pace of a job says how long it will take, s."""


class Job:
    """A long job. Call it with the number of steps done and the number in all, as often as they change."""

    def __init__(self, channel: Channel, what: str) -> None:
        self._channel = channel
        self._what = what
        self._began = channel.now()
        self._first = self._total = 0
        """The first count of steps, and the steps in all: the pace is measured from there."""
        self._shown_at = float("-inf")

    def __call__(self, done: int, total: int) -> None:
        """Report progress; most reports are not published."""
        now = self._channel.now()
        if total != self._total or done < self._first:
            self._began, self._first, self._total = now, done, total
        if done < total and now - self._shown_at >= PERIOD:
            self._shown_at = now
            self._channel.publish(Progressed(now, self._what, done, total, self._left(done, now)))

    def _left(self, done: int, now: float) -> float | None:
        """The time that the rest takes at the pace so far; None before there is a pace."""
        took, steps = now - self._began, done - self._first
        return took / steps * (self._total - done) if steps and took >= EARLIEST else None

    def end(self) -> None:
        """Publish the end, if anything was published."""
        if self._shown_at > float("-inf"):
            total = self._total
            self._channel.publish(Progressed(self._channel.now(), self._what, total, total, 0.0))


@contextmanager
def running(channel: Channel, what: str) -> Iterator[Job]:
    """Publish the progress of a job; `what` names it with its drive (`a: download`). It ends with the block."""
    job = Job(channel, what)
    try:
        yield job
    finally:
        job.end()


async def transferring(drive: Drive, procedure: Procedure[T]) -> T:
    """Run a conversation of many requests; polls of the drive wait."""
    drive.transferring = True
    try:
        return await drive.run(procedure)
    finally:
        drive.transferring = False
