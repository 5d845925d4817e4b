"""The positions that a log holds: polls as their bytes, decoded by the conversation that once made them."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from datetime import datetime
from typing import TYPE_CHECKING, NamedTuple

from multidrop.base.errors import DriveError
from multidrop.base.text import whole
from multidrop.dialects import Priority, Procedure, Request
from multidrop.dialects.codec import copy_with
from multidrop.dialects.families import family_of
from multidrop.dialects.family import Motion
from multidrop.dialects.state import DriveState
from multidrop.shell.log.steps import LoggedPoll, LoggedStep

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive

WORDS = {"P": "", "PX": "x", "PY": "y"}
"""The axis of the words that print a position."""


class MeasuredPosition(NamedTuple):
    """The measured position of an axis of a drive."""

    where: str
    at: datetime
    axis: str
    position: int
    velocity: int | None
    """None: only the position was read."""


class Assumed(NamedTuple):
    """A drive of which only a log is known."""

    state: DriveState


class Decoding:
    """Decodes the polls of one drive, in their order."""

    def __init__(self, drive: Drive | Assumed) -> None:
        self._drive = drive
        self._procedure: Procedure[tuple[Motion, ...]] | None = None
        self._request: Request | None = None

    def take(self, poll: LoggedPoll) -> Iterator[MeasuredPosition]:
        """Take a request with its reply; yield what the drive's motion was once that is known."""
        try:
            result = self._step(poll)
        except DriveError:  # it is in program mode now, or the reply was damaged then, too
            self._request, result = None, ()
        for motion in result:
            yield MeasuredPosition(poll.where, poll.at, motion.axis, motion.position, motion.velocity)

    def _step(self, poll: LoggedPoll) -> tuple[Motion, ...]:
        """Go on with the conversation that the request belongs to, or begin one; return its result at its end."""
        try:
            if self._request is None or not self._fits(self._request, poll):
                self._procedure = family_of(copy(self._drive.state)).motion(Priority.POLL)
                self._request = next(self._procedure)
            request, self._request = self._request, None
            if self._fits(request, poll) and self._procedure is not None:
                numbered = copy_with(request, tag=int.from_bytes(poll.sent[:2], "big"))
                codec, received = request.codec, poll.received
                if (decoded := codec.decode(numbered, received) or codec.on_quiet(numbered, received)) is not None:
                    self._request = self._procedure.send(copy_with(decoded.reply, raw=received[: decoded.used]))
        except StopIteration as done:
            motion: tuple[Motion, ...] = done.value
            return motion
        return ()

    @staticmethod
    def _fits(request: Request | None, poll: LoggedPoll) -> bool:
        """Whether a request has these bytes. The number of one that has a number begins its bytes."""
        if request is None:
            return False
        numbered = copy_with(request, tag=int.from_bytes(poll.sent[:2], "big"))
        return request.codec.encode(numbered) == poll.sent


def printed(step: LoggedStep, drive: Drive) -> Iterator[MeasuredPosition]:
    """Yield the position that a line has printed."""
    questions = {drive.family.question(word): axis for word, axis in WORDS.items()}
    axis = questions.get(" ".join(step.text.upper().split()))
    position = whole(step.printed[0].strip(), -(2**31), 2**31 - 1) if len(step.printed) == 1 else None
    if axis is not None and position is not None:
        yield MeasuredPosition(step.where, step.at, axis, position, None)
