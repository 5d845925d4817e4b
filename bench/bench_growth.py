"""Growth of memory and processor time: with the lines received, with the tabs, with the drives on a line.

The transcript keeps 50,000 lines a bus, so memory must be flat beyond them. `--full` goes on to 10 million lines (some
minutes) and measures more tabs and drives.

Run: python bench/bench_growth.py [--full]
"""

from __future__ import annotations

import os
import shutil
import string
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from bench_intake import LAST, OURS, PEERS, Program, opened, seen
from bench_stop import simulated
from report import Row, main
from sim_process import busy, served
from terminal import Terminal, multidrop

KEPT = 50_000
LINES = (1_000, 10_000, 50_000, 200_000, 500_000)
MANY = (1_000, 10_000, 50_000, 200_000, 1_000_000, 5_000_000, 10_000_000)
TABS = (1, 8, 32)
MANY_TABS = (1, 2, 4, 8, 16, 32)
DRIVES = (1, 16, 62)
MANY_DRIVES = (1, 2, 4, 8, 16, 32, 62)
NAMES = string.ascii_lowercase + string.ascii_uppercase + string.digits
SECONDS = 4.0
MB = 1e6


def rows(full: bool) -> Iterator[Row]:
    """Lines, tabs, drives."""
    yield from lines(MANY if full else LINES)
    yield from tabs(MANY_TABS if full else TABS)
    yield from drives(MANY_DRIVES if full else DRIVES)


def lines(counts: tuple[int, ...]) -> Iterator[Row]:
    """Memory of the TUI after so many lines, beside picocom's, and what a retained line takes."""
    picocom = memory_after(PEERS[0], counts) if shutil.which("picocom") else {}
    ours = memory_after(OURS[0], counts)
    for count in counts:
        peer = picocom.get(count)
        ratio = ours[count] / peer if peer else None
        name = "picocom" if peer is not None else ""
        yield Row(f"tui: memory after {count:,} lines", "MB", ours[count] / MB, peer and peer / MB, name, ratio)
    yield Row("tui: memory a retained line", "bytes", (ours[KEPT] - ours[0]) / KEPT, note="of 64 bytes on the line")


def memory_after(program: Program, counts: tuple[int, ...]) -> dict[int, float]:
    """Resident memory of one process as lines come, bytes."""
    with opened(program) as (line, shown):
        found, done = {0: resident(shown.pid)}, 0
        for count in counts:
            shown.seek(LAST)
            line.flood(count - done)
            seen(line, shown)
            time.sleep(1.5)
            found[count], done = resident(shown.pid), count
    return found


def tabs(counts: tuple[int, ...]) -> Iterator[Row]:
    """Memory and processor time of the TUI with a drive in each tab, which it polls."""
    for count in counts:
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            urls = [f"tcp://{each}?party=0" for each in simulated(folder, count, stack)]
            yield from resting(f"{count} tabs", multidrop("tui", *urls), folder, stack)


def drives(counts: tuple[int, ...]) -> Iterator[Row]:
    """The same with so many drives on one party line at 115,200 baud."""
    for count in counts:
        names = NAMES[:count]
        one = '[[bus.drive]]\npersonality = "LMDCM"\nname = "{}"\nparty = true\nset = {{ EM = 1 }}\n'
        cell = '[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\nbaud = 115200\n' + "".join(map(one.format, names))
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            _, port = stack.enter_context(served(cell))
            url = f"serial:{port}?baud=115200&party=1&drives={','.join(names)}"
            yield from resting(f"{count} drives", multidrop("tui", url), folder, stack)


def resting(what: str, command: list[str], folder: Path, stack: ExitStack) -> Iterator[Row]:
    """A TUI without input, once everything is open."""
    begin = time.monotonic()
    shown = Terminal(command, folder)
    stack.callback(shown.end)
    shown.until(b"LMDCM", 120.0)
    settle(shown)
    opened_in = time.monotonic() - begin
    used, count, begin = busy(shown.pid), shown.count, time.monotonic()
    time.sleep(SECONDS)
    took = time.monotonic() - begin
    core = 100 * (busy(shown.pid) - used) / took
    note = f"{(shown.count - count) / took / 1e3:.1f} kB/s to the terminal; steady within {opened_in:.1f} s"
    yield Row(f"tui, {what}: processor time at rest", "% core", core, note=note)
    yield Row(f"tui, {what}: memory", "MB", resident(shown.pid) / MB)


def settle(shown: Terminal) -> None:
    """Until the output of two seconds is like that of the two before, for 30 s at most."""
    before = 0.0
    for _ in range(15):
        count = shown.count
        time.sleep(2.0)
        now = shown.count - count
        if before and 0.8 < now / before < 1.25:
            return
        before = max(1.0, now)


def resident(pid: int) -> float:
    """Resident memory, bytes."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split()[1])
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


if __name__ == "__main__":
    main(rows)
