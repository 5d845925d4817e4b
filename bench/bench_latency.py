"""How long a reply takes over a pseudo-terminal: `multidrop sim` on an unpaced line beside bare processes that echo.

Both of these read up to the end of a request and write the same answer, and do nothing else: one in a blocking loop,
one in an event loop, which is what a server of many lines needs at the least. Rounds take turns, so that whatever else
the machine does meets all.

Run: python bench/bench_latency.py
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

from report import Row, compared, main, percentile
from sim_process import served

AIMS = {"bare process": 2.5, "bare event loop": 1.5}
ROUNDS = 15
TRIPS = 300
CELL = '[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1 }\n'
EXCHANGES = {"PR P": (b"PR P\r", b"\r\n0\r\n"), "VM=400000": (b"VM=400000\r", b"\r\n")}
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


def rows(full: bool) -> Iterator[Row]:
    """Each exchange: the median trip, and what one in a hundred takes at least."""
    with served(CELL) as (_, sim):
        for name, (request, answer) in EXCHANGES.items():
            with bare("blocking", answer) as blocking, bare("loop", answer) as loop:
                yield from compare(name, (sim, blocking, loop), request, answer, TRIPS * (5 if full else 1))


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


def compare(name: str, places: tuple[str, ...], request: bytes, answer: bytes, trips: int) -> Iterator[Row]:
    """Rounds of all in turn."""
    rounds: list[list[list[float]]] = [[] for _ in places]
    with ExitStack() as stack:
        ports = [os.open(each, os.O_RDWR | os.O_NOCTTY) for each in places]
        for port in ports:
            stack.callback(os.close, port)
        for _ in range(ROUNDS):
            for port, taken in zip(ports, rounds, strict=True):
                taken.append([round_trip(port, request, answer) for _ in range(trips)])
    for what, figure in (("", statistics.median), (", 99 of 100 within", slow)):
        ours, *peers = [[figure(trips) for trips in taken] for taken in rounds]
        for (peer, aim), theirs in zip(AIMS.items(), peers, strict=True):
            bound = {} if what else {"aim": aim, "aim_of": "ratio"}
            yield compared(f"simulated reply to {name}{what}", "us", ours, theirs, peer, **bound)


def slow(trips: list[float]) -> float:
    """What one in a hundred takes at least."""
    return percentile(trips, 99)


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
    main(rows)
