"""A search of a line without a reply, beside the silence that the absent names require.

The search is `multidrop scan` in this process, on a pseudo-terminal at a baud rate: MCode at one baud rate. The peer
writes a print for each name without and with a checksum, and waits 20 ms after each: names x (bytes + 20 ms) x forms.

Run: python bench/bench_scan.py
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import serial
from report import Row, compared, main
from sim_process import served

from multidrop.families.lexium.host.mcode.framing import sealed
from multidrop.families.lexium.manual.statements import NAMES
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import open_buses
from multidrop.shell.connect.urls import parse
from multidrop.shell.finding.scanning import NothingFound, Scanning
from multidrop.shell.session import Session

CELL = '[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\nbaud = {baud}\n' + "".join(
    f'[[bus.drive]]\npersonality = "PMX"\nname = "{number}"\n' for number in ("00", "01")
)
"""Two controllers, which do not reply to MCode."""
SILENCE = 0.02


def rows(full: bool) -> Iterator[Row]:
    """All figures."""
    for baud in (9600, 115200):
        ours, peer = [], []
        with served(CELL.format(baud=baud)) as (_, port), tempfile.TemporaryDirectory() as folder:
            for _ in range(5 if full else 3):
                ours.append(asyncio.run(searched(port, baud, Path(folder))))
                peer.append(waited(port, baud))
        yield compared(f"scan without a reply, {baud}", "s", ours, peer, "the silence", aim=1.3, aim_of="ratio")


async def searched(port: str, baud: int, folder: Path) -> float:
    """Seconds of a search that finds nothing."""
    session = Session(Settings({}, folder / "config", folder / "state"))
    opener = partial(open_buses, state=session.settings.state)
    scanning = Scanning(session, opener, parse(f"{port}?dialect=mcode"), lambda drive: None)
    begin = time.perf_counter()
    try:
        await scanning.run([baud], False)
    except NothingFound:
        return time.perf_counter() - begin
    finally:
        await session.close()
    raise AssertionError("a drive replied")


def waited(port: str, baud: int) -> float:
    """Seconds that every name takes, asked in both forms."""
    with serial.Serial(port, baud, timeout=0) as line:
        begin = time.perf_counter()
        for name in NAMES:
            for frame in (f"{name}PR DN".encode(), sealed(f"{name}PR DN".encode())):
                line.write(frame + b"\n")
                time.sleep((len(frame) + 1) * 10 / baud + SILENCE)
        return time.perf_counter() - begin


if __name__ == "__main__":
    main(rows)
