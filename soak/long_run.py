"""The long run: eight lines with polls, programs that print, macros and plots; memory, descriptors and rates over time.

In virtual time the session runs on cells in this process. In real time the app shows it, on pseudo-terminals.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import importlib.util
import os
import statistics
import tempfile
import time
from collections import Counter
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from multidrop.drives.events import Sample
from multidrop.macros import Macro
from multidrop.macros.model import MacroStep
from multidrop.shell.batch.virtual_loop import VirtualLoop
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Failed, OnBus
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import play
from multidrop.shell.session import Session
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor

TABS = 8
SLICES = 8
PERIOD = 2.0
"""Of the polls, s."""
PROGRAM = 'PG 1\nLB G1\nPR "tick ",R3\nIC R3\nH 3000\nBR G1\nE\nPG\n'
MACRO = ("R1=5", "PR R1", "MR 1000", "/wait stopped 30", "/sleep 1")
GROWTH = 8_000_000
"""Most bytes of growth after the first quarter: a leak of the transcript or of events is larger."""
DRIFT = 0.1
"""Greatest difference between the rates of the first and the second half, as a part; in real time three times that."""


def cell(served: bool) -> str:
    """The lines, each with two drives."""
    text = ""
    for number in range(TABS):
        text += f'[[bus]]\nname = "tab{number}"\nbaud = 19200\n' + f'serve = ["pty:tab{number}"]\n' * served
        for name in "ab":
            text += f'[[bus.drive]]\npersonality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = 1, CK = 1 }}\n'
            text += 'program = "tick.mxt"\n' * (name == "b")
    return text


class LongRun:
    """A session at work, and what it costs."""

    def __init__(self, session: Session, seconds: float, drift: float = DRIFT) -> None:
        self.session, self.slice, self.drift = session, seconds / SLICES, drift
        self.samples: Counter[str] = Counter()
        self.rates: list[float] = []
        """Samples a second of all lines, by slice."""
        self.memory: list[int] = []
        self.descriptors: list[int] = []
        self.played = 0
        self.failed: list[str] = []

    async def run(self) -> tuple[dict[str, Any], list[str]]:
        """Work through all slices; return figures and failures."""
        session = self.session
        session.subscribe(self._take)
        for number, bus in enumerate(session.buses.values()):
            bus.telemetry.subscribe(("a", "b"), PERIOD)
            if number % 2:  # a print may collide with a reply, so macros play on the other lines
                await session.run(f"@{bus.name}:b EX G1")
        player = asyncio.create_task(self._play())
        loop = asyncio.get_running_loop()
        for _ in range(SLICES):
            self.samples.clear()
            begun = loop.time()
            await asyncio.sleep(self.slice)
            self.rates.append(self.samples.total() / (loop.time() - begun))
            gc.collect()
            self.memory.append(resident())
            self.descriptors.append(descriptors())
        player.cancel()
        await asyncio.gather(player, return_exceptions=True)
        return self._figures(), self._failures()

    def _take(self, event: object) -> None:
        if isinstance(event, OnBus) and isinstance(event.event, Sample):
            self.samples[event.bus] += 1
        elif isinstance(event, Failed):
            self.failed.append(event.text)

    async def _play(self) -> None:
        """Play a macro on one line after another."""
        for number in range(10**9):
            at = f"tab{2 * number % TABS}:a"
            lines = [line if line.startswith("/") else f"@{at} {line}" for line in MACRO]
            await play(self.session, PERSON, Macro("soak", tuple(MacroStep(0.1, line) for line in lines)), {})
            self.played += 1

    def _figures(self) -> dict[str, Any]:
        return {
            "slice s": round(self.slice, 1),
            "samples a second": [round(rate, 2) for rate in self.rates],
            "memory MB": [round(each / 1e6, 1) for each in self.memory],
            "descriptors": self.descriptors,
            "macros played": self.played,
        }

    def _failures(self) -> list[str]:
        failures = []
        quarter = SLICES // 4
        if (growth := self.memory[-1] - self.memory[quarter]) > GROWTH:
            failures.append(f"memory grew by {growth / 1e6:.1f} MB")
        if max(self.descriptors[quarter:]) > self.descriptors[quarter]:
            failures.append(f"descriptors grew: {self.descriptors}")
        early, late = (statistics.median(half) for half in (self.rates[: SLICES // 2], self.rates[SLICES // 2 :]))
        if abs(late - early) > self.drift * early:
            failures.append(f"rates drift: {self.rates}")
        if not self.played:
            failures.append("no macro was played to its end")
        return failures + self.failed[:5]


def in_virtual_time(hours: float) -> tuple[dict[str, Any], list[str]]:
    """Run so many hours of virtual time."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, asyncio.Runner(loop_factory=VirtualLoop) as runner:
        figures, failures = runner.run(_simulated(Path(folder), 3600 * hours))
    return {"virtual hours": hours, "took s": round(time.monotonic() - begun), **figures}, failures


async def _simulated(folder: Path, seconds: float) -> tuple[dict[str, Any], list[str]]:
    _write(folder, served=False)
    session = _session(folder)
    try:
        await session.open(f"sim:{folder / 'cell.toml'}")
        return await LongRun(session, seconds).run()
    finally:
        await session.close()


def in_real_time(minutes: float) -> tuple[dict[str, Any], list[str]]:
    """Run so many minutes with the app and a tab for each line, and with a plot if rerun is installed."""
    with tempfile.TemporaryDirectory() as folder:
        figures, failures = asyncio.run(_shown(Path(folder), 60 * minutes))
    return {"minutes": minutes, **figures}, failures


async def _shown(folder: Path, seconds: float) -> tuple[dict[str, Any], list[str]]:
    from multidrop.tui.app import MultidropApp
    from multidrop.tui.assist import Assist

    _write(folder, served=True)
    spec = cells.load(str(folder / "cell.toml"))
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(spec))
        stack.callback(floor.close)
        for bus in spec.buses:
            await serve_bus(floor, bus, stack)
        session = _session(folder)
        stack.push_async_callback(session.close)
        urls = [f"serial:{folder / bus.name}?baud=19200&drives=a,b" for bus in spec.buses]
        app = MultidropApp(session, urls, Assist(session, session.settings))
        pilot = await stack.enter_async_context(app.run_test(size=(100, 40)))
        while len([bus for bus in session.buses.values() if bus.drives]) < TABS:
            await pilot.pause(0.1)
        with contextlib.chdir(folder):
            if importlib.util.find_spec("rerun"):
                await session.run("/plot plot.rrd")
            return await LongRun(session, seconds, 3 * DRIFT).run()


def _write(folder: Path, served: bool) -> None:
    (folder / "tick.mxt").write_text(PROGRAM)
    (folder / "cell.toml").write_text(cell(served))


def _session(folder: Path) -> Session:
    return Session(Settings({}, folder / "config", folder / "state", data=folder / "data"))


def resident() -> int:
    """The resident memory of this process, bytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def descriptors() -> int:
    """The number of open descriptors."""
    return len(os.listdir("/proc/self/fd"))
