"""Runs of many seeds: side by side on all cores, in their order, and taken up again where they ended."""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import subprocess
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import TextIO

from multidrop import __version__
from soak.simulation.judges.judge import Judgement, judged
from soak.simulation.shrinking import Life
from soak.simulation.story import CREW, whole
from soak.simulation.system.process import Killed
from soak.simulation.world import World

STEPS = 30
"""The steps of a story, unless told."""
ROOT = Path(__file__).parents[2]
GARBAGE = 50_000
"""The number of new objects between two collections of garbage."""
WORD = ": "
"""What a count has before a word of the host, and no other count has."""


@dataclass(frozen=True)
class Result:
    """What came of a seed. `took`: seconds of a core."""

    seed: int
    line: str
    breaches: list[tuple[str, str]]
    """The name of each rule that broke, and how."""
    commands: int
    exchanges: int
    virtual: float
    took: float
    counts: dict[str, int] = field(default_factory=dict)


def verdict(world: World, found: Judgement) -> str:
    """The one line of a seed, the same in every run of it."""
    said = f"broke {', '.join(found.rules)}" if found.rules else "held"
    commands = len(world.history.commands) + world.history.asked
    seconds, trace = world.loop.now, world.history.trace
    return f"seed {world.seed}: {said}, {seconds:.1f} virtual s, {commands} commands, trace {trace}"


def outcomes(world: World) -> Counter[str]:
    """The host's words about the commands, by language and checksum."""
    found: Counter[str] = Counter()
    for each in world.history.commands.values():
        place = world.place(each.line)
        found[f"{place.language} with{'' if place.checked else 'out'} a checksum{WORD}{each.outcome.value}"] += 1
    return found


def result(life: Life) -> Result:
    """Live and judge. Raises RuntimeError where a kill leaves the story: it would end a worker, and not the range."""
    began = time.process_time()
    try:
        world = life.live()
    except Killed as escaped:
        raise RuntimeError(f"seed {life.seed}: a kill ended the story") from escaped
    found, history = judged(world), world.history
    return Result(
        life.seed,
        verdict(world, found),
        [(rule.name, text) for rule, text in found.breaches],
        len(history.commands) + history.asked,
        history.exchanges,
        world.loop.now,
        time.process_time() - began,
        history.counts | world.climate.happened | found.granted | outcomes(world),
    )


def run(lives: Sequence[Life], jobs: int = 0, resume: Path | None = None) -> Iterator[Result]:
    """Yield the result of each, in their order. `jobs`: 0 stands for one a core. `resume`: a file of results.

    Raises ValueError where the file is of another program or other lives.
    """
    known, file = _taken_up(lives, resume) if resume is not None else ([], None)
    yield from known
    left = lives[len(known) :]
    jobs = min(jobs or os.cpu_count() or 1, len(left))
    with ExitStack() as stack:
        stack.enter_context(_collected_seldom())
        if file is not None:
            stack.enter_context(file)
        results: Iterator[Result] = map(result, left)
        if jobs > 1:
            pool = stack.enter_context(multiprocessing.get_context("fork").Pool(jobs))
            results = pool.imap(result, left, chunksize=2)
        for each in results:
            if file is not None:
                print(json.dumps(asdict(each)), file=file, flush=True)
            yield each


@contextmanager
def _collected_seldom() -> Iterator[None]:
    """Let the garbage collection leave alone what the program consists of, and look seldom at the rest."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(GARBAGE)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()


def _taken_up(lives: Sequence[Life], path: Path) -> tuple[list[Result], TextIO]:
    """The results that a file has, and the file to append the others to; a row that was cut off goes."""
    head = json.dumps({"of": identity(), "first": lives[0].seed, "steps": sum(step < CREW for step in lives[0].steps)})
    rows = path.read_text().splitlines(keepends=True) if path.exists() else []
    whole = [row for row in rows if row.endswith("\n")]
    if whole and whole[0] != f"{head}\n":
        raise ValueError(f"{path}: has results of another run: {whole[0].strip()}; name another file")
    file = path.open("w")
    file.writelines(whole or [f"{head}\n"])
    return [Result(**json.loads(row)) for row in whole[1:]][: len(lives)], file


def kept(path: Path) -> list[Result]:
    """The results that a file of a run has. Raises ValueError where it is no such file."""
    head, *rows = path.read_text().splitlines(keepends=True) or [""]
    if not head.startswith('{"of": '):
        raise ValueError(f"{path}: has no results of a run (RESUME=FILE)")
    return [Result(**json.loads(row)) for row in rows if row.endswith("\n")]


def identity() -> str:
    """The commit of the tree; where it has none, the version."""
    git = ("git", "-C", str(ROOT), "rev-parse", "HEAD")
    try:
        found = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    except OSError:
        found = ""
    return found or __version__


def derived(count: int) -> list[int]:
    """Seeds that follow from the commit, so that each commit tries others, and each run of it the same."""
    digest = sha256(identity().encode()).digest()
    return [int.from_bytes(sha256(digest + bytes([number])).digest()[:3], "big") for number in range(count)]


def lives(seeds: Sequence[int], steps: int = STEPS) -> list[Life]:
    """The whole story of each seed."""
    return [Life(seed, whole(seed, steps)) for seed in seeds]
