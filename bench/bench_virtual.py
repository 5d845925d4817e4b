"""Ten minutes of motion programs in virtual time, as `multidrop program test` runs them. The aim is under a second.

Run: python bench/bench_virtual.py
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from dialects.mcode.manual import program_file
from simulator.cell.spec import DriveSpec, WorldSpec
from simulator.lexium.program_events import Printed, Summary
from simulator.lexium.program_run import ProgramRun

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


def main() -> None:
    """Measure, and print a table."""
    print(f"{MINUTES} minutes in virtual time, s of processor time; the best of {ROUNDS} rounds; the aim is {AIM} s\n")
    print(f"{'program':28} {'s':>7} {'of the aim':>11} {'times real':>11} {'lines':>10} {'motions':>8} {'prints':>7}")
    for name, text in PROGRAMS.items():
        runs = [run(text) for _ in range(ROUNDS)]
        seconds, end, prints = min(runs, key=lambda each: each[0])
        share, pace = seconds / AIM, end.t / seconds
        print(
            f"{name:28} {seconds:7.3f} {share:10.2f}x {pace:10,.0f}x {end.instructions:10,} {end.moves:8,} {prints:7,}"
        )
    print(f"\nmedian {statistics.median(run(text)[0] for text in PROGRAMS.values()):.3f} s")


def run(text: str) -> tuple[float, Summary, int]:
    """Seconds, how it ended, and how many lines were printed."""
    lines = program_file.read(f"{SETUP}{text}E\nPG\n", "bench.mxt")
    begin = time.process_time()
    events = list(ProgramRun(DriveSpec(world=WORLD), lines, "bench.mxt").run(until=MINUTES * 60))
    seconds = time.process_time() - begin
    end = events[-1]
    assert isinstance(end, Summary) and end.ended == "until" and not end.errors, end
    return seconds, end, sum(isinstance(each, Printed) for each in events)


if __name__ == "__main__":
    main()
