"""Keeps the lines that are typed while a macro is recorded. Reads no clock: it is given lines and times."""

from __future__ import annotations

from dialects.errors import Diagnostic
from macros.model import Macro, Step, check_name, escape


class Recorder:
    """Records one macro at a time. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self.name = ""
        """The macro that is being recorded; empty: none."""
        self.before: bytes | None = None
        """What was in its file when the recording began; None: there was none."""
        self._kept: list[tuple[str, float]] = []

    def start(self, name: str, now: float, before: bytes | None = None) -> None:
        """Begin. Raises Diagnostic for a name that cannot be, and while another macro is recorded.

        What passes between `now` and the first line is not kept: a macro starts with its first line.
        """
        check_name(name)
        if self.name:
            raise Diagnostic(f"the macro {self.name} is being recorded", hint="stop that first")
        self.name, self.before, self._kept = name, before, []

    def keep(self, line: str, now: float) -> None:
        """Keep a line, its braces doubled so that playing gives it back. Does nothing while not recording."""
        if self.name:
            self._kept.append((escape(line), now))

    def macro(self) -> Macro:
        """What is recorded so far, times rounded to ms; `discard` ends it once that is kept.

        Raises Diagnostic where nothing was typed, which ends it too.
        """
        name = self.name
        if not name:
            raise Diagnostic("no macro is being recorded", hint="start one first")
        if not self._kept:
            self.discard()
            raise Diagnostic(f"nothing was typed for the macro {name}", hint="it is not kept; record it again")
        return Macro(name, _steps(self._kept))

    def discard(self) -> None:
        """End."""
        self.name, self.before, self._kept = "", None, []


def _steps(kept: list[tuple[str, float]]) -> tuple[Step, ...]:
    """Offsets from the first line are rounded, not the gaps, so that a long macro does not drift."""
    first = before = kept[0][1]
    steps = []
    for line, at in kept:
        gap = round(at - first, 3) - round(before - first, 3)
        steps.append(Step(max(0.0, round(gap, 3)), line))
        before = at
    return tuple(steps)
