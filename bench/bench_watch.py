"""What watchers of a shared screen cost its host, and the time of a stop from one of them.

The host is on a terminal of its own, with three simulated drives that move and are plotted. Five watchers read all
that it sends. Its processor time with and without them is measured by turns. A stop takes until the host has confirmed
that it is written; the peer is a byte through a bare event loop on a Unix socket and back.

Run: python bench/bench_watch.py [--full]
"""

from __future__ import annotations

import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from report import Row, alone, main, percentile
from terminal import ROOT, Terminal, multidrop

sys.path.insert(0, str(ROOT))

from multidrop.shell.watching.wire import greeting

WATCHERS = 5
ROUND = 4.0
"""Seconds of one measurement of processor time."""
ROUNDS = 5
TRIES = 100
PAUSE = 0.15
"""Seconds between two stops."""
BARE = """
import asyncio, sys
async def serve(reader, writer):
    while data := await reader.read(4096):
        writer.write(data)
async def main():
    server = await asyncio.start_unix_server(serve, sys.argv[1])
    await server.serve_forever()
asyncio.run(main())
"""


class Watcher:
    """A connection to the host, of which everything is read."""

    def __init__(self, path: str) -> None:
        self.heard: list[float] = []
        """When each stop was confirmed, CLOCK_MONOTONIC, s."""
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(path)
        self._socket.sendall(greeting())
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while data := self._socket.recv(65536):
            if re.search(rb'"Heard"', data):
                self.heard.append(time.monotonic())

    def stop(self) -> float:
        """Send a stop; return the time until it was confirmed, ms."""
        count, began = len(self.heard), time.monotonic()
        self._socket.sendall(b"\x18")
        while len(self.heard) == count and time.monotonic() < began + 3:
            time.sleep(0.0002)
        return (self.heard[-1] - began) * 1000 if len(self.heard) > count else 3000.0

    def close(self) -> None:
        """Leave."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()


def busy(pid: int, seconds: float) -> float:
    """The share of a core that a process takes, %."""

    def used() -> float:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    before, began = used(), time.monotonic()
    time.sleep(seconds)
    return (used() - before) / (time.monotonic() - began) * 100


def cost(pid: int, path: str, rounds: int) -> tuple[list[float], list[float]]:
    """The share of a core without watchers, and with them, by turns."""
    bare, watched = list[float](), list[float]()
    for _ in range(rounds):
        bare.append(busy(pid, ROUND))
        watchers = [Watcher(path) for _ in range(WATCHERS)]
        time.sleep(0.5)  # the transcript so far
        watched.append(busy(pid, ROUND))
        for each in watchers:
            each.close()
    return bare, watched


def echoes(folder: Path, tries: int) -> list[float]:
    """The time of a byte through a bare event loop and back, ms."""
    path = str(folder / "bare")
    with subprocess.Popen([sys.executable, "-c", BARE, path]) as process:
        while not Path(path).exists():
            time.sleep(0.01)
        times = list[float]()
        with socket.socket(socket.AF_UNIX) as made:
            made.connect(path)
            for _ in range(tries):
                began = time.monotonic()
                made.sendall(b"\x18")
                made.recv(1)
                times.append((time.monotonic() - began) * 1000)
                time.sleep(0.005)
        process.kill()
    return times


def run(full: bool) -> Iterator[Row]:
    """Measure both."""
    tries = TRIES * (5 if full else 1)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="md")))
        host = Terminal(multidrop("tui", "sim:#press", "--share"), folder)
        stack.callback(host.end)
        host.until(b"press: a b c")
        path = str(folder / "state" / "screens" / f"{host.pid}.sock")
        moves = b"".join(b"@%s SL %d\r" % (name, 50_000) for name in (b"a", b"b", b"c"))
        host.type(b"/plot a b c\r" + moves)
        time.sleep(2.0)
        bare, watched = cost(host.pid, path, ROUNDS)
        yield from of_cost(bare, watched)
        watchers = [Watcher(path) for _ in range(WATCHERS)]
        times = list[float]()
        for _ in range(tries):
            host.type(moves)
            time.sleep(PAUSE)
            times.append(watchers[0].stop())
        for each in watchers:
            each.close()
        peer = echoes(folder, tries)
        for name, n in (("median", 50), ("p99", 99)):
            ours, other = percentile(times, n), percentile(peer, n)
            aim = 20.0 if n == 99 else None
            yield Row(f"stop of a watcher, {name}", "ms", ours, other, "bare event loop", ours / other, aim)


def of_cost(bare: Sequence[float], watched: Sequence[float]) -> Iterator[Row]:
    more = [after - before for before, after in zip(bare, watched, strict=True)]
    note = f"{statistics.median(bare):.0f} % without them"
    yield alone("five watchers cost the host, three drives move", "% core", more, aim=5.0, note=note)


if __name__ == "__main__":
    main(run)
