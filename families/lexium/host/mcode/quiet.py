"""The quiet time that ends a reply without an end of its own.

Theory of operation. A prompt, an ACK or an expected line ends most replies. Lists, settings and collections have no
such end, and in some modes silence is the reply. The time is long where a late reply could be taken for another
request's. It is short where the next request proves what came: a mark follows every list, and a print of the
settings follows `EM=`. A sign that more is unlikely then only decides how soon the next request is sent.

Each kind of request has its rows: what was received, and the seconds of quiet. The first row that applies decides.

Source: MCode reference 5.1.39 (EM), 7.1; what real units do.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

from multidrop.dialects.codec import Kind, Request
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode import framing
from multidrop.families.lexium.manual.groups import SLOW

SHORT, PATIENT, FLASH = 0.02, 0.15, 3.0
LIST_QUIET = 0.25
SHORTEST_REQUEST_TIME, WITHIN_REPLY = 0.4, 0.06
SLOWEST_BYTES_A_SECOND = 90.0
"""Characters a second on a line of 1200 baud after a gateway, where the host does not know the baud rate."""
PONG = 0.15
"""The time without a reply to a ping, which EM=2 does not give."""
EXECUTED = 0.003
"""After the last line of a reply a prompt may follow: three characters at 9600 baud."""
EXECUTING = 0.01
"""Twice the time that a drive takes for a command, where it may reply nothing (7.1: 1 to 5 ms)."""
AT_ONCE = 0.0
"""Nothing more can follow."""
EMPTY = b"\x80"
"""The check byte of an empty line."""
LAST_LINE = re.compile(rb"\d+ +(?:E|RT) *[\x80-\xff]?\r\n\Z", re.I)
"""A listed line that is often the last one of a program."""
_PROMPTS = (">", "?")
_ACK = "\x06"


def pongs(address: str, checksum: bool) -> tuple[bytes, ...]:
    """The whole replies to a ping in EM=1 and EM=0."""
    name, sign = address.encode("latin-1"), b"\x15" if checksum else b"\r\n"
    return sign, name + sign + b">", name + sign + b"?"


@lru_cache(maxsize=64)
def _is_echo_mode(text: str) -> bool:
    setting = classify.setting_of(text)
    return setting is not None and setting.name == "EM"


class Received:
    """What a drive with echo mode `em` and checksum mode `checksum` has sent since a request."""

    def __init__(self, request: Request, buffer: bytes, em: int, checksum: int) -> None:
        self.request, self.buffer, self.em, self.checksum = request, buffer, em, checksum

    def quiet_time(self) -> float:
        """Seconds of quiet that end the reply."""
        request = self.request
        if request.settle is not None:
            return request.settle
        changes_echo = request.kind is Kind.SETTING and _is_echo_mode(request.text)
        for row in ECHO_MODE if changes_echo else BY_KIND.get(request.kind, OTHERS):
            if row.applies(self):
                return row.seconds(self) if callable(row.seconds) else row.seconds
        raise AssertionError(f"no row for {request.kind}")  # the last row of each kind always applies

    # A list, or a command

    @property
    def is_listing(self) -> bool:
        return classify.word_of(self.request.text)[0] == "L"

    @property
    def is_slow(self) -> bool:
        """Whether the command writes to the flash memory, which takes seconds."""
        return classify.word_of(self.request.text)[0] in SLOW

    @property
    def ends_in_last_line(self) -> bool:
        return LAST_LINE.search(self.buffer[-16:]) is not None

    @property
    def ends_in_empty_line(self) -> bool:
        """Whether an empty line was printed last; with EM=1 the first line feed ends no line."""
        own = EMPTY * (self.checksum > 0) + b"\r\n"
        if not self.buffer.endswith(own):
            return False
        before = self.buffer[: -len(own)]
        return before[-1:] in (b"\n", framing.ACK) or (not before and (self.em == 2 or self.checksum > 0))

    @property
    def may_be_refused(self) -> bool:
        """Whether the error prompt came last; a program's print may begin like it."""
        return self.em == 0 and self.buffer[-1:] == b"?"

    @property
    def has_nak(self) -> bool:
        return self.checksum > 0 and framing.NAK in self.buffer

    @property
    def is_executed(self) -> bool:
        """Whether the sign of a command that was executed has come."""
        return framing.ACK in self.buffer if self.checksum else b"\n" in self.buffer

    # A collection

    @cached_property
    def expected(self) -> re.Match[bytes] | None:
        """The expected print, where it has come."""
        expect = self.request.expect
        return re.search(expect.encode("latin-1"), self.buffer) if expect else None

    @property
    def is_whole(self) -> bool:
        """Whether nothing more follows the expected print. Its group `em`, the drive's own EM, decides how it ends."""
        if self.expected is None:
            return False
        em = self.expected.groupdict().get("em")
        if em is None:
            return self.ends_by_itself
        if self.checksum and em != b"2" and not (framing.ACK in self.buffer or framing.NAK in self.buffer):
            return False
        end = self.buffer[self.expected.end() :]
        return re.search(rb"\n[>?]\Z" if em == b"0" else rb"\n\Z", end) is not None

    @property
    def ends_by_itself(self) -> bool:
        """Whether nothing more can follow a signed print.

        EM=0 repeats the request and ends in a prompt; EM=3 only repeats it, so this cannot distinguish the two.
        """
        request, buffer = self.request, self.buffer
        if not (request.signed and request.expect) or buffer[-1:] not in (b"\n", b">", b"?"):
            return False
        text = buffer.decode("latin-1")
        matches = list(re.finditer(rf"(?:{request.expect})(.?)\r?\n", text))
        if not matches:
            return False
        before, after = text[: matches[-1].start()], text[matches[-1].end() :]
        if self.checksum and not (
            _ACK in before and framing.unsealed(matches[-1][0].rstrip("\r\n").encode("latin-1")) is not None
        ):
            return False  # an ACK may follow the print
        return after in _PROMPTS if "PR " in before else not after

    @property
    def has_expected_line(self) -> bool:
        """Whether the line of the expected print has ended.

        A gateway gathers bytes: on a slow line its pieces are further apart than a line and its prompt.
        """
        return self.expected is not None and b"\n" in self.buffer[self.expected.end() :]

    @property
    def is_pong(self) -> bool:
        """Whether the whole reply to a ping has come."""
        request = self.request
        pinged = bool(request.address) and not (request.body or request.text)
        return pinged and any(self.buffer in pongs(request.address, checksum) for checksum in (False, True))

    @property
    def sending_time(self) -> float:
        """The seconds that the request takes on the slowest line, at least FIRST."""
        return max(SHORTEST_REQUEST_TIME, len(self.request.text) / SLOWEST_BYTES_A_SECOND)


class QuietRow(NamedTuple):
    """The seconds of quiet that end a reply, if what was received is as `applies` says."""

    applies: Callable[[Received], bool]
    seconds: float | Callable[[Received], float]


def _always(received: Received) -> bool:
    return True


COLLECTION = (
    QuietRow(lambda it: it.is_whole, AT_ONCE),
    QuietRow(lambda it: it.has_expected_line, SHORT),
    QuietRow(lambda it: it.expected is not None, WITHIN_REPLY),
    QuietRow(lambda it: it.is_pong, AT_ONCE),
    QuietRow(lambda it: bool(it.buffer), WITHIN_REPLY),
    QuietRow(lambda it: bool(it.request.text), lambda it: it.sending_time),
    QuietRow(_always, PONG),
)
LIST = (
    QuietRow(lambda it: it.em == 0, LIST_QUIET),  # its prompt ends it
    QuietRow(lambda it: it.is_listing and it.ends_in_last_line, SHORT),
    QuietRow(lambda it: not it.is_listing and it.ends_in_empty_line, EXECUTED),
    QuietRow(_always, LIST_QUIET),
)
_SIGNS = (
    QuietRow(lambda it: it.may_be_refused, SHORT),
    QuietRow(lambda it: it.has_nak, PATIENT),
)
SILENT_ROWS = (
    *_SIGNS,
    QuietRow(lambda it: it.is_slow, FLASH),
    QuietRow(lambda it: it.em == 2, SHORT),
    QuietRow(_always, PATIENT),
)
"""Commands and program lines, which print no line."""
ECHO_MODE = (  # the next question shows the mode and ignores what is left of this reply
    *_SIGNS,
    QuietRow(lambda it: it.em == 2 and not it.buffer, EXECUTING),
    QuietRow(lambda it: not it.is_executed, PATIENT),
    QuietRow(lambda it: it.buffer[-1:] == b">", AT_ONCE),
    QuietRow(_always, EXECUTED),
)
"""`EM=`."""
OTHERS = (
    *_SIGNS,
    QuietRow(lambda it: it.checksum == 2 and it.buffer[-1:] == b"\n", SHORT),
    QuietRow(_always, PATIENT),
)
BY_KIND: Mapping[Kind, Sequence[QuietRow]] = {
    Kind.QUIET: COLLECTION,
    Kind.LIST: LIST,
    Kind.COMMAND: SILENT_ROWS,
    Kind.PROGRAM: SILENT_ROWS,
}
