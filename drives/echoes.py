"""Our own bytes, which a two-wire adapter repeats, and what came before the first reply. It has no clock.

The repetition has the length of what was written and arrives as a whole. Bytes before it were under way earlier.
"""

from __future__ import annotations

from multidrop.dialects import Codec

TERMINATORS = (b"\r", b"\n")
LONGEST_TAIL = 4096
"""Longest unsolicited line without an end, in characters; a longer one is published in pieces."""


class LocalEcho:
    """Waits for the repetition of the last write."""

    def __init__(self) -> None:
        self.own = b""
        """The bytes whose repetition is awaited; empty: none."""
        self.held = b""
        """Bytes received while the repetition is incomplete."""

    def note_written(self, data: bytes) -> bytes:
        """Wait for these bytes from now on; return what was held for the write before."""
        held, self.own, self.held = self.held, data, b""
        return held

    def sift(self, data: bytes) -> tuple[bytes, bytes]:
        """Take received bytes; return what preceded the repetition and what followed, nothing while incomplete."""
        if not self.own:
            return b"", data
        self.held += data
        at = self.held.find(self.own)
        if at < 0:
            return b"", b""
        before, after = self.held[:at], self.held[at + len(self.own) :]
        self.forget()
        return before, after

    def forget(self) -> bytes:
        return self.note_written(b"")


WATCHED = 24
"""Requests of an opening in which the repetition of our own bytes is looked for."""
ENOUGH = 4
"""Fewer bytes than these prove nothing where others came before them."""


class EchoWatch:
    """Looks for an adapter that repeats what it sends, in the first requests on a port.

    A drive may repeat a line, too: the codec of the request says which of the two it was.
    """

    def __init__(self) -> None:
        self._left = WATCHED
        self._codec: Codec | None = None
        self._sent = self._heard = b""

    def note_written(self, data: bytes, codec: Codec | None) -> None:
        """Look for these bytes from now on. `codec`: that of a request; None: they are not looked for."""
        self._left -= codec is not None
        self._codec = codec if self._left >= 0 else None
        self._sent, self._heard = data, b""

    def repeated(self, data: bytes, over: bool = False) -> bytes:
        """Take received bytes; return ours once it is certain that the adapter repeats them, else nothing.

        `over`: no more is expected.
        """
        if self._codec is None or not self._sent:
            return b""
        self._heard = (self._heard + data)[:LONGEST_TAIL]
        at = self._heard.find(self._sent)
        line_begins = self._heard[:at].endswith(TERMINATORS) and len(self._sent) >= ENOUGH
        if at < 0 or (at and not line_begins):  # a drive may repeat what it refuses, after a sign of its own
            return b""
        return self._sent if self._codec.repeated(self._sent, self._heard[at + len(self._sent) :], over) else b""


MOST_HEARD = 16384
"""Most bytes that are kept of what comes before the first reply."""


class FirstBytes:
    """What came, and what was written, until a drive has replied for the first time."""

    def __init__(self) -> None:
        self.answered = False
        """A drive has replied."""
        self.addresses: set[str] = set()
        """The addresses of the drives that have replied."""
        self.came = b""
        self._written: list[bytes] = []

    def received(self, data: bytes) -> None:
        if not self.answered:
            self.came = (self.came + data)[:MOST_HEARD]

    def note_written(self, data: bytes) -> None:
        if not self.answered and len(self._written) < MOST_HEARD:
            self._written.append(data)

    def replied(self, address: str) -> None:
        """Note a drive that has replied. Forget what came: from now on the line is known to work."""
        self.answered, self.came, self._written = True, b"", []
        self.addresses.add(address)

    def foreign(self) -> bytes:
        """What came, without the repetition of what was written."""
        came = self.came
        for data in self._written:
            came = came.replace(data, b"", 1)
        return came
