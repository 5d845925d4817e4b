"""The system calls of the product's transports: ports, sockets and the `ssh` program of the simulation, in their place.

The product's own code runs above: `transports.serial_port` with its claims and its errors, `transports.sockets` with
its look-ups and its times, `transports.ssh_session` above the program that it starts. Whose descriptor it is, says a
context variable: this person's session, another one's ("2"), or a computer that lends a port ("far").
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import termios
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from random import Random
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from multidrop.drives import pacing
from multidrop.families.lexium.simulator import power
from multidrop.features.usb import libusb
from multidrop.shell.connect import reconnect
from multidrop.simulator.serving.running import Listener, RunningFloor
from multidrop.transports import relay, serial_pipe, serial_port, serial_ports, sockets, ssh_session
from soak.simulation.records.climate import Climate
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.far import SshProgram
from soak.simulation.system.network import Network, Socket
from soak.simulation.system.pacer import Pacer
from soak.simulation.system.ports import Descriptor, Port, Trace
from soak.simulation.system.process import PROCESS, Process, operate, outside
from soak.simulation.system.usb import OTHER, Carrier, UsbSockets

if TYPE_CHECKING:
    from multidrop.transports.ssh import FarPort

WHO: ContextVar[str] = ContextVar("who", default="")
"""Whose code runs."""
NODES = 8
BOOT = 2.0
"""The time that an Ethernet drive takes to boot, s: a real one takes longer than a whole story."""


class Adapter(Listener):
    """A serial adapter: the wire behind it, its node while it is plugged in, and the link that follows it."""

    def __init__(self, kernel: Kernel, line: str, link: str) -> None:
        self.line, self.link = line, link
        self.node = ""
        self.held = False
        """Another program has it open."""
        self.opened: Port | None = None
        self._kernel = kernel
        self.plugged()

    def unplugged(self) -> None:
        """Its node vanishes."""
        self.node = ""

    def plugged(self) -> None:
        """It gets a node, of any free number: another adapter may have had it before."""
        taken = {each.node for each in self._kernel.adapters}
        free = [node for node in (f"/dev/ttySIM{number}" for number in range(NODES)) if node not in taken]
        self.node = free[0] if self._kernel.calm else self._kernel.rng.choice(free)


class Kernel:
    """All descriptors, adapters and programs of the simulated computers."""

    def __init__(
        self,
        loop: SimulatedLoop,
        seed: int,
        climate: Climate,
        network: Network,
        trace: Callable[[str, str], Trace],
    ) -> None:
        """`trace` makes the notebook of a descriptor: of whose it is, and of which line."""
        self.loop, self.climate, self.network = loop, climate, network
        self.calm = climate.calm
        self.rng = Random(f"{seed} kernel")
        self.floor: RunningFloor
        self.adapters: list[Adapter] = []
        self.descriptors: dict[int, Any] = {}
        """All that are open: `Descriptor`s."""
        self.latest: dict[str, Descriptor] = {}
        """The last one of each line and person."""
        self._trace = trace
        self.seed = seed
        self.usb = UsbSockets(self)

    def adapter(self, floor: RunningFloor, line: str, link: str) -> Adapter:
        """Plug an adapter in to a line."""
        self.floor = floor
        made = Adapter(self, line, link)
        self.adapters.append(made)
        floor.attach(line, made)
        return made

    def quiet(self, climate: Climate) -> None:
        """Give every descriptor another climate, and those to come."""
        self.climate = self.network.climate = climate
        for each in self.descriptors.values():
            each.climate = climate
        self.usb.quiet(climate)

    def rest(self, name: str) -> int:
        """The bytes that are left of a write which has begun."""
        return self.latest[name].rest if name in self.latest else 0

    def found(self, path: str) -> Adapter | None:
        """The adapter that has a path now."""
        return next((each for each in self.adapters if each.node and path in (each.node, each.link)), None)

    # Made by the product

    def _add(self, made: Any) -> Any:
        """Keep a descriptor. Each read and write of a process is an operation that a kill may meet."""
        self.descriptors = {number: each for number, each in self.descriptors.items() if not each.closed}
        made.owner = PROCESS.get()
        if made.owner is not None:
            receive, send = made.recv, made.send
            made.recv = lambda *given: operate(lambda: outside(receive, *given))
            made.send = lambda data: operate(lambda: outside(send, data), lambda: outside(send, self._torn(data)))
        self.descriptors[made.fileno()] = made
        return made

    def _torn(self, data: Any) -> Any:
        return data[: self.rng.randrange(1, len(data) + 1)] if len(data) else data

    def close_all(self, process: Process, power: bool) -> None:
        """Close the descriptors of a dead process. What a tty holds goes out, unless the computer has no power."""
        for each in self.descriptors.values():
            if each.owner is process and not each.closed:
                if power and isinstance(each, Port):
                    outside(each.drop)
                outside(each.close)

    def _rng(self) -> Random:
        return Random(f"{self.seed} descriptor {self.loop.descriptors}")

    def serial(self, port: str, baud: int, **settings: Any) -> Any:
        """Open a port, as `serial.Serial` does."""
        adapter = self.found(port)
        if adapter is None:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
        if adapter.held or (adapter.opened is not None and not adapter.opened.closed):
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        who = WHO.get()
        trace = self._trace(who, adapter.line)
        made = Port(self.loop, self.floor, adapter.line, self._rng(), self.climate, trace, baud)
        self.latest[adapter.line + who] = made
        adapter.opened = self._add(made)
        return SerialPort(made)

    def socket(self, family: Any, kind: Any, protocol: int = 0) -> Socket:
        """Make a socket; its line is known once it is connected."""
        who = WHO.get()
        made: Socket = self._add(Socket(self.network, self._rng(), lambda way, data: None, kind))

        def traced(host: str) -> Trace:
            line = host.partition(".")[0]
            self.latest[line + who] = made
            return self._trace(who, line)

        made.traced = traced
        return made

    def keep(self, made: Carrier, line: str) -> None:
        """Keep an open controller, whose host is the process that runs now."""
        made.owner, made.climate, made.trace = PROCESS.get(), self.climate, self._trace(WHO.get(), line)
        self.descriptors[self.loop.descriptor()] = made

    def ssh(self, far: FarPort, baud: int, way: str) -> SshProgram:
        """Start the program `ssh`."""
        made = outside(SshProgram, self, far, baud)
        made.own(PROCESS.get())
        return made

    @staticmethod
    def as_far(work: Callable[[], Any]) -> Any:
        """Do something as a computer that lends a port."""
        token = WHO.set("far")
        try:
            return outside(work)
        finally:
            WHO.reset(token)

    # System calls

    def read(self, number: int, most: int) -> bytes:
        """Read a descriptor."""
        return bytes(self._at(number).recv(most))

    def write(self, number: int, data: Any) -> int:
        """Write a descriptor."""
        return int(self._at(number).send(data))

    def unsent(self, number: int) -> int:
        """Bytes that have not left."""
        return self._at(number).unsent() if number in self.descriptors else 0

    def flush(self, number: int, queue: int) -> None:
        """Drop what a tty has not sent."""
        self._at(number).drop()

    def _at(self, number: int) -> Any:
        if (found := self.descriptors.get(number)) is None or found.closed:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return found

    def exists(self, path: str) -> bool:
        """Whether a path is there."""
        return self.found(path) is not None

    def realpath(self, path: str) -> str:
        """The node that a path leads to."""
        found = self.found(path)
        return found.node if found is not None else path

    def stable_names(self, root: object) -> dict[str, str]:
        """The links of all adapters, by their nodes."""
        return {each.node: each.link for each in self.adapters if each.node}

    def in_use(self, path: str) -> str:
        """The program that has a port open, and the remedy."""
        found = self.found(path)
        return f"{OTHER if found is not None and found.held else 'another program'}; close it there"

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Put them in place of the system's."""
        path = SimpleNamespace(exists=self.exists, realpath=self.realpath)
        system = _like(os, read=self.read, write=self.write, path=path)
        tty = _like(termios, tcgetattr=lambda number: [0] * 7, tcsetattr=lambda *given: None, tcflush=self.flush)
        seams: tuple[tuple[Any, str, Any], ...] = (
            (reconnect, "os", system),
            (serial_ports, "_stable_names", self.stable_names),
            (serial_ports, "present", lambda name: name if self.exists(name) else ""),
            (serial_port, "os", system),
            (serial_port, "serial", SimpleNamespace(Serial=self.serial, SerialBase=object)),
            (serial_port, "termios", tty),
            (serial_port, "fcntl", SimpleNamespace(ioctl=lambda *given: 0)),
            (serial_port, "output_queue", self.unsent),
            (serial_port, "in_use", self.in_use),
            (serial_port, "beside", lambda port: ""),
            (serial_port, "taker", lambda: ""),
            (serial_pipe, "beside", lambda port: ""),
            (serial_pipe, "suspects", lambda port: ""),
            (libusb, "LibusbCarrier", self.usb),
            (sockets, "socket", _like(socket, socket=self.socket)),
            (sockets, "output_queue", self.unsent),
            (ssh_session, "SshSession", self.ssh),
            (relay, "os", system),
            (relay, "_now", self.loop.time),
            (pacing, "PACER", Pacer(self.loop, Random(f"{self.seed} pacer"))),
            (power, "ETHERNET_BOOT", BOOT),
        )
        before = [(module, name, getattr(module, name)) for module, name, _ in seams]
        for module, name, made in seams:
            setattr(module, name, made)
        try:
            yield
        finally:
            for module, name, made in before:
                setattr(module, name, made)


def _like(module: Any, **others: Any) -> SimpleNamespace:
    """A module with other functions."""
    return SimpleNamespace(**{**vars(module), **others})


class SerialPort:
    """An open port, as `serial.Serial` is one."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self.fileno, self.close = port.fileno, port.close
        self.dtr = self.rts = self.break_condition = False

    @property
    def baudrate(self) -> int:
        """The baud rate."""
        return self._port.baud or 0

    @baudrate.setter
    def baudrate(self, baud: int) -> None:
        self._port.baud = baud
