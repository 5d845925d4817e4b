"""How long a reply takes over a pseudo-terminal: `multidrop sim` on an unpaced line beside bare processes that echo.

Both of these read up to the end of a request and write the same answer, and do nothing else: one in a blocking loop,
one in an event loop, which is what a server of many lines needs at the least. Rounds take turns, so that whatever else
the machine does meets all. The aim: within twice the blocking one.

Run: python bench/bench_latency.py [ROUND TRIPS A ROUND]
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from sim_process import served

AIM = 2.0
ROUNDS = 15
CELL = '[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1 }\n'
ROWS = {"PR P": (b"PR P\r", b"\r\n0\r\n"), "VM=400000": (b"VM=400000\r", b"\r\n")}
PEER = """
import asyncio, os, sys, tty
answer = bytes.fromhex(sys.argv[2])
ours, theirs = os.openpty()
tty.setraw(theirs)
print(os.ttyname(theirs), flush=True)
held = b""
def read():
    global held
    held += os.read(ours, 4096)
    if held.endswith(b"\\r"):
        held = b""
        os.write(ours, answer)
if sys.argv[1] == "blocking":
    while True:
        read()
loop = asyncio.new_event_loop()
loop.add_reader(ours, read)
loop.run_forever()
"""


def main() -> None:
    """Measure, and print a table."""
    trips = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    print(f"round trips over a pty, us: medians of {ROUNDS} rounds of {trips}, and what 1 in 100 takes\n")
    print(
        f"{'':10} {'bare':>6} {'p99':>6} {'loop':>6} {'p99':>6} {'sim':>6} {'p99':>6} {'sim/bare':>9} {'sim/loop':>9}"
    )
    with served(CELL) as (_, sim):
        for name, (request, answer) in ROWS.items():
            with bare("blocking", answer) as blocking, bare("loop", answer) as loop:
                compare(name, (blocking, loop, sim), request, answer, trips)
    print(f"\naim: sim/bare at most {AIM:g}")


@contextmanager
def bare(kind: str, answer: bytes) -> Iterator[str]:
    """A process that echoes, and the port that it is on."""
    command = [sys.executable, "-c", PEER, kind, answer.hex()]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as peer:
        try:
            assert peer.stdout is not None
            yield peer.stdout.readline().strip()
        finally:
            peer.kill()


def compare(name: str, places: tuple[str, str, str], request: bytes, answer: bytes, trips: int) -> None:
    """Rounds of all in turn, and a line of the table."""
    times: list[list[list[float]]] = [[], [], []]
    with ExitStack() as stack:
        ports = [os.open(each, os.O_RDWR | os.O_NOCTTY) for each in places]
        for port in ports:
            stack.callback(os.close, port)
        for _ in range(ROUNDS):
            for port, rounds in zip(ports, times, strict=True):
                rounds.append([round_trip(port, request, answer) for _ in range(trips)])
    middles = [[statistics.median(trips) for trips in rounds] for rounds in times]
    figures = [f"{each:6.0f}" for rounds in times for each in (typical(rounds), slow(rounds))]
    print(f"{name:10} {' '.join(figures)} {ratio(middles, 0):9.2f} {ratio(middles, 1):9.2f}")


def ratio(middles: list[list[float]], beside: int) -> float:
    """The median of the ratios of rounds side by side."""
    return statistics.median(sim / other for sim, other in zip(middles[2], middles[beside], strict=True))


def typical(rounds: list[list[float]]) -> float:
    """The median."""
    return statistics.median(each for trips in rounds for each in trips)


def slow(rounds: list[list[float]]) -> float:
    """What one in a hundred takes at least."""
    return statistics.quantiles((each for trips in rounds for each in trips), n=100)[98]


def round_trip(port: int, request: bytes, answer: bytes) -> float:
    """Microseconds from the request to the end of its answer."""
    begin = time.perf_counter()
    os.write(port, request)
    held = b""
    while len(held) < len(answer):
        held += os.read(port, 4096)
    took = (time.perf_counter() - begin) * 1e6
    assert held == answer, held
    return took


if __name__ == "__main__":
    main()
