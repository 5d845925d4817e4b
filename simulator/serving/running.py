"""A floor in real time: the one place where the simulator meets the event loop's clock.

It wakes at the floor's next event, at most once a millisecond, and not at all without one. What comes from a client is
carried out at once, so a reply that takes no time is sent in the same turn.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from multidrop.simulator.family import Connection, Shadow
from multidrop.simulator.floor import Floor
from multidrop.simulator.wire import BITS_A_BYTE

SHORTEST_SLEEP = 0.001
LATEST = 0.1
"""Seconds that are made up for where this process came too late. The floor's time pauses for the rest, so that a
machine that is too slow for a floor still serves its clients at once."""


class Listener(Protocol):
    """An endpoint of a bus."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the wire."""

    def unplugged(self) -> None:
        """Disconnect the client: the bus is unplugged."""

    def plugged(self) -> None:
        """The bus is plugged in again."""

    def disconnected(self) -> None:
        """End all connections: the bus's Ethernet drive has lost power, or boots."""

    def connectable(self) -> None:
        """The Ethernet drive has booted."""


class RunningFloor:
    """Runs a floor `speed` times as fast as the clock. Needs a running loop; `close` ends it."""

    def __init__(self, floor: Floor, speed: float = 1.0) -> None:
        self.floor = floor
        self.notify: Callable[[str], None] = lambda text: None
        """Takes a notice about clients, for a person."""
        self._loop = asyncio.get_running_loop()
        self._speed = speed
        self._origin = self._loop.time()
        self._now = 0.0
        self._deadline: float | None = None
        """When something happens next, as of the last turn."""
        self._listeners: dict[str, list[Listener]] = {name: [] for name in floor.wires}
        self._down = {name: wire.hung_up for name, wire in floor.wires.items()}
        self._connectable = {name: floor.connectable(name) for name in floor.ethernet}
        self._wake: asyncio.TimerHandle | None = None
        self._closed = False
        self._sources = 0
        self._turn()

    @property
    def loop(self) -> asyncio.AbstractEventLoop:
        """The loop that it runs in."""
        return self._loop

    def now(self) -> float:
        """The floor's time: seconds since the start, times the speed; less where it stood still."""
        now = (self._loop.time() - self._origin) * self._speed
        if self._deadline is not None:
            most = max(self._deadline + LATEST * self._speed, self._now)
            self._origin += max(0.0, now - most) / self._speed
            now = min(now, most)
        self._now = now
        return now

    def attach(self, bus: str, listener: Listener) -> Callable[[], None]:
        """Listen on a bus; call what is returned to end that."""
        self._listeners[bus].append(listener)

        def detach() -> None:
            if listener in self._listeners[bus]:
                self._listeners[bus].remove(listener)

        return detach

    def source(self) -> int:
        """A number for a new source of bytes."""
        self._sources += 1
        return self._sources

    def bytes_a_second(self, bus: str) -> float:
        """How many bytes a wire carries in a second of the clock; 0 if they take no time."""
        return self.floor.wires[bus].baud / BITS_A_BYTE * self._speed

    def write(self, bus: str, data: bytes, source: int = 0, baud: int | None = None) -> None:
        """Put a client's bytes on a wire."""
        if not self._closed:
            wire = self.floor.wires[bus]
            wire.receive(data, self.now(), baud, source)
            if wire.baud:  # the bytes take their time, and are not there yet
                self._set_alarm()
            else:
                self._turn()

    def exchange(self, bus: str, connection: Connection, data: bytes) -> bytes:
        """Pass a client's bytes to its connection; give the reply. Nothing passes while the bus is unplugged."""
        if self._closed:
            return b""
        self._turn()
        if self.floor.wires[bus].hung_up:
            return b""
        answer = connection.receive(data, self.now())
        self.floor.wires[bus].look_again()
        self._turn()
        return answer

    def later(self, seconds: float, call: Callable[[], None]) -> None:
        """Call something when so much of the floor's time has passed."""
        self._loop.call_later(seconds / self._speed, call)

    def retract(self, bus: str, source: int) -> int:
        """Drop what a source has written and what has not begun to go out; return the number of bytes."""
        return self.floor.wires[bus].retract(self.now(), source)

    def command(self, text: str) -> str | None:
        """Carry out a `/sim` line. Raises Diagnostic."""
        if self._closed:
            return None
        self._turn()
        try:
            return self.floor.command(text, self.now())
        finally:
            self._turn()

    def shadow(self, bus: str, name: str) -> Shadow | None:
        """The reading of a drive without its wire, up to date; None where the cell has no such drive."""
        self._turn()
        found = [each for each in self.floor.drives if each.bus == bus]
        named = [each for each in found if each.spec.name == name] or (found if len(found) == 1 else [])
        return named[0].unit.shadow if named else None

    def close(self) -> None:
        """Stop the time."""
        self._closed = True
        if self._wake is not None:
            self._wake.cancel()

    def _turn(self) -> None:
        """Bring the floor up to date, and see when to come back."""
        self._advance()
        self._set_alarm()

    def _advance(self) -> None:
        """Bring the floor up to date, and call the listeners."""
        for bus, data in self.floor.advance(self.now()).items():
            for listener in tuple(self._listeners[bus]):
                listener.receive(data)
        for bus, wire in self.floor.wires.items():
            if wire.hung_up != self._down[bus]:
                self._down[bus] = wire.hung_up
                for listener in tuple(self._listeners[bus]):
                    (listener.unplugged if wire.hung_up else listener.plugged)()
        for bus, before in self._connectable.items():
            now = self.floor.connectable(bus)
            if now != before:
                self._connectable[bus] = now
                for listener in tuple(self._listeners[bus]):
                    (listener.connectable if now else listener.disconnected)()

    def _set_alarm(self) -> None:
        if self._wake is not None:
            self._wake.cancel()
            self._wake = None
        self._deadline = self.floor.deadline
        if self._deadline is not None and not self._closed:
            at = max(self._origin + self._deadline / self._speed, self._loop.time() + SHORTEST_SLEEP)
            self._wake = self._loop.call_at(at, self._turn)
