"""Requests that wait for the wire: by priority, then in order; a poll is passed over only once."""

from __future__ import annotations

from bisect import insort
from collections.abc import Container, Sequence
from typing import NamedTuple

from multidrop.dialects import Priority, Request


class Waiting(NamedTuple):
    """A queued request and its ticket, by which its end is reported. The least is next; no two tickets are equal."""

    priority: Priority
    ticket: int
    request: Request

    @property
    def is_poll(self) -> bool:
        """A poll yields to everything else, but only once."""
        return self.priority is Priority.POLL


class RequestQueue:
    """Issues tickets and chooses what is written next."""

    def __init__(self) -> None:
        self._waiting: list[Waiting] = []
        self._tickets = 0
        self._poll_passed_over = False

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def add(self, request: Request) -> int:
        """Queue a request; return its ticket."""
        self._tickets += 1
        insort(self._waiting, Waiting(request.priority, self._tickets, request))
        return self._tickets

    def withdraw(self, ticket: int) -> None:
        """Remove a request that has not been written."""
        if self._waiting:
            self._waiting = [each for each in self._waiting if each.ticket != ticket]

    def take(self) -> Waiting:
        """Remove and return the next request. A poll passed over once goes next, or typing would blind a plot."""
        poll_waits = self._waiting[-1].is_poll
        at = 0
        if poll_waits and self._poll_passed_over:
            at = next(at for at, each in enumerate(self._waiting) if each.is_poll)
        chosen = self._waiting.pop(at)
        self._poll_passed_over = poll_waits and not chosen.is_poll
        return chosen

    def drop(self, only: Container[str] | None) -> list[Waiting]:
        """Remove and return all requests, or those for `only` these addresses."""
        dropped = [each for each in self._waiting if only is None or each.request.address in only]
        self._waiting = [each for each in self._waiting if each not in dropped]
        return dropped

    @property
    def requests(self) -> Sequence[Request]:
        """The queued requests, next first."""
        return [each.request for each in self._waiting]
