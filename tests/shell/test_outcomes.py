"""How motions end, MCode: a wait succeeds or fails by how the motion ended, not by velocity alone."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from itertools import product
from pathlib import Path

import pytest

from multidrop.dialects import DriveError
from multidrop.dialects.errors import MotionFailed
from multidrop.shell.events import Failed, Notified
from multidrop.shell.session import Session
from tests.support.cell_session import bus, party, session_on

pytestmark = pytest.mark.virtual

ENCODER = {"EE": 1, "VM": 8000, "A": 40000, "D": 40000, "MT": 50}
STALLS = "[bus.drive.world]\nstall_at = 20000"
"""In steps: P stays at about 1571 counts of 4000."""


@asynccontextmanager
async def on(folder: Path, *lines: str, **settings: int) -> AsyncIterator[Session]:
    """A session on drives a and b; `lines` and settings are a's."""
    cell = bus("press", party("a", *lines, **{"CK": 0, **settings}), party("b", CK=0), baud=0)
    async with session_on(folder, cell) as session:
        yield session


async def sent(session: Session, *lines: str) -> None:
    """Run lines as one automation, as `send` does."""
    async with session.automations.run():
        for line in lines:
            await session.run(line)


async def failed(session: Session, *lines: str) -> MotionFailed:
    with pytest.raises(MotionFailed) as caught:
        await sent(session, *lines)
    return caught.value


async def value(session: Session, word: str) -> int:
    (text,) = await session.drive().send(f"PR {word}")
    return int(text)


def noted(session: Session) -> list[str]:
    events: Sequence[object] = session.events  # type: ignore[attr-defined]
    return [each.text for each in events if isinstance(each, Notified | Failed)]


@pytest.mark.parametrize(("em", "ck"), list(product((0, 1, 2, 3), (0, 1))))
async def test_a_stall_fails_the_wait_and_the_next_line_is_not_sent(tmp_path: Path, em: int, ck: int) -> None:
    async with on(tmp_path, STALLS, **ENCODER, EM=em, CK=ck) as session:
        failure = await failed(session, "MA 4000", "/wait stopped", "R1=777")
        assert failure.reason == "stalled" and failure.outcome == "stall" and failure.target == 4000
        assert failure.position is not None and 1000 < failure.position < 2000
        assert str(failure) == f"a stopped at {failure.position} of 4000: stalled"
        assert await value(session, "R1") == 0
        assert not any("old error" in each for each in noted(session))


@pytest.mark.parametrize(("em", "ck"), list(product((0, 1, 2, 3), (0, 1))))
async def test_a_move_that_reaches_its_target_does_not_fail(tmp_path: Path, em: int, ck: int) -> None:
    async with on(tmp_path, **ENCODER, EM=em, CK=ck) as session:
        await sent(session, "MA 4000", "/wait stopped", "MR -500", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777 and await value(session, "P") == 3500
