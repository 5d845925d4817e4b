"""Errors of a simulated MCode drive: raised by a line, recorded for a program run, and kept in ER and EF.

Manual 5.1.36, 5.1.40.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass

from multidrop.simulator.lexium.state.timeline import Timeline


class Fault(Exception):
    """A drive's error, with its code (manual, section 10). `fatal` ends a program that has no error handler."""

    def __init__(self, code: int, fatal: bool = False) -> None:
        super().__init__(f"error {code}")
        self.code, self.fatal = code, fatal


@dataclass
class Failure:
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
        self.failures: list[Failure] | None = None
        self.line: Callable[[], int] = lambda: 0

    @property
    def code(self) -> int:
        return int(self._values["ER"])

    def set(self, code: int) -> None:
        number = self._codes.get(code, int(code))
        self._values["ER"], self._values["EF"] = number, 1
        if self.failures is not None:
            self.failures.append(Failure(self._timeline.now, number, self.line()))

    def clear(self) -> None:
        self._values["ER"], self._values["EF"] = 0, 0

    def handled(self) -> None:
        """Record that the subroutine of OE is called for the errors of this moment."""
        for each in self.failures or ():
            each.handled = each.handled or each.t == self._timeline.now
