"""Received bytes on their way to a reply or to an unsolicited line.

An unsolicited line is published once it is whole, and an unterminated one once the wire has been quiet. Until then it
may still be arriving, so nothing is written. Times are seconds.

A two-wire adapter repeats our own bytes, which are removed before they can be taken for a reply. The repetition has the
length of what was written and arrives as a whole. Bytes before it were under way earlier. Without a repetition, or with
a changed one, the wire was disturbed (or the adapter does not repeat). No byte that came since then can be trusted as a
reply.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from multidrop.dialects import Codec, Kind, Request


class LocalEcho:
    """Waits for the repetition of the last write."""

    def __init__(self) -> None:
        self._own = b""
        self.held = b""
        """Bytes received while the repetition is incomplete."""

    @property
    def awaited(self) -> bool:
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
        return self.wrote(b"")


TAIL = 0.05
"""Quiet time after which no more of an unterminated line is awaited, s."""
NEVER_QUIET = 1.0
"""Longest wait for a quiet wire, s: a program may print without a pause, and a stop must be repeated."""
LONGEST_TAIL = 4096
"""Longest unsolicited line without an end, in characters; a longer one is published in pieces."""


class Inbox:
    """The buffer of a line. It removes the local echo and sorts out unsolicited lines."""

    def __init__(self, codec: Codec, local_echo: bool, publish: Callable[[float, Iterable[str]], None]) -> None:
        self.codec = codec
        """The codec that parses unsolicited lines."""
        self.buffer = b""
        self.received_at = float("-inf")
        """When the last bytes came."""
        self.echo = LocalEcho() if local_echo else None
        self._begun_at = float("-inf")
        self._tail = b""
        """The beginning of a line that was published before its end came: its check byte covers both parts."""
        self._cut_off: tuple[Request, int] | None = None
        """A PR that a stop interrupted, and how many bytes of its reply came before; the rest is not program output."""
        self._publish = publish

    # Bytes

    def receive(self, data: bytes, now: float) -> None:
        """Take received bytes."""
        self.received_at = now
        if not self.buffer:
            self._begun_at = now
        if self.echo:
            before, data = self.echo.sift(data)
            self._publish_rest(before, now)
        self.buffer += data

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

    @property
    def awaits_echo(self) -> bool:
        return self.echo is not None and self.echo.awaited

    def wrote(self, data: bytes, now: float) -> None:
        """Expect the repetition of these bytes, if the adapter repeats them."""
        if self.echo:
            self._publish_rest(self.echo.wrote(data), now)

    # Stops

    def stop(self, request: Request | None) -> None:
        """Forget what came before a stop, but not half a message, nor the reply that the stop interrupts.

        `request` is the one in flight.
        """
        if request is not None and self._can_interrupt(request):
            self._cut_off = request, len(self.buffer)
        elif self._cut_off is None and not self.codec.framed:
            self.buffer = b""

    def _can_interrupt(self, request: Request) -> bool:
        """Whether the rest of the reply can be distinguished from program output."""
        readable = not self.echo and not self.codec.framed
        return readable and request.kind is Kind.PRINT and bool(request.expect)

    def _awaits_cut_off(self, now: float) -> bool:
        """Whether the rest of an interrupted reply is still awaited; remove it once it is whole or overdue."""
        if self._cut_off is None or not self.buffer:
            return False
        request, received = self._cut_off
        found = request.codec.decode(request, self.buffer)
        if found is None and self.awaits_tail(now):
            return True
        self._cut_off = None
        if found is not None:
            self._publish(now, found.strays)
        self.buffer = self.buffer[found.used if found is not None else received :]
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
        return quiet if held else min(quiet, self._begun_at + NEVER_QUIET)
