"""Mutants: defects planted in a copy of the program, each of which some seed has to see.

A mutant is a patch, `soak/mutants/NAME.patch`. Its first line says what it breaks, and the rule that saw it first. The
copy has the rooms with their links; a process of its own lives the seeds there, and ends at the first that breaks. A
mutant that no seed sees any more names a quick test in place of a rule.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from soak.simulation.runs import result
from soak.simulation.shrinking import Life
from soak.simulation.story import whole

ROOT = Path(__file__).parents[2]
PATCHES = ROOT / "soak" / "mutants"
ALL = "all"
HEAD = re.compile(r"# (.+); seen by (.+)\n")
BROKE = re.compile(r"^seed (\d+): broke ([^,\n]+)", re.M)
EXCEPTION, RAISED = "an exception", "Traceback"
"""What sees a mutant with which a seed cannot be lived, and how its process says so."""
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "docs", "bench", "fuzz", "packaging")
"""What neither a seed nor a test needs of the tree."""
TEST = re.compile(r"tests/\S+::\w+$")
LONGEST = 3600.0
"""Real seconds that the seeds of one mutant take at most."""


class Caught(NamedTuple):
    """What came of a mutant. `rule` empty: nothing saw it; `said`: the last that its process said."""

    name: str
    rule: str
    seed: int
    tried: int
    took: float
    said: str

    @property
    def row(self) -> str:
        """A row of the table."""
        found = f"{self.rule:14}{self.seed:>6}" if self.rule else f"{'NOT CAUGHT':14}{'':6}"
        return f"{self.name:36}{found}{self.tried:>7}{self.took:>8.1f}"


TITLE = f"{'mutant':36}{'rule':14}{'seed':>6}{'tried':>7}{'s':>8}"


def names() -> list[str]:
    """The mutants, by name."""
    return sorted(each.stem for each in PATCHES.glob("*.patch"))


def head(name: str) -> tuple[str, str]:
    """What a mutant breaks, and the rule that saw it first. Raises ValueError where its first line does not say so."""
    with (PATCHES / f"{name}.patch").open() as file:
        found = HEAD.fullmatch(file.readline())
    if found is None:
        raise ValueError(f"{name}.patch: the first line says '# what it breaks; seen by RULE'")
    return found[1], found[2]


def chosen(name: str) -> list[str]:
    """The mutants that a name stands for. Raises ValueError for one that there is none of."""
    if name != ALL and name not in names():
        raise ValueError(f"no mutant {name}; valid: {ALL}, {', '.join(names())}")
    return names() if name == ALL else [name]


def applied(name: str, tree: Path, check: bool = False) -> str:
    """Apply a patch to a tree, or only check that it applies; say why it does not. Raises FileNotFoundError."""
    patch = PATCHES / f"{name}.patch"
    git = ("git", "apply", *("--check",) * check, str(patch))
    other = ("patch", "-p1", "--batch", "--silent", *("--dry-run",) * check, "-i", str(patch))
    command = git if shutil.which("git") else other
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    return (done.stderr or done.stdout or command[0]).strip() if done.returncode else ""


@contextmanager
def planted(name: str) -> Iterator[Path]:
    """A copy of the tree with a mutant in it. Raises ValueError where the patch does not apply."""
    with tempfile.TemporaryDirectory(prefix=f"mutant-{name}-") as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, symlinks=True, ignore=LEFT_OUT)
        if why := applied(name, tree):
            raise ValueError(f"{name}.patch does not apply: {why}")
        yield tree


def caught(name: str, seeds: range, steps: int, jobs: int = 0) -> Caught:
    """Live seeds with a mutant until one breaks a rule that it holds without the mutant."""
    began, left, (_, test) = time.monotonic(), seeds, head(name)
    with planted(name) as tree:
        if TEST.match(test):
            failed, said = _tested(tree, test)
            return Caught(name, "a test" * failed, 0, 1, time.monotonic() - began, said)
        while left:
            text, problem = _lived(tree, left, steps, jobs)
            took = time.monotonic() - began
            if (found := BROKE.search(text)) is None:
                ends = (each for each in left if RAISED in _lived(tree, range(each, each + 1), steps, 1)[1])
                seed = next(ends, 0) if RAISED in problem else 0
                return Caught(name, EXCEPTION * bool(seed), seed, len(seeds), took, (problem or text).strip())
            seed, rule = int(found[1]), found[2]
            if not result(Life(seed, whole(seed, steps))).breaches:
                return Caught(name, rule, seed, seed - seeds.start + 1, took, "\n".join(text.splitlines()[:2]))
            left = range(seed + 1, seeds.stop)
    return Caught(name, "", 0, len(seeds), took, f"seed {seed} breaks a rule without it too")


def _tested(tree: Path, test: str) -> tuple[bool, str]:
    """Run a test in a tree; return whether it failed, and what was said of it."""
    command = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=no", test)
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST)
    return done.returncode == 1, done.stdout.strip()


def _lived(tree: Path, seeds: range, steps: int, jobs: int) -> tuple[str, str]:
    """Live seeds in a tree until one breaks a rule; return what that prints, and what went wrong."""
    wanted = (f"{seeds.start}-{seeds.stop - 1}", str(steps), str(jobs))
    options = [part for pair in zip(("--seeds", "--steps", "--jobs"), wanted, strict=True) for part in pair]
    command = (sys.executable, "-m", "soak.simulation", "--until-broken", *options)
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return "", f"not done after {LONGEST:g} s"
    return done.stdout, done.stderr
