"""Failures of a sweep: cases in groups of one cause, each with the simplest world and a command that repeats it."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from multidrop.shell.sweeps.plan import Plan
from multidrop.shell.sweeps.shrink import Run, World, shrunk
from multidrop.shell.sweeps.trial import DIED, Case, Result
from multidrop.shell.sweeps.values import spelled
from multidrop.shell.sweeps.variation import SEED

MOST = 20
"""The largest number of groups whose simplest world is looked for."""
WIDTH = 50
"""The largest width of the column of what was seen."""


@dataclass
class Group:
    """Cases that fail alike in one simplest world."""

    failed: int
    why: str
    world: World
    numbers: list[int] = field(default_factory=list)

    def explains(self, case: Case, result: Result) -> bool:
        """Whether a case has the simplest world among its values, and failed alike."""
        pairs = zip(self.world, case[1], strict=True)
        return result.failed == self.failed and all(small is None or small == value for small, value in pairs)


@dataclass(frozen=True)
class Failures:
    """The groups, and how many further failures belong to none of them."""

    groups: list[Group]
    more: int


def grouped(plan: Plan, failures: Iterable[Result], run: Run) -> Failures:
    """Put failures into groups. `run` runs a case in search of a simpler world."""
    groups: list[Group] = []
    more = 0
    for result in failures:
        case = plan.case(result.number)
        group = next((each for each in groups if each.explains(case, result)), None)
        if group is None and len(groups) < MOST:
            group = _simplest(plan, case, result, run, groups)
        if group is None:
            more += 1
        else:
            group.numbers.append(result.number)
    return Failures(groups, more)


def _simplest(plan: Plan, case: Case, result: Result, run: Run, groups: list[Group]) -> Group:
    """Find the group of the simplest world of a failure; add it where it is a new one."""
    own = [key.own(plan.drive) for key in plan.job.keys]
    world: World = tuple(
        None if key.part == SEED else value for key, value in zip(plan.job.keys, case[1], strict=True)
    )  # no condition of a program test depends on the seed
    if result.failed != DIED:  # it would end this process, too
        world = shrunk((case[0], world), result.failed, plan.values, own, run)
    found = next((each for each in groups if (each.failed, each.world) == (result.failed, world)), None)
    if found is None:
        found = Group(result.failed, result.why, world)
        groups.append(found)
    return found


def command(plan: Plan, world: World, failed: int) -> str:
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


def rows(plan: Plan, failures: Failures) -> Iterator[str]:
    """The lines of the table."""
    table = [("cases", "first", "seen", "simplest world that fails so")]
    for each in failures.groups:
        world = plan.settings((0, each.world))
        shown = " ".join(f"{name}={spelled(value)}" for name, value in world.items())
        table.append((str(len(each.numbers)), str(each.numbers[0]), each.why, shown or "the cell's own"))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for number, (cases, first, seen, shown) in enumerate(table):
        yield f"{cases:>{widths[0]}}  {first:>{widths[1]}}  {seen:{min(widths[2], WIDTH)}}  {shown}"
        if number:
            group = failures.groups[number - 1]
            yield f"{' ' * widths[0]}  {command(plan, group.world, group.failed)}"
    if failures.more:
        yield f"and {failures.more} further failed cases; --json lists all"
