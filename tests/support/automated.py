"""An automation whose lines are all those that a session is given, as a command or a program has one."""

from __future__ import annotations

from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager

from multidrop.shell.automation_record import Claim
from multidrop.shell.origin import Origin
from multidrop.shell.session import Session


@asynccontextmanager
async def automated(session: Session, name: str = "", claims: Collection[Claim] = ()) -> AsyncIterator[Origin]:
    """Run the body as an automation, or as a part of the one that the session has."""
    before = session.origin
    async with session.automations.run(before, name, claims) as origin:
        session.origin = origin
        try:
            yield origin
        finally:
            session.origin = before
