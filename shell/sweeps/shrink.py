"""The simplest world in which a case still fails as it did: fewer changes, then values nearer to the cell's own.

Each key has the cell's own value, the value of the failed case, or a value of the sweep between the two. So every world
that is tried is one that the sweep could have had.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from multidrop.shell.sweeps.trial import Case, Result
from multidrop.shell.sweeps.values import Value, Values, simpler

MOST = 60
"""The largest number of runs for one case."""
World = tuple[Value | None, ...]
"""A value for each key; None is the cell's own."""
Run = Callable[[Case], Result | None]
"""Runs a case; None: no further run, and the search ends."""


def shrunk(case: Case, failed: int, values: Sequence[Values], own: Sequence[Value | None], run: Run) -> World:
    """Find the simplest world. `own` are the cell's values."""
    search = _Search(case, failed, run)
    for index in range(len(values)):
        search.tries(index, None)
    for index, (each, origin) in enumerate(zip(values, own, strict=True)):
        value = search.world[index]
        if value is not None:
            search.nearest(index, simpler(each, value, origin))
    return search.world


class _Search:
    def __init__(self, case: Case, failed: int, run: Run) -> None:
        self._number, values = case
        self.world: World = tuple(values)
        self._failed, self._run = failed, run
        self._left = MOST

    def tries(self, index: int, value: Value | None) -> bool:
        """Take a value of one key if the case still fails with it."""
        if not self._left or value == self.world[index]:
            return False
        self._left -= 1
        world = (*self.world[:index], value, *self.world[index + 1 :])
        result = self._run((self._number, world))
        if result is None or result.failed != self._failed:
            self._left = self._left if result is not None else 0
            return False
        self.world = world
        return True

    def nearest(self, index: int, nearer: Sequence[Value]) -> None:
        """Take the nearest value with which it still fails: the first, or one where failures begin."""
        if not nearer or self.tries(index, nearer[0]):
            return
        passes, fails = 0, len(nearer)
        while fails - passes > 1:
            middle = (passes + fails) // 2
            if self.tries(index, nearer[middle]):
                fails = middle
            else:
                passes = middle
