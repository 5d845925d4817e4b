"""Failures of a sweep: cases in groups of one cause, each with the simplest world and a command that repeats it.

The simplest world is one in which a case still fails as it did: fewer changes, then values nearer to the cell's own.
Each key has the cell's own value, the value of the failed case, or a value of the sweep between the two. So every world
that is tried is one that the sweep could have had.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from multidrop.base.text import counted
from multidrop.features.sweeps.plan import SweepPlan
from multidrop.features.sweeps.trial import DIED, Case, TrialResult
from multidrop.features.sweeps.variation import SEED, KeyValues, Value, simpler, spelled

RUNS = 60
"""The largest number of runs for one case."""
World = tuple[Value | None, ...]
"""A value for each key; None is the cell's own."""
Run = Callable[[Case], TrialResult | None]
"""Runs a case; None: no further run, and the search ends."""


def shrunk(case: Case, failed: int, values: Sequence[KeyValues], own: Sequence[Value | None], run: Run) -> World:
    """Find the simplest world. `own` are the cell's values."""
    search = _FailureSearch(case, failed, run)
    for index in range(len(values)):
        search.tries(index, None)
    for index, (key_values, origin) in enumerate(zip(values, own, strict=True)):
        value = search.world[index]
        if value is not None:
            search.nearest(index, simpler(key_values, value, origin))
    return search.world


class _FailureSearch:
    def __init__(self, case: Case, failed: int, run: Run) -> None:
        self._number, values = case
        self.world: World = tuple(values)
        self._failed, self._run = failed, run
        self._left = RUNS

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


MOST_GROUPS = 20
"""The largest number of groups whose simplest world is looked for."""
WIDTH = 50
"""The largest width of the column of what was seen."""


@dataclass
class FailureGroup:
    """Cases that fail alike in one simplest world."""

    failed: int
    why: str
    world: World
    numbers: list[int] = field(default_factory=list)

    def explains(self, case: Case, result: TrialResult) -> bool:
        """Whether a case has the simplest world among its values, and failed alike."""
        pairs = zip(self.world, case[1], strict=True)
        return result.failed == self.failed and all(small is None or small == value for small, value in pairs)


def grouped(plan: SweepPlan, failures: Iterable[TrialResult], run: Run) -> list[FailureGroup]:
    """Put failures into groups, MOST_GROUPS at most. `run` runs a case in search of a simpler world."""
    groups: list[FailureGroup] = []
    for result in failures:
        case = plan.case(result.number)
        group = next((each for each in groups if each.explains(case, result)), None)
        if group is None and len(groups) < MOST_GROUPS:
            group = _simplest(plan, case, result, run, groups)
        if group is not None:
            group.numbers.append(result.number)
    return groups


def _simplest(plan: SweepPlan, case: Case, result: TrialResult, run: Run, groups: list[FailureGroup]) -> FailureGroup:
    """Find the group of the simplest world of a failure; add it where it is a new one."""
    own = [key.own(plan.drive) for key in plan.job.keys]
    world: World = tuple(
        None if key.part == SEED else value for key, value in zip(plan.job.keys, case[1], strict=True)
    )  # no condition of a program test depends on the seed
    if result.failed != DIED:  # it would end this process, too
        world = shrunk((case[0], world), result.failed, plan.values, own, run)
    group = next((each for each in groups if (each.failed, each.world) == (result.failed, world)), None)
    if group is None:
        group = FailureGroup(result.failed, result.why, world)
        groups.append(group)
    return group


def command(plan: SweepPlan, world: World, failed: int) -> str:
    """The shortest command line that repeats a failure, quoted for a shell."""
    asked = plan.asked
    words = ["multidrop", "program", "sweep", asked.file]
    words += ["--cell", plan.place] if plan.place else []
    for name, value in plan.settings((0, world)).items():
        words += ["--vary", f"{name}={spelled(value)}"]
    words += ["--expect", plan.job.expects[failed]] if failed >= 0 and asked.expect else []
    words += ["--run", asked.run] if asked.run else []
    words += ["--until", f"{asked.until:.15g}"] if asked.until is not None else []
    words += ["--language", asked.language] if asked.language else []
    return subprocess.list2cmdline(words) if sys.platform == "win32" else shlex.join(words)


def rows(plan: SweepPlan, groups: Sequence[FailureGroup], failed: int) -> Iterator[str]:
    """The lines of the table of groups. `failed`: the number of all failed cases."""
    table = [("cases", "first", "seen", "simplest world that fails so")]
    for each in groups:
        world = plan.settings((0, each.world))
        shown = " ".join(f"{name}={spelled(value)}" for name, value in world.items())
        table.append((str(len(each.numbers)), str(each.numbers[0]), each.why, shown or "the cell's own"))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for number, (cases, first, seen, shown) in enumerate(table):
        yield f"{cases:>{widths[0]}}  {first:>{widths[1]}}  {seen:{min(widths[2], WIDTH)}}  {shown}"
        if number:
            group = groups[number - 1]
            yield f"{' ' * widths[0]}  {command(plan, group.world, group.failed)}"
    if more := failed - sum(len(each.numbers) for each in groups):
        yield f"and {counted(more, 'further failed case')}; --json lists all"
