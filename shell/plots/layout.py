"""The views of a plot in the viewer: positions, velocities, and the log of commands and replies."""

from __future__ import annotations

from collections.abc import Set
from typing import Any

QUANTITIES = (("position", "steps"), ("velocity", "steps/s"))
"""The plotted quantities of an axis, with their units."""
COLOURS = {"command": 0x4FC3F7FF, "reply": 0xB0BEC5FF, "error": 0xEF5350FF, "note": 0xFFD54FFF}
"""The colour of a log line, by level."""


def layout(paths: Set[str]) -> Any:
    """The views of these entities, one below the other."""
    import rerun.blueprint as rrb

    def named(what: str) -> list[str]:
        return sorted(path for path in paths if path.endswith(f"/{what}"))

    charts = [rrb.TimeSeriesView(name=f"{what} ({unit})", contents=named(what)) for what, unit in QUANTITIES]
    log = rrb.TextLogView(name="commands and replies", contents=named("log"))
    return rrb.Blueprint(
        rrb.Vertical(*charts, log, row_shares=[2, 2, 1]),
        rrb.TimePanel(timeline="elapsed"),
        collapse_panels=True,
    )


def entity_path(rr: Any, *parts: str) -> str:
    """The path of an entity from its parts; empty parts are left out."""
    return str(rr.new_entity_path([part for part in parts if part]))
