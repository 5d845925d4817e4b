"""A carrier in memory between the product's USB pipe and simulated controllers, with the faults of a USB connection.

No transfer ends in the call that begins it. A packet that the controller has taken is executed once. Its reply can
become readable late: a flush in between does not take it away, as with a controller that still works at its reply.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import Context, copy_context
from dataclasses import dataclass, field
from random import Random
from unittest import mock

from multidrop.families.pmx.simulator.device import PmxDevice
from multidrop.features.usb import libusb
from multidrop.features.usb.controllers import FoundController, chosen
from multidrop.features.usb.device import UsbController, sides
from multidrop.features.usb.interface import CANCELLED, GONE, PACKET, STALLED, UsbControl
from multidrop.features.usb.pipe import Broken, Done, TransferFailed
from multidrop.features.usb.usbip import setup
from multidrop.simulator.serving.running import Listener, RunningFloor
from multidrop.transports import Unreachable


@dataclass(frozen=True)
class UsbFaults:
    """The probability of each fault of a packet, and the longest delays, s."""

    late: float = 0.0
    """A reply becomes readable late."""
    latest: float = 1.5
    missing: float = 0.0
    """A reply never comes: something has flushed the buffers meanwhile."""
    held: float = 0.0
    """The controller takes a packet late, unless that is cancelled before."""
    longest_held: float = 0.4
    stalled: float = 0.0
    """A packet is refused, and is not executed."""
    empty: float = 0.0
    """A packet of no bytes comes before a reply."""


@dataclass(eq=False)
class Plugged(Listener):
    """A controller of a floor in a socket of this machine, as `1-1`."""

    floor: RunningFloor
    bus: str
    controller: UsbController
    place: str
    rng: Random
    stand_in: StandIn | None = None
    """The carrier that has it open."""
    faults: UsbFaults = UsbFaults()
    reply_time: float = 0.0
    """Seconds that the controller takes for a reply."""
    ends_at: dict[str, float] = field(default_factory=lambda: {"out": 0.0, "control": 0.0, "in": 0.0})
    """When the last transfer of each endpoint ends: they end in their order, also those of a host that has gone."""
    context: Context = field(default_factory=copy_context)
    """Where the controller works: whoever talks to it."""

    def __post_init__(self) -> None:
        self.floor.attach(self.bus, self)

    def unplugged(self) -> None:
        if self.stand_in is not None:
            self.stand_in.unplug()

    def commanded(self) -> None:
        if not self.present:
            self.unplugged()

    def drawn(self, probability: float) -> bool:
        """Whether a fault happens now."""
        return probability > 0 and self.rng.random() < probability

    def reply(self, reply: bytes) -> None:
        """Let a reply become readable."""
        if self.present:
            self.controller.replies += [b""] * self.drawn(self.faults.empty) + [reply]
            if self.stand_in is not None:
                self.stand_in.deliver()

    @property
    def present(self) -> bool:
        """Whether it has power and its cable is plugged in."""
        return self.controller.present and not self.floor.floor.wires[self.bus].hung_up

    @property
    def found(self) -> FoundController:
        """The entry of the list of controllers."""
        device = self.controller.device
        assert isinstance(device, PmxDevice)  # only these have a USB side
        return FoundController(f"2ED{device.controller.settings.number}", self.place, "", self)


class Sockets:
    """The USB sockets of a machine, in place of libusb's search."""

    def __init__(self, *plugged: Plugged) -> None:
        self.plugged = list(plugged)

    def __call__(self, target: str) -> StandIn:
        """Open the controller that a target names, in place of `LibusbCarrier`. Raises Unreachable."""
        found = chosen([each.found for each in self.plugged if each.present], target)
        plugged: Plugged = found.device
        if plugged.stand_in is not None:
            raise Unreachable(f"{found.url}: another program has it")
        plugged.stand_in = self.opened(found.url, plugged)
        return plugged.stand_in

    def opened(self, name: str, plugged: Plugged) -> StandIn:
        """Open a controller that nobody has."""
        return StandIn(name, plugged)


@contextmanager
def plugged_in(floor: RunningFloor, buses: Iterable[str]) -> Iterator[None]:
    """Plug the first controller of each bus in to this machine, the first one as `1-1`."""
    plugged = [
        Plugged(floor, name, sides(floor.floor, name)[0], f"1-{n}", Random(n)) for n, name in enumerate(buses, 1)
    ]
    with mock.patch.object(libusb, "LibusbCarrier", Sockets(*plugged)):
        yield


class StandIn:
    """The transfers of one controller: a `Carrier`."""

    delay = 0.0

    def __init__(self, name: str, plugged: Plugged) -> None:
        self.name = name
        self._plugged = plugged
        self._timers: dict[int, asyncio.TimerHandle] = {}
        """Packets and requests that were not taken yet."""
        self._reading: deque[int] = deque()
        """Transfers that wait for a reply."""
        self._last = 0
        self._ends_at = plugged.ends_at
        self._gone = self._halted = False

    def start(self, done: Done, broken: Broken) -> None:
        self._loop, self._context = asyncio.get_running_loop(), copy_context()
        self._done = done

    # Transfers

    def control(self, value: UsbControl) -> int:
        def carry_out() -> None:
            status, _ = self._plugged.controller.request(setup(value))
            self._end(number, status)

        number = self._begin("control", 0.0, carry_out)
        return number

    def send(self, data: bytes) -> int:
        plugged, faults = self._plugged, self._plugged.faults
        held = plugged.rng.random() * faults.longest_held if plugged.drawn(faults.held) else 0.0
        number = self._begin("out", held, lambda: self._take(number, data))
        return number

    def receive(self) -> int:
        self._reading.append(self._number())
        self._loop.call_soon(self.deliver, context=self._plugged.context)
        return self._last

    def cancel(self, number: int) -> None:
        if number in self._reading:
            self._reading.remove(number)
        elif number not in self._timers:
            return
        self._end(number, CANCELLED)

    def halt(self) -> None:
        self._halted = self._gone = True

    def close(self) -> None:
        self.halt()
        self._plugged.stand_in = None
        for timer in self._timers.values():
            timer.cancel()

    # What the controller does

    def unplug(self) -> None:
        """End every transfer: the controller is gone for this carrier."""
        for number in (*self._timers, *self._reading):
            self._end(number, GONE)
        self._reading.clear()
        self._gone = True

    def _number(self) -> int:
        if self._gone or not self._plugged.present:
            raise TransferFailed(GONE)
        self._last += 1
        return self._last

    def _begin(self, endpoint: str, after: float, work: Callable[[], None]) -> int:
        number = self._number()
        self._timers[number] = self._loop.call_at(self._end_of(endpoint, after), work, context=self._plugged.context)
        return number

    def _end_of(self, endpoint: str, after: float) -> float:
        self._ends_at[endpoint] = max(self._ends_at[endpoint] + 1e-6, self._loop.time() + after)
        return self._ends_at[endpoint]

    def _end(self, number: int, status: int, data: bytes = b"") -> None:
        if (timer := self._timers.pop(number, None)) is not None:
            timer.cancel()
        if not self._halted:
            self._loop.call_soon(self._done, number, status, data, context=self._context)

    def _take(self, number: int, data: bytes) -> None:
        plugged, faults, controller = self._plugged, self._plugged.faults, self._plugged.controller
        if not plugged.present:
            return self._end(number, GONE)
        if plugged.drawn(faults.stalled):
            return self._end(number, STALLED)
        before = [*controller.replies]
        controller.replies.clear()
        plugged.floor.exchange(plugged.bus, controller, data)
        replies, controller.replies = controller.replies, deque(before, controller.replies.maxlen)
        self._end(number, 0)
        for reply in replies:
            late = plugged.rng.random() * faults.latest if plugged.drawn(faults.late) else plugged.reply_time
            if not plugged.drawn(faults.missing):
                self._loop.call_at(self._end_of("in", late), plugged.reply, reply, context=plugged.context)

    def deliver(self) -> None:
        """Give the packets that wait to the transfers that wait for one."""
        replies = self._plugged.controller.replies
        while self._reading and replies and self._plugged.present:
            self._end(self._reading.popleft(), 0, replies.popleft()[:PACKET])
