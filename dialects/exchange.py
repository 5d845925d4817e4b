"""One request to a drive whose replies have no numbers, and proof that the reply belongs to no other request.

Theory of operation. A late reply can pass for the next one's. So after a missing or doubtful reply the host sends a
sync mark: a request that changes nothing, and whose reply no other request has. A drive replies in order, so everything
before the reply to the mark is late. The host never repeats a command.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TypeVar

from multidrop.base.errors import NoAnswer, Refused, Stopped
from multidrop.base.text import visible
from multidrop.dialects.codec import End, Kind, Procedure, Reply, Request
from multidrop.dialects.state import OfDrive, who

T = TypeVar("T")


class Exchange(OfDrive, ABC):
    """The exchange with a drive; its methods record in the state what they show."""

    @property
    def _who(self) -> str:
        return who(self.state)

    @abstractmethod
    def mark(self, request: Request, after: bool) -> Procedure[tuple[str, ...] | None]:
        """Send a sync mark before a request, or after it; None without the mark's reply.

        Return the lines before that reply; after a request only those that can be its reply.
        """

    def lost(self, request: Request) -> None:
        """Record that the reply to a request may arrive late."""
        self.state.reply_outstanding()

    @abstractmethod
    def refusal(self, request: Request, reply: Reply) -> Refused | NoAnswer:
        """Describe a refusal; NoAnswer: that of another line."""

    def send(self, request: Request) -> Procedure[Reply]:
        """Send a request once."""
        return (yield request)

    def answered(self, request: Request, doubts: list[Request] | None = None) -> Procedure[Reply]:
        """Send a request once; return the reply. Raises Refused or NoAnswer.

        `doubts`: a list for a request whose reply may belong to another; without it a sync mark follows at once.
        """
        yield from self.synchronised(request)
        reply = yield from self.send(request)
        if reply.end in (End.TIMEOUT, End.DAMAGED):
            self.lost(request)
            raise unanswered(self._who, request, reply)
        if reply.doubtful and doubts is not None:
            doubts.append(request)
        elif reply.doubtful:
            yield from self.beyond_doubt(request)
        self.state.settings_confirmed()
        if reply.end is End.REFUSED:
            if request.kind is Kind.COMMAND and not (reply.doubtful or self.state.programming):
                yield from self.beyond_doubt(request)  # the refusal of another program's line has no other sign
            raise self.refusal(request, reply)
        return reply

    def synchronised(self, request: Request) -> Procedure[None]:
        """Make sure that no reply is outstanding before a request. Raises NoAnswer."""
        if not self.state.reply_pending:
            return
        if (yield from unsent_if_stopped(self._who, request, self.mark(request, False))) is None:
            raise NoAnswer(f"{self._who} does not reply: '{request.text}' was not sent")

    def beyond_doubt(self, request: Request) -> Procedure[None]:
        """Prove that a reply was not the outstanding one of another request. Raises NoAnswer."""
        late = yield from self.mark(request, True)
        if late is None or late:
            raise NoAnswer(
                f"{self._who}: a late reply came, perhaps to '{request.text}': it is not known whether that was "
                "executed; it was sent once"
            )


def unsent_if_stopped(who: str, request: Request, steps: Procedure[T]) -> Procedure[T]:
    """Take the steps before a request. A stop that cuts them off keeps it from being sent."""
    try:
        return (yield from steps)
    except Stopped:
        raise Stopped(f"{who}: stopped; '{request.text}' was not sent") from None


LONGEST_SYNC = 6.0
"""The longest time, s, for which a drive is looked for in what comes without a pause."""
MOST_SHOWN_BYTES = 40
"""Most characters that are shown of that."""


@dataclass
class Looking:
    """How long a drive has been looked for among other bytes, s, and the last ones."""

    spent: float = 0.0
    heard: bytes = b""

    def begins(self) -> None:
        """Give the next line the whole time."""
        self.spent, self.heard = 0.0, b""


def limited(who: str, text: str, fate: str, steps: Procedure[T], looking: Looking) -> Procedure[T]:
    """Look for a drive, as long as silence lasts, but not in endless bytes. Raises NoAnswer, which says what came.

    `text`: the line that waits for it; `fate`: what has become of that line; `looking`: one for all steps of that line.
    """
    ended: float | None = None
    try:
        asked = next(steps)
        while True:
            try:
                if looking.spent > LONGEST_SYNC:
                    raise NoAnswer(f"{who} was looked for in {looking.spent:.0f} s of other bytes: '{text}' {fate}")
                reply = yield asked
                if reply.raw:  # with the wait for a quiet line before the request
                    looking.spent += reply.took if ended is None else reply.at - ended
                    looking.heard = reply.raw
                ended = reply.at
            except GeneratorExit:
                steps.close()
                raise
            except BaseException as error:
                asked = steps.throw(error)
            else:
                asked = steps.send(reply)
    except StopIteration as end:
        result: T = end.value
        return result
    except NoAnswer as error:
        if came := visible(looking.heard[:MOST_SHOWN_BYTES].decode("latin-1").strip()):
            raise NoAnswer(f"{error}; what came is no reply ('{came}'): check dialect, baud and the line") from None
        raise


def unanswered(who: str, request: Request, reply: Reply | None = None) -> NoAnswer:
    """Describe a reply that did not come, or came damaged."""
    if reply is not None and reply.end is End.DAMAGED:
        return NoAnswer(
            f"{who}: the reply to '{request.text}' is damaged ({reply.detail}); it may have been executed and "
            "was not sent again"
        )
    why = f" ({reply.detail})" if reply is not None and reply.detail else ""
    return NoAnswer(
        f"{who} does not reply{why}: it is not known whether '{request.text}' was executed; it was sent once"
    )
