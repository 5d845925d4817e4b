"""The keys of single step: one byte each, outside of any line.

Theory of operation. In EX mode 2, and after a break point, a drive waits before each line of its program for a key:
space executes that line, Enter runs on at normal speed (MCode reference 5.1.42). A key has no name, no terminator and
no checksum. The only sign of a step is the line that the drive prints: its address, two blanks, its text. A blank that
comes back alone is an echo: the drive took the key as the first character of a command, so it does not step. The host
never sends a key twice: after a lost line it is not known whether the drive stepped.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from dialects.codec import Decoded, End, Kind, Reply, Request
from dialects.mcode.host.codec import MCode
from dialects.mcode.host.framing import printable
from dialects.mcode.host.state import MCodeState

SPACE, ENTER = b" ", b"\r"
STEP, RUN_ON = "single step", "run on"
SETTLE = 0.05
"""The quiet time after Enter, to which a drive gives no reply, s."""
LONGEST_SETTLE = 0.3
TRACED = re.compile(r"[>? ]*(\d{1,6})  (\S[ -~\t]*)[\x80-\xff]?")
"""A line as trace and single step print it; a prompt or an echo may precede it, a check byte may follow."""


@dataclass(frozen=True)
class StepKey(MCode):
    """The codec of one key for a drive with these settings."""

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """Find the line that a step printed; a program's prints before it are strays."""
        if request.body != SPACE:
            return None
        used = 0
        strays: list[str] = []
        for raw in buffer.split(b"\n")[:-1]:
            used += len(raw) + 1
            text = printable(raw)
            if TRACED.fullmatch(text):
                return Decoded(Reply((text.lstrip(">? "),), acknowledged=True), used, tuple(strays))
            strays.append(text)
        return None

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        """End the wait after Enter; a step waits for its line."""
        return self._settled(buffer) if request.body == ENTER else None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """Return REFUSED where the key only came back, TIMEOUT where its line is missing."""
        if request.body == ENTER:
            return self._settled(buffer)
        if buffer == SPACE:
            return Decoded(Reply(end=End.REFUSED), len(buffer))
        lines, used = self.parse_unsolicited(buffer)
        return Decoded(Reply(end=End.TIMEOUT), used, lines)

    def _settled(self, buffer: bytes) -> Decoded:
        lines, used = self.parse_unsolicited(buffer)
        return Decoded(Reply(), used, lines)


def key(state: MCodeState, data: bytes) -> Request:
    """Build the request that sends one key."""
    codec = state.codec
    own = StepKey(codec.em, codec.party, codec.checksum, codec.escape)
    step = data == SPACE
    request = Request(state.address, STEP if step else RUN_ON, Kind.COMMAND, own, body=data)
    return request if step else replace(request, settle=SETTLE, timeout=LONGEST_SETTLE)
