"""The `world` table of a drive in a cell file: what surrounds each of its axes."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.cell.table import Table

KEYS = ("home", "limit_plus", "limit_minus", "stall_at", "load", "inputs", "analog", "locked")
"""Keys for every drive."""
ENCODER_KEYS = ("index", "encoder", "slip")
"""Further keys for a drive with a separate encoder."""


def read_world(table: Table, inputs: Sequence[int], counts: int) -> WorldSpec:
    """Read the surroundings of one axis of a drive with these inputs and an analog input up to `counts`."""
    changes = table.rows("inputs", (("seconds", 0, 1e9), ("input", min(inputs), max(inputs)), ("level", 0, 1)))
    for _, n, _ in changes:
        if n not in inputs:
            raise table.wrong("inputs", f"has no input {n:g}", f"valid: {', '.join(map(str, sorted(inputs)))}")
    analog = table.rows("analog", (("seconds", 0, 1e9), ("counts", 0, counts)))
    locked = table.rows("locked", (("from", 0, 1e9), ("to", 0, 1e9)))
    for begin, end in locked:
        if begin >= end:
            raise table.wrong("locked", f"rows must go up, not from {begin:g} to {end:g}")
    return WorldSpec(
        home=table.edges("home"),
        limit_plus=table.position("limit_plus"),
        limit_minus=table.position("limit_minus"),
        stall_at=table.position("stall_at"),
        load=table.number("load", 0.0, low=0.0, high=10.0),
        inputs=tuple((t, int(n), int(level)) for t, n, level in changes),
        analog=tuple((t, int(value)) for t, value in analog),
        locked=tuple((begin, end) for begin, end in locked),
        index=table.number("index", 800.0, low=-(2.0**40), high=2.0**40),
        encoder=table.number("encoder", 1.0, low=0.0, high=1000.0),
        slip=table.number("slip", 0.0, low=0.0, high=1.0),
    )


def read_worlds(
    table: Table, axes: Sequence[str], keys: Sequence[str], inputs: Sequence[int], counts: int
) -> tuple[WorldSpec, ...]:
    """Read the surroundings of each axis from a table of its own; keys without an axis belong to the first axis."""
    table.only(*keys, *axes)
    parts = [table.table(axis, f"[bus.drive.world.{axis}]") for axis in axes]
    for part in parts:
        part.only(*keys)
    first = parts[0]
    for key in keys:
        if key in first.values and key in table.values:
            raise first.wrong(key, "is given twice", f"keys without an axis belong to {axes[0]}")
    both = Table({**table.values, **first.values}, first.where if first.values else table.where)
    return tuple(read_world(part, inputs, counts) for part in (both, *parts[1:]))
