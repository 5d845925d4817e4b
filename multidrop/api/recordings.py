"""Plots in files, read back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dialects import Diagnostic
from dialects.files import why
from multidrop.api.samples import Sample, Samples
from shell.plots.sink import load

QUANTITIES = ("position", "velocity")
Key = tuple[float, str, str]
"""Seconds since the plot began, drive, axis."""


def read_rrd(file: str | Path) -> Samples:
    """Read the samples of a plot that multidrop wrote. Raises Diagnostic for another file, and without rerun."""
    load()
    path = Path(file)
    if not path.exists():
        raise Diagnostic("cannot be read: there is no such file", str(path))
    rows: dict[Key, dict[str, float]] = {}
    for drive, axis, what, elapsed, wall, value in _values(path):
        rows.setdefault((elapsed, drive, axis), {"time": wall})[what] = value
    whole = (each for each in sorted(rows.items()) if all(what in each[1] for what in QUANTITIES))
    found = Samples(
        Sample(elapsed, row["time"], drive, axis, int(row["position"]), int(row["velocity"]))
        for (elapsed, drive, axis), row in whole
    )
    if not found:
        raise Diagnostic(
            "has no samples of multidrop", str(path), "multidrop plot URL --to FILE.rrd writes such a file"
        )
    return found


def _values(path: Path) -> Iterator[tuple[str, str, str, float, float, float]]:
    """Drive, axis, quantity, elapsed, time of day and value of each entry."""
    from rerun.chunk import RrdReader

    try:
        for chunk in RrdReader(str(path)).stream():
            series = _series(chunk.entity_path)
            if series is not None and "elapsed" in chunk.timeline_names:
                yield from ((*series, *row) for row in _column(chunk.to_record_batch()))
    except (OSError, RuntimeError, ValueError) as problem:
        reason = why(problem) if isinstance(problem, OSError) else "not a recording of rerun"
        raise Diagnostic(f"cannot be read: {reason}", str(path)) from None


def _series(entity: str) -> tuple[str, str, str] | None:
    """The drive, axis and quantity of an entity `/BUS/ADDRESS/AXIS/position`; None for another one."""
    parts = entity.strip("/").replace("\\", "").split("/")
    if len(parts) < 2 or parts[-1] not in QUANTITIES:
        return None
    bus, address, axis = (*parts[:-1], "", "")[:3]
    return f"{bus}:{address}" if address else bus, axis, parts[-1]


def _column(batch: Any) -> Iterator[tuple[float, float, float]]:
    names = batch.schema.names
    if "Scalars:scalars" not in names:
        return
    for elapsed, wall, values in zip(
        batch.column("elapsed"), batch.column("time"), batch.column("Scalars:scalars"), strict=True
    ):
        if elapsed.is_valid and values.as_py():
            yield elapsed.value / 1e9, wall.value / 1e9, values.as_py()[0]
