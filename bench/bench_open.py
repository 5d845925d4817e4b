"""Opening a line: `send` beside a bare Python, a party line beside a loop of the same bytes, and 32 lines at once.

`send` reads a position at 9600 baud: with all settings in the URL, with those of last time, and for the first time. The
peer starts Python and imports asyncio and pyserial. A party line is opened through a bus in this process; the peer
writes the same bytes and waits for as many as came back.

Run: python bench/bench_open.py
"""

from __future__ import annotations

import asyncio
import os
import shutil
import string
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parent.parent))

import serial
from report import Row, compared, main
from sim_process import ROOT, all_served, served

from multidrop.dialects import Hints
from multidrop.drives.bus import Bus
from multidrop.drives.events import BusEvent, Traffic
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.transports.serial_port import open_serial

NAMES = string.ascii_letters + string.digits
BUS = '[[bus]]\nname = "line{number}"\nserve = ["pty:line{number}.tty"]\nbaud = {baud}\n'
DRIVE = '[[bus.drive]]\npersonality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = {em} }}\n'
BARE = [sys.executable, "-c", "import asyncio, serial"]
LINES = 32


def rows(full: bool) -> Iterator[Row]:
    """All figures."""
    yield from sends(15 if full else 5)
    for baud in (9600, 115200):
        for count in (1, 3, 16, 62):
            yield opened(count, baud, (3 if full else 1) if count > 16 else 5)
    yield side_by_side(5 if full else 3)


def cell(baud: int, names: str, lines: int = 1) -> str:
    """A cell of lines with the same drives."""
    drives = "".join(DRIVE.format(name=name, em=1) for name in names)
    return "".join(BUS.format(number=number, baud=baud) + drives for number in range(lines))


# send


def sends(rounds: int) -> Iterator[Row]:
    """Seconds that `send` takes beyond the peer."""
    cases = {
        "send PR P, all given": ("drives=a&party=1&checksum=0&em=1", "PR P", True),
        "send PR P, as last time": ("drives=a", "PR P", True),
        "send VM=, as last time": ("drives=a", "VM=300000", True),
        "send PR P, for the first time": ("drives=a", "PR P", False),
    }
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
    with served(cell(9600, "abc")) as (_, port), tempfile.TemporaryDirectory() as folder:
        os.environ.update(MULTIDROP_STATE_DIR=f"{folder}/state", MULTIDROP_CONFIG_DIR=f"{folder}/config")
        for name, (query, line, again) in cases.items():
            command = [sys.executable, "-m", "multidrop", "send", f"{port}?{query}", line]
            taken(command)
            for _ in range(rounds):
                if not again:
                    shutil.rmtree(f"{folder}/state")
                times[name].append((taken(BARE), taken(command)))
    for name, pairs in times.items():
        over, bare = [ours - peer for peer, ours in pairs], [peer for peer, _ in pairs]
        aim = 0.25 if "first" not in name else None
        yield Row(name, "s over peer", median(over), median(bare), "python, imports", aim=aim)


def taken(command: list[str]) -> float:
    """Seconds that a command takes."""
    begin = time.perf_counter()
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


# A party line


def opened(count: int, baud: int, rounds: int) -> Row:
    """Opening a party line, and the same bytes in a loop."""
    ours, peer = [], []
    with served(cell(baud, NAMES[:count])) as (_, port):
        for _ in range(rounds):
            took, exchanges = asyncio.run(identified(port, baud, NAMES[:count]))
            ours.append(took)
            peer.append(replayed(port, baud, exchanges))
    return compared(f"open {count} drives at {baud}", "s", ours, peer, "same bytes", aim=1.5, aim_of="ratio")


async def identified(port: str, baud: int, names: str) -> tuple[float, list[tuple[bytes, int]]]:
    """Seconds to find the drives, and what was written with how many bytes of reply."""
    exchanges: list[tuple[bytes, int]] = []

    def watch(event: BusEvent) -> None:
        if isinstance(event, Traffic) and event.outgoing:
            exchanges.append((event.data, 0))
        elif isinstance(event, Traffic):
            written, received = exchanges[-1]
            exchanges[-1] = (written, received + len(event.data))

    bus = Bus("line", await open_serial(port, baud), baud=baud)
    bus.watch(watch)
    bus.start()
    begin = time.perf_counter()
    drives = await bus.identify(Hints(drives=tuple(names), party=True))
    took = time.perf_counter() - begin
    assert all(drive.product for drive in drives)
    await bus.close()
    return took, exchanges


def replayed(port: str, baud: int, exchanges: list[tuple[bytes, int]]) -> float:
    """Seconds for the same bytes without any wait."""
    with serial.Serial(port, baud, timeout=5) as line:
        begin = time.perf_counter()
        for written, received in exchanges:
            line.write(written)
            assert len(line.read(received)) == received
        return time.perf_counter() - begin


# Lines at once


def side_by_side(rounds: int) -> Row:
    """Opening 32 lines of one drive, and one of them."""
    with all_served(cell(9600, "a", LINES)) as (_, ports), tempfile.TemporaryDirectory() as folder:
        times = [[asyncio.run(opened_all(chosen, folder)) for chosen in (ports, ports[:1])] for _ in range(rounds)]
    ours, peer = zip(*times, strict=True)
    return compared(f"open {LINES} lines at 9600", "s", ours, peer, "one line", aim=2.0)


async def opened_all(ports: list[str], folder: str) -> float:
    """Seconds to open lines side by side."""
    session = Session(Settings({}, Path(folder, "config"), Path(folder, "state")))
    begin = time.perf_counter()
    await session.open_all([f"{port}?drives=a" for port in ports])
    took = time.perf_counter() - begin
    assert len(session.buses) == len(ports)
    await session.close()
    return took


if __name__ == "__main__":
    main(rows)
