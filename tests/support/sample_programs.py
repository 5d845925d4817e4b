"""Running a program file on a simulated drive, for the sample programs' tests."""

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World

REVOLUTION = 51200


def load(text, personality="LMDCM", **world):
    """A drive with a sample in it, as a person loads one: variables, then the program, then S."""
    spec = WorldSpec(**world)
    device = MCodeDevice(DriveSpec(personality=personality), World(spec))
    device.prints()
    for line in text.strip().splitlines():
        answer = device.execute(line, 0.0)
        assert not answer.refused, (line, device.execute("PR ER", 0.0).lines)
    return device


def printed(device, until):
    """The lines printed by themselves up to a time."""
    device.advance(until)
    text = "".join(text for _, text in device.prints())
    return [line for line in text.split("\r\n") if line]


def say(device, *lines):
    """Carry lines out; what they printed."""
    out = []
    for line in lines:
        answer = device.execute(line, device.now)
        assert not answer.refused, line
        out += answer.lines
    return out


def begin(device):
    """Reset it, so that SU runs; its sign-on is thrown away."""
    device.reset(device.now)
    device.prints()


# 9.1: an input starts a move of ten turns, and back.
