"""What a test sees behind the Python API: the session of the shell, the simulated cell, the thread, the end."""

from __future__ import annotations

from typing import Any

from multidrop.api import endings
from tests.support.cell_session import moves


def awaited(called: Any) -> Any:
    """The awaited session or drive that a blocking one calls."""
    return called._awaited


def shell_of(session: Any) -> Any:
    """The session of the shell that an awaited session of the API calls."""
    return session._shell


def thread_of(session: Any) -> Any:
    """The thread in which a blocking session works."""
    return session._thread


def floor_of(session: Any) -> Any:
    """The simulated cell of an awaited session, which outlives it."""
    return next(iter(shell_of(session).cells.values()))


def moving(floor: Any, later: float = 0.0) -> set[str]:
    """The drives that move, in the simulator; `later`: seconds from now, once the last ramp is over."""
    return {each.spec.name for each in floor.floor.drives if moves(each.device, floor.now() + later)}


async def break_off(session: Any) -> None:
    """End what an awaited session does, as an interrupted notebook and Ctrl+C do."""
    await session._break_off()


def end_all() -> None:
    """End what is open, as the end of the process does."""
    endings._end_all()
