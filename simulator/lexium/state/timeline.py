"""The virtual time of one simulated drive, and its prints: in the answer of a typed line, or unsolicited."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter

Event = tuple[float, Callable[[float], None]]
"""When something happens, s, and what carries it out then."""


when = itemgetter(0)
"""The key that finds the first of several events."""


def nothing(t: float) -> None:
    """An event of which the next look at the inputs and the rotor makes what there is to make."""


class Timeline:
    """`now`, in seconds, which never goes back. `outdated`: the next event must be worked out again."""

    __slots__ = ("now", "outdated")

    def __init__(self) -> None:
        self.now = 0.0
        self.outdated = True

    def replan(self) -> None:
        """Request that the next event be worked out again: something on which it depends has changed."""
        self.outdated = True


CRLF = "\r\n"
BITS_A_BYTE, TRANSMIT_BUFFER = 10, 256
"""The transmitter of a drive: bits on the wire for a byte, bytes that wait to be sent (not in the manual)."""


class Printer:
    """The output of one drive.

    `immediate`: a typed line is being carried out, and takes what is printed as its answer. `watched`: time stops
    where something is printed. `waits`: a program waits for the transmitter; `delay` makes it wait until a time.
    """

    def __init__(self, timeline: Timeline, waits: bool, delay: Callable[[float], None]) -> None:
        self._timeline, self._waits, self._delay = timeline, waits, delay
        self.immediate = False
        self.watched = False
        self.baud = 9600
        self._answer: list[str] = []
        self._printed: list[tuple[float, str]] = []
        self._sending_until = 0.0

    @property
    def pending(self) -> bool:
        """Return whether something was printed since `take`."""
        return bool(self._printed)

    def begin_answer(self) -> None:
        self._answer, self.immediate = [], True

    def end_answer(self) -> str:
        """End it; return what it printed."""
        self.immediate = False
        return "".join(self._answer)

    def emit(self, text: str) -> None:
        """Print: into the answer of a typed line, else by itself."""
        if self.immediate:
            self._answer.append(text)
        else:
            self.announce(text)

    def announce(self, text: str) -> None:
        """Print by itself, whatever asked for it."""
        self._printed.append((self._timeline.now, text))
        if self._waits:
            byte = BITS_A_BYTE / self.baud
            self._sending_until = max(self._sending_until, self._timeline.now) + len(text) * byte
            self._delay(self._sending_until - TRANSMIT_BUFFER * byte)
        if self.watched:
            self._timeline.replan()

    def take(self) -> list[tuple[float, str]]:
        printed, self._printed = self._printed, []
        return printed
