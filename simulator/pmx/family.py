"""The family of the Arcus PMX-2ED-SA controllers."""

from __future__ import annotations

from simulator.cell.spec import DriveSpec
from simulator.family import Family, Place, Unit
from simulator.pmx import drive_table, drive_text
from simulator.pmx.controller import BAUDS
from simulator.pmx.device import PmxDevice
from simulator.pmx.port import PmxPort


def build(spec: DriveSpec, place: Place) -> Unit:
    """Build a controller that is powered up. Raises Diagnostic for settings that it refuses, and for a program."""
    device = PmxDevice(spec, place.baud)
    return Unit(
        device=device,
        port=PmxPort(device, alone=place.alone, any_baud=place.baud not in BAUDS.values()),
        worlds=dict(zip("xy", device.worlds, strict=True)),
        inputs=drive_table.INPUTS,
        counts=drive_table.COUNTS,
    )


PMX = Family(
    name="pmx",
    read_drive=drive_table.read_drive,
    build=build,
    snapshots=drive_text.SNAPSHOTS,
    addressed=True,
)
