"""Lines of one automation, the failure of one of its motions, and drives with switches."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from multidrop.base.errors import MotionFailed
from multidrop.shell.origin import PERSON
from multidrop.shell.session import Session
from tests.support.cell_session import bus, drive, pmx, session_on

SWITCHES = "[bus.drive.world.x]\nlimit_plus = 3000\nlimit_minus = -3000\nhome = [-1100, -1000]"


async def sent(session: Session, *lines: str) -> None:
    """Run lines as one automation, as `send` does."""
    async with session.automations.run(PERSON) as origin:
        for line in lines:
            await session.run(line, origin)


async def failed(session: Session, *lines: str) -> MotionFailed:
    """Run lines of which one must end by the failure of a motion; return that."""
    with pytest.raises(MotionFailed) as caught:
        await sent(session, *lines)
    return caught.value


@asynccontextmanager
async def controller(folder: Path, *world: str) -> AsyncIterator[Session]:
    """A session on two PMX controllers; the first is selected, and has a moderate speed."""
    async with session_on(folder, bus("stage", pmx("00", *world), pmx("01"), baud=0)) as session:
        for line in ("HSPD=2000", "ACC=50"):
            await session.run(f"@00 {line}")
        await session.run("/use 00")
        yield session


@asynccontextmanager
async def module(folder: Path, personality: str = "TMCM-1241", *world: str) -> AsyncIterator[Session]:
    """A session on one TMCL module."""
    async with session_on(folder, bus("line", drive(personality, "1", *world), baud=0)) as session:
        yield session


async def asked(session: Session, text: str) -> int:
    """The number that a line prints."""
    (printed,) = await session.drive().send(text)
    return int(printed)
