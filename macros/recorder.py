"""Recording a macro from lines and the times at which they were typed. Reads no clock."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.text import visible
from multidrop.macros.braces import escape
from multidrop.macros.model import Macro, Step, check_name
from multidrop.macros.pauses import Observed, Offer, offers

REPLIES = 20
"""The number of replies that a step keeps."""
LONGEST = 200
"""The characters of a reply that a step keeps."""


@dataclass(eq=False)
class Recorded:
    """One line under recording."""

    line: str
    at: float
    drive: str = ""
    starts: bool = False
    heard: list[str] = field(default_factory=list)

    def came_back(self, texts: Iterable[str]) -> None:
        """Add what the line was answered with."""
        self.heard += texts

    @property
    def replies(self) -> tuple[str, ...]:
        """The replies, cut to a length that people read."""
        more = len(self.heard) - REPLIES
        return (*map(_cut, self.heard[:REPLIES]), *([f"... {more} more"] if more > 0 else []))


class Recorder:
    """Records one macro at a time. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self.name = ""
        """The macro under recording; empty: none."""
        self.before: bytes | None = None
        """The bytes of its file when the recording began; None without a file."""
        self._begun = ""
        self._recorded: list[Recorded] = []
        self.observed = Observed()
        """What drives did since the recording began."""

    def start(self, name: str, now: float, before: bytes | None = None, time: str = "") -> None:
        """Begin. `time`: the time of day, for the file.

        Raises Diagnostic for an invalid name, and while another macro is recorded. The time from `now` to the first
        line is not recorded: a macro starts with its first line.
        """
        check_name(name)
        if self.name:
            raise Diagnostic(f"the macro {self.name} is being recorded", hint="stop that recording first")
        self.name, self.before, self._begun, self._recorded, self.observed = name, before, time, [], Observed()

    def record(self, line: str, now: float, drive: str = "", starts: bool = False) -> Recorded:
        """Record a line, its braces doubled so that playing returns it; what comes back is added to the result.

        `starts`: it can start motion or a program. Without a recording nothing is kept.
        """
        recorded = Recorded(escape(line), now, drive, starts)
        if self.name:
            self._recorded.append(recorded)
        return recorded

    def macro(self) -> Macro:
        """The macro recorded so far, times rounded to ms. Call `discard` once it is stored.

        Raises Diagnostic if nothing was typed, and ends the recording.
        """
        name = self.name
        if not name:
            raise Diagnostic("no macro is being recorded", hint="start one first")
        if not self._recorded:
            self.discard()
            raise Diagnostic(f"nothing was typed for the macro {name}", hint="it is not stored; record it again")
        return Macro(name, _steps(self._recorded), recorded=self._begun)

    @property
    def offers(self) -> list[Offer]:
        """The waits that may stand in place of its pauses."""
        return offers(self._recorded, self.observed)

    def discard(self) -> None:
        """End the recording."""
        self.name, self.before, self._recorded = "", None, []


def _steps(recorded: list[Recorded]) -> tuple[Step, ...]:
    """Round the offsets from the first line, not the gaps, so that a long macro does not drift."""
    first = before = recorded[0].at
    steps = []
    for each in recorded:
        gap = round(each.at - first, 3) - round(before - first, 3)
        steps.append(Step(max(0.0, round(gap, 3)), each.line, each.drive, each.replies))
        before = each.at
    return tuple(steps)


def _cut(text: str) -> str:
    shown = visible(text)
    return shown if len(shown) <= LONGEST else f"{shown[:LONGEST]}... ({len(shown)} characters)"
