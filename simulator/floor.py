"""A simulated shop floor in virtual time: the wire of each bus, the drives on it, and the commands of `/sim`.

`Floor` has no clock: `advance(now)` gives the bytes that the endpoints of each bus receive, `deadline` is the time of
the next event. `command` carries out a line of `/sim`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from random import Random

from multidrop.base.errors import Diagnostic
from multidrop.base.text import whole
from multidrop.simulator import USAGES
from multidrop.simulator.cell.spec import BusSpec, Cell, DriveSpec
from multidrop.simulator.declared import own_ports
from multidrop.simulator.families import BY_PERSONALITY, family_of
from multidrop.simulator.family import Device, Place, PortConnection, Unit
from multidrop.simulator.wire import Wire
from multidrop.simulator.world import World

LEVELS: dict[str, int | None] = {"0": 0, "1": 1, "open": None}
MOST_PUSH = 999_999_999
"""Motor steps."""


@dataclass(frozen=True)
class FloorDrive:
    """A drive and where it is: its bus, its description in the cell, the simulated unit."""

    bus: str
    spec: DriveSpec
    unit: Unit

    @property
    def device(self) -> Device:
        return self.unit.device

    @property
    def world(self) -> World:
        """The surroundings of its first axis."""
        return next(iter(self.unit.worlds.values()))

    def world_of(self, axis: str, where: str) -> World:
        """Find the surroundings of an axis; no name means the first axis. Raises Diagnostic."""
        worlds = self.unit.worlds
        if not axis:
            return self.world
        if axis not in worlds:
            axes = ", ".join(f"{self.spec.name}.{each}" for each in worlds if each)
            hint = f"valid: {axes}" if axes else f'it has one axis: write "{self.spec.name}"'
            raise Diagnostic(f'"{self.spec.name}" has no axis "{axis}"', where, hint)
        return worlds[axis]


class Floor:
    """The wires (by bus) and drives of a cell. Raises Diagnostic for what is not simulated."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.drives: list[FloorDrive] = []
        self.wires: dict[str, Wire] = {bus.name: self._wire(bus, cell.seed) for bus in cell.buses}

    @property
    def deadline(self) -> float | None:
        """When something next happens anywhere, s."""
        return min((at for wire in self.wires.values() if (at := wire.deadline) is not None), default=None)

    def advance(self, now: float) -> dict[str, bytes]:
        """What the endpoints of each bus hear by `now`; buses on which nothing is heard are left out."""
        heard = {}
        for name, wire in self.wires.items():
            if data := wire.advance(now):
                heard[name] = data
        return heard

    def command(self, text: str, now: float) -> None:
        """Move the world: `/sim input b 1 0` (`/sim` may be left out). Raises Diagnostic and changes nothing.

        A drive is called `b`, or `press:b` where its name is on several buses.
        """
        words = text.split()
        if words[:1] == ["/sim"]:
            words = words[1:]
        usages = ", ".join(USAGES.values())
        if not words:
            raise Diagnostic("no command", "/sim", f"valid: {usages}")
        usage = USAGES.get(words[0])
        if usage is None:
            raise Diagnostic(f'no command "{words[0]}"', "/sim", f"valid: {usages}")
        if len(words) != len(usage.split()):
            raise Diagnostic("wrong number of words", f"/sim {words[0]}", f"usage: /sim {usage}")
        try:
            self._carry_out(words[0], words[1:], f"/sim {words[0]}", now)
        finally:
            for wire in self.wires.values():
                wire.look_again()

    def _carry_out(self, verb: str, words: list[str], where: str, now: float) -> None:
        """Carry out a command of the right length. Raises Diagnostic and changes nothing."""
        name = words[0]
        if verb in ("plug", "unplug"):
            if name not in self.wires:
                raise Diagnostic(f'no bus "{name}"', where, f"valid: {', '.join(self.wires)}")
            wire = self.wires[name]
            return wire.plug() if verb == "plug" else wire.unplug()
        placed, world = self.place(name, where)
        unit, device = placed.unit, placed.device
        if verb == "power":
            on = _on(words[1], where)
            device.advance(now)
            device.power(on, now)
            return self._retune(placed.bus)
        if verb == "supply":
            if unit.single_supply:
                hint = f"/sim power {name} {words[1]} switches it"
                raise Diagnostic(f'"{name}" has one supply only', where, hint)
            return device.supply(_on(words[1], where), now)
        change = self._change_of_world(verb, words, where, unit, world)
        device.advance(now)
        change(now)
        device.advance(now)

    def _change_of_world(
        self, verb: str, words: list[str], where: str, unit: Unit, world: World
    ) -> Callable[[float], None]:
        """Check the words of a command that changes the surroundings of an axis. Raises Diagnostic."""
        match verb:
            case "input":
                if not unit.inputs:
                    raise Diagnostic(f'"{words[0]}" has no inputs', where)
                number = _number(words[1], sorted(unit.inputs), "input", where)
                if words[2] not in LEVELS:
                    raise Diagnostic(f'no level "{words[2]}"', where, "valid: 0 (ground), 1 (+V), open (neither)")
                return partial(world.set_input, number, LEVELS[words[2]])
            case "analog":
                return partial(world.set_input, 0, _number(words[1], range(unit.counts + 1), "analog value", where))
            case "push":
                steps = whole(words[1], -MOST_PUSH, MOST_PUSH)
                if steps is None:
                    raise Diagnostic(f'no push "{words[1]}"', where, "valid: motor steps, such as 100 or -100")
                return partial(world.push, steps)
        held = _on(words[1], where)
        return lambda now: world.hold(held)

    def own_port(self, bus: str) -> PortConnection:
        """Connect to the own port of the Ethernet drive of a bus. Raises Diagnostic if there is none.

        What comes by it can change the drive: the bus's wire is to `look_again`.
        """
        for unit in self._ethernet(bus):
            if unit.connect is not None:
                return unit.connect()
        names = " and ".join(name for name, family in BY_PERSONALITY.items() if name in family.ethernet)
        raise Diagnostic("no drive with a port of its own", f'bus "{bus}"', f"valid: {names}")

    def connectable(self, bus: str) -> bool:
        """Whether a client can connect: not while the Ethernet drive of the bus has no power, or boots."""
        return all(unit.device.powered for unit in self._ethernet(bus))

    @property
    def ethernet(self) -> list[str]:
        """The buses of Ethernet drives, to which a client cannot connect at times."""
        return [bus for bus in self.wires if any(self._ethernet(bus))]

    def _ethernet(self, bus: str) -> Iterator[Unit]:
        return (drive.unit for drive in self.drives if drive.bus == bus and drive.unit.connect is not None)

    def delays(self, bus: str) -> Iterator[float]:
        """Yield the reply delays of a connection to a bus, s, without an end; an equal seed gives equal delays."""
        low, high = next(each.faults.delay for each in self.cell.buses if each.name == bus)
        rng = Random(" ".join((str(self.cell.seed), bus, *own_ports())))
        while True:
            yield rng.uniform(low, high) if high else 0.0

    def place(self, drive: str, where: str) -> tuple[FloorDrive, World]:
        """Find a drive and the surroundings of its axis; `00.y` names an axis. Raises Diagnostic."""
        bus, _, name = drive.rpartition(":")
        name, _, axis = name.partition(".")
        drives = [each for each in self.drives if each.spec.name == name and bus in ("", each.bus)]
        if len(drives) == 1:
            return drives[0], drives[0].world_of(axis, where)
        if drives:
            names = ", ".join(f"{each.bus}:{name}" for each in drives)
            raise Diagnostic(f'"{drive}" is on several buses', where, f"valid: {names}")
        names = ", ".join(f"{each.bus}:{each.spec.name}" for each in self.drives)
        raise Diagnostic(f'no drive "{drive}"', where, f"valid: {names}")

    def _wire(self, bus: BusSpec, seed: int) -> Wire:
        place = Place(bus.baud, alone=len(bus.drives) == 1)
        placed = [FloorDrive(bus.name, spec, family_of(spec.personality).build(spec, place)) for spec in bus.drives]
        self.drives += placed
        return Wire([drive.unit.port for drive in placed], bus.baud, bus.faults, Random(f"{seed} {bus.name}"))

    def _retune(self, bus: str) -> None:
        """Let a wire follow its drives if all of them have taken the same other baud rate at power-up."""
        wire = self.wires[bus]
        bauds = {drive.unit.port.baud for drive in self.drives if drive.bus == bus}
        if 0 not in bauds and len(bauds) == 1 and bauds != {wire.baud}:
            wire.retune(bauds.pop())


def _number(text: str, allowed: Sequence[int], what: str, where: str) -> int:
    number = whole(text, allowed[0], allowed[-1])
    if number is None or number not in allowed:
        run = allowed[-1] - allowed[0] + 1 == len(allowed)
        choice = f"{allowed[0]} to {allowed[-1]}" if run else ", ".join(map(str, allowed))
        raise Diagnostic(f'no {what} "{text}"', where, f"valid: {choice}")
    return number


def _on(text: str, where: str) -> bool:
    if text not in ("on", "off"):
        raise Diagnostic(f'no state "{text}"', where, "valid: on, off")
    return text == "on"
