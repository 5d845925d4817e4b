"""Cases of a sweep a second: on one core, on two, and on a local Dask cluster of two workers.

A case builds a drive of a cell, runs a program of two virtual seconds, and judges two conditions. Rounds of one and two
processes take turns. `growth` has sweeps of 10 to 10,000 cases from the command line, with the start of the program.

Run: python bench/bench_sweep.py [--full]
"""

from __future__ import annotations

import contextlib
import io
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from report import Row, alone, compared, main

from multidrop.__main__ import main as command
from multidrop.features.sweeps import plan, trial

ROOT = Path(__file__).resolve().parent.parent
AIM, MOST_MS = 1.8, 5.0
ROUNDS = 5
CASES = 1000
PROGRAM = 'PG 1\nLB SU\n MA 8000\n H\n PR "at ",P\n H 200\n MA 0\n H\n PR "at ",P\nE\nPG\n'
CELL = '[[bus]]\nname = "line"\n[[bus.drive]]\npersonality = "LMDCM"\nname = "b"\nset = { EE = 1, VM = 12000 }\n'
EXPECT = ("errors == []", "position == 0")
GROWTH = (10, 100, 1000, 10_000)


def rows(full: bool) -> Iterator[Row]:
    """One case, one and two processes, a cluster, growth."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("go.mxt").write_text(PROGRAM)
        Path("cell.toml").write_text(CELL)
        yield _one_case()
        one, two = [], []
        for _ in range(ROUNDS):
            one.append(CASES / swept(CASES, "--jobs", "1"))
            two.append(CASES / swept(CASES, "--jobs", "2"))
        yield compared(
            "cases, 2 processes", "/s", two, one, "1 process", aim=AIM, aim_of="ratio", better="more", note=_note()
        )
        yield _by_processor_time()
        yield from _on_a_cluster(one)
        for cases in GROWTH if full else GROWTH[:-1]:
            yield alone(f"a sweep of {cases:,} cases, --jobs 2", "s", [swept(cases, "--jobs", "2")])


def _one_case() -> Row:
    """Processor time of a case in a process that is warm."""
    made = plan.make(plan.SweepArguments("go.mxt", "cell.toml", vary=[("load", "0..0.9:0.1")], expect=EXPECT))
    ready, spent = trial.bench(made.job), []
    for number in range(1, 200):
        begin = time.process_time()
        result = ready.tried(made.case(1 + number % 10))
        spent.append((time.process_time() - begin) * 1000)
        assert result.ok, result
    end = trial.outcome_of(ready.loaded(made.case(1)[1]).run("", 60.0))
    return alone("a case", "ms", spent, aim=MOST_MS, note=f"{end.virtual_s:.2f} virtual seconds; processor time")


def _by_processor_time() -> Row:
    """The ratio that two idle cores would give at least: what one process spends, by the share of the busiest.

    The first process waits while the others work; its own time counts as if it did not.
    """
    ratios = []
    for _ in range(ROUNDS):
        alone_, _ = _spent("--jobs", "1")
        first, others = _spent("--jobs", "2")
        ratios.append(alone_ / (first + others / 2))
    return alone("2 processes by 1, in processor time", "x", ratios, aim=AIM, better="more", note="on a busy machine")


def _spent(*arguments: str) -> tuple[float, float]:
    """Processor time of a sweep in this process, and of its further processes."""
    before, own = resource.getrusage(resource.RUSAGE_CHILDREN), time.process_time()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        command(_arguments(CASES) + list(arguments))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.process_time() - own, spent


def _note() -> str:
    return f"medians of {ROUNDS} rounds; load {os.getloadavg()[0]:.1f}"


def _on_a_cluster(one: list[float]) -> Iterator[Row]:
    with cluster() as address:
        swept(CASES, "--cluster", address, "--yes")  # the workers import what they need
        found = [CASES / swept(CASES, "--cluster", address, "--yes") for _ in range(ROUNDS)]
    ours, theirs = statistics.median(found), statistics.median(one)
    yield Row("cases, a cluster of 2 workers", "/s", ours, theirs, "1 process", ours / theirs, note=_note())


@contextlib.contextmanager
def cluster() -> Iterator[str]:
    """A cluster of two workers in processes of their own; its address."""
    script = ROOT / "tests" / "support" / "dask_cluster.py"
    with open("cluster.log", "wb") as log:
        process = subprocess.Popen(
            [sys.executable, str(script), "address", "2"], stdin=subprocess.PIPE, stdout=log, stderr=log, env=_env()
        )
    try:
        while not (Path("address").exists() and Path("address").read_text()):
            if process.poll() is not None:
                raise RuntimeError(Path("cluster.log").read_text())
            time.sleep(0.05)
        yield Path("address").read_text()
    finally:
        assert process.stdin is not None
        process.stdin.close()
        process.wait()


def swept(cases: int, *arguments: str) -> float:
    """Seconds of a sweep as its summary has them, without the start of the program."""
    line = [sys.executable, "-m", "multidrop", *_arguments(cases), *arguments]
    done = subprocess.run(line, capture_output=True, text=True, env=_env())
    words = done.stdout.splitlines()[-1].split()
    assert done.returncode == 0 and words[:4] == [str(cases), "cases,", "0", "failed,"], done
    return float(words[4])


def _arguments(cases: int) -> list[str]:
    vary = ["--vary", "load=0..0.9:0.1", "--vary", f"seed=1..{cases // 10}"]
    expect = [word for each in EXPECT for word in ("--expect", each)]
    return ["program", "sweep", "go.mxt", "--cell", "cell.toml", *vary, *expect]


def _env() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT)}


if __name__ == "__main__":
    main(rows)
