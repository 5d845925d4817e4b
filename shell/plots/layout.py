"""The views of a plot in the viewer: velocities, positions, values, states, and the log of commands and replies.

Time axes are linked. A view of one drive bears its name, and has no legend that could cover a curve, unless it has a
twin. A twin's position and velocity share the charts of its drive; the difference has a chart of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from typing import Any

from multidrop.shell.roles import DIFFERENCE

UNITS = {"position": "steps", "velocity": "steps/s", DIFFERENCE: "steps"}
"""The quantities of every drive, and the difference from its twin, with their units."""
TWIN = "twin"
"""The part of a path before the quantities of a twin; also its lane of states."""
RUNS, AGREES, DIFFERS = "runs", "agrees", "differs"
"""The states of a twin: it runs, it agrees with its drive again, or the two differ."""
STATE = "state"
"""The part of a path after which the name of a lane of states follows."""
COLOURS = {"command": 0x2F8FD0FF, "reply": 0x808A90FF, "error": 0xE04848FF, "note": 0xB07D10FF}
"""The colour of a log line, by level; each can be read on a dark and on a light ground."""
LINES = (0x3FA0E0FF, 0x009E73FF, 0xCC79A7FF, 0xD08C00FF, 0x7A6FD0FF, 0x808A90FF, 0x40B0A8FF, 0xA07850FF)
"""The colours of drives, which people with any colour vision can tell apart. None is that of an error."""
SHADES = {
    "on": 0x3FA0E0FF,
    "off": 0x80808050,
    "none": 0x80808050,
    RUNS: 0x80808050,
    AGREES: 0x80808050,
    DIFFERS: 0xE04848FF,
}
"""The colours of states that need no attention, and of what is on; the viewer chooses those of others."""
BAND, PALE = 4.0, 0x70
"""The width of a twin's line, and its opacity: a pale band in the colour of its drive, whose thin line lies in it."""
SIDE_BY_SIDE = 4
"""The greatest number of drives that open with views of their own."""


def layout(paths: Set[str], names: Mapping[str, str]) -> Any:
    """The views of these entities, one below the other; `names` are those of drives, by their paths."""
    import rerun.blueprint as rrb

    rows: list[Any] = [_charts(rrb, paths, names)] if _curves(paths) else []
    if lanes := sorted(path for path in paths if is_state(path)):
        rows.append(
            rrb.StateTimelineView(name="programs, errors, inputs, outputs", contents=lanes, time_view=_linked(rrb))
        )
    log = sorted(path for path in paths if path.rpartition("/")[2] == "log")
    rows.append(rrb.TextLogView(name="commands and replies", contents=log))
    shares = [4.0, 1.5, 1.0] if len(rows) == 3 else [4.0, 1.0][-len(rows) :]
    return rrb.Blueprint(
        rrb.Vertical(*rows, row_shares=shares),
        rrb.TimePanel(state="collapsed", timeline="elapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _charts(rrb: Any, paths: Set[str], names: Mapping[str, str]) -> Any:
    """The charts of one drive; of several, each drive beside the others, and all together."""
    drives = drives_of(paths)
    if len(drives) == 1:
        return _column(rrb, _curves(paths), names.get(drives[0], drives[0]))
    together = _column(rrb, _curves(paths), "")
    each = [
        _column(rrb, [path for path in _curves(paths) if _drive(path) == drive], names.get(drive, drive))
        for drive in drives
    ]
    beside = rrb.Horizontal(*each, name="each drive")
    few = len(drives) <= SIDE_BY_SIDE
    return rrb.Tabs(beside, together, active_tab=0 if few else 1)


def _column(rrb: Any, curves: Iterable[str], drive: str) -> Any:
    """One chart for each quantity, one below the other; `drive` names the only one, or is empty."""
    words: dict[str, list[str]] = {word: [] for word in UNITS}
    for path in sorted(curves):
        words.setdefault(path.rpartition("/")[2], []).append(path)
    charts = [
        rrb.TimeSeriesView(
            name=" ".join(filter(None, (drive.lstrip("/"), word, f"({UNITS[word]})" if word in UNITS else ""))),
            contents=found,
            axis_x=_linked(rrb),
            plot_legend=rrb.PlotLegend(visible=not drive or len(found) > 1),
        )
        for word, found in words.items()
        if found
    ]
    return rrb.Vertical(*charts, name=drive.lstrip("/") or "all drives together")


def _linked(rrb: Any) -> Any:
    """A time axis that moves with all others."""
    return rrb.TimeAxis(link="LinkToGlobal")


def is_state(path: str) -> bool:
    """Whether a path is that of a lane of states."""
    return path.split("/")[-2:-1] == [STATE]


def _curves(paths: Set[str]) -> list[str]:
    return sorted(path for path in paths if not is_state(path) and path.rpartition("/")[2] != "log")


def _drive(path: str) -> str:
    parent = path.rpartition("/")[0]
    return parent.removesuffix(f"/{TWIN}") or parent  # a line of drives may have that name


def drives_of(paths: Set[str]) -> list[str]:
    """The paths of the axes of drives that have curves."""
    return sorted({_drive(path) for path in _curves(paths)})


def entity_path(rr: Any, *parts: str) -> str:
    """The path of an entity from its parts; empty parts are left out."""
    return str(rr.new_entity_path([part for part in parts if part]))
