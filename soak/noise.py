"""Noise: many commands on many lines, each line judged; in memory in virtual time, and on real ports."""

from __future__ import annotations

import asyncio
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from multidrop.shell.batch.replay import VirtualLoop
from soak.judge import Ledger
from soak.noisy_line import Setup, in_memory, on_usb, served

CHUNK = 250
"""Commands of one line; the next one has another seed."""
LEVELS = (1e-4, 3e-4, 1e-3)
IN_MEMORY = {"": in_memory, "usb": on_usb}
"""Places in memory, in virtual time."""


@dataclass(frozen=True)
class Job:
    """A line to be judged, how it is reached, and how many commands are sent. `place` is empty in memory, on a wire."""

    setup: Setup
    commands: int
    place: str = ""
    group: str = "checksum"

    @property
    def shown(self) -> str:
        """The job's row in the report."""
        return f"{self.setup.shown} {self.place or 'memory'}"


def judge(job: Job) -> Ledger:
    """Run one job in a loop of its own."""
    with tempfile.TemporaryDirectory() as folder:
        factory = None if job.place not in IN_MEMORY else VirtualLoop
        with asyncio.Runner(loop_factory=factory) as runner:
            return runner.run(_judge(job, Path(folder)))


async def _judge(job: Job, folder: Path) -> Ledger:
    make = IN_MEMORY.get(job.place)
    opened = make(job.setup, folder) if make else served(job.setup, folder, job.place)
    async with opened as line:
        return await line.run(job.commands)


def jobs(commands: int, on_ports: int) -> list[Job]:
    """Build the jobs: `commands` with a checksum in memory, and `on_ports` on each kind of port."""
    lines = [
        Setup(em=em, names=names, level=level, hangups=hangups)
        for em in range(4)
        for names, hangups in ((("a", "b", "c"), False), ((), False), (("a", "b"), True))
        for level in LEVELS
    ]
    found = list(_chunks(lines, commands, "checksum"))
    real = partial(Setup, baud=115200, latest=0.6, level=3e-4)
    for place in ("pty", "tcp", "rfc2217"):
        found += [Job(real(em=em), on_ports, place) for em in range(4)]
    found += [Job(real(em=1, checksum=0), on_ports, "udp", "no checksum")]
    bare = [Setup(em=em, checksum=0, level=level) for em in range(4) for level in LEVELS]
    found += _chunks(bare, commands // 10, "no checksum")
    pmx = Setup(language="pmx", names=("01", "02"), printing=False, level=3e-4)
    found += _chunks([pmx], commands // 10, "no checksum")
    tmcl = [Setup(language="tmcl", names=("1", "3"), printing=False, level=level) for level in LEVELS]
    found += _chunks(tmcl, commands // 10, "TMCL")
    for hangups in (False, True):
        usb = Setup(language="pmx", names=(), printing=False, level=0.03, hangups=hangups)
        found += [replace(each, place="usb") for each in _chunks([usb], commands // 10, "USB")]
    modbus = Setup(language="modbus", names=(), printing=False, latest=0.45)
    found += [Job(replace(modbus, hangups=hangups), on_ports, "modbus", "Modbus/TCP") for hangups in (False, True)]
    return found


def _chunks(lines: Sequence[Setup], commands: int, group: str) -> Iterator[Job]:
    """Divide the commands over the lines, each chunk with a seed of its own."""
    for number in range(-(-commands // CHUNK)):
        setup = lines[number % len(lines)]
        yield Job(replace(setup, seed=number + 1), min(CHUNK, commands - number * CHUNK), group=group)


def run(commands: int, on_ports: int) -> dict[str, dict[str, Ledger]]:
    """Judge everything, several lines side by side; return the ledgers by group and row."""
    ledgers: dict[str, dict[str, Ledger]] = {}
    todo = jobs(commands, on_ports)
    with ProcessPoolExecutor(int(os.environ.get("SOAK_JOBS", os.cpu_count() or 1))) as pool:
        for job, ledger in zip(todo, pool.map(judge, todo), strict=True):
            ledgers.setdefault(job.group, {}).setdefault(job.shown, Ledger()).add(ledger)
    return ledgers
