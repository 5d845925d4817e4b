"""Program lines a second that the simulated drive's interpreter executes, in virtual time. The aim is 300,000.

The drive takes a microsecond a line here, so that a second of its time is a million lines. Beside it, what the same
machine needs for the barest loop over closures: calling them and nothing else.

Run: python bench/bench_interpreter.py
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from report import Row, compared, main

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.world import World

AIM = 300_000
ROUNDS = 5
SECONDS = 0.3
"""Of the drive's time, a round."""

PROGRAMS = {
    "count": "LB G1\nIC R1\nBR G1\n",
    "compute": "LB G1\nR1=R1+1\nR2=R1*3\nR3=R2-R1\nR4=R3/7&255\nBR G1\n",
    "decide": "LB G1\nIC R1\nBR G2,R1<100\nR1=0\nLB G2\nBR G1,R1>0\nBR G1\n",
    "call": "LB G1\nCL K1\nCL K1,R1>5\nBR G1\nLB K1\nIC R1\nRT\n",
    "float": "LB G1\nF1=F2*1.5\nF2=SI F1\nF3=SQ 2\nBR G1\n",
    "read": "LB G1\nR1=P\nR2=V\nR3=I1\nBR G1,MV=1\nBR G1\n",
}


def rows(full: bool) -> Iterator[Row]:
    """Lines a second of processor time for each program, rounds in turn with the bare loop."""
    for name, text in PROGRAMS.items():
        device = running(text)
        rounds = [(rate(device, each * SECONDS), calls()) for each in range(1, ROUNDS + 1)]
        assert device.running and not device.memory.error_flag
        ours, bare = zip(*rounds, strict=True)
        yield compared(f"program lines, {name}", "/s", ours, bare, "bare calls", aim=AIM, better="more")


def running(program: str) -> MCodeDevice:
    """A drive that runs the program."""
    device = MCodeDevice(DriveSpec(instruction_us=1), World(DriveSpec().world))
    for line in ("PG 1", *program.splitlines(), "E", "PG", "EX 1"):
        assert not device.execute(line, 0.0).refused, line
    return device


def rate(device: MCodeDevice, until: float) -> float:
    """Lines a second up to a time of the drive's."""
    before, begin = device.thread.executed, time.process_time()
    device.advance(until)
    return (device.thread.executed - before) / (time.process_time() - begin)


def calls(count: int = 1_000_000) -> float:
    """Calls a second of closures in a list."""
    values = {"R1": 0}

    def make() -> Callable[[], None]:
        def action() -> None:
            values["R1"] += 1

        return action

    code: Sequence[Callable[[], None]] = [make() for _ in range(10)]
    begin = time.process_time()
    for _ in range(count // 10):
        for action in code:
            action()
    return count / (time.process_time() - begin)


if __name__ == "__main__":
    main(rows)
