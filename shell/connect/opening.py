"""Opening a connection: a transport and the bus that owns it, or the buses of a simulated cell."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.dialects import Family, Hints
from multidrop.dialects.families import DEFAULT, FAMILIES
from multidrop.drives.bus import Bus
from multidrop.drives.line import DEFAULT_TIMEOUT
from multidrop.shell import configuration
from multidrop.shell.connect.reconnect import Absent, Reopen, simulated
from multidrop.shell.connect.scheme import Connection
from multidrop.shell.state.port_state import PortState
from multidrop.transports import NotOpen, Unreachable

if TYPE_CHECKING:
    from multidrop.dialects.units import Scale
    from multidrop.drives.port_journal import Keeper
    from multidrop.simulator.serving.in_process import SimBus
    from multidrop.simulator.serving.running import RunningFloor
    from multidrop.transports import Transport

Naming = Callable[[str], str]
"""Returns a free name for a bus."""


@dataclass(frozen=True)
class OpenedBus:
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


Opener = Callable[[Connection, Naming], Awaitable[list[OpenedBus]]]


async def open_buses(
    connection: Connection, naming: Naming, state: Path | None = None, failure: TransportLost | None = None
) -> list[OpenedBus]:
    """Open a connection. Raises Unreachable where nothing listens, Diagnostic for an unknown family.

    `state`: the folder that keeps what an interrupted session leaves on a port; None: nothing is kept. `failure`: the
    port could not be opened; its bus is lost from the beginning, and is tried again.
    """
    family = _family(connection)
    if connection.scheme.simulated:
        return await _simulated(connection, naming)
    if family.offers("prepare"):
        await asyncio.to_thread(family.prepare)  # a stop of another bus must not wait for it
    transport, reopen = (
        await _connected(connection) if failure is None else (NotOpen(connection.short, failure), first(connection))
    )
    limits = transport.limits
    hints, name = connection.hints, naming(connection.short)
    if state is None or not family.repairs:
        return [
            OpenedBus(
                _bus(name, transport, connection, hints.family),
                hints,
                limits=limits,
                reopen=reopen,
                absent=failure is not None,
            )
        ]
    kept = PortState(state, connection.port_name, _baud(connection))
    bus = _bus(name, transport, connection, hints.family, kept)
    kept.notify = partial(bus.notify, warning=True)
    bus.link.leftovers.recovering = bool(kept.owed) and not family.codec.framed
    cut = "" if family.codec.framed else kept.cut  # a part of a frame is dropped after a pause
    warnings = (*kept.remarks, *([CUT.format(cut)] if cut else []))
    known_hints = replace(
        hints, cut=cut, owed=kept.owed, remembered=kept.memory.drives, first_mark=time.time_ns() // 10_000_000 % MARKS
    )
    return [OpenedBus(bus, known_hints, warnings=warnings, limits=limits, reopen=reopen, absent=failure is not None)]


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
    """As for `OpenedBus`."""


async def open_port(connection: Connection) -> OpenedPort:
    """Open the byte pipe of a connection. Raises Unreachable, Diagnostic for a URL of several pipes or of none."""
    family, baud = connection.hints.family, connection.baud or _family(connection).baud
    if connection.scheme.simulated:
        cell = await _cell(connection)
        first, *others = cell
        if others:
            for bus in cell:
                await bus.transport.close()
            raise Diagnostic(f"{len(cell)} buses", connection.text, f"name one of them, as in sim:#{first.name}")
        return OpenedPort(first.name, first.transport, family or first.dialect, first.baud or baud, simulated(first))
    transport, reopen = await _connected(connection)
    return OpenedPort(connection.short, transport, family, baud, reopen)


def _family(connection: Connection) -> type[Family]:
    """The family that a connection names, or the default one. Raises Diagnostic."""
    name = connection.hints.family or DEFAULT
    if name not in FAMILIES:
        raise Diagnostic(f"no family of drives {name}", connection.text, f"valid: {', '.join(FAMILIES)}")
    return FAMILIES[name]


def _baud(connection: Connection) -> int:
    """The baud rate of a connection; 0 for a port that has none."""
    return connection.baud or (_family(connection).baud if connection.scheme.bauded else 0)


def _bus(name: str, transport: Transport, connection: Connection, family: str, keeper: Keeper | None = None) -> Bus:
    timeout = connection.timeout or DEFAULT_TIMEOUT
    echo, baud = connection.local_echo, _baud(connection)
    return Bus(name, transport, baud=baud, local_echo=echo, timeout=timeout, family=family, keeper=keeper)


async def _transport(connection: Connection, *, within: float | None = None, baud: int | None = None) -> Transport:
    """Open a transport, at another baud rate than its URL has, or a host within a time, s. Raises Unreachable."""
    try:
        return await connection.scheme.open(connection, baud or connection.baud or _family(connection).baud, within)
    except OSError as failure:  # of a scheme by others, as that of a socket
        raise Unreachable(f"{connection.scheme.shown(connection)}: {failure.strerror or failure}") from failure


async def _connected(connection: Connection) -> tuple[Transport, Reopen | None]:
    """Open a transport; return with it the way to open it again after a loss, if there is one."""
    clock = asyncio.get_running_loop().time
    begun = clock()
    transport = await _transport(connection)
    return transport, _again(connection, clock() - begun)


def _again(connection: Connection, took: float) -> Reopen | None:
    """The way to open a port again, whose first opening `took` so long, s; None: there is none."""
    return connection.scheme.again(connection, _transport, took)


def first(connection: Connection) -> Reopen:
    """The way to open a port that was never open in this session, or is set in another way; then to open it again."""
    again: Reopen | None = _again(connection, 0.0) if connection.scheme.logs_in else None
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


async def _simulated(connection: Connection, naming: Naming) -> list[OpenedBus]:
    buses = []
    for sim in await _cell(connection):
        given = connection.hints
        hints = replace(
            given,
            family=given.family or sim.dialect,
            drives=given.drives or (sim.names if sim.party else ()),
            party=sim.party if given.party is None else given.party,
        )
        own = connection.name if connection.bus and connection.name else sim.name
        bus = _bus(naming(own), sim.transport, connection, hints.family)
        buses.append(OpenedBus(bus, hints, sim.floor, reopen=simulated(sim), units=sim.units))
    return buses
