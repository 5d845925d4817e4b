"""The samples in the file of a plot, for `multidrop.read_rrd`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from multidrop.api.telemetry import Sample, Samples
from multidrop.base.errors import Diagnostic
from multidrop.base.files import why
from multidrop.features.plot_files.rerun_calls import load
from multidrop.shell.plots.batch import TWIN

QUANTITIES = ("position", "velocity")
"""Both are in every sample of a drive, and of its twin."""
Key = tuple[float, str, str]
"""Seconds since the plot began, drive, axis."""


def read(file: str | Path, twin: bool) -> Samples:
    """Read them; `twin`: those that the twins of its drives predicted. Raises Diagnostic: see `multidrop.read_rrd`."""
    load()
    path = Path(file)
    if not path.exists():
        raise Diagnostic("cannot be read: there is no such file", str(path))
    rows: dict[Key, dict[str, float]] = {}
    for drive, axis, what, elapsed, wall, value in _values(path, twin):
        rows.setdefault((elapsed, drive, axis), {"time": wall})[what] = value
    whole = (row for row in sorted(rows.items()) if all(what in row[1] for what in QUANTITIES))
    samples = Samples(
        Sample(elapsed, row["time"], drive, axis, int(row["position"]), int(row["velocity"]))
        for (elapsed, drive, axis), row in whole
    )
    if not samples:
        missing, hint = (
            ("twins", "/twin on, then /plot --to FILE.rrd")
            if twin
            else ("multidrop", "multidrop plot URL --to FILE.rrd")
        )
        raise Diagnostic(f"has no samples of {missing}", str(path), f"{hint} writes such a file")
    return samples


def _values(path: Path, twin: bool) -> Iterator[tuple[str, str, str, float, float, float]]:
    """Drive, axis, quantity, elapsed, time of day and value of each entry."""
    from rerun.chunk import RrdReader

    try:
        for chunk in RrdReader(str(path)).stream():
            series = _series(chunk.entity_path, twin)
            if series is not None and "elapsed" in chunk.timeline_names:
                yield from ((*series, *row) for row in _column(chunk.to_record_batch()))
    except (OSError, RuntimeError, ValueError) as problem:
        reason = why(problem) if isinstance(problem, OSError) else "not a recording of rerun"
        raise Diagnostic(f"cannot be read: {reason}", str(path)) from None


def _series(entity: str, twin: bool) -> tuple[str, str, str] | None:
    """The drive, axis and quantity of an entity `/BUS/ADDRESS/AXIS/position`; None for another one.

    `twin`: of `/BUS/ADDRESS/AXIS/twin/position`.
    """
    *parts, what = entity.strip("/").replace("\\", "").split("/")
    of_twin = len(parts) > 1 and parts[-1] == TWIN
    if not parts or what not in QUANTITIES or of_twin is not twin:
        return None
    bus, address, axis = (*(parts[:-1] if twin else parts), "", "")[:3]
    return f"{bus}:{address}" if address else bus, axis, what


def _column(batch: Any) -> Iterator[tuple[float, float, float]]:
    names = batch.schema.names
    if "Scalars:scalars" not in names:
        return
    for elapsed, wall, values in zip(
        batch.column("elapsed"), batch.column("time"), batch.column("Scalars:scalars"), strict=True
    ):
        if elapsed.is_valid and values.as_py():
            yield elapsed.value / 1e9, wall.value / 1e9, values.as_py()[0]
