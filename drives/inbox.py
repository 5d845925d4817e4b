"""Received bytes on their way to a reply or to an unsolicited line, and what they must not be taken for.

An unsolicited line is published once it is whole, and an unterminated one once the wire has been quiet. Until then it
may still be arriving, so nothing is written. Times are seconds.

A two-wire adapter repeats our own bytes, which are removed before they can be taken for a reply. The repetition has the
length of what was written and arrives as a whole. Bytes before it were under way earlier. Without a repetition, or with
a changed one, the wire was disturbed (or the adapter does not repeat). No byte that came since then can be trusted as a
reply.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from multidrop.dialects import Codec, End, Kind, Reply, Request
from multidrop.drives.echoes import LONGEST_TAIL, TERMINATORS, EchoWatch, LocalEcho

# Late replies, debris of a stop, and what a session before left.
#
# On a line whose language does not number replies, a drive that timed out may be slow, and its reply be taken for the
# reply to a later request. So each reply is weighed against those that are outstanding, until the slow drive has
# printed something that is certainly its own.
#
# Debris is pieces of the reply and echo that a stop cut off, and replies to the stop itself. None of it is shown. A
# session that was killed leaves replies to its questions, and echoes. A line that may be program output is shown.


LATE_WITHIN = 10.0
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
    nak: bool
    begun: bool
    """Its reply had begun as the wait for it ended: the rest may come, and look like another value."""
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

    def weigh(self, request: Request, reply: Reply, now: float, heard: bytes) -> Weight:
        """Weigh a reply against those outstanding, and update these. `heard`: what came in its time."""
        if request.codec.numbered:
            return CERTAIN
        if not self._late and not _outstanding(request, reply, doubtful=False):
            return CERTAIN
        self._late = [late for late in self._late if late.until > now]
        doubtful = any(_may_answer(late, request, reply) for late in self._late)
        own = [late for late in self._late if late.request.address == request.address]
        others = [late for late in self._late if late.request.address != request.address]
        if reply.surplus or (doubtful and not reply.lines):
            others = [replace(late, taken=late.nak) for late in others]
            self._late = own + others
        # Whether the reply is certainly that of this drive: it printed what only this request can print.
        expected = request.expect is not None and (reply.end is End.DONE or reply.flagged)
        distinct = request.gather or not doubtful
        executed = reply.acknowledged or reply.flagged or request.kind is not Kind.QUIET
        if expected and distinct and executed:
            self._late = others
            return Weight(doubtful or any(late.taken for late in own), request.gather and bool(own))
        if _outstanding(request, reply, doubtful):
            cut = reply.end in (End.DAMAGED, End.STOPPED) and heard != b"" and not heard.endswith(TERMINATORS)
            late = _Late(now + LATE_WITHIN, request, nak=reply.end is End.NAK, begun=cut)
            # A drive replies in order: replies to its earlier requests may come for as long as the one to this request.
            own = [replace(each, until=late.until, nak=late.nak, taken=False) for each in own]
            self._late = [*others, *own, late]
        return Weight(doubtful)

    def with_evidence(self, request: Request, reply: Reply) -> Reply:
        """Return the reply. Before that to a mark, add all lines since the doubtful reply that the mark checks.

        They include lines before another drive's mark: one of these may be the true reply of this drive.
        """
        evidence = self._evidence.pop(request.address, None)
        if request.gather or reply.doubtful:  # a doubtful reply may be the true one to an earlier request
            self.stray(reply.lines)
        if evidence and request.gather and reply.end is End.DONE:
            return replace(reply, lines=(*evidence, *reply.lines))
        if reply.doubtful and reply.lines:
            self._evidence[request.address] = []
        return reply


def _may_answer(late: _Late, request: Request, reply: Reply) -> bool:
    """Whether the reply may belong to an earlier request. Replies that print nothing all look alike, and refusals."""
    if not reply.lines or reply.end is End.REFUSED:
        return True
    if request.signed:
        return False
    expect = late.request.expect
    return late.begun or expect is None or any(re.fullmatch(expect, line) for line in reply.lines)


def _outstanding(request: Request, reply: Reply, doubtful: bool) -> bool:
    """Whether the reply to this request may still come: none came, or one that may be another's."""
    if reply.end in (End.TIMEOUT, End.DAMAGED, End.STOPPED, End.NAK):  # a NAK may be noise
        return True
    if request.kind is Kind.QUIET:
        return request.expect is not None
    return doubtful or reply.end is End.SILENT


DEBRIS_LASTS = 0.5
"""Time after the last byte of a stop during which its debris may come, s."""
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

    def stop_written(self, data: bytes, transmitted_at: float) -> None:
        """Note a stop; `data` is empty for a repeated one. `transmitted_at`: when its last byte is sent, s."""
        self._sent += data.decode("latin-1")
        self._until = transmitted_at + DEBRIS_LASTS

    def may_come(self, now: float) -> bool:
        """Whether bytes may still be those that a stop leaves."""
        return now <= self._until

    def removed(self, lines: tuple[str, ...], known: re.Pattern[str] | None, now: float) -> tuple[str, ...]:
        """Unsolicited lines without debris. `known`: what only a stop leaves in this language."""
        if not self.may_come(now):
            return lines
        expect = self._asked.expect if self._asked is not None else None

        def is_debris(text: str) -> bool:
            return (
                (known is not None and known.fullmatch(text) is not None)
                or text in self._sent
                or GARBLED.search(text) is not None
                or SCRAP.fullmatch(text) is not None
                or (expect is not None and re.fullmatch(expect, text) is not None)
            )

        return tuple(text for text in lines if not is_debris(text.lstrip(">?").strip()))


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
        self._sent += [form for form in (text, text.rstrip(CHECK_BYTES)) if len(form) > 1]
        self._sent_at = now

    def divided(
        self, lines: tuple[str, ...], answers_host: Callable[[str], bool], now: float
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Divide unsolicited lines into those of programs and those that a session before left; echoes are neither.

        `answers_host`: whether only a question of a host makes a drive send a line.
        """
        if now <= self._sent_at + LATE_WITHIN:
            lines = tuple(part for part in self._without_parts(lines) if not self._is_echo(part))
        if self.recovering:
            return (), lines
        if now > self._opened_at + LATE_WITHIN:
            return lines, ()
        left = tuple(filter(answers_host, lines))
        return tuple(line for line in lines if line not in left), left

    def _without_parts(self, lines: tuple[str, ...]) -> tuple[str, ...]:
        """Leave out lines that are one request together: a search ends each of its first letters with a line feed."""
        sent = {_without_blanks(text) for text in self._sent}
        kept, begin = list[str](), 0
        while begin < len(lines):
            whole = (
                end
                for end in range(min(begin + MOST_PARTS, len(lines)), begin + 1, -1)
                if _without_blanks("".join(lines[begin:end])) in sent
            )
            if (end := next(whole, None)) is None:
                kept.append(lines[begin])
            begin = begin + 1 if end is None else end
        return tuple(kept)

    def _is_echo(self, line: str) -> bool:
        """Whether a line repeats requests, one or several, after a prompt at most."""
        rest = line
        while own := max((text for text in self._sent if rest.endswith(text)), key=len, default=""):
            rest = rest.removesuffix(own).rstrip("\r\n")
        return rest != line and not rest.strip(PROMPT)


MOST_PARTS = 3
"""Lines that one request is sent as, at most: a search ends its first two letters with a line feed each."""


def _without_blanks(text: str) -> str:
    return "".join(text.split())


CERTAINLY_OVER = 0.018
"""The silence, s, after which no line feed of a drive follows the CR that it repeats; adapters hold bytes for 16 ms."""
TAIL = 0.05
"""Quiet time after which no more of an unterminated line is awaited, s."""
LONGEST_WAIT_FOR_QUIET = 1.0
"""Longest wait for a quiet wire, s: a program may print without a pause, and a stop must be repeated even then."""


class Inbox:
    """The buffer of a line. It removes the local echo and sorts out unsolicited lines."""

    def __init__(
        self,
        codec: Codec,
        local_echo: bool,
        publish: Callable[[float, Iterable[str]], None],
        on_echo: Callable[[], None] = lambda: None,
    ) -> None:
        """`on_echo`: called once it is found that the adapter repeats what it sends."""
        self.codec = codec
        """The codec that parses unsolicited lines."""
        self.buffer = b""
        self.received_at = float("-inf")
        """When the last bytes came."""
        self.echo = LocalEcho() if local_echo else None
        self.watch, self._found = EchoWatch(), False
        self._begun_at = float("-inf")
        self._tail = b""
        """The beginning of a line that was published before its end came: its check byte covers both parts."""
        self._cut_off: tuple[Request, int] | None = None
        """A PR that a stop interrupted, and how many bytes of its reply came before; the rest is not program output."""
        self._publish, self.on_echo = publish, on_echo

    # Bytes

    def receive(self, data: bytes, now: float) -> None:
        self.received_at = now
        if not self.buffer:
            self._begun_at = now
        if self.echo:
            before, data = self.echo.sift(data)
            self._publish_rest(before, now)
        self.buffer += data
        self.notice_echo(data, now)

    def consume(self, used: int, now: float) -> None:
        self.buffer, self._begun_at = self.buffer[used:], now

    def resume(self) -> None:
        """Note the end of a pause: only numbered messages can still be distinguished after it."""
        if not self.codec.numbered:
            self.buffer = b""
        self._cut_off = None

    def cut_off(self, now: float) -> None:
        """Note that the wire broke: publish what came without a request, and expect the rest of nothing."""
        rest, self.buffer = self.buffer, b""
        if self.echo:
            rest = self.echo.forget() + rest
        self._cut_off = None
        self._publish_rest(rest, now)

    def forget(self) -> None:
        self.buffer = b""

    # Local echo

    def note_written(self, data: bytes, now: float, codec: Codec | None = None) -> None:
        """Expect the repetition of these bytes, if the adapter repeats them. `codec`: that of their request."""
        if self.echo:
            self._publish_rest(self.echo.note_written(data), now)
        else:
            self.watch.note_written(data, codec)

    def notice_echo(self, data: bytes, now: float, over: bool = False) -> None:
        """Remove our own bytes from now on, once it is certain that the adapter repeats them. `over`: as in it."""
        quiet = over and now >= self.received_at + CERTAINLY_OVER
        own = b"" if self.echo else self.watch.repeated(data, quiet)
        if not own:
            return
        self.echo, self._found = LocalEcho(), True
        before, _, self.buffer = self.buffer.partition(own)
        self._publish_rest(before, now)
        self.on_echo()

    def doubt_echo(self) -> None:
        """Look again for the repetition, where one that was found by itself did not come: another adapter, perhaps."""
        if self._found:
            self.echo, self._found, self.watch = None, False, EchoWatch()

    # Stops

    def stop(self, request: Request | None) -> None:
        """Forget what came before a stop, but not half a message, nor the reply that the stop interrupts.

        `request` is the one in flight.
        """
        readable = not self.echo and not self.codec.framed
        if readable and request is not None and request.kind is Kind.PRINT and request.expect:
            # The rest of the reply can be distinguished from program output.
            self._cut_off = request, len(self.buffer)
        elif self._cut_off is None and not self.codec.framed:
            self.buffer = b""

    def _awaits_cut_off(self, now: float) -> bool:
        """Whether the rest of an interrupted reply is still awaited; remove it once it is whole or overdue."""
        if self._cut_off is None or not self.buffer:
            return False
        request, received = self._cut_off
        decoded = request.codec.decode(request, self.buffer)
        if decoded is None and self.awaits_tail(now) and len(self.buffer) <= LONGEST_TAIL:
            return True
        self._cut_off = None
        if decoded is not None:
            self._publish(now, decoded.strays)
        self.buffer = self.buffer[decoded.used if decoded is not None else received :]
        return False

    # Unsolicited lines

    def sort(self, now: float) -> None:
        """Publish what came without a request."""
        if not (self.buffer or self.echo):
            return
        if self._awaits_cut_off(now):
            return
        if self.buffer:
            self._publish_lines(now)
        if self.echo and self.echo.held and not self.codec.numbered and now >= self.received_at + TAIL:
            self._publish_rest(self.echo.forget(), now)

    def _publish_lines(self, now: float) -> None:
        """Publish whole lines, and the unterminated rest once it is overdue or too long."""
        lines, used = self.codec.parse_unsolicited(self.buffer)
        if self._tail and lines and self.codec.damaged(lines[0]):
            whole, _ = self.codec.parse_unsolicited(self._tail + self.buffer)
            lines = (whole[0].removeprefix(self._tail.decode("latin-1")), *lines[1:])
        self._publish(now, lines)
        if used:
            self._tail = b""
            self.consume(used, now)
        if self.codec.numbered or not self.buffer:
            return
        if not self.awaits_tail(now) or len(self.buffer) > LONGEST_TAIL:
            self._publish_rest(self.buffer, now)
            self._tail = (self._tail + self.buffer)[-LONGEST_TAIL:]
            self.buffer = b""

    def _publish_rest(self, data: bytes, now: float) -> None:
        """Publish unsolicited bytes, the unterminated rest included."""
        lines, used = self.codec.parse_unsolicited(data)
        rest = data[used:].hex(" ") if self.codec.framed else data[used:].decode("latin-1").strip("\r\n>?")
        self._publish(now, (*lines, rest))

    def awaits_tail(self, now: float) -> bool:
        """Whether an unsolicited line may still be arriving."""
        tail = self.tail_at()
        return tail is not None and now < tail

    def tail_at(self) -> float | None:
        """Time at which an unterminated line is published; None if there is none.

        A program that prints without ever ending a line does not keep the wire to itself.
        """
        held = self.echo is not None and self.echo.held
        if self.codec.numbered or not (self.buffer or held):
            return None
        quiet = self.received_at + TAIL
        return quiet if held else min(quiet, self._begun_at + LONGEST_WAIT_FOR_QUIET)
