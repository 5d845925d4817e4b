"""Noise: commands on noisy lines over real ports, each line judged. Noise in memory is made by the simulation."""

from __future__ import annotations

import asyncio
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from soak.judge import Ledger
from soak.noisy_line import Setup, served


@dataclass(frozen=True)
class Job:
    """A line to be judged, the port over which it is reached, and how many commands are sent."""

    setup: Setup
    commands: int
    place: str
    group: str = "checksum"

    @property
    def shown(self) -> str:
        """The job's row in the report."""
        return f"{self.setup.shown} {self.place}"


def judge(job: Job) -> Ledger:
    """Run one job in a loop of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return asyncio.run(_judge(job, Path(folder)))


async def _judge(job: Job, folder: Path) -> Ledger:
    async with served(job.setup, folder, job.place) as line:
        return await line.run(job.commands)


def jobs(commands: int) -> list[Job]:
    """Build the jobs: so many commands on each kind of port."""
    line = partial(Setup, baud=115200, latest=0.6, level=3e-4)
    found = [Job(line(em=em), commands, place) for place in ("pty", "tcp", "rfc2217") for em in range(4)]
    found += [Job(line(em=1, checksum=0), commands, "udp", "no checksum")]
    pmx = line(language="pmx", names=("01", "02"), printing=False)
    tmcl = line(language="tmcl", names=("1", "3"), printing=False)
    found += [Job(pmx, commands, "pty", "no checksum"), Job(tmcl, commands, "pty", "TMCL")]
    modbus = Setup(language="modbus", names=(), printing=False, latest=0.45)
    found += [Job(replace(modbus, hangups=hangups), commands, "modbus", "Modbus/TCP") for hangups in (False, True)]
    return found


def run(commands: int) -> dict[str, dict[str, Ledger]]:
    """Judge everything, several lines side by side; return the ledgers by group and row."""
    ledgers: dict[str, dict[str, Ledger]] = {}
    todo = jobs(commands)
    with ProcessPoolExecutor(int(os.environ.get("SOAK_JOBS", os.cpu_count() or 1))) as pool:
        for job, ledger in zip(todo, pool.map(judge, todo), strict=True):
            ledgers.setdefault(job.group, {}).setdefault(job.shown, Ledger()).add(ledger)
    return ledgers
