"""Local echo: a two-wire adapter repeats our own bytes, which are removed before they can be taken for a reply.

The repetition has the length of what was written and arrives as a whole. Bytes before it were under way earlier.
Without a repetition, or with a changed one, the wire was disturbed (or the adapter does not repeat). No byte that
came since then can be trusted as a reply.
"""

from __future__ import annotations


class LocalEcho:
    """Waits for the repetition of the last write."""

    def __init__(self) -> None:
        self._own = b""
        self.held = b""
        """Bytes received while the repetition is incomplete."""

    @property
    def awaited(self) -> bool:
        """The repetition is still outstanding."""
        return bool(self._own)

    def wrote(self, data: bytes) -> bytes:
        """Wait for these bytes from now on; return what was held for the write before."""
        held, self._own, self.held = self.held, data, b""
        return held

    def sift(self, data: bytes) -> tuple[bytes, bytes]:
        """Take received bytes; return what preceded the repetition and what followed, nothing while incomplete."""
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
        """Stop waiting; return what was held."""
        return self.wrote(b"")
