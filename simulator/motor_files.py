"""The motor of a drive in a cell file: a name, or a file of the torque by speed. The simulation itself reads none."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from multidrop.base.files import LARGEST_FILE, split_lines
from multidrop.simulator.cell.drive_keys import read_file
from multidrop.simulator.cell.spec import DriveSpec, MotorSpec
from multidrop.simulator.cell.table import Folder, Table, quoted
from multidrop.simulator.torque import MOTORS

VALID = ", ".join((*MOTORS, "FILE.csv"))
MOST_ROWS = 1000
FASTEST_SPEED, STRONGEST = 1000.0, 10_000.0
"""The highest speed and torque of a row."""
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""A number of a row; `float` would also take `1_0` and digits of other scripts."""


def read_motor(table: Table, folder: Folder) -> MotorSpec | None:
    """Read `motor` of a drive: a class, a CSV file, or its rows. Raises Diagnostic."""
    given = table.values.get("motor")
    if given is None:
        return None
    if isinstance(given, list):
        columns = (("rev/s", 0.0, FASTEST_SPEED), ("N m", 0.0, STRONGEST))
        return MotorSpec(_checked(table, "motor", table.rows("motor", columns)))
    name = table.text("motor")
    if name in MOTORS:
        return MOTORS[name]
    if not name.lower().endswith(".csv"):
        raise table.wrong("motor", f"cannot be {quoted(name)}", f"valid: {VALID}")
    return MotorSpec(_checked(table, f"motor: {name}", tuple(_rows(table, folder, name))))


def with_motor(drive: DriveSpec, table: Table, folder: Folder) -> DriveSpec:
    """Give a drive the motor of its table, on each axis. Raises Diagnostic."""
    motor = read_motor(table, folder)
    worlds = [replace(world, motor=motor) for world in (drive.world, *drive.further)]
    if motor is None and any(world.friction or world.inertia for world in worlds):
        raise table.wrong("motor", "is missing, and the world has friction or inertia", f"valid: {VALID}")
    return replace(drive, world=worlds[0], further=tuple(worlds[1:]))


def _rows(table: Table, folder: Folder, name: str) -> Iterator[tuple[float, ...]]:
    text, head = read_file(name, "motor", table, folder, LARGEST_FILE).decode("utf-8-sig", "replace"), ["rev/s", "N m"]
    for number, line in enumerate(split_lines(text), 1):
        text = line.partition("#")[0].strip()
        fields = [part.strip() for part in text.split(",")]
        if not text:
            continue
        first, head = fields == head, []
        if first:
            continue
        where = f"motor: {name}:{number}"
        if len(fields) != 2 or not all(map(_NUMBER.fullmatch, fields)):
            raise table.wrong(where, f"cannot be {quoted(text)}", "valid: rev/s, N m, as in 5, 0.38")
        speed, torque = map(float, fields)
        if not (0 <= speed <= FASTEST_SPEED and 0 <= torque <= STRONGEST):
            hint = f"valid: 0 to {FASTEST_SPEED:g} rev/s, 0 to {STRONGEST:g} N m"
            raise table.wrong(where, f"is out of range: {quoted(text)}", hint)
        yield speed, torque


def _checked(table: Table, key: str, rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, float], ...]:
    if not 2 <= len(rows) <= MOST_ROWS:
        raise table.wrong(key, f"has {len(rows)} rows", f"valid: 2 to {MOST_ROWS}, each a speed and a torque")
    if rows[0][0] or not rows[0][1]:
        raise table.wrong(key, f"begins at {rows[0][0]:g}, {rows[0][1]:g}", "the first row is 0 and the holding torque")
    for (low, _), (high, _) in pairwise(rows):
        if low >= high:
            raise table.wrong(key, f"must go up in speed, not from {low:g} to {high:g} rev/s")
    return tuple((speed, torque) for speed, torque in rows)
