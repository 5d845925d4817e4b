"""The family of the TMCL modules."""

from __future__ import annotations

from multidrop.dialects.family import Motion
from multidrop.dialects.tmcl.manual.commands import BAUDS, Axis
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.family import Family, Place, Shadow, Unit
from multidrop.simulator.tmcl import drive_text
from multidrop.simulator.tmcl.drive_table import read_drive, split_settings
from multidrop.simulator.tmcl.module import VERSION, TmclModule
from multidrop.simulator.tmcl.port import TmclPort
from multidrop.simulator.world import World


def build(spec: DriveSpec, place: Place) -> Unit:
    """Build a module that is powered up."""
    world = World(spec.world)
    axis, module = split_settings(spec.set)
    own = spec.identity
    position = own.counters.get("position", (0,))[0]
    device = TmclModule(int(spec.name), world, axis, module, place.baud, own.version or VERSION, position)
    port = TmclPort(device, any_baud=place.baud not in BAUDS.values())
    return Unit(device=device, port=port, worlds={"": world}, shadow=_shadow(device), single_supply=True)


def _shadow(device: TmclModule) -> Shadow:
    motor = device.motor

    def motion(now: float) -> tuple[Motion, ...]:
        return (Motion(motor.read(Axis.ACTUAL_POSITION, now), motor.read(Axis.ACTUAL_VELOCITY, now)),)

    return Shadow(lambda: None, motion, lambda _, position, now: motor.stand_at(position, now))


TMCL = Family(
    name="tmcl",
    read_drive=read_drive,
    build=build,
    snapshots=drive_text.SNAPSHOTS,
    addressed=True,
)
