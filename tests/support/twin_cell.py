"""The events of the twins of a cell, and a drive whose P counts what its shaft does."""

from __future__ import annotations

from typing import Any

from multidrop.shell.events import OnBus
from tests.support.cell_session import CellSession, party


def encoder(name: str = "a", world: str = "", **settings: int) -> str:
    """A drive on a party line with an encoder; `world`: lines of its surroundings."""
    drive = party(name, EE=1, VM=8000, A=40000, D=40000, MT=50, **settings)
    return f"{drive}\n[bus.drive.world]\n{world}" if world else drive


def of(cell: CellSession, kind: type) -> list[Any]:
    """The events of a kind on all buses."""
    return [event.event for event in cell.events if isinstance(event, OnBus) and isinstance(event.event, kind)]


async def run(cell: CellSession, *lines: str) -> None:
    """Run lines as typed."""
    for line in lines:
        await cell.session.run(line)
