"""The twin of one drive: a simulated drive in the time of a real one, made of a snapshot of it."""

from __future__ import annotations

from multidrop.base.errors import Inexpressible
from multidrop.dialects.family import Motion
from multidrop.dialects.values import Levels, Snapshot
from multidrop.simulator import cells
from multidrop.simulator.cell.writer import BusText, write
from multidrop.simulator.families import FAMILIES, family_of
from multidrop.simulator.family import Place, Shadow, Unit
from multidrop.simulator.wire import Transmission

NAME = "twin"
LIMITS = {"limit+": "limit_plus", "limit-": "limit_minus"}
"""Switches by the names of limits."""


class Twin:
    """The simulated drive. `registers`: the real one is reached through its registers, by a connection of its own."""

    def __init__(self, unit: Unit, shadow: Shadow, levels: Levels | None, begun: float, registers: bool) -> None:
        self.levels = levels
        self._unit, self._shadow, self._begun = unit, shadow, begun
        self._connection = unit.connect() if registers and unit.connect is not None else None
        self._world = next(iter(unit.worlds.values()))
        self._now = 0.0
        self._inputs: dict[int, int] = {}
        self._overheard: list[Transmission] = []
        self._learned: set[tuple[str, str]] = set()
        """The switches that were found on the way, by axis."""
        shadow.rest()

    def shift(self, seconds: float) -> None:
        """Let it be ahead by so much more from now on; its own time never goes back."""
        self._begun -= seconds

    def live(self, at: float) -> float:
        """Live up to a time of the host's clock; return the drive's own time."""
        self._now = max(self._now, at - self._begun)
        self._overheard += [transmission for transmission in self._unit.port.sent(self._now) if transmission.overheard]
        return self._now

    def hear(self, data: bytes, at: float) -> None:
        """Take bytes of the host; the replies go nowhere."""
        now = self.live(at)
        if self._connection is not None:
            self._connection.receive(data, now)
        else:
            self._unit.port.receive(data, now)
        self.live(at)

    def overhear(self, data: bytes, at: float) -> None:
        self._unit.port.overhear(data, self.live(at))

    def printed(self) -> list[bytes]:
        """The bytes for other drives of its line that it has sent since the last call."""
        printed, self._overheard = self._overheard, []
        return [transmission.data for transmission in printed]

    def put(self, value: int, at: float) -> bool:
        """Set the inputs as they were read; return whether one has changed."""
        if self.levels is None:
            return False
        levels = dict(self.levels.of(value))
        changed, self._inputs = levels != self._inputs and bool(self._inputs), levels
        now = self.live(at)
        for number, level in levels.items():
            if self._world.level(number, now) != level:
                self._world.set_input(number, level, now)
        self._unit.device.advance(now)
        return changed

    def motion(self, at: float) -> dict[str, Motion]:
        return {of_axis.axis: of_axis for of_axis in self._shadow.motion(self.live(at))}

    def align(self, axis: str, position: int, at: float) -> None:
        self._shadow.align(axis, position, self.live(at))
        self.live(at)

    # What it cannot know beforehand: where the switches of the drive are.

    def awaits(self, axis: str, at: float) -> str | None:
        """What its homing awaits, as `Shadow.awaits`; None: it is not homing."""
        return self._shadow.awaits(axis, self.live(at))

    def meet(self, axis: str, switch: str, at: float) -> bool:
        """Learn that a switch is where the axis is; False for one that it knows, or that is no switch of the axis."""
        now, shaft = self.live(at), self._shadow.shafts.get(axis)
        if shaft is None or not switch or (axis, switch) in self._learned:
            return False
        self._learned.add((axis, switch))
        shaft.world.learn(switch, shaft.position(now), shaft.path.velocity(now))
        self._unit.device.advance(now)
        return True

    def at_learned(self, axis: str, at: float) -> bool:
        """Whether it stands at a limit that it has learned."""
        now, shaft = self.live(at), self._shadow.shafts.get(axis)
        closed = shaft.switches(now)[1:] if shaft is not None else ()
        return any(on and (axis, limit) in self._learned for on, limit in zip(closed, LIMITS.values(), strict=False))

    def forget(self, axis: str) -> None:
        """Forget the switches of an axis that it has learned."""
        for name, switch in [learned for learned in self._learned if learned[0] == axis]:
            self._learned.discard((name, switch))
            self._shadow.shafts[axis].world.learn(switch, None)


def make(snapshot: Snapshot, begun: float, registers: bool, alone: bool) -> tuple[Twin, tuple[str, ...]]:
    """Make the twin of a drive that was read, with its gaps. Raises Inexpressible, or Diagnostic.

    `begun`: the time of the host's clock from which it lives. `alone`: no other drive is on the line.
    """
    described = FAMILIES[snapshot.kind].describe(snapshot)
    spec = cells.read(write([BusText(NAME, [described])]), NAME).buses[0].drives[0]
    unit = family_of(spec.personality).build(spec, Place(alone=alone))
    if unit.shadow is None:
        raise Inexpressible(f"the simulator has no twin of an {spec.personality}")
    gaps = [*described.remarks]
    if described.unread:
        gaps.append(f"not read, so as in a new drive: {', '.join(name for name, _ in described.unread)}")
    return Twin(unit, unit.shadow, snapshot.levels, begun, registers), tuple(gaps)
