"""What is on the wire and is not what it seems: late replies, debris of a stop, and what a session before left.

On a line whose language does not number replies, a drive that timed out may be slow, and its reply be taken for the
reply to a later request. So each reply is weighed against those that are outstanding, until the slow drive has printed
something that is certainly its own.

Debris is pieces of the reply and echo that a stop cut off, and replies to the stop itself. None of it is shown. A
session that was killed leaves replies to its questions, and echoes. A line that may be program output is shown.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Sequence
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


LASTS = 0.5
"""How long after the last byte of a stop its debris may come, s."""
GARBLED = re.compile(r"[^\t -~]")
"""Two drives that replied at once; a print has no such characters unless it wants them."""
SCRAP = re.compile(r'[-\w]{0,2}["!~]+[-\w ]{0,2}"?')
"""A piece of the name between two values, with what ran into it: a digit and the sign of a stop make a space."""

CHECK_BYTES = "".join(map(chr, range(0x80, 0x100)))
PROMPT = "0123456789>? \x06\x15"
"""The characters of a prompt; in program mode it shows an address."""


class Debris:
    """What was written last, and how long the debris of a stop may come. Times are seconds."""

    def __init__(self) -> None:
        self._sent = ""
        self._asked: Request | None = None
        self._until = float("-inf")

    def request_written(self, data: bytes, request: Request, now: float) -> None:
        text = data.decode("latin-1")
        self._sent = self._sent + text if now <= self._until else text
        self._asked = request

    def stop_written(self, data: bytes, transmitted: float) -> None:
        """Note a stop. `transmitted`: when its last byte has left."""
        self._sent += data.decode("latin-1")
        self._until = transmitted + LASTS

    def stop_repeated(self, transmitted: float) -> None:
        self._until = transmitted + LASTS

    def removed(self, lines: tuple[str, ...], known: re.Pattern[str] | None, now: float) -> tuple[str, ...]:
        """Unsolicited lines without debris. `known`: what only a stop leaves in this language."""
        if now > self._until:
            return lines
        return tuple(text for text in lines if not self._holds(text, known))

    def _holds(self, text: str, known: re.Pattern[str] | None) -> bool:
        text = text.lstrip(">?").strip()
        return (
            (known is not None and known.fullmatch(text) is not None)
            or text in self._sent
            or GARBLED.search(text) is not None
            or SCRAP.fullmatch(text) is not None
            or self._answers(text)
        )

    def _answers(self, text: str) -> bool:
        expect = self._asked.expect if self._asked is not None else None
        return expect is not None and re.fullmatch(expect, text) is not None


class Leftovers:
    """Echoes of what this session has sent, and replies to the questions of one before. Times are seconds.

    A drive replies in the order of the questions: once it has replied to this session, it owes the last one nothing.
    """

    def __init__(self) -> None:
        self._sent: deque[str] = deque(maxlen=32)
        """What was sent last, with its check byte and without."""
        self._sent_at = self._opened_at = float("-inf")
        self.recovering = False
        """A session before was cut off, and its drive has not replied to this one yet: all that comes is its echo."""

    def opened(self, now: float) -> None:
        """Note that the port is open: a reply to a session before may still come."""
        self._opened_at = now

    def drives_found(self) -> None:
        """Note that the drives have replied to this session: of one before, nothing comes any more."""
        self._opened_at = float("-inf")

    def request_written(self, data: bytes, now: float) -> None:
        text = data.decode("latin-1").strip("\r\n")
        self._sent += [each for each in (text, text.rstrip(CHECK_BYTES)) if len(each) > 1]
        self._sent_at = now

    def divided(
        self, lines: tuple[str, ...], answers_host: Callable[[str], bool], now: float
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Divide unsolicited lines into those of programs and those that a session before left; echoes are neither.

        `answers_host`: whether only a question of a host makes a drive send a line.
        """
        if now <= self._sent_at + LATE:
            ends = tuple(self._sent)
            lines = tuple(each for each in lines if not (each.endswith(ends) and self._is_echo(each)))
        if self.recovering:
            return (), lines
        if now > self._opened_at + LATE:
            return lines, ()
        left = tuple(filter(answers_host, lines))
        return tuple(each for each in lines if each not in left), left

    def _is_echo(self, line: str) -> bool:
        """Whether a line repeats a request, after a prompt at most."""
        return any(line.endswith(each) and not line.removesuffix(each).strip(PROMPT) for each in self._sent)
