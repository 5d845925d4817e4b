"""The USB of the simulated machine: controllers in sockets, and what goes wrong there.

The product's pipe works above (`features.usb.pipe`), and its choice of a controller. In place of libusb are the
carriers of `tests.support.usb_stand_in`: transfers that the controller takes late or refuses, replies that come late
or never.
"""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING, Any, Protocol

from multidrop.features.usb.device import sides
from multidrop.features.usb.pipe import Broken, Done
from multidrop.transports import Unreachable
from soak.simulation.records.climate import Climate
from soak.simulation.system.ports import Trace
from soak.simulation.system.process import operate, outside
from tests.support.usb_stand_in import Plugged, Sockets, StandIn, UsbFaults

if TYPE_CHECKING:
    from multidrop.simulator.serving.running import RunningFloor


OTHER = "picocom (pid 4711)"
"""Another program, which has a port or a controller open at times."""


class Socket(Plugged):
    """A controller in its socket. `held`: another program has it open."""

    held = False

    @property
    def line(self) -> str:
        """The line of drives that it is."""
        return self.bus


class Carrier(StandIn):
    """An open controller. Each packet to it is an operation that a kill may meet, and is noted as it leaves."""

    climate: Climate
    trace: Trace
    owner: Any
    rest = 0

    def start(self, done: Done, broken: Broken) -> None:
        """Begin to report; note what comes in."""

        def noted(number: int, status: int, data: bytes) -> None:
            if data:
                self.trace("<", data.partition(b"\0")[0] + b"\r")
            done(number, status, data)

        super().start(noted, broken)

    def send(self, data: bytes) -> int:
        """Begin a packet, and note it."""

        def leave() -> int:
            number = outside(super(Carrier, self).send, data)
            self.trace(">", data.rstrip(b"\0") + b"\r")
            return number

        return operate(leave)

    @property
    def closed(self) -> bool:
        """Whether the product has given it back."""
        return self._halted and self._plugged.stand_in is not self


class Kernel(Protocol):
    """What the sockets ask of the kernel: see `kernel.Kernel`."""

    seed: int

    def keep(self, made: Carrier, line: str) -> None:
        """Keep an open controller, whose host is the process that runs now."""


class UsbSockets(Sockets):
    """All sockets of the machine, in place of `LibusbCarrier`."""

    def __init__(self, kernel: Kernel) -> None:
        super().__init__()
        self._kernel = kernel

    def add(self, floor: RunningFloor, line: str, place: str) -> None:
        """Plug the controller of a line in."""
        rng = Random(f"{self._kernel.seed} usb {line}")
        self.plugged.append(Socket(floor, line, sides(floor.floor, line)[0], place, rng))

    def quiet(self, climate: Climate) -> None:
        """Give every controller the faults of another climate."""
        names = ("late", "missing", "held", "stalled", "empty")
        for each in self.plugged:
            each.faults = UsbFaults(longest_held=2.5, **{name: climate[f"usb {name}"] for name in names})

    def exchange(self) -> None:
        """Let each controller go to the socket of the next one."""
        places = [each.place for each in self.plugged]
        for each, place in zip(self.plugged, places[1:] + places[:1], strict=True):
            each.place = place

    def opened(self, name: str, plugged: Plugged) -> StandIn:
        """Open a controller for the process that runs now. Raises Unreachable."""
        if getattr(plugged, "held", False):
            raise Unreachable(f"{name}: {OTHER} has it")
        made = Carrier(name, plugged)
        self._kernel.keep(made, plugged.bus)
        return made
