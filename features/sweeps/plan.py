"""A sweep as it is asked for: the drive that runs the program, and its cases, numbered from 1.

The cases of a grid are in the order of `--vary`: the values of the last key change fastest. Draws are independent.
"""

from __future__ import annotations

import hashlib
import json
import platform
import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from pathlib import Path
from random import Random

from multidrop.base.errors import Diagnostic
from multidrop.features.sweeps.trial import Case, TrialJob, TrialResult, bench, version
from multidrop.features.sweeps.variation import (
    DRIVE,
    OWN_KEYS,
    SEED,
    Drive,
    KeyValues,
    Value,
    VariedKey,
    misplaced_hint,
    parse_key,
    parse_values,
    spelled,
)
from multidrop.shell import configuration
from multidrop.shell.programs.checking import to_run
from multidrop.simulator import cells
from multidrop.simulator.cells import CellDrive
from multidrop.simulator.families import PROGRAMS
from multidrop.simulator.torque import MOTORS

MOST_CASES = 100_000
"""The largest number of cases."""
EXPECTED = ("errors == []",)
"""The condition where none is given."""


@dataclass(frozen=True)
class SweepArguments:
    """The arguments of a sweep. `cell` None: a drive in empty surroundings. `draws` None: all cases of the grid."""

    file: str
    cell: str | None = None
    language: str = ""
    vary: Sequence[tuple[str, str]] = ()
    expect: Sequence[str] = ()
    run: str = ""
    until: float | None = None
    draws: int | None = None
    seed: int = 1
    search: str = ""
    """The key whose boundary is searched, by bisection."""


@dataclass(frozen=True)
class SweepPlan:
    """A checked sweep. `place` is what `--cell` needs to name the drive; empty: no cell is given."""

    asked: SweepArguments
    job: TrialJob
    place: str
    values: tuple[KeyValues, ...]
    drive: Drive

    @property
    def count(self) -> int:
        return prod(value.count for value in self.values) if self.asked.draws is None else self.asked.draws

    @cached_property
    def _drawn(self) -> list[tuple[Value, ...]]:
        rng = Random(self.asked.seed)
        return [tuple(value.draw(rng) for value in self.values) for _ in range(self.asked.draws or 0)]

    def case(self, number: int) -> Case:
        return number, self.values_of(number)

    def values_of(self, number: int) -> tuple[Value, ...]:
        """The values of a case."""
        if self.asked.draws is not None:
            return self._drawn[number - 1]
        index, numbers = number - 1, []
        for value in reversed(self.values):
            index, rest = divmod(index, value.count)
            numbers.append(value.at(rest))
        return tuple(reversed(numbers))

    def rounds(self, results: Mapping[int, TrialResult]) -> Iterator[Sequence[int]]:
        """Yield the numbers of the cases to run, in rounds; `results` has those of a round before the next is taken.

        A search runs the ends of its key in each world, and halves the interval of each whose ends differ.
        """
        if not self.asked.search:
            yield range(1, self.count + 1)
            return
        at = [key.text for key in self.job.keys].index(self.asked.search)
        count, stride = self.values[at].count, prod(value.count for value in self.values[at + 1 :])
        worlds = [
            1 + high * stride * count + low for high in range(self.count // stride // count) for low in range(stride)
        ]
        spans = {world: (0, count - 1) for world in worlds}
        yield sorted({world + stride * end for world, span in spans.items() for end in span})

        def ok(world: int, index: int) -> bool:
            return results[world + stride * index].ok

        while spans := {w: (a, b) for w, (a, b) in spans.items() if b - a > 1 and ok(w, a) != ok(w, b)}:
            yield sorted(world + stride * ((low + high) // 2) for world, (low, high) in spans.items())
            for world, (low, high) in spans.items():
                middle = (low + high) // 2
                spans[world] = (middle, high) if ok(world, middle) == ok(world, low) else (low, middle)

    @property
    def runs(self) -> int:
        """The largest number of cases that run."""
        if not self.asked.search:
            return self.count
        return self.count // self.searched.count * (1 + self.searched.count.bit_length())

    @property
    def searched(self) -> KeyValues:
        """The values of the key whose boundary is searched."""
        return next(v for k, v in zip(self.job.keys, self.values, strict=True) if k.text == self.asked.search)

    def facts(self) -> dict[str, str]:
        """What makes this sweep the same as another: equal facts, equal results."""
        drawn = f"{self.asked.draws} draws" if self.asked.draws is not None else ""
        until = "" if self.job.until is None else f"until {self.job.until:.15g}"
        facts = {
            "seed": str(self.asked.seed),
            "multidrop": version(),
            "python": platform.python_version(),
            "program": _digest(self.job.program, self.job.language),
            "cell": _digest(self.job.drive, self.job.own_units),
            "vary": " ".join(filter(None, [*(shlex.quote(f"{key}={text}") for key, text in self.asked.vary), drawn])),
            "expect": "; ".join(filter(None, [*self.job.expects, self.job.run and f"run {self.job.run}", until])),
        }
        return {name: text for name, text in facts.items() if name not in (key.text for key in self.job.keys)}

    def settings(self, case: Case) -> dict[str, Value]:
        """The values of a case by their keys, as they are written; the cell's own ones are left out."""
        return {key.text: value for key, value in zip(self.job.keys, case[1], strict=True) if value is not None}


def make(asked: SweepArguments) -> SweepPlan:
    """Read the files and check everything, before anything runs. Raises Diagnostic."""
    program, language = to_run(asked.file, asked.language)
    default = PROGRAMS[language].drive
    allow = configuration.load().allowed if asked.cell else ()
    bare = CellDrive("", "", default, {"personality": default.personality, "name": default.name})
    everyone = [bare] if asked.cell is None else cells.matching(asked.cell.partition("#")[0], allow)
    names = {name: candidate for candidate in everyone for name in _names(candidate)}
    parsed = [(*_parsed(key, names), _values(key, text, asked)) for key, text in asked.vary]
    chosen = bare if asked.cell is None else _chosen(asked.cell, allow, {drive for drive, _, _ in parsed} - {""})
    keys = tuple(key for _, key, _ in parsed)
    seen: dict[tuple[str, str, str], str] = {}
    for each in keys:
        where_it_is = (each.part, each.axis, each.name)
        if where_it_is in seen:
            raise Diagnostic("is varied twice", f"--vary {each.text}", f"see --vary {seen[where_it_is]}")
        seen[where_it_is] = each.text
    for named, key, _ in parsed:
        if named and named not in _names(chosen):
            name = names[named].spec.name
            what = f"drive {chosen.spec.name} runs the program, so drive {name} changes nothing"
            raise Diagnostic(what, f"--vary {key.text}", f"--cell {names[named].place} lets drive {name} run it")
    drive = {name: value for name, value in chosen.table.items() if name not in OWN_KEYS}
    expects = tuple(asked.expect) or EXPECTED
    where = f"drive {chosen.spec.name}"
    job = TrialJob(
        asked.file, program, language, json.dumps(drive), where, keys, expects, asked.run, asked.until, chosen.own_units
    )
    place = asked.cell or ""
    if asked.cell is not None and len(cells.matching(asked.cell, allow)) != 1:
        place = chosen.place
    made = SweepPlan(asked, job, place, tuple(values for _, _, values in parsed), drive)
    _check(made)
    return made


def _parsed(text: str, names: Collection[str]) -> tuple[str, VariedKey]:
    try:
        return parse_key(text, names)
    except Diagnostic as problem:
        hint = problem.hint or f"valid: {', '.join(sorted(names, key=lambda name: (len(name), name))) or 'KEY'}"
        raise Diagnostic(problem.message, problem.where, hint) from None


def _values(key: str, text: str, asked: SweepArguments) -> KeyValues:
    try:
        return parse_values(text, drawn=asked.draws is not None)
    except Diagnostic as problem:
        raise Diagnostic(problem.message, f"--vary {key}", problem.hint) from None


def _digest(*parts: object) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _names(drive: CellDrive) -> tuple[str, ...]:
    name = drive.spec.name
    return (name, f"{drive.bus}:{name}") if drive.bus else (name,)


def _chosen(cell: str, allow: Sequence[Path], named: set[str]) -> CellDrive:
    """The drive that runs the program: the only one, or else the only one that a key names. Raises Diagnostic."""
    candidates = cells.matching(cell, allow)
    chosen = [candidate for candidate in candidates if named.intersection(_names(candidate))]
    return chosen[0] if len(candidates) > 1 and len(chosen) == 1 else cells.placed(cell, allow)


def _check(plan: SweepPlan) -> None:
    """Refuse too many cases, and any value that the world or the drive refuses. Raises Diagnostic."""
    if plan.asked.search and plan.asked.search not in (key.text for key in plan.job.keys):
        raise Diagnostic("has no values", f"--search {plan.asked.search}", f"--vary {plan.asked.search}=A..B:STEP")
    if plan.asked.search:
        numbers = [sample for sample in plan.searched.samples() if isinstance(sample, int | float)]
        if numbers not in (sorted(numbers), sorted(numbers, reverse=True)):
            raise Diagnostic("its values go up and down", f"--search {plan.asked.search}", "write them in order")
    if plan.runs > MOST_CASES:
        hint = "take larger steps or fewer values, or draw some with --random N"
        raise Diagnostic(f"{plan.runs} cases are too many; a sweep has {MOST_CASES} at most", "--vary", hint)
    bench(plan.job)
    for index, (key, values) in enumerate(zip(plan.job.keys, plan.values, strict=True)):
        for value in values.samples():
            try:
                _check_value(plan, index, key, value)
            except Diagnostic as problem:
                where = f"--vary {key.text}={spelled(value)}"
                hint = misplaced_hint(key) or problem.hint
                raise Diagnostic(f"{problem.where}: {problem.message}", where, hint) from None


def _check_value(plan: SweepPlan, index: int, key: VariedKey, value: Value) -> None:
    """Refuse a value that the drive refuses beside its own ones, and beside the first and last of the other keys."""
    if key.part == SEED:
        if not isinstance(value, int):
            raise Diagnostic("must be a whole number", "seed")
        return
    if key.part == DRIVE and value not in MOTORS:  # a file would be read in each process, here or elsewhere
        raise Diagnostic(f"is not one of {', '.join(MOTORS)}", key.name, "name a file in the cell")
    ready = bench(plan.job)
    others: list[list[Value | None]] = [[None, *each.samples()] for each in plan.values]
    refusals = []
    for at in (0, 1, -1):
        try:
            ready.loaded([value if n == index else pick[at] for n, pick in enumerate(others)])
            return
        except Diagnostic as problem:
            refusals.append(problem)
    raise refusals[0]
