"""Lines of one automation, and the failure of one of its motions."""

from __future__ import annotations

import pytest

from multidrop.base.errors import MotionFailed
from multidrop.shell.origin import PERSON
from multidrop.shell.session import Session


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
