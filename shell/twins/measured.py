"""The positions that a log holds: polls as their bytes, decoded by the conversation that once made them."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from datetime import datetime
from typing import NamedTuple

from dialects import DriveError, Priority, Request
from dialects.codec import Reply
from dialects.family import Motion
from dialects.numbers import whole
from drives.drive import Drive
from drives.procedure import ProcedureRunner
from shell.log.steps import Exchange, Step

WORDS = {"P": "", "PX": "x", "PY": "y"}
"""The axis of the words that print a position."""


class Measured(NamedTuple):
    """The measured position of an axis of a drive."""

    where: str
    at: datetime
    axis: str
    position: int
    velocity: int | None
    """None: only the position was read."""


class Decoding:
    """Decodes the polls of one drive, in their order."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._runner: ProcedureRunner[tuple[Motion, ...]] | None = None

    def take(self, poll: Exchange) -> Iterator[Measured]:
        """Take a request with its reply; yield what the drive's motion was once that is known."""
        try:
            result = self._step(poll)
        except DriveError:  # it is in program mode now, or the reply was damaged then, too
            self._runner, result = None, ()
        for each in result:
            yield Measured(poll.where, poll.at, each.axis, each.position, each.velocity)

    def _step(self, poll: Exchange) -> tuple[Motion, ...]:
        """Go on with the conversation that the request belongs to, or begin one; return its result at its end."""
        if self._runner is None or not self._fits(self._runner.request, poll):
            self._runner = ProcedureRunner(self._drive.family.motion(copy(self._drive.state), Priority.POLL))
        runner, self._runner = self._runner, None
        request = runner.request
        reply = self._reply(request, poll) if request is not None and self._fits(request, poll) else None
        if reply is None:
            return ()
        runner.answer(reply)
        if runner.request is None:
            return runner.result
        self._runner = runner
        return ()

    @staticmethod
    def _fits(request: Request | None, poll: Exchange) -> bool:
        """Whether a request has these bytes. The number of one that has a number begins its bytes."""
        if request is None:
            return False
        numbered = request.numbered(int.from_bytes(poll.sent[:2], "big"))
        return request.codec.encode(numbered) == poll.sent

    @staticmethod
    def _reply(request: Request, poll: Exchange) -> Reply | None:
        numbered = request.numbered(int.from_bytes(poll.sent[:2], "big"))
        codec, received = request.codec, poll.received
        found = codec.decode(numbered, received) or codec.on_quiet(numbered, received)
        return found.reply.heard(received[: found.used], False) if found is not None else None


def printed(step: Step, drive: Drive) -> Iterator[Measured]:
    """Yield the position that a line has printed."""
    questions = {drive.family.question(word): axis for word, axis in WORDS.items()}
    axis = questions.get(" ".join(step.text.upper().split()))
    position = whole(step.printed[0].strip(), -(2**31), 2**31 - 1) if len(step.printed) == 1 else None
    if axis is not None and position is not None:
        yield Measured(step.where, step.at, axis, position, None)
