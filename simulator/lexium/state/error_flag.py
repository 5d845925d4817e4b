"""The error register ER and the error flag EF (manual 5.1.36, 5.1.40)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping

from multidrop.simulator.lexium.state.errors import Failure
from multidrop.simulator.lexium.state.expressions import Value
from multidrop.simulator.lexium.state.timeline import Timeline


class ErrorFlag:
    """ER and EF of one drive.

    `codes` are the numbers that the product gives in place of a Lexium's. `failures` is None, or a list that records
    each error with its time and the `line` of the program.
    """

    def __init__(self, values: MutableMapping[str, Value], codes: Mapping[int, int], timeline: Timeline) -> None:
        self._values, self._codes, self._timeline = values, codes, timeline
        self.failures: list[Failure] | None = None
        self.line: Callable[[], int] = lambda: 0

    @property
    def code(self) -> int:
        """ER."""
        return int(self._values["ER"])

    def set(self, code: int) -> None:
        """Put a code into ER and set EF."""
        number = self._codes.get(code, int(code))
        self._values["ER"], self._values["EF"] = number, 1
        if self.failures is not None:
            self.failures.append(Failure(self._timeline.now, number, self.line()))

    def clear(self) -> None:
        """Clear ER and EF."""
        self._values["ER"], self._values["EF"] = 0, 0

    def handled(self) -> None:
        """Record that the subroutine of OE is called for the errors of this moment."""
        for each in self.failures or ():
            each.handled = each.handled or each.t == self._timeline.now
