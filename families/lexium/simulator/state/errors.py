"""The virtual time of a simulated MCode drive, its prints, and its errors.

An error is raised by a line, recorded for a program run, and kept in ER and EF (manual 5.1.36, 5.1.40).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass
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
"""Bits on the wire for a byte; bytes that wait to be sent when the next print waits, or is lost (not in the manual)."""


class DriveOutput:
    """The output of one drive.

    `immediate`: a typed line is being carried out, and takes what is printed as its answer. `printed`: times and texts
    since `take`. `watched`: time stops where something is printed. `waits`: a program waits for the transmitter;
    `delay` makes it wait until a time.
    """

    def __init__(self, timeline: Timeline, waits: bool, delay: Callable[[float], None]) -> None:
        self._timeline, self._waits, self._delay = timeline, waits, delay
        self.immediate = False
        self.watched = False
        self.baud = 9600
        self._answer: list[str] = []
        self.printed: list[tuple[float, str]] = []
        self._sending_until = 0.0

    def begin_answer(self) -> None:
        self._answer, self.immediate = [], True

    def end_answer(self) -> str:
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
        self.printed.append((self._timeline.now, text))
        if self._waits:
            byte = BITS_A_BYTE / self.baud
            self._sending_until = max(self._sending_until, self._timeline.now) + len(text) * byte
            self._delay(self._sending_until - TRANSMIT_BUFFER * byte)
        if self.watched:
            self._timeline.replan()

    def take(self) -> list[tuple[float, str]]:
        printed, self.printed = self.printed, []
        return printed


class DriveFault(Exception):
    """A drive's error, with its code (manual, section 10). `fatal` ends a program that has no error handler."""

    def __init__(self, code: int, fatal: bool = False) -> None:
        super().__init__(f"error {code}")
        self.code, self.fatal = code, fatal


@dataclass
class RecordedError:
    """A recorded error: its time, code and line of the linked program. `handled`: OE's subroutine was called."""

    t: float
    code: int
    line: int
    handled: bool = False


class ErrorFlag:
    """ER and EF of one drive.

    `codes` are the numbers that the product gives in place of a Lexium's. `failures` is None, or a list that records
    each error with its time and the `line` of the program.
    """

    def __init__(self, values: MutableMapping[str, int | float], codes: Mapping[int, int], timeline: Timeline) -> None:
        self._values, self._codes, self._timeline = values, codes, timeline
        self.failures: list[RecordedError] | None = None
        self.line: Callable[[], int] = lambda: 0

    @property
    def code(self) -> int:
        return int(self._values["ER"])

    def set(self, code: int) -> None:
        number = self._codes.get(code, int(code))
        self._values["ER"], self._values["EF"] = number, 1
        if self.failures is not None:
            self.failures.append(RecordedError(self._timeline.now, number, self.line()))

    def clear(self) -> None:
        self._values["ER"], self._values["EF"] = 0, 0

    def handled(self) -> None:
        """Record that the subroutine of OE is called for the errors of this moment."""
        for failure in self.failures or ():
            failure.handled = failure.handled or failure.t == self._timeline.now
