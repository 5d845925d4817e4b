"""Opens what a connection names: a transport and the bus that owns it, or the buses of a simulated cell."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dialects import Diagnostic, Family, Hints
from dialects.families import DEFAULT, FAMILIES
from drives.bus import Bus
from shell.connect.port_state import PortState
from shell.connect.urls import Connection

if TYPE_CHECKING:
    from drives.keeping import Keeper
    from simulator.serving.running import RunningFloor
    from transports import Transport

Naming = Callable[[str], str]
"""Makes the name of a bus one that is not taken."""


@dataclass(frozen=True)
class Opened:
    """A bus that reads nothing yet, what is known of its drives, and its shop floor where it is a simulated one."""

    bus: Bus
    hints: Hints
    floor: RunningFloor | None = None
    warnings: tuple[str, ...] = ()
    """What a person should know before its drives are looked for."""


Opener = Callable[[Connection, Naming], Awaitable[list[Opened]]]


async def open_buses(connection: Connection, naming: Naming, state: Path | None = None) -> list[Opened]:
    """Open it. Raises Unreachable where there is nothing, Diagnostic for what this version cannot speak.

    `state`: the folder in which it is kept what a session that is cut off leaves behind on a port; None: nowhere.
    """
    family = _spoken(connection.hints.family, connection)
    if connection.scheme == "sim":
        return await _simulated(connection, naming)
    if family.prepare is not None:
        await asyncio.to_thread(family.prepare)  # a stop of another bus must not wait for it
    transport = await _transport(connection)
    hints, name = connection.hints, naming(connection.short)
    if state is None or not family.repairs:
        return [Opened(_bus(name, transport, connection, hints.family), hints)]
    kept = PortState(state, _port(connection))
    bus = _bus(name, transport, connection, hints.family, kept)
    kept.notify = partial(bus.notify, warning=True)
    warnings = (*kept.remarks, *([CUT.format(kept.cut)] if kept.cut else []))
    return [Opened(bus, replace(hints, cut=kept.cut, owed=kept.owed), warnings=warnings)]


CUT = (
    "the last use of this port was cut off while '{}' was on its way, and a part of it may stand in a drive: every "
    "drive is stopped and its line buffer made to overflow (error 20) before anything is asked"
)


def _port(connection: Connection) -> str:
    """What a port is called whichever of its names is given."""
    if connection.scheme != "serial":
        return f"{connection.host.lower()}:{connection.port}"
    from transports.listing import stable_name

    return stable_name(connection.target)


def _spoken(family: str, connection: Connection) -> Family[Any]:
    """The family that a connection names, or the default one. Raises Diagnostic."""
    if (found := FAMILIES.get(family or DEFAULT.name)) is None:
        known = ", ".join(FAMILIES)
        raise Diagnostic(f"{family} is not spoken by this version", connection.text, f"it speaks {known}")
    return found


def _bus(name: str, transport: Transport, connection: Connection, family: str, keeper: Keeper | None = None) -> Bus:
    serial = connection.scheme in ("serial", "rfc2217")
    baud = connection.baud or (DEFAULT_BAUD if serial else 0)
    timeout = connection.timeout or DEFAULT_TIMEOUT
    echo = connection.local_echo
    return Bus(name, transport, baud=baud, local_echo=echo, timeout=timeout, family=family, keeper=keeper)


DEFAULT_BAUD = 9600
DEFAULT_TIMEOUT = 1.0


async def _transport(connection: Connection) -> Transport:
    from transports import open as opening

    if connection.scheme == "serial":
        return await opening.open_serial(connection.target, connection.baud or DEFAULT_BAUD)
    if connection.scheme in ("tcp", "modbus"):
        return await opening.open_tcp(connection.host, connection.port, connection.scheme)
    if connection.scheme == "udp":
        return await opening.open_udp(connection.host, connection.port)
    baud = connection.baud or DEFAULT_BAUD
    return await opening.open_rfc2217(connection.host, connection.port, baud)


async def _simulated(connection: Connection, naming: Naming) -> list[Opened]:
    from simulator.serving.in_process import connect

    target = connection.target + (f"#{connection.bus}" if connection.bus else "")
    found = []
    for each in await connect(target):
        said = connection.hints
        hints = replace(
            said,
            family=said.family or each.dialect,
            drives=said.drives or (each.names if each.party else ()),
            party=each.party if said.party is None else said.party,
        )
        own = connection.name if connection.bus and connection.name else each.name
        bus = _bus(naming(own), each.transport, connection, hints.family)
        found.append(Opened(bus, hints, each.floor))
    return found
