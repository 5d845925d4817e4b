"""A simulated Lexium or MDrivePlus without a wire: lines in, prints and positions out, in virtual time."""

from __future__ import annotations

from typing import Any

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World


def drive(*lines: str, personality: str = "LMDCM", program: str = "", **world: Any) -> MCodeDevice:
    """A drive in a world, with lines carried out that it must take."""
    spec = WorldSpec(**world)
    program = "\n".join(line.strip() for line in program.splitlines())
    device = MCodeDevice(DriveSpec(personality=personality, program=program, world=spec), World(spec))
    device.prints()
    for line in lines:
        assert not device.execute(line, 0.0).refused, line
    return device


def switched_on(program: str = "", personality: str = "LMDCM", **spec: Any) -> MCodeDevice:
    """A drive with a program in it, at the moment of power-up: its sign-on is yet to be read."""
    spec.setdefault("world", WorldSpec())
    lines = "".join(line.strip() + "\n" for line in program.splitlines())
    return MCodeDevice(DriveSpec(personality=personality, program=lines, **spec), World(spec["world"]))


def output(device: MCodeDevice, until: float) -> str:
    """What the drive prints by itself up to a time, without sign-ons; `|` ends a line."""
    device.advance(until)
    return "".join(text for _, text in device.prints() if not text.startswith("Copyright")).replace("\r\n", "|")


def say(device: MCodeDevice, *lines: str | float) -> list[str]:
    """Carry lines out, or let so many seconds pass; what the lines printed, and the code of each refusal as `?code`."""
    out: list[str] = []
    for line in lines:
        if isinstance(line, str):
            out += _carried_out(device, line)
        else:
            device.advance(device.now + line)
    return out


def run(device: MCodeDevice, *lines: str | float) -> list[str]:
    """Do the same, and return in addition what the drive printed by itself, word for word."""
    out: list[str] = []
    for line in lines:
        out += _carried_out(device, line) if isinstance(line, str) else printed(device, line).split()
    return out


def _carried_out(device: MCodeDevice, line: str) -> list[str]:
    answer = device.execute(line, device.now)
    return [*answer.lines, *([_error(device)] if answer.refused else [])]


def _error(device: MCodeDevice) -> str:
    """Read the error and clear it, as PR ER does, which cannot be typed while a program is stored."""
    code = device.memory.values["ER"]
    device.errors.clear()
    return f"?{code}"


def printed(device: MCodeDevice, seconds: float = 0.0) -> str:
    """What the drive prints by itself in so many seconds."""
    device.advance(device.now + seconds)
    return "".join(text for _, text in device.prints())


def printed_lines(device: MCodeDevice, seconds: float) -> list[str]:
    """The lines that the drive prints by itself in so many seconds."""
    return printed(device, seconds).split("\r\n")[:-1]


def prints_until(device: MCodeDevice, t: float) -> list[str]:
    """Each text that the drive prints by itself up to a time."""
    device.advance(t)
    return [text.strip() for _, text in device.prints()]


def at(device: MCodeDevice, t: float, *words: str) -> list[str]:
    """What variables read at a time."""
    device.advance(t)
    return say(device, *(f"PR {word}" for word in words))


def rotor(device: MCodeDevice) -> int:
    """Where the rotor is, motor steps."""
    return round(device.motor.axis.rotor.position(device.now))


def codes(device: MCodeDevice, *lines: str) -> list[int]:
    """The error of each line, 0 for one that is taken; works in program mode too."""
    found = []
    for line in lines:
        refused = device.execute(line, device.now).refused
        found.append(int(device.memory.values["ER"]) if refused else 0)
        device.errors.clear()
    return found


def closed_loop(*lines: str, mode: int = 1, **world: Any) -> MCodeDevice:
    """A drive with hMT on, calibrated."""
    device = drive(f"AS={mode}", *lines, **world)
    device.advance(0.1)
    return device
