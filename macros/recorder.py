"""Recording a macro from lines and the times at which they were typed. Reads no clock."""

from __future__ import annotations

from dialects.errors import Diagnostic
from macros.model import Macro, Step, check_name, escape


class Recorder:
    """Records one macro at a time. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self.name = ""
        """The macro under recording; empty: none."""
        self.before: bytes | None = None
        """The bytes of its file when the recording began; None without a file."""
        self._recorded: list[tuple[str, float]] = []

    def start(self, name: str, now: float, before: bytes | None = None) -> None:
        """Begin. Raises Diagnostic for an invalid name, and while another macro is recorded.

        The time from `now` to the first line is not recorded: a macro starts with its first line.
        """
        check_name(name)
        if self.name:
            raise Diagnostic(f"the macro {self.name} is being recorded", hint="stop that recording first")
        self.name, self.before, self._recorded = name, before, []

    def record(self, line: str, now: float) -> None:
        """Record a line, its braces doubled so that playing returns it. Does nothing while not recording."""
        if self.name:
            self._recorded.append((escape(line), now))

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
        return Macro(name, _steps(self._recorded))

    def discard(self) -> None:
        """End the recording."""
        self.name, self.before, self._recorded = "", None, []


def _steps(recorded: list[tuple[str, float]]) -> tuple[Step, ...]:
    """Round the offsets from the first line, not the gaps, so that a long macro does not drift."""
    first = before = recorded[0][1]
    steps = []
    for line, at in recorded:
        gap = round(at - first, 3) - round(before - first, 3)
        steps.append(Step(max(0.0, round(gap, 3)), line))
        before = at
    return tuple(steps)
