"""The work of a sweep: runs of one program in many worlds. Everything here runs in any process, on any machine.

A `Job` is what all cases have in common; each process reads it once. A case is a number and the values of its keys.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.on_demand import imported
from multidrop.shell.sweeps import conditions
from multidrop.shell.sweeps.conditions import Condition, outcome_of
from multidrop.shell.sweeps.variation import Drive, Key, Value
from multidrop.simulator.cells import read_drive
from multidrop.simulator.families import PROGRAMS
from multidrop.simulator.program_run import Load, ProgramRun

UNTIL = 60.0
"""Virtual seconds after which a case has failed, unless the sweep sets a time."""
LONGEST = 0.5
"""Seconds after which a chunk gives back what it has, so that it can be reported."""
HELD = -1
"""The number of the failed condition of a case in which all hold."""
CUT, REFUSED, DIED = -2, -3, -4
"""In its place: the program still ran; the drive refused the settings together; the process of the case died."""


@dataclass(frozen=True)
class Job:
    """The common part of all cases. `drive` is the table of the drive, as JSON; `where` names it in messages."""

    file: str
    program: str
    language: str
    drive: str
    where: str
    keys: tuple[Key, ...]
    expects: tuple[str, ...]
    run: str = ""
    until: float | None = None


Case = tuple[int, Sequence[Value | None]]
"""A number, and a value for each key of the job; None is the cell's own value."""


class Result(NamedTuple):
    """The result of a case. `failed` is the index of the first condition that does not hold, or one of the others."""

    number: int
    failed: int = HELD
    why: str = ""

    @property
    def ok(self) -> bool:
        return self.failed == HELD


@dataclass(frozen=True)
class Bench:
    """A job that was read: all that a case needs."""

    job: Job
    load: Load
    drive: Drive
    conditions: tuple[Condition, ...]

    def loaded(self, values: Sequence[Value | None]) -> ProgramRun:
        """Load the program into a drive with these values. Raises Diagnostic."""
        table = self.drive
        for key, value in zip(self.job.keys, values, strict=True):
            if value is not None:
                table = key.put(table, value)
        return self.load(read_drive(table, self.job.where))

    def tried(self, case: Case) -> Result:
        number, values = case
        job = self.job
        try:
            outcome = outcome_of(self.loaded(values).run(job.run, UNTIL if job.until is None else job.until))
            if job.until is None and outcome.ended == "until":
                return Result(number, CUT, f"still running after {UNTIL:g} s; --until SECONDS sets another limit")
            for index, each in enumerate(self.conditions):
                if not each.holds(outcome):
                    return Result(number, index, each.seen(outcome))
        except Diagnostic as problem:
            return Result(number, REFUSED, str(problem))
        return Result(number)


@lru_cache(maxsize=4)
def bench(job: Job) -> Bench:
    load = PROGRAMS[job.language].read(job.program, job.file)
    drive: Drive = json.loads(job.drive)
    example = outcome_of(load(read_drive(drive, job.where)).run(job.run, 0.0))
    return Bench(job, load, drive, tuple(conditions.parse(each, example) for each in job.expects))


def chunk(job: Job, cases: Sequence[Case]) -> list[Result]:
    """Run some cases in turn: one at least, and no further one after `LONGEST`."""
    ready, until = bench(job), time.monotonic() + LONGEST
    found: list[Result] = []
    for case in cases:
        try:
            found.append(ready.tried(case))
        except BaseException as error:
            error.add_note(f"in case {case[0]} of the sweep: {case[1]}")
            raise
        if time.monotonic() > until:
            break
    return found


def version() -> str:
    found: str = imported("multidrop:__version__")
    return found
