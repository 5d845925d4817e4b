"""A TMCL module as it was read, as the `[[bus.drive]]` table of a cell file; and that table as settings to write."""

from __future__ import annotations

from multidrop.dialects.tmcl.manual.commands import Global
from multidrop.dialects.values import Snapshot, Value
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.cell.writer import DriveText, Entry, remark
from multidrop.simulator.family import Snapshots, StoredProgram
from multidrop.simulator.tmcl.drive_table import GLOBAL_PREFIX, stored

ADDRESS = f"{GLOBAL_PREFIX}{int(Global.ADDRESS)}"
"""The parameter that has a key of its own."""
BAUD = f"{GLOBAL_PREFIX}{int(Global.BAUD)}"


def describe(snapshot: Snapshot) -> DriveText:
    """Make the table of a module."""
    readings = [each for each in snapshot.readings.readings if each.name != ADDRESS]
    return DriveText(
        personality="TMCM",
        name=snapshot.name,
        remarks=[
            *snapshot.remarks,
            *(f"not in set: {each.name} = {each.value}" for each in readings if not stored(each.name)),
        ],
        unread=snapshot.readings.unread,
        settings=[Entry(each.name, each.value, remark(each)) for each in readings if stored(each.name)],
        identity=[
            *([Entry("version", snapshot.version)] if snapshot.version else []),
            *(Entry(key, counts[0]) for key, counts in snapshot.counters.items()),
        ],
        baud=snapshot.baud,
    )


def wanted(spec: DriveSpec) -> dict[str, Value]:
    """The settings of a module in a cell file, but not its baud rate, which would cut the line off at once."""
    settings = {name: held for name, held in spec.set.items() if not isinstance(held, tuple) and name != BAUD}
    return {ADDRESS: int(spec.name), **settings}


def program(spec: DriveSpec) -> StoredProgram:
    """Return no program: direct mode has none."""
    return StoredProgram()


SNAPSHOTS = Snapshots(describe, wanted, program)
