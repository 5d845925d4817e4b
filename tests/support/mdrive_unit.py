"""A simulated MDrivePlus behind its port: bytes in, bytes out, in virtual time."""

from __future__ import annotations

from typing import Any

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World


class Unit:
    """One unit as it is from the factory (EM=0), in a world."""

    def __init__(self, personality: str = "MDI", *lines: str, **world: Any) -> None:
        spec = WorldSpec(**world)
        self.device = MCodeDevice(DriveSpec(personality=personality, world=spec), World(spec))
        self.device.prints()
        self.port = MCodePort(self.device)
        for line in lines:
            assert self.say(line) == [""], line

    def write(self, text: str) -> str:
        """Everything that comes back for some bytes at this moment."""
        self.port.receive(text.encode("latin-1"), self.device.now)
        return self.port.advance(self.device.now).decode("latin-1")

    def say(self, *lines: str) -> list[str]:
        """What each line printed; `?` and the code of a refusal, which is read and so cleared."""
        return [self._say(line) for line in lines]

    def at(self, t: float, *words: str) -> list[str]:
        """What variables read at a time."""
        self.port.advance(t)
        self.device.advance(t)
        return self.say(*(f"PR {word}" for word in words))

    def told(self, t: float) -> str:
        """What it has printed by itself up to a time."""
        return self.port.advance(t).decode("latin-1")

    def _say(self, line: str) -> str:
        heard = self.write(line + "\r").replace(line + "\x06", line + "\r\n")  # a line that sets CK
        echo = line + "\r\n"
        assert heard.startswith(echo), heard
        said, prompt = heard[len(echo) : -1], heard[-1]
        if prompt == "?":
            return "?" + self._say("PR ER")
        assert prompt == ">" or self.device.programming is not None, heard
        return "" if self.device.programming is not None else said.removesuffix("\r\n").replace("\r\n", "|")
