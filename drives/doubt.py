"""Answers that are outstanding on a line whose language does not number them, and what may be taken for them.

A drive that did not answer in time may be slow, and its answer be taken for the next one's. So each answer is looked at
in that light, until the slow drive has printed something that is surely its own.
"""

from __future__ import annotations

import re
from dataclasses import replace

from dialects import End, Kind, Reply, Request

LATE = 10.0
"""Seconds for which an answer that did not come may still come, and be taken for another's."""
MOST_EVIDENCE = 8
"""Lines that are kept behind a doubtful answer: one is enough to tell against it."""


class Doubt:
    """Keeps account of what is owed. Times are seconds."""

    def __init__(self) -> None:
        self._late: list[tuple[float, Request]] = []
        self._behind: dict[str, list[str]] = {}

    def stray(self, lines: tuple[str, ...]) -> None:
        """Take note of lines that answer nothing: they tell against an answer that was doubtful."""
        for behind in self._behind.values():
            behind += lines[: MOST_EVIDENCE - len(behind)]

    def weigh(self, request: Request, reply: Reply, now: float) -> tuple[bool, bool]:
        """Whether this may be the answer to another request; whether it is a mark that ends a wait for others."""
        if request.codec.numbered:
            return False, False
        self._late = [late for late in self._late if late[0] > now]
        doubtful = any(_may_answer(late, request, reply) for _, late in self._late)
        told = request.expect is not None and reply.end is End.DONE and (request.gather or not doubtful)
        told = told and (reply.acknowledged or request.kind is not Kind.QUIET)
        others = [late for late in self._late if late[1].address != request.address]
        ends = told and request.gather and len(others) < len(self._late)
        if told:
            self._late = others
        elif _outstanding(request, reply, doubtful):
            owed = [earlier for _, earlier in self._late if earlier.address == request.address]
            self._late = others + [(now + LATE, each) for each in (*owed, request)]  # none comes before the first
        return doubtful, ends

    def with_evidence(self, request: Request, reply: Reply) -> Reply:
        """A mark with all the lines that came since the doubtful answer that it is printed for."""
        behind = self._behind.pop(request.address, None)
        if behind and request.gather and reply.end is End.DONE:
            return replace(reply, lines=(*behind, *reply.lines))
        if reply.doubtful and reply.lines:
            self._behind[request.address] = []
        return reply


def _may_answer(late: Request, request: Request, reply: Reply) -> bool:
    """Whether this reply may be the one to an earlier request. What prints nothing looks the same for all."""
    if not reply.lines:
        return True
    if request.signed:
        return False
    return late.expect is None or any(re.fullmatch(late.expect, line) for line in reply.lines)


def _outstanding(request: Request, reply: Reply, doubtful: bool) -> bool:
    """Whether an answer to it may still come: none came, or it was another's."""
    if reply.end in (End.TIMEOUT, End.DAMAGED, End.STOPPED):
        return True
    if request.kind is Kind.QUIET:
        return request.expect is not None
    return doubtful or reply.end is End.SILENT
