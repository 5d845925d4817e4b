"""The family of the Arcus PMX-2ED-SA controllers."""

from __future__ import annotations

from multidrop.dialects.family import Motion
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.family import Family, Place, Shadow, Unit
from multidrop.simulator.pmx import drive_table, drive_text
from multidrop.simulator.pmx.controller import BAUDS
from multidrop.simulator.pmx.device import PmxDevice
from multidrop.simulator.pmx.port import PmxPort
from multidrop.simulator.pmx.program_commands import PROGRAMS

AXES = "xy"


def build(spec: DriveSpec, place: Place) -> Unit:
    """Build a controller that is powered up. Raises Diagnostic for settings that it refuses, and for a program."""
    device = PmxDevice(spec, place.baud)
    return Unit(
        device=device,
        port=PmxPort(device, alone=place.alone, any_baud=place.baud not in BAUDS.values()),
        worlds=dict(zip(AXES, device.worlds, strict=True)),
        shadow=_shadow(device),
        inputs=drive_table.INPUTS,
        counts=drive_table.COUNTS,
    )


def _shadow(device: PmxDevice) -> Shadow:
    axes = dict(zip(AXES, device.controller.axes, strict=True))

    def rest() -> None:
        for program in range(PROGRAMS):
            device.programs.control(program, 0, 0.0)

    def motion(now: float) -> tuple[Motion, ...]:
        return tuple(
            Motion(axis.position(now), axis.speed(now) if axis.pulses.moving(now) else 0, name)
            for name, axis in axes.items()
        )

    def align(name: str, position: int, now: float) -> None:
        if not axes[name].loop.on:  # where it follows the encoder and cannot be set (8.1.2)
            axes[name].set_position(position, now)

    return Shadow(rest, motion, align)


PMX = Family(
    name="pmx",
    read_drive=drive_table.read_drive,
    build=build,
    snapshots=drive_text.SNAPSHOTS,
    addressed=True,
)
