"""The work of a sweep: runs of one program in many worlds, and the conditions that their results must meet.

Everything here runs in any process, on any machine. A `TrialJob` is what all cases have in common; each process reads
it once. A case is a number and the values of its keys.

A CONDITION of `--expect` is one comparison like that of `/assert`, over the results of a run instead of words. Lists
are written in brackets, compare with `==` and `!=`, and take no part in calculations: `errors == [86]`. A number in a
list equals a print that is this number. `ended` is a text, and beside a number 1 or 0: ended by itself, or not.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import multidrop
from multidrop.base.errors import Diagnostic
from multidrop.features.sweeps.variation import Drive, Value, VariedKey
from multidrop.shell.scripts.expression import (
    EQUAL,
    Comparison,
    Constant,
    DriveQuestion,
    Expression,
    Known,
    Name,
    compared,
    evaluate,
    number,
    parse_check,
    quoted,
    unknowns,
    value_of,
)
from multidrop.shell.scripts.expression import Value as Scalar
from multidrop.simulator.cells import read_drive
from multidrop.simulator.families import PROGRAMS
from multidrop.simulator.program_events import ProgramEvent
from multidrop.simulator.program_run import Load, ProgramRun

BY_ITSELF = ("E", "END")
"""The ends of a program that has ended by itself."""
ENDS = (*BY_ITSELF, "error", "until")
Position = int | tuple[int, ...]


class TrialOutcome(NamedTuple):
    """`position` has a number for each axis, `errors` those that the program did not handle, in their order."""

    position: Position = 0
    errors: tuple[int | str, ...] = ()
    prints: tuple[str, ...] = ()
    virtual_s: float = 0.0
    ended: str = "E"


def outcome_of(events: Iterable[ProgramEvent]) -> TrialOutcome:
    """Run to the end, and take the result from the events."""
    prints: list[str] = []
    fact = {}
    for event in events:
        fact = event.fact(0.0)
        if "print" in fact:
            prints.append(fact["print"])
    summary = fact["summary"]
    place = summary["position"]
    return TrialOutcome(
        position=tuple(place.values()) if isinstance(place, dict) else place,
        errors=tuple(summary["errors"]),
        prints=tuple(prints),
        virtual_s=summary["virtual_s"],
        ended=summary["ended"],
    )


NAMES = TrialOutcome._fields
OUTCOME_COLUMNS = ("position", "errors", "virtual_s", "ended")
"""The fields that are kept of each case."""
MARGIN = "margin of "
"""The beginning of the name of a margin."""
LISTS = ("errors", "prints")
POSITION, ENDED = "position", "ended"
List = tuple[Scalar, ...]
Side = Scalar | List
_SINGLE = re.compile(r"\"[^\"]*\"|'([^'\"]*)'")
_ITEMS = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([^,\"'\[\]]+?))\s*(?:,|$)")


@dataclass(frozen=True)
class TrialCondition:
    """One comparison. `text` is what was written."""

    text: str
    tree: Comparison

    def holds(self, outcome: TrialOutcome) -> bool:
        """Whether the condition holds for a result. Raises Diagnostic for a calculation without a value."""
        left, right, within = self._sides(outcome)
        if isinstance(left, tuple) and isinstance(right, tuple):
            pairs = zip(left, right, strict=False)
            equal = len(left) == len(right) and all(_alike(*pair, within) for pair in pairs)
            return equal == (self.tree.sign == "==")
        assert not isinstance(left, tuple) and not isinstance(right, tuple)
        return compared(self.tree.sign, left, right, within)

    @property
    def has_margin(self) -> bool:
        """Whether it is about an order, or has a tolerance."""
        return self.tree.sign not in EQUAL or (self.tree.sign == "==" and self.tree.within != Constant(0))

    def margin(self, outcome: TrialOutcome) -> str:
        """The distance of a result from the limit, below 0 beyond it; empty without numbers on both sides."""
        try:
            left, right, within = self._sides(outcome)
        except Diagnostic:
            return ""
        if not (isinstance(left, int | float) and isinstance(right, int | float)):
            return ""
        if self.tree.sign == "==":
            return f"{within - abs(left - right):.9g}"
        return f"{right - left if self.tree.sign[0] == '<' else left - right:.9g}"

    def _sides(self, outcome: TrialOutcome) -> tuple[Side, Side, float]:
        """Both sides and the tolerance. Raises Diagnostic for a calculation without a value."""
        names = [unknown for unknown in unknowns(self.tree) if isinstance(unknown, Name)]
        values = {name: getattr(outcome, name.name, name.name) for name in names}
        known: Known = {name: "" if isinstance(value, tuple) else value for name, value in values.items()}
        left, right = (_side(side, outcome, known) for side in (self.tree.left, self.tree.right))
        if not (isinstance(left, tuple) or isinstance(right, tuple)):
            left, right = _beside(self.tree, left, right)
        return left, right, number(evaluate(self.tree.within, known))

    def seen(self, outcome: TrialOutcome) -> str:
        names = (unknown.name for unknown in unknowns(self.tree) if isinstance(unknown, Name))
        values = {name: getattr(outcome, name) for name in names if name in NAMES}
        shown = {
            name: f"[{', '.join(map(quoted, value))}]" if isinstance(value, tuple) else quoted(value)
            for name, value in values.items()
        }
        return ", ".join(f"{name} == {value}" for name, value in shown.items())


def parse_condition(text: str, example: TrialOutcome) -> TrialCondition:
    """Parse a condition; `example` is a result of the family's programs. Raises Diagnostic."""
    try:
        quoted_twice = _SINGLE.sub(lambda match: match[0] if match[1] is None else f'"{match[1]}"', text)
        tree = parse_check(quoted_twice, (*NAMES, *ENDS), lists=True)
    except Diagnostic as problem:
        raise Diagnostic(problem.message, f"--expect {text}", problem.hint.replace("[@ADDR] ", "")) from None
    names = tuple(unknowns(tree))
    for unknown in names:
        if isinstance(unknown, DriveQuestion) and (unknown.target or not unknown.line):
            raise Diagnostic(f"{unknown.shown} is not a result", f"--expect {text}", f"valid: {', '.join(NAMES)}")
    if not any(isinstance(unknown, Name) and unknown.name in NAMES for unknown in names):
        raise Diagnostic("is not about a result", f"--expect {text}", f"valid: {', '.join(NAMES)}")
    # A list is refused in a calculation, beside a number, and in an order.
    sides = [_is_list(side, example) for side in (tree.left, tree.right)]
    no_lists = [tree.within, *(side for side in (tree.left, tree.right) if not _is_list(side, example))]
    inner = [unknown for part in no_lists for unknown in unknowns(part) if _is_list(unknown, example)]
    mixed, ordered = any(sides) != all(sides), any(sides) and tree.sign not in EQUAL
    if inner or mixed or ordered:
        hint = 'as in errors == [], errors == [86], prints == ["done"]'
        raise Diagnostic("compares a list, which has == and != with a list only", f"--expect {text}", hint)
    for unknown in names:
        if isinstance(unknown, DriveQuestion):
            _items(unknown.text)
    return TrialCondition(text, tree)


def _is_list(tree: Expression, example: TrialOutcome) -> bool:
    if isinstance(tree, Name):
        return isinstance(getattr(example, tree.name, None), tuple)
    return isinstance(tree, DriveQuestion)


def _side(tree: Expression, outcome: TrialOutcome, known: Known) -> Side:
    if isinstance(tree, DriveQuestion):
        return _items(tree.text)
    if isinstance(tree, Name):
        value: Side = getattr(outcome, tree.name, tree.name)
        return value
    return evaluate(tree, known)


def _beside(tree: Comparison, left: Scalar, right: Scalar) -> tuple[Scalar, Scalar]:
    """The two sides; `ended` beside a number is one, too."""
    if tree.left == Name(ENDED) and not isinstance(right, str):
        return int(left in BY_ITSELF), right
    if tree.right == Name(ENDED) and not isinstance(left, str):
        return left, int(right in BY_ITSELF)
    return left, right


def _alike(left: Scalar, right: Scalar, within: float) -> bool:
    if isinstance(left, str) != isinstance(right, str):
        left, right = (value_of(side) if isinstance(side, str) else side for side in (left, right))
    return compared("==", left, right, within)


def _items(text: str) -> List:
    scalars: list[Scalar] = []
    at = 0
    while at < len(text):
        match = _ITEMS.match(text, at)
        if match is None:
            raise Diagnostic(f"[{text}] is not a list", hint='as in [], [86], ["done", "at 51200"]')
        double, single, bare = match.groups()
        scalars.append(value_of(bare) if bare is not None else double if double is not None else single)
        at = match.end()
    return tuple(scalars)


UNTIL = 60.0
"""Virtual seconds after which a case has failed, unless the sweep sets a time."""
LONGEST_BATCH = 0.5
"""Seconds after which a chunk gives back what it has, so that it can be reported."""
ALL_HELD = -1
"""The number of the failed condition of a case in which all hold."""
CUT, REFUSED, DIED = -2, -3, -4
"""In its place: the program still ran; the drive refused the settings together; the process of the case died."""


@dataclass(frozen=True)
class TrialJob:
    """The common part of all cases. `drive` is the table of the drive, as JSON; `where` names it in messages."""

    file: str
    program: str
    language: str
    drive: str
    where: str
    keys: tuple[VariedKey, ...]
    expects: tuple[str, ...]
    run: str = ""
    until: float | None = None
    own_units: tuple[str, ...] = ()


Case = tuple[int, Sequence[Value | None]]
"""A number, and a value for each key of the job; None is the cell's own value."""


class TrialResult(NamedTuple):
    """The result of a case. `failed` is the index of the first condition that does not hold, or one of the others."""

    number: int
    failed: int = ALL_HELD
    why: str = ""
    cells: tuple[str, ...] = ()
    """Texts for `Bench.columns`; empty ones where the run had no result."""

    @property
    def ok(self) -> bool:
        return self.failed == ALL_HELD


@dataclass(frozen=True)
class Bench:
    """A job that was read: all that a case needs."""

    job: TrialJob
    load: Load
    drive: Drive
    conditions: tuple[TrialCondition, ...]
    measured: tuple[TrialCondition, ...]
    """The conditions that have a margin."""

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of what is kept of a run: margins, and the result."""
        return (*(f"{MARGIN}{condition.text}" for condition in self.measured), *OUTCOME_COLUMNS)

    def loaded(self, values: Sequence[Value | None]) -> ProgramRun:
        """Load the program into a drive with these values. Raises Diagnostic."""
        table = self.drive
        for key, value in zip(self.job.keys, values, strict=True):
            if value is not None:
                table = key.put(table, value)
        return self.load(read_drive(table, self.job.where, self.job.own_units))

    def tried(self, case: Case) -> TrialResult:
        number, values = case
        job, cells = self.job, ("",) * len(self.columns)
        try:
            outcome = outcome_of(self.loaded(values).run(job.run, UNTIL if job.until is None else job.until))
            margins = [condition.margin(outcome) for condition in self.measured]
            kept = [getattr(outcome, name) for name in OUTCOME_COLUMNS]
            cells = (*margins, *(json.dumps(each) if isinstance(each, tuple) else str(each) for each in kept))
            if job.until is None and outcome.ended == "until":
                what = f"still running after {UNTIL:g} s; --until SECONDS sets another limit"
                return TrialResult(number, CUT, what, cells)
            for index, condition in enumerate(self.conditions):
                if not condition.holds(outcome):
                    return TrialResult(number, index, condition.seen(outcome), cells)
        except Diagnostic as problem:
            return TrialResult(number, REFUSED, str(problem), cells)
        return TrialResult(number, cells=cells)


@lru_cache(maxsize=4)
def bench(job: TrialJob) -> Bench:
    load = PROGRAMS[job.language].read(job.program, job.file)
    drive: Drive = json.loads(job.drive)
    example = outcome_of(load(read_drive(drive, job.where, job.own_units)).run(job.run, 0.0))
    conditions = tuple(parse_condition(expected, example) for expected in job.expects)
    return Bench(job, load, drive, conditions, tuple(condition for condition in conditions if condition.has_margin))


def chunk(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
    """Run some cases in turn: one at least, and no further one after `LONGEST_BATCH`."""
    ready, until = bench(job), time.monotonic() + LONGEST_BATCH
    results: list[TrialResult] = []
    for case in cases:
        try:
            results.append(ready.tried(case))
        except BaseException as error:
            error.add_note(f"in case {case[0]} of the sweep: {case[1]}")
            raise
        if time.monotonic() > until:
            break
    return results


def version() -> str:
    return multidrop.__version__
