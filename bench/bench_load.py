"""Processor time and bytes to the terminal while a drive prints at an even rate: TUI and prompt beside picocom.

Lines of 64 bytes on a pseudo-terminal; 177 a second fill a line at 115,200 baud. The drive is simulated in another
process. The screen has 120 x 40 characters, with the plot beside the transcript, and for the TUI 80 x 24, too.

Run: python bench/bench_load.py [--full]
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from bench_intake import OURS, PEERS, Line, Program, opened
from report import Row, main
from sim_process import busy
from terminal import Terminal

RATES = (0, 10, 177, 1000)
SMALL = (80, 24)
AIMS = {"177 lines/s": (8.0, 8.0), "a motor turns": (6.0, 8.0)}
"""Percent of a core that the TUI takes at most, on the small screen and on the large one."""
MOVING = b"SL 50000\r"
SECONDS = 4.0
Load = dict[str, tuple[float, float]]
"""Percent of a core and kB/s to the terminal, by what goes on."""


def rows(full: bool) -> Iterator[Row]:
    """Each rate, of ours beside picocom's."""
    seconds = SECONDS * (5 if full else 1)
    picocom = measure(PEERS[0], seconds) if shutil.which("picocom") else {}
    tui, shell = OURS[:2]
    for program in (replace(tui, name=f"{tui.name}, 80x24", size=SMALL), tui, shell):
        for what, (core, size) in measure(program, seconds).items():
            aims = AIMS.get(what) if program is not shell else None
            aim = aims[program.size != SMALL] if aims else None
            for unit, mine, index in (("% core", core, 0), ("kB/s", size, 1)):
                peer = picocom[what][index] if what in picocom else None
                ratio = mine / peer if peer else None
                name = "picocom" if peer is not None else ""
                yield Row(f"{program.name}: {what}", unit, mine, peer, name, ratio, aim if unit == "% core" else None)


def measure(program: Program, seconds: float) -> Load:
    """One program through all rates, and with a motor that turns."""
    found: Load = {}
    with opened(program) as (line, shown):
        assert isinstance(shown, Terminal)
        time.sleep(2.0)
        for rate in RATES:
            found[f"{rate} lines/s" if rate else "idle"] = load(line, shown, rate, seconds)
        if program.command is OURS[0].command:  # only the screen polls
            shown.type(MOVING)
            time.sleep(3.0)
            found["a motor turns"] = load(line, shown, 0, seconds)
    return found


def load(line: Line, shown: Terminal, rate: int, seconds: float) -> tuple[float, float]:
    """The cost of showing so many lines a second."""
    used, count, begin = busy(shown.pid), shown.count, time.monotonic()
    line.pace(rate, seconds)
    took = time.monotonic() - begin
    return 100 * (busy(shown.pid) - used) / took, (shown.count - count) / took / 1e3


if __name__ == "__main__":
    main(rows)
