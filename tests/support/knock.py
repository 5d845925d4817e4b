"""Knock: a made-up family in the fewest lines, with its simulated drives. A line is `A GO 500`, a reply `A 500 0`."""

from __future__ import annotations

import re
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from multidrop.base.errors import NoAnswer, Refused
from multidrop.base.feature import Feature
from multidrop.dialects.codec import Codec, Decoded, End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.families import Dialect
from multidrop.dialects.family import Family, Hints, Motion, Printed
from multidrop.dialects.state import DriveState, who
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.declared import Simulated
from multidrop.simulator.family import Place, SimulatedFamily, Unit
from multidrop.simulator.kinematics import MotionPace, Profile, halt, move
from multidrop.simulator.wire import Port, Transmission
from multidrop.simulator.world import World

STOP = b"\r*HALT\r"
PACE = MotionPace(100.0, 2000.0, 2000.0, 2000.0)


@dataclass(frozen=True)
class Knock(Codec):
    """Lines of text; an address is a capital letter."""

    family: ClassVar[str] = "knock"

    def request(self, address: str, text: str, priority: Priority = Priority.OPERATOR) -> Request:
        return Request(address, text, Kind.PRINT, self, priority)

    def encode(self, request: Request) -> bytes:
        return f"{request.address} {request.text}\r".encode()

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        line, end, _ = buffer.partition(b"\r")
        address, _, text = line.decode("latin-1").partition(" ")
        if not end:
            return None
        if address != request.address:
            return Decoded(Reply(end=End.DAMAGED, detail=f"heard {line!r}"), len(line) + 1)
        return Decoded(Reply((text,), End.REFUSED if text == "NO" else End.DONE), len(line) + 1)

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        return STOP

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        return STOP in data

    def starts_motion(self, text: str) -> bool:
        return text != "?"


class KnockFamily(Family):
    """A drive that goes to a place and says where it is."""

    name = "knock"
    codec = Knock()

    @classmethod
    def identify(cls, hints: Hints) -> Procedure[list[DriveState]]:
        found = [cls.new_state(cls.codec, address) for address in hints.drives or ("A",)]
        for state in found:
            if (yield cls.codec.request(state.address, "?")).end is End.DONE:
                state.identified("Knock", "1.0")
            else:
                state.note(f"{who(state)} does not reply")
        if not any(state.product for state in found):
            raise NoAnswer("no drive replies")
        return found

    def perform(self, text: str, priority: Priority = Priority.OPERATOR) -> Printed:
        reply = yield self.codec.request(self.state.address, text, priority)
        if reply.end is not End.DONE:
            kind = Refused if reply.end is End.REFUSED else NoAnswer
            raise kind(f"{who(self.state)}: '{text}' was {'refused' if kind is Refused else 'sent once: no reply'}")
        return reply.lines

    def motion(self, priority: Priority) -> Generator[Request, Reply, tuple[Motion, ...]]:
        (line,) = yield from self.perform("?", priority)
        return (Motion(*map(int, line.split())),)

    @classmethod
    def move_to(cls, axis: str, position: int | str) -> tuple[str, ...]:
        return (f"GO {position}",)


class KnockDrive(Port):
    """A simulated drive with its port."""

    baud, deadline, powered = 0, None, True

    def __init__(self, name: str) -> None:
        self._name, self._begun, self._out, self.profile = name, b"", list[Transmission](), halt(0.0, 0.0)

    def advance(self, now: float) -> None: ...
    def power(self, on: bool, now: float) -> None: ...
    def supply(self, on: bool, now: float) -> None: ...

    def quiet(self, now: float) -> bool:
        return not self._out

    def receive(self, data: bytes, now: float) -> None:
        *lines, self._begun = (self._begun + data).split(b"\r")
        for line in lines:
            address, _, text = line.decode("latin-1").partition(" ")
            if line == STOP.strip():
                self.profile = halt(now, self.profile.position(now))
            elif address == self._name:
                self._out.append(Transmission(now, f"{address} {self._done(text, now)}\r".encode()))

    def _done(self, text: str, now: float) -> str:
        at: Profile = self.profile
        if found := re.fullmatch(r"GO (-?\d+)", text):
            self.profile = move(now, at.position(now), at.velocity(now), float(found[1]), PACE)
        return f"{self.profile.position(now):.0f} {self.profile.velocity(now):.0f}" if found or text == "?" else "NO"

    def sent(self, now: float) -> list[Transmission]:
        out, self._out = self._out, []
        return out


class SimulatedKnock(SimulatedFamily):
    """Simulated drives of the family."""

    name, addressed = "knock", True

    @classmethod
    def build(cls, spec: DriveSpec, place: Place) -> Unit:
        made: Any = KnockDrive(spec.name)
        return Unit(made, made, {"": World(spec.world)})


FAMILY = Feature(
    "knock",
    "a made-up family",
    adds=(Dialect("knock", f"{__name__}:KnockFamily"), Simulated("knock", f"{__name__}:SimulatedKnock", ("KNOCK",))),
)
