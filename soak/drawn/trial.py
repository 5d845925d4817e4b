"""The trial of mutants: each in a copy of the tree, against the tests that execute its line, then against seeds.

A test that fails in the copy counts if it passes there without the mutant: the tests that saw something are run once
more, without any mutant, at the end.
"""

from __future__ import annotations

import os
import queue
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from soak.drawn.operators import Mutant
from soak.drawn.rooms import ROOT
from soak.drawn.tests_of import Map, MeasuredTest, function

FIRST = 15.0
"""s; what the tests take together that are run first: most mutants are seen there, and one that hangs ends soon."""
BUDGET = 90.0
"""s; what the tests of one mutant take at most, as they were measured, without one that is the first."""
SEEDS = "1-20"
SLOWER = 4.0
"""Times that a trial may take longer than its tests were measured, before it counts as one that never ends."""
START = 60.0
"""s; what a trial gets beside that, to start on a busy machine."""
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__")
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?)(?:\[.*)?(?: - .*)?$", re.M)
ENDLESS = "never ends"


class Verdict(NamedTuple):
    """What saw a mutant: `by` is the node of a test, a seed or ENDLESS; empty: nothing. `quick`: it is fast."""

    mutant: Mutant
    by: str
    quick: bool
    tests: int
    """Number of tests that execute the line."""


class Copies:
    """Copies of a tree, one for each process."""

    def __init__(self, root: Path, folder: Path, count: int) -> None:
        self.root = root
        self._free: queue.Queue[Path] = queue.Queue()
        for number in range(count):
            tree = folder / str(number)
            shutil.copytree(root, tree, symlinks=True, ignore=LEFT_OUT)
            self._free.put(tree)

    @contextmanager
    def one(self, mutant: Mutant | None = None) -> Iterator[Path]:
        """A copy that nobody else has, with a mutant in it."""
        tree = self._free.get()
        file = tree / mutant.path if mutant is not None else None
        whole = file.read_bytes() if file is not None else b""
        try:
            if mutant is not None and file is not None:
                file.write_bytes(mutant.planted(whole))
            yield tree
        finally:
            if file is not None:
                file.write_bytes(whole)
            self._free.put(tree)


def chosen(tests: Iterable[MeasuredTest], budget: float = BUDGET) -> list[MeasuredTest]:
    """The tests that there is time for, the fast ones first."""
    taken, spent = list[MeasuredTest](), 0.0
    for each in tests:
        if taken and spent + each.seconds > budget:
            break
        taken.append(each)
        spent += each.seconds
    return taken


def tried(
    mutants: Sequence[Mutant], seen_by: Map, jobs: int, tell: Callable[[Verdict], None], root: Path = ROOT
) -> list[Verdict]:
    """Try mutants on some processes; return what saw each. `tell` is called as each is done, and for what was wrong."""
    verdicts = list[Verdict]()
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(jobs) as pool:
        copies = Copies(root, Path(folder), jobs)
        for each in pool.map(lambda each: _one(each, seen_by, copies), mutants):
            verdicts.append(each)
            tell(each)
        wrong = _wrong({each.by for each in verdicts if "::" in each.by}, copies)
    for number, each in enumerate(verdicts):
        if each.by in wrong:
            verdicts[number] = each._replace(by="", quick=False)
            tell(verdicts[number])
    return verdicts


def _one(mutant: Mutant, seen_by: Map, copies: Copies) -> Verdict:
    tests = chosen(seen_by.of(mutant.path, mutant.line, (copies.root / mutant.path).read_bytes()))
    with copies.one(mutant) as tree:
        first = chosen(tests, FIRST)
        if by := _tested(tree, first) or _tested(tree, tests[len(first) :]):
            quick = by == ENDLESS or any(each.node == by and each.quick for each in tests)
            return Verdict(mutant, by, quick, len(tests))
        return Verdict(mutant, by := _lived(tree), bool(by), len(tests))


def _environment(tree: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(tree), "MULTIDROP_MUTANT": "1"}


def _tested(tree: Path, tests: Sequence[MeasuredTest]) -> str:
    """Run tests until one fails; return its node, ENDLESS where they do not end, and nothing where all pass."""
    if not tests:
        return ""
    options = (
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "--no-header",
        "--tb=no",
        "-rfE",
        "-W",
        "default",
    )
    command = (sys.executable, "-m", "pytest", *options, *(each.node for each in tests))
    limit = START + SLOWER * sum(each.seconds for each in tests)
    done = _run(command, tree, limit)
    if done is None:
        return ENDLESS
    if done.returncode in (0, 5):  # 5: every test is of a kind that this machine leaves out
        return ""
    found = FAILED.search(done.stdout)
    return function(found[1]) if found else tests[0].node


def _lived(tree: Path) -> str:
    """Live seeds until one breaks a rule; return it."""
    command = (sys.executable, "-m", "soak.simulation", "--until-broken", "--seeds", SEEDS, "--jobs", "1")
    done = _run(command, tree, START + SLOWER * 30.0)
    if done is None:
        return ENDLESS
    found = re.search(r"^seed (\d+): broke ([^,\n]+)", done.stdout, re.M)
    return f"seed {found[1]}: {found[2]}" if found else "a seed ends in an exception" if done.returncode else ""


def _run(command: Sequence[str], tree: Path, limit: float) -> subprocess.CompletedProcess[str] | None:
    """Run a process and its children in a tree; return None, with all of them killed, where it does not end in time."""
    with subprocess.Popen(
        command, cwd=tree, env=_environment(tree), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            out, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.communicate()
            return None
        return subprocess.CompletedProcess(command, process.returncode, out)


def _wrong(nodes: set[str], copies: Copies) -> set[str]:
    """The tests that fail without any mutant, too: what they saw is nothing."""
    wrong = set[str]()
    left = sorted(nodes)
    with copies.one() as tree:
        while left and (by := _tested(tree, [MeasuredTest(each, 10.0, True) for each in left])):
            wrong.add(by)
            left = [each for each in left if each != by]
            if by == ENDLESS:
                break
    return wrong
