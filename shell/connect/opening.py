"""Opening a connection: a transport and the bus that owns it, or the buses of a simulated cell."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.dialects import Family, Hints
from multidrop.dialects.families import DEFAULT, FAMILIES
from multidrop.drives.bus import Bus
from multidrop.drives.line import DEFAULT_TIMEOUT
from multidrop.shell import configuration
from multidrop.shell.connect.reconnect import Absent, LoginAgain, Reopen, SerialAgain, host_again, simulated, usb_again
from multidrop.shell.connect.urls import Connection
from multidrop.shell.state.port_state import PortState
from multidrop.transports import NotOpen, Unreachable
from multidrop.transports.ssh import FarPort

if TYPE_CHECKING:
    from multidrop.dialects.units import Scale
    from multidrop.drives.port_journal import Keeper
    from multidrop.simulator.serving.in_process import SimBus
    from multidrop.simulator.serving.running import RunningFloor
    from multidrop.transports import Transport

Naming = Callable[[str], str]
"""Returns a free name for a bus."""


@dataclass(frozen=True)
class Opened:
    """A bus that does not read yet, the hints on its drives, and its simulated cell if it has one."""

    bus: Bus
    hints: Hints
    floor: RunningFloor | None = None
    warnings: tuple[str, ...] = ()
    """Notices for a person before the search for drives."""
    limits: str = ""
    """The promises that its transport cannot keep."""
    reopen: Reopen | None = None
    """Opens its port again after a loss; None: it cannot be found again."""
    absent: bool = False
    """Its port could not be opened yet; the bus is lost as soon as it is adopted."""
    units: Mapping[str, Scale] = field(default_factory=lambda: MappingProxyType({}))
    """The scales that a simulated cell states for its drives, by address, or `ADDRESS.AXIS`."""


BAUDED = ("serial", "rfc2217", "ssh")
"""The schemes of ports with a baud rate."""
Opener = Callable[[Connection, Naming], Awaitable[list[Opened]]]


async def open_buses(
    connection: Connection, naming: Naming, state: Path | None = None, failure: TransportLost | None = None
) -> list[Opened]:
    """Open a connection. Raises Unreachable where nothing listens, Diagnostic for an unknown family.

    `state`: the folder that keeps what an interrupted session leaves on a port; None: nothing is kept. `failure`: the
    port could not be opened; its bus is lost from the beginning, and is tried again.
    """
    family = _family(connection)
    if connection.scheme == "sim":
        return await _simulated(connection, naming)
    if family.prepare is not None:
        await asyncio.to_thread(family.prepare)  # a stop of another bus must not wait for it
    transport, reopen = (
        await _connected(connection) if failure is None else (NotOpen(connection.short, failure), first(connection))
    )
    limits = transport.limits
    hints, name = connection.hints, naming(connection.short)
    if state is None or not family.repairs:
        return [
            Opened(
                _bus(name, transport, connection, hints.family),
                hints,
                limits=limits,
                reopen=reopen,
                absent=failure is not None,
            )
        ]
    kept = PortState(state, port_name(connection), _baud(connection))
    bus = _bus(name, transport, connection, hints.family, kept)
    kept.notify = partial(bus.notify, warning=True)
    bus.link.leftovers.recovering = bool(kept.owed) and not family.codec.framed
    cut = "" if family.codec.framed else kept.cut  # a part of a frame is dropped after a pause
    warnings = (*kept.remarks, *([CUT.format(cut)] if cut else []))
    found = replace(
        hints, cut=cut, owed=kept.owed, remembered=kept.memory.drives, first_mark=time.time_ns() // 10_000_000 % MARKS
    )
    return [Opened(bus, found, warnings=warnings, limits=limits, reopen=reopen, absent=failure is not None)]


MARKS = 90
"""A mark differs from that of the last use of a port; it has two digits, so that lines stay short."""
CUT = (
    "the last session on this port was interrupted while it sent '{}'; a drive may hold a part of it. Every drive is "
    "stopped, and its line buffer is made to overflow (error 20), before anything else is sent"
)


@dataclass(frozen=True)
class OpenedPort:
    """An open byte pipe without a bus, for a front end that passes bytes on."""

    name: str
    transport: Transport
    family: str
    """The family that its URL names; empty: it names none."""
    baud: int
    reopen: Reopen | None = None
    """As for `Opened`."""


async def open_port(connection: Connection) -> OpenedPort:
    """Open the byte pipe of a connection. Raises Unreachable, Diagnostic for a URL of several pipes or of none."""
    family, baud = connection.hints.family, connection.baud or _family(connection).baud
    if connection.scheme == "sim":
        found = await _cell(connection)
        first, *others = found
        if others:
            for each in found:
                await each.transport.close()
            raise Diagnostic(f"{len(found)} buses", connection.text, f"name one of them, as in sim:#{first.name}")
        return OpenedPort(first.name, first.transport, family or first.dialect, first.baud or baud, simulated(first))
    transport, reopen = await _connected(connection)
    return OpenedPort(connection.short, transport, family, baud, reopen)


def port_name(connection: Connection) -> str:
    """One name for a port, whichever of its names is given; empty for a simulated bus."""
    if connection.scheme == "sim":
        return ""
    if connection.scheme == "ssh":
        return replace(far_port(connection), user="", host=connection.host.lower()).name
    if connection.scheme == "usb":
        return f"usb:{connection.target}"
    if connection.scheme != "serial":
        return f"{connection.host.lower()}:{connection.port}" + (f"/{connection.target}" if connection.target else "")
    from multidrop.transports.serial_ports import stable_name

    return stable_name(connection.target)


def far_port(connection: Connection) -> FarPort:
    return FarPort(connection.host, connection.target, connection.user, connection.port)


def _family(connection: Connection) -> Family[Any]:
    """The family that a connection names, or the default one. Raises Diagnostic."""
    name = connection.hints.family or DEFAULT
    if name not in FAMILIES:
        raise Diagnostic(f"no family of drives {name}", connection.text, f"valid: {', '.join(FAMILIES)}")
    return FAMILIES[name]


def _baud(connection: Connection) -> int:
    """The baud rate of a connection; 0 for a port that has none."""
    return connection.baud or (_family(connection).baud if connection.scheme in BAUDED else 0)


def _bus(name: str, transport: Transport, connection: Connection, family: str, keeper: Keeper | None = None) -> Bus:
    timeout = connection.timeout or DEFAULT_TIMEOUT
    echo, baud = connection.local_echo, _baud(connection)
    return Bus(name, transport, baud=baud, local_echo=echo, timeout=timeout, family=family, keeper=keeper)


async def _transport(
    connection: Connection, port: str = "", within: float | None = None, baud: int | None = None
) -> Transport:
    """Open a transport; a serial port by another name than it was given, a host within a time, s."""
    baud = baud or connection.baud or _family(connection).baud
    if connection.scheme == "serial":
        from multidrop.transports.serial_port import open_serial

        return await open_serial(port or connection.target, baud)
    if connection.scheme == "rfc2217":
        from multidrop.transports.rfc2217 import open_rfc2217

        return await open_rfc2217(connection.host, connection.port, baud, within)
    if connection.scheme == "ssh":
        far = far_port(connection)
        if sys.platform == "win32":
            raise Unreachable(f"{far.name}: ssh:// needs multidrop on Linux or macOS here")
        else:
            from multidrop.transports.ssh_session import open_ssh

            return await open_ssh(far, baud, within, connection.relay)
    if connection.scheme == "usb":
        from multidrop.transports.libusb import open_libusb

        return await open_libusb(port or connection.target)
    if connection.scheme == "usbip":
        from multidrop.transports.usb import open_usb
        from multidrop.transports.usbip import imported

        carrier = await imported(connection.host, connection.port, connection.target, within)
        opened = await open_usb(carrier)
        opened.identity = await carrier.number()
        return opened
    from multidrop.transports.sockets import open_tcp, open_udp

    if connection.scheme == "udp":
        return await open_udp(connection.host, connection.port)
    return await open_tcp(connection.host, connection.port, connection.scheme, within)


async def _connected(connection: Connection) -> tuple[Transport, Reopen | None]:
    """Open a transport; return with it the way to open it again after a loss, if there is one."""
    clock = asyncio.get_running_loop().time
    begun = clock()
    transport = await _transport(connection)
    return transport, _again(connection, clock() - begun)


def _again(connection: Connection, took: float) -> Reopen | None:
    """The way to open a port again, whose first opening `took` so long, s; None: there is none."""
    if connection.scheme == "ssh":
        return LoginAgain(lambda within, baud: _transport(connection, within=within, baud=baud), took)
    if connection.scheme == "usb":
        return usb_again(partial(_transport, connection))
    if connection.scheme != "serial":
        return host_again(lambda within: _transport(connection, within=within), took)
    again = SerialAgain(connection.target, partial(_transport, connection))
    return again if again.possible else None


def first(connection: Connection) -> Reopen:
    """The way to open a port that was never open in this session, or is set in another way; then to open it again."""
    again: Reopen | None = _again(connection, 0.0) if connection.scheme == "ssh" else None
    opened = False

    async def open_(old: Transport) -> Transport:
        nonlocal again, opened
        await old.close()
        if again is not None:
            return await again(old)
        if opened:
            raise Absent(f"{old.name} cannot be found again")
        transport, again = await _connected(connection)
        opened = True
        return transport

    return open_


async def _cell(connection: Connection) -> Sequence[SimBus]:
    """The buses of a simulated cell, or the one that is named."""
    from multidrop.simulator.serving.in_process import connect

    target = connection.target + (f"#{connection.bus}" if connection.bus else "")
    return await connect(target, configuration.load().allowed if connection.target else ())


async def _simulated(connection: Connection, naming: Naming) -> list[Opened]:
    found = []
    for each in await _cell(connection):
        given = connection.hints
        hints = replace(
            given,
            family=given.family or each.dialect,
            drives=given.drives or (each.names if each.party else ()),
            party=each.party if given.party is None else given.party,
        )
        own = connection.name if connection.bus and connection.name else each.name
        bus = _bus(naming(own), each.transport, connection, hints.family)
        found.append(Opened(bus, hints, each.floor, reopen=simulated(each), units=each.units))
    return found
