"""The end of a reply that has no end of its own: a collected reply's form, or a quiet time."""

from __future__ import annotations

import re
from functools import lru_cache

from multidrop.dialects.codec import Kind, Request
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.framing import ACK, NAK, unsealed

_PROMPTS = (">", "?")
_ACK = "\x06"


def pongs(address: str, checksum: bool) -> tuple[bytes, ...]:
    """The whole replies to a ping in EM=1 and EM=0."""
    name, sign = address.encode("latin-1"), b"\x15" if checksum else b"\r\n"
    return sign, name + sign + b">", name + sign + b"?"


def ends_by_itself(request: Request, buffer: bytes, checksum: bool) -> bool:
    """Whether nothing more can follow a signed print. `checksum`: the request bears one.

    EM=0 repeats the request and ends in a prompt; EM=3 only repeats it, so this cannot distinguish the two.
    """
    if not (request.signed and request.expect) or buffer[-1:] not in (b"\n", b">", b"?"):
        return False
    text = buffer.decode("latin-1")
    found = list(re.finditer(rf"(?:{request.expect})(.?)\r?\n", text))
    if not found:
        return False
    before, after = text[: found[-1].start()], text[found[-1].end() :]
    if checksum and not (_ACK in before and unsealed(found[-1][0].rstrip("\r\n").encode("latin-1")) is not None):
        return False  # an ACK may follow the print
    return after in _PROMPTS if "PR " in before else not after


# The quiet time after which a reply without an end of its own is taken as it is.
#
# Theory of operation. A prompt, an ACK or an expected line ends most replies. Lists, settings and collections have no
# such end, and in some modes silence is the reply. The time is long where a late reply could be taken for another
# request's. It is short where the next request proves what came: a mark follows every list, and a print of the
# settings follows `EM=`. A sign that more is unlikely then only decides how soon the next request goes out. (MCode
# reference 5.1.39, 7.1; facts of real units.)


SHORT, PATIENT, FLASH = 0.02, 0.15, 3.0
LIST_QUIET = 0.25
FIRST, BETWEEN = 0.4, 0.06
SLOWEST = 90.0
"""Characters a second on a line of 1200 baud after a gateway, where the host does not know the baud rate."""
PONG = 0.15
"""The time without a reply to a ping, which EM=2 does not give."""
EXECUTED = 0.003
"""After the last line of a reply a prompt may follow: three characters at 9600 baud."""
EXECUTING = 0.01
"""Twice the time that a drive takes for a command, where it may reply nothing (7.1: 1 to 5 ms)."""
SILENT = (Kind.COMMAND, Kind.PROGRAM)
"""Kinds of requests that print no line."""
EMPTY = b"\x80"
"""The check byte of an empty line."""
LAST_LINE = re.compile(rb"\d+ +(?:E|RT) *[\x80-\xff]?\r\n\Z", re.I)
"""A listed line that is often the last one of a program."""


def quiet_time(request: Request, buffer: bytes, em: int, checksum: int) -> float:
    """Seconds of quiet that end the reply to a request, by the bytes received so far."""
    if request.settle is not None:
        return request.settle
    if request.kind is Kind.QUIET:
        # The time that ends a collection: none once it holds the expected print and the end that belongs to it.
        found = request.expect and re.search(request.expect.encode("latin-1"), buffer)
        if found:
            return 0.0 if _is_whole(request, found, buffer, checksum) else SHORT
        if buffer:
            pinged = request.address and not (request.body or request.text)
            return 0.0 if pinged and any(buffer in pongs(request.address, each) for each in (False, True)) else BETWEEN
        return max(FIRST, len(request.text) / SLOWEST) if request.text else PONG
    if request.kind is Kind.LIST:
        # The time after a list. With EM=0 its prompt ends it.
        if em == 0:
            return LIST_QUIET
        if classify.word_of(request.text)[0] == "L":
            return SHORT if LAST_LINE.search(buffer[-16:]) else LIST_QUIET
        return EXECUTED if _ends_in_empty_line(buffer, em, checksum) else LIST_QUIET
    if em == 0 and buffer[-1:] == b"?":
        return SHORT
    if checksum and NAK in buffer:
        return PATIENT
    if request.kind in SILENT:
        if classify.word_of(request.text)[0] in classify.SLOW:
            return FLASH
        return SHORT if em == 2 else PATIENT
    if request.kind is Kind.SETTING and _is_echo_mode(request.text):
        # The time after `EM=`. The next question shows the mode and ignores what is left of this reply.
        if em == 2 and not buffer:
            return EXECUTING
        executed = ACK in buffer if checksum else b"\n" in buffer
        if not executed:
            return PATIENT
        return 0.0 if buffer[-1:] == b">" else EXECUTED
    return SHORT if checksum == 2 and buffer[-1:] == b"\n" else PATIENT


@lru_cache(maxsize=64)
def _is_echo_mode(text: str) -> bool:
    setting = classify.setting_of(text)
    return setting is not None and setting.name == "EM"


def _ends_in_empty_line(buffer: bytes, em: int, checksum: int) -> bool:
    """Whether an empty line was printed last; with EM=1 the first line feed ends no line."""
    own = EMPTY * (checksum > 0) + b"\r\n"
    if not buffer.endswith(own):
        return False
    before = buffer[: -len(own)]
    return before[-1:] in (b"\n", ACK) or (not before and (em == 2 or checksum > 0))


def _is_whole(request: Request, found: re.Match[bytes], buffer: bytes, checksum: int) -> bool:
    """Whether nothing more follows an expected print. Its group `em`, the drive's own EM, decides how it ends."""
    em = found.groupdict().get("em")
    if em is None:
        return ends_by_itself(request, buffer, checksum > 0)
    if checksum and em != b"2" and not (ACK in buffer or NAK in buffer):
        return False
    return re.search(rb"\n[>?]\Z" if em == b"0" else rb"\n\Z", buffer[found.end() :]) is not None
