"""A request in flight: written, and neither answered nor given up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from multidrop.dialects import Kind, Reply, Request
from multidrop.drives.events import Transaction

TAIL = 0.05
"""Quiet time after which no more of an unterminated line is awaited, s."""
NEVER_QUIET = 1.0
"""Longest wait for a quiet wire, s: a program may print without a pause, and a stop must be repeated."""
CHATTER = 4.0
"""Longest wait for a reply, in timeouts, while a running program keeps the wire busy."""
LONGEST_LIST = 60.0
"""Longest time for a listing, s: 28 kB at 4800 baud."""


class Finished(NamedTuple):
    """The end of a request, and the ticket under which it was queued."""

    ticket: int
    transaction: Transaction

    @property
    def request(self) -> Request:
        """The request."""
        return self.transaction.request

    @property
    def reply(self) -> Reply:
        """Its reply, with how it ended."""
        return self.transaction.reply


@dataclass
class Flight:
    """The request that the line waits for. Times are seconds."""

    ticket: int
    request: Request
    sent_at: float
    transmitted_at: float
    received_at: float
    """When the last byte came; before the first, when the request was written."""
    sent: bool = True
    _judged_length: int = -1

    def may_end_by_quiet(self, buffer: bytes) -> bool:
        """Quiet can end the reply: it has not been consulted about these bytes before."""
        return self._judged_length != len(buffer)

    def judged_quiet(self, buffer: bytes) -> None:
        """Note that quiet was consulted about these bytes."""
        self._judged_length = len(buffer)

    def deadline(self, buffer: bytes, default: float, by_quiet: bool) -> float:
        """Time at which it times out, or at which quiet may end it. `default`: the line's timeout, s."""
        patience = self.request.codec.quiet_time(self.request, buffer)
        timeout = self._timeout_at(patience, buffer, default)
        if not by_quiet or self._judged_length == len(buffer):
            return timeout
        return min(timeout, self._quiet_at(patience))

    def quiet_at(self, buffer: bytes) -> float:
        """Time at which a reply without an end of its own is complete."""
        return self._quiet_at(self.request.codec.quiet_time(self.request, buffer))

    def timeout_at(self, buffer: bytes, default: float) -> float:
        """Time at which the request times out. `default`: the line's timeout, s."""
        return self._timeout_at(self.request.codec.quiet_time(self.request, buffer), buffer, default)

    def _quiet_at(self, patience: float) -> float:
        quiet = self._last_activity + patience
        if self.request.kind is not Kind.COMMAND:
            return quiet
        # A command prints nothing, so a program that prints without a pause does not delay it.
        return min(quiet, self.transmitted_at + max(2 * patience, NEVER_QUIET))

    def _timeout_at(self, patience: float, buffer: bytes, default: float) -> float:
        timeout = max(default if self.request.timeout is None else self.request.timeout, patience)
        longest = self.transmitted_at + (LONGEST_LIST if self.request.kind is Kind.LIST else CHATTER * timeout)
        if not buffer.endswith(b"\n"):  # not in the middle of a program's line
            longest = max(longest, min(self.received_at + TAIL, longest + NEVER_QUIET))
        return min(self._last_activity + timeout, longest)

    def finished(self, reply: Reply, now: float) -> Finished:
        """The end of this request with a reply."""
        ended = Transaction(self.request, reply, self.sent_at, now, self.transmitted_at, self.sent)
        return Finished(self.ticket, ended)

    @property
    def _last_activity(self) -> float:
        return max(self.received_at, self.transmitted_at)
