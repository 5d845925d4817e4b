"""A client of a shared line that goes in the middle of a line, before a person's next one."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

from multidrop.families.lexium.simulator.ports.replies import checksum
from multidrop.families.tmcl.host import codec
from multidrop.families.tmcl.manual import commands
from multidrop.features.sharing.writer_turns import WRITER_TIMEOUT
from soak.simulation.records.places import Place
from soak.simulation.world import World

if TYPE_CHECKING:
    from multidrop.features.sharing.server import SharedPort

QUIET = WRITER_TIMEOUT + 1.0
"""The time in which nobody writes, so that the guest may, s."""


class Guest:
    """The connection of a client that reads nothing."""

    def __init__(self, port: SharedPort) -> None:
        self._port = port
        self._number = port.connected(self, "guest:1")  # type: ignore[arg-type]
        self._gone = False

    def write(self, data: bytes) -> None:
        """Send bytes, if the port still takes any."""
        if not self._gone:
            self._port.received(self._number, data)

    def send(self, data: bytes) -> bool:
        """Take what the drives send."""
        return True

    def say_goodbye(self, farewell: bytes) -> None:
        """Be refused."""
        self.end()

    def end(self) -> None:
        """Go."""
        if not self._gone:
            self._gone = True
            self._port.disconnected(self._number)

    abort = end


def _begun(place: Place, serial: int, rng: Random) -> tuple[str, bytes]:
    """A command of a guest, and its bytes without what ends it on this line."""
    drive = rng.choice(place.names)
    if place.language == "tmcl":
        text = f"SAP 194, 0, {8_000_000 + serial}"
        return text, codec.frame_of(int(drive), commands.parse(text))[: rng.randrange(1, codec.LENGTH)]
    if place.language == "pmx":
        text = f"V2={8_000_000 + serial}"
        return text, f"@{drive}{text}".encode() + rng.choice((b"", b"\n"))
    text = f"R2={8_000_000 + serial}"
    line = f"{drive if place.drives else ''}{text}".encode()
    line += bytes([checksum(line)]) * bool(place.checksum)
    return text, line + rng.choice((b"", b"\r" if place.drives else b"\n"))


def half_line(world: World, rng: Random) -> float:
    """Let a client write to a shared line, and go in the middle of a line; then a person types to its drives."""
    places = [each for each in world.places if each.kind == "rfc2217" and each.name in world.shares]
    if not places:
        return 0.0
    place = rng.choice(places)
    text, data = _begun(place, world.step * 100, rng)
    world.history.told.half.add((place.name, text))

    def write() -> None:
        guest = Guest(world.shares[place.name])
        guest.write(data)
        world.loop.call_later(0.05, guest.end)

    def follow() -> None:
        if world.ready.is_set():
            world.person.type(world.command(rng, place))

    world.loop.call_later(QUIET, write)
    world.loop.call_later(QUIET + 0.2 + rng.random(), follow)
    return QUIET + 3.0
