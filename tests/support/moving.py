"""A simulated drive to try motion on, and what the tests of motion do with it."""

from __future__ import annotations

from typing import Any

from simulator.cell.spec import DriveSpec, WorldSpec
from simulator.lexium.device import MCodeDevice
from simulator.world import World


def drive(*lines: str, personality: str = "LMDCM", program: str = "", **world: Any) -> MCodeDevice:
    """A drive in a world, with lines carried out that it must take."""
    spec = WorldSpec(**world)
    program = "\n".join(line.strip() for line in program.splitlines())
    device = MCodeDevice(DriveSpec(personality=personality, program=program, world=spec), World(spec))
    device.prints()
    for line in lines:
        assert not device.execute(line, 0.0).refused, line
    return device


def say(device: MCodeDevice, *lines: str) -> list[str]:
    """Carry lines out; what they printed, and the code of each refusal as `?code`."""
    out: list[str] = []
    for line in lines:
        answer = device.execute(line, device.now)
        out += answer.lines
        if answer.refused:
            out.append("?" + device.execute("PR ER", device.now).lines[0])
    return out


def at(device: MCodeDevice, t: float, *words: str) -> list[str]:
    """What variables read at a time."""
    device.advance(t)
    return say(device, *(f"PR {word}" for word in words))


def rotor(device: MCodeDevice) -> int:
    """Where the rotor is, motor steps."""
    return round(device.axis.rotor.position(device.now))
