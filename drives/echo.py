"""What a two-wire adapter repeats of our own bytes, taken off before anybody takes it for an answer.

The repetition is as long as what was written and comes as a whole; what is heard in front of it was under way before.
Where it does not come, or comes changed, the wire was disturbed while we spoke (or the adapter repeats nothing at
all), and nothing that came since then can be trusted to be an answer.
"""

from __future__ import annotations


class LocalEcho:
    """Waits for the repetition of what was written last."""

    def __init__(self) -> None:
        self._own = b""
        self.held = b""
        """What was heard while the repetition is not whole."""

    @property
    def awaited(self) -> bool:
        """Whether the repetition has not come yet."""
        return bool(self._own)

    def wrote(self, data: bytes) -> bytes:
        """Wait for these bytes from now on; what was held for the ones before."""
        held, self._own, self.held = self.held, data, b""
        return held

    def sift(self, data: bytes) -> tuple[bytes, bytes]:
        """Bytes came: what stood in front of the repetition, and what followed it. Nothing while it is not whole."""
        if not self._own:
            return b"", data
        self.held += data
        at = self.held.find(self._own)
        if at < 0:
            return b"", b""
        before, after = self.held[:at], self.held[at + len(self._own) :]
        self.forget()
        return before, after

    def forget(self) -> bytes:
        """Wait no longer; what was held."""
        return self.wrote(b"")
