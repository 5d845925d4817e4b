"""Ten minutes of motion programs in virtual time, as `multidrop program test` runs them. The aim is under a second.

Run: python bench/bench_virtual.py
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from report import Row, alone, main

from multidrop.families.lexium.manual import program_file
from multidrop.families.lexium.simulator.program_run import MCodeRun
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.program_events import Summary

AIM = 1.0
MINUTES = 10
ROUNDS = 3

SETUP = "VI=1000\nVM=768000\nA=1000000\nD=A\nIS=1,0,0\nIS=2,2,0\nPG 1\n"
PROGRAMS = {
    "out and back, H": "LB G1\nMA 512000\nH\nH 250\nMA 0\nH\nH 250\nBR G1\n",
    "short moves, a print each": "LB G1\nMR 5120\nH\nIC R1\nPR R1,P\nBR G1\n",
    "SL on the fly": "LB G1\nSL 100000\nH 20\nSL 200000\nH 20\nSL -100000\nH 20\nBR G1\n",
    "trips on the way": "LB G1\nP=0\nTP=25600,K1\nTE=2\nMR 51200\nH\nBR G1\nLB K1\nIC R1\nRT\n",
    "an input asked every 10 ms": "LB G1\nMR 5120,0\nLB G2\nH 10\nBR G2,I1=1\nBR G2,MV=1\nBR G1\n",
    "MV asked all the time": "LB G1\nMR 512000\nLB G2\nBR G2,MV=1\nBR G1\n",
}
WORLD = WorldSpec(limit_plus=1e12, inputs=tuple((10.0 * n, 1, n % 2) for n in range(60)))


def rows(full: bool) -> Iterator[Row]:
    """Processor time for each program, and their median."""
    medians = []
    for name, text in PROGRAMS.items():
        runs = [run(text) for _ in range(ROUNDS)]
        _, end, prints = runs[0]
        seconds = [each for each, _, _ in runs]
        medians.append(statistics.median(seconds))
        counts = f"{end.instructions:,} lines, {end.moves:,} motions, {prints:,} prints"
        note = f"{end.t / medians[-1]:,.0f} times real; {counts}"
        yield alone(name, "s", seconds, aim=AIM, note=note)
    yield alone("the median of these", "s", medians, aim=AIM)


def run(text: str) -> tuple[float, Summary, int]:
    """Seconds, how it ended, and how many lines were printed."""
    lines = program_file.read(f"{SETUP}{text}E\nPG\n", "bench.mxt")
    begin = time.process_time()
    events = list(MCodeRun(DriveSpec(world=WORLD), lines, "bench.mxt").run(until=MINUTES * 60))
    seconds = time.process_time() - begin
    end = events[-1]
    assert isinstance(end, Summary) and end.ended == "until" and not end.errors, end
    return seconds, end, sum("print" in each.facts for each in events)


if __name__ == "__main__":
    main(rows)
