"""Late replies on a line whose language does not number them, and what may be taken for one.

A drive that timed out may be slow, and its reply be taken for the reply to a later request. So each reply is weighed
against those that are outstanding, until the slow drive has printed something that is certainly its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from multidrop.dialects import End, Kind, Reply, Request

LATE = 10.0
"""How long a missing reply may still come and be taken for another, s."""
MOST_EVIDENCE = 8
"""Most lines kept after a doubtful reply: one is enough as evidence against it."""


class Weight(NamedTuple):
    """How far a reply can be trusted."""

    doubtful: bool = False
    """It may be the reply to an earlier request."""
    ends_wait: bool = False
    """It is a mark that ends the wait for outstanding replies."""


CERTAIN = Weight()
"""The weight of a reply where no earlier one is outstanding."""


@dataclass(frozen=True)
class _Late:
    """A request whose reply is outstanding, and until when that may come. `nak`: a NAK came, which may be noise."""

    until: float
    request: Request
    nak: bool = False
    taken: bool = False
    """Its reply may have been taken for another drive's."""
    came: bool = False
    """A line came that seems to be its reply."""


class Doubt:
    """Records outstanding replies. Times are seconds."""

    def __init__(self) -> None:
        self._late: list[_Late] = []
        self._evidence: dict[str, list[str]] = {}
        """By address: the lines that came after its last doubtful reply."""

    def stray(self, lines: Sequence[str]) -> None:
        """Note lines that answer no request: evidence against a doubtful reply."""
        for evidence in self._evidence.values():
            evidence += lines[: MOST_EVIDENCE - len(evidence)]

    def without_late(self, lines: tuple[str, ...]) -> tuple[str, ...]:
        """Remove late replies to questions, which were reported as missing, each once: a print may look like one."""
        shown = []
        for line in lines:
            for number, late in enumerate(self._late):
                if not late.came and late.request.codec.answers(late.request, line):
                    self._late[number] = replace(late, came=True)
                    break
            else:
                shown.append(line)
        return tuple(shown)

    def weigh(self, request: Request, reply: Reply, now: float) -> Weight:
        """Weigh a reply against those outstanding, and update these."""
        if request.codec.numbered:
            return CERTAIN
        if not self._late and not _outstanding(request, reply, doubtful=False):
            return CERTAIN
        self._late = [late for late in self._late if late.until > now]
        doubtful = any(_may_answer(late.request, request, reply) for late in self._late)
        own = [late for late in self._late if late.request.address == request.address]
        others = [late for late in self._late if late.request.address != request.address]
        if reply.surplus or (doubtful and not reply.lines):
            others = [replace(late, taken=late.nak) for late in others]
            self._late = own + others
        if _proves_itself(request, reply, doubtful):
            self._late = others
            return Weight(doubtful or any(late.taken for late in own), request.gather and bool(own))
        if _outstanding(request, reply, doubtful):
            late = _Late(now + LATE, request, nak=reply.end is End.NAK)
            own = [replace(late, request=each.request, came=each.came) for each in own]  # none comes before the first
            self._late = [*others, *own, late]
        return Weight(doubtful)

    def with_evidence(self, request: Request, reply: Reply) -> Reply:
        """A mark with all lines that came since the doubtful reply for which it was printed."""
        evidence = self._evidence.pop(request.address, None)
        if evidence and request.gather and reply.end is End.DONE:
            return replace(reply, lines=(*evidence, *reply.lines))
        if reply.doubtful and reply.lines:
            self._evidence[request.address] = []
        return reply


def _may_answer(late: Request, request: Request, reply: Reply) -> bool:
    """Whether the reply may belong to an earlier request. Replies that print nothing all look alike."""
    if not reply.lines:
        return True
    if request.signed:
        return False
    return late.expect is None or any(re.fullmatch(late.expect, line) for line in reply.lines)


def _proves_itself(request: Request, reply: Reply, doubtful: bool) -> bool:
    """Whether the reply is certainly that of this drive: it printed what only this request can print."""
    expected = request.expect is not None and reply.end is End.DONE
    distinct = request.gather or not doubtful
    executed = reply.acknowledged or request.kind is not Kind.QUIET
    return expected and distinct and executed


def _outstanding(request: Request, reply: Reply, doubtful: bool) -> bool:
    """Whether the reply to this request may still come: none came, or one that may be another's."""
    if reply.end in (End.TIMEOUT, End.DAMAGED, End.STOPPED, End.NAK):  # a NAK may be noise
        return True
    if request.kind is Kind.QUIET:
        return request.expect is not None
    return doubtful or reply.end is End.SILENT
