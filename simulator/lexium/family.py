"""The family of the MCode drives: the Lexium MDrives of four kinds and the older MDrivePlus."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.family import Motion
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.family import Family, Place, Shadow, Unit
from multidrop.simulator.lexium import drive_table, drive_text
from multidrop.simulator.lexium.device import MCodeDevice
from multidrop.simulator.lexium.ports.mcode import MCodePort
from multidrop.simulator.lexium.ports.modbus import ModbusPort
from multidrop.simulator.lexium.ports.registers import Registers
from multidrop.simulator.lexium.power import BAUDS
from multidrop.simulator.lexium.state.models import MODELS
from multidrop.simulator.world import World

DEFAULT = 96
"""BD from the factory."""
ETHERNET = frozenset(name for name, model in MODELS.items() if model.ethernet)


def build(spec: DriveSpec, place: Place) -> Unit:
    """Build a drive that is powered up. Raises Diagnostic for settings that it refuses, and for a program."""
    world = World(spec.world)
    device = MCodeDevice(_at_baud(spec, place.baud), world)
    device.prints()  # no client can be connected at its sign-on
    model, ethernet = device.model, spec.personality in ETHERNET
    port = MCodePort(device, serial=not ethernet, baud=0 if model.waits_to_print else place.baud)
    return Unit(
        device=device,
        port=port,
        worlds={"": world},
        shadow=_shadow(device, port),
        inputs=model.points.inputs,
        counts=model.points.analog,
        single_supply=model.single_supply,
        connect=(lambda: _connect(device)) if ethernet else None,
    )


def _shadow(device: MCodeDevice, port: MCodePort) -> Shadow:
    def rest() -> None:
        device.escape(0.0)
        port.receive(b"\n", 0.0)  # the line feed without which party mode is not in force (5.1.105)
        port.sent(0.0)

    def motion(now: float) -> tuple[Motion, ...]:
        return (Motion(device.position(now), device.velocity(now)),)

    def align(_: str, position: int, now: float) -> None:
        device.execute(f"P={position}", now, immediate=True)

    return Shadow(rest, motion, align)


def _at_baud(spec: DriveSpec, baud: int) -> DriveSpec:
    """Set BD to the baud rate of the bus, where the cell file sets no other."""
    code = next((code for code, each in BAUDS.items() if each == baud), DEFAULT)
    if code == DEFAULT or "BD" in spec.set or spec.personality in ETHERNET:
        return spec
    return replace(spec, set={"BD": code, **spec.set})


def _connect(device: MCodeDevice) -> ModbusPort:
    motor = device.motor
    registers = Registers(
        device,
        errors=device.errors,
        inputs=device.inputs,
        trips=motor.trips,
        torque=motor.torque,
        program=device.program,
    )
    return ModbusPort(device, registers)


MCODE = Family(
    name="mcode",
    read_drive=drive_table.read_drive,
    build=build,
    snapshots=drive_text.SNAPSHOTS,
    ethernet=ETHERNET,
)
