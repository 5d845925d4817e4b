"""The shop floor of simulated drives that `/sim` moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from shell.session import Session
    from simulator.serving.running import RunningFloor


def floor_of(session: Session) -> RunningFloor | None:
    """That of the selected bus, or the only one that is open; None where neither is."""
    here = session.floors.get(session.selected_bus)
    floors = {id(floor): floor for floor in session.floors.values()}
    return cast("RunningFloor | None", here or (next(iter(floors.values())) if len(floors) == 1 else None))
