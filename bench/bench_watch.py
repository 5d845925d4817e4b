"""What watchers of a shared screen cost its host, and the time of a stop from one of them to the wires.

The host is on a terminal of its own, with three lines of one drive each that moves and is plotted. Five watchers read
all that it sends. Its processor time with and without them is measured by turns. A stop passes the tap of `bench_stop`;
its peer is the host's own stop key, by turns with it.

Run: python bench/bench_watch.py [--full]
"""

from __future__ import annotations

import os
import random
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from bench_stop import LOST, STOP, Taps, row, simulated
from report import Row, alone, main
from terminal import ROOT, Terminal, multidrop

sys.path.insert(0, str(ROOT))

from multidrop.features.shared_screen.wire import greeting

WATCHERS = 5
ROUND = 4.0
"""Seconds of one measurement of processor time."""
ROUNDS = 5
LINES = 3


class Watcher:
    """A connection to the host, of which everything is read."""

    def __init__(self, path: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(path)
        self._socket.sendall(greeting())
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while self._socket.recv(65536):
            pass

    def stop(self) -> None:
        """Send a stop."""
        self._socket.sendall(b"\x18")

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


def slowest(taps: Taps, press: Callable[[], None]) -> float:
    """The time from a stop to the slowest wire, ms."""
    taps.stops.clear()
    began = time.monotonic()
    press()
    while time.monotonic() < began + LOST:
        first = {index: at for index, at in reversed(taps.stops)}
        if len(first) == LINES:
            return (max(first.values()) - began) * 1000
        time.sleep(0.001)
    return LOST * 1000


def rows(full: bool) -> Iterator[Row]:
    """Processor time, then stops."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="md")))
        taps = Taps(0, simulated(folder, LINES, stack))
        stack.callback(taps.process.kill)
        urls = [f"tcp://127.0.0.1:{port}?party=0" for port in taps.ports]
        names = [f"w{number}" for number in range(LINES)]
        host = Terminal(multidrop("tui", *urls, "--share"), folder)
        stack.callback(host.end)
        host.until(b"LMDCM")
        time.sleep(1.0 + 0.5 * LINES)
        for number, name in enumerate(names, 1):
            host.type(b"\x1b%d" % number)
            time.sleep(0.2)
            host.type(f"/rename {name}\r".encode())
            time.sleep(0.2)
        moves = "".join(f"@{name}: SL 50000\r" for name in names).encode()
        host.type(f"/plot {' '.join(f'{name}:' for name in names)}\r".encode() + moves)
        time.sleep(2.0)
        path = str(folder / "state" / "screens" / f"{host.pid}.sock")
        bare, watched = cost(host.pid, path, ROUNDS)
        more = [after - before for before, after in zip(bare, watched, strict=True)]
        note = f"{statistics.median(bare):.0f} % without them"
        yield alone("five watchers cost the host, three drives move", "% core", more, aim=5.0, note=note)
        watchers = [Watcher(path) for _ in range(WATCHERS)]
        ours, keys = list[float](), list[float]()
        for _ in range(500 if full else 100):
            for times, press in ((ours, watchers[0].stop), (keys, lambda: host.type(STOP))):
                host.type(moves)
                time.sleep(random.uniform(0.2, 0.4))
                times.append(slowest(taps, press))
        for each in watchers:
            each.close()
        yield row("stop of a watcher, three lines", ours, keys, "the host's stop key", aim=20.0)


if __name__ == "__main__":
    main(rows)
