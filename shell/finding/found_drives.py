"""A drive that a search has found: in words, as facts for a program, and as the URL that opens it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from multidrop.dialects import DriveState
from multidrop.dialects.families import DEFAULT
from multidrop.shell.connect.opening import far_port, port_name
from multidrop.shell.connect.urls import Connection


@dataclass(frozen=True)
class FoundDrive:
    """A drive that replied, and where."""

    connection: Connection
    """Leads to the port as the drive is set."""
    port: str
    state: DriveState

    @property
    def url(self) -> str:
        """The URL that opens this drive alone."""
        return url_of([self])

    def facts(self) -> dict[str, Any]:
        """The drive for a program."""
        state, codec = self.state, self.state.codec
        return {
            "port": self.port,
            "baud": self.connection.baud,
            "dialect": codec.family,
            "address": state.address,
            "name": state.name,
            "product": state.product,
            "part": state.part,
            "version": state.version,
            "serial": state.serial,
            **{key: getattr(codec, key, None) for key in ("party", "checksum", "em", "escape")},
            "url": self.url,
        }

    def words(self) -> str:
        """The drive for a person, in one line."""
        state = self.state
        baud = f"{self.connection.baud} baud" if self.connection.baud else ""
        name = state.address or (f"({state.name})" if state.name else "-")
        part = f"part {state.part}" if state.part else ""
        serial = f"serial {state.serial}" if state.serial else ""
        product = "" if state.version.startswith(state.product) else state.product
        modes = getattr(state.codec, "shown", "")
        return "  ".join(filter(None, (self.port, baud, name, product, state.version, part, serial, modes)))


def url_of(found: Sequence[FoundDrive]) -> str:
    """The URL that opens drives of one language and baud rate on one port."""
    connection, codec = found[0].connection, found[0].state.codec
    keys = []
    if connection.baud:
        keys.append(f"baud={connection.baud}")
    if codec.family != DEFAULT:
        keys.append(f"dialect={codec.family}")
    party = getattr(codec, "party", None)
    if party is not None and connection.scheme != "udp":
        keys.append(f"party={int(party)}")
    if names := [each.state.address for each in found if each.state.address]:
        keys.append(f"drives={','.join(names)}")
    elif party is None:
        keys.append("address=none")
    if connection.relay:
        keys.append(f"relay={connection.relay}")
    if connection.local_echo:
        keys.append("echo=local")
    base = f"serial:{port_name(connection)}" if connection.scheme == "serial" else found[0].port
    head, _, bus = base.partition("#")
    return head + (f"?{'&'.join(keys)}" if keys else "") + (f"#{bus}" if bus else "")


def port_of(connection: Connection, bus: str) -> str:
    """The port for a person and a program, without keys."""
    if connection.scheme == "serial":
        return connection.target
    if connection.scheme == "sim":
        return f"sim:{connection.target}" + (f"#{connection.bus or bus}" if connection.bus or bus else "")
    if connection.scheme == "ssh":
        return far_port(connection).name
    host = f"[{connection.host}]" if ":" in connection.host else connection.host
    return f"{connection.scheme}://{host}:{connection.port}"
