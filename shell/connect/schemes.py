"""The kinds of URL: one table for opening, completion, messages, and help. Imports nothing that takes time."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.text import whole
from multidrop.shell.connect.scheme import Connection, NoLine, Open, Scheme, last_part

if TYPE_CHECKING:
    from multidrop.shell.connect.reconnect import Reopen
    from multidrop.transports import Transport
    from multidrop.transports.serial_ports import PortInfo
    from multidrop.transports.ssh import FarPort


class Serial(Scheme):
    """A serial port of this machine. It is opened again under a name that follows its adapter."""

    name, prefix, example = "serial", "serial:", "serial:PORT?baud=9600"
    meaning = "a serial port; its bare path does too"
    bauded = True

    def parse(self, base: Connection, body: str) -> Connection:
        if not body:
            raise Diagnostic("serial: without a port", base.text, "as in serial:/dev/ttyUSB0?baud=9600")
        return replace(base, target=body)

    def in_folder(self, connection: Connection, folder: str) -> Connection:
        """Start a path at a folder. The name of a port, as COM3, is not a path."""
        is_path = re.search(r"[/\\]|^\.", connection.target)
        return _rooted(connection, folder) if is_path else connection

    def port_name(self, connection: Connection) -> str:
        from multidrop.transports.serial_ports import stable_name

        return stable_name(connection.target)

    def shown(self, connection: Connection, bus: str = "") -> str:
        return connection.target

    def lasting(self, connection: Connection, bus: str) -> str:
        return connection.text.replace(connection.target, connection.port_name, 1)

    def found(self, connection: Connection, port: str) -> str:
        return f"serial:{connection.port_name}"

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        from multidrop.transports.serial_port import open_serial

        return await open_serial(connection.target, baud)

    def again(self, connection: Connection, open_: Open, took: float) -> Reopen | None:
        from multidrop.shell.connect.reconnect import SerialAgain

        again = SerialAgain(connection.target, lambda name: open_(replace(connection, target=name)))
        return again if again.possible else None

    def ports(self) -> list[PortInfo]:
        from multidrop.transports.serial_ports import list_ports

        return list_ports()


class Tcp(Scheme):
    """A stream of bytes: a drive with Ethernet, or a gateway to a serial line."""

    name, prefix, example = "tcp", "tcp://", "tcp://HOST:503"
    meaning = "an Ethernet drive or a gateway"
    port = 503
    turns = 1.0

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        from multidrop.transports.sockets import open_tcp

        return await open_tcp(connection.host, connection.port, self.name, within)


class Udp(Scheme):
    """Datagrams of a drive with Ethernet."""

    name, prefix, example = "udp", "udp://", "udp://HOST:503"
    meaning = "an Ethernet drive over UDP"
    port = 503
    datagrams = alone = True

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        from multidrop.transports.sockets import open_udp

        return await open_udp(connection.host, connection.port)


class Rfc2217(Scheme):
    """A serial port of a terminal server."""

    name, prefix, example = "rfc2217", "rfc2217://", "rfc2217://HOST:PORT"
    meaning = "a serial port of a terminal server"
    port = 0
    bauded = True

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        from multidrop.transports.rfc2217 import open_rfc2217

        return await open_rfc2217(connection.host, connection.port, baud, within)


class Ssh(Scheme):
    """A serial port of another machine, to which the user's own `ssh` logs in."""

    name, prefix, example = "ssh", "ssh://", "ssh://HOST/dev/ttyUSB0"
    meaning = "a serial port of another machine, through ssh"
    bauded = relayed = logs_in = True
    turns = 0.25

    def parse(self, base: Connection, body: str) -> Connection:
        """Read a host as `ssh` takes it, never one of its options, and the path of a port there."""
        from urllib.parse import unquote

        from multidrop.transports.ssh import WORD, wrong_path

        example = "as in ssh://user@host/dev/ttyUSB0"
        match = re.fullmatch(rf"//(?:({WORD})@)?(\[[0-9A-Fa-f:.]+\]|{WORD})(?::(\d+))?(/.*)?", body, re.DOTALL)
        if match is None:
            raise Diagnostic("ssh: needs //[USER@]HOST[:PORT] and the path of a port there", base.text, example)
        if (port := whole(match[3], 1, 65535) if match[3] else 0) is None:
            raise Diagnostic(f"no port {match[3]}; valid: 1 to 65535", base.text, example)
        path = unquote(match[4] or "")
        if wrong := wrong_path(path):
            raise Diagnostic(f"{wrong}, on {match[2]}", base.text, example)
        return replace(base, user=match[1] or "", host=match[2].strip("[]"), port=port, target=path)

    def short(self, connection: Connection) -> str:
        return f"{connection.host}-{last_part(connection.target)}"

    def port_name(self, connection: Connection) -> str:
        return replace(_far_port(connection), user="", host=connection.host.lower()).name

    def shown(self, connection: Connection, bus: str = "") -> str:
        return _far_port(connection).name

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        far = _far_port(connection)
        if sys.platform == "win32":
            from multidrop.transports import Unreachable

            raise Unreachable(f"{far.name}: ssh:// needs multidrop on Linux or macOS here")
        else:
            from multidrop.transports.ssh_session import open_ssh

            return await open_ssh(far, baud, within, connection.relay)

    def again(self, connection: Connection, open_: Open, took: float) -> Reopen | None:
        from multidrop.shell.connect.reconnect import LoginAgain

        return LoginAgain(lambda within, baud: open_(connection, within=within, baud=baud), took)


class Sim(Scheme):
    """The buses of a simulated cell, which `shell.connect.opening` opens in this process."""

    name, prefix, example = "sim", "sim:", "sim:CELL.toml#BUS"
    meaning = "simulated drives; sim: alone is the demo cell"
    simulated = True

    def parse(self, base: Connection, body: str) -> Connection:
        return replace(base, target=body)

    def in_folder(self, connection: Connection, folder: str) -> Connection:
        return _rooted(connection, folder)

    def port_name(self, connection: Connection) -> str:
        return ""

    def shown(self, connection: Connection, bus: str = "") -> str:
        return f"sim:{connection.target}" + (f"#{connection.bus or bus}" if connection.bus or bus else "")

    def lasting(self, connection: Connection, bus: str) -> str:
        """The URL with the whole path of the file: a saved connection is opened from any folder."""
        text = connection.text
        if written := re.split(r"[?#]", text.partition(":")[2])[0]:
            text = text.replace(written, os.path.abspath(connection.target), 1)
        return text if connection.bus else f"{text.partition('?')[0]}#{bus}"

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        """Raise Unreachable: a cell has buses, which are opened without a port."""
        from multidrop.transports import Unreachable

        raise Unreachable(f"{self.shown(connection)}: a simulated cell has no port")


def _rooted(connection: Connection, folder: str) -> Connection:
    path = connection.target
    whole_path = os.path.abspath(os.path.join(folder, os.path.expanduser(path)))
    return replace(connection, target=whole_path) if path else connection


def _far_port(connection: Connection) -> FarPort:
    from multidrop.transports.ssh import FarPort

    return FarPort(connection.host, connection.target, connection.user, connection.port)


CORE: Mapping[str, Scheme] = {scheme.name: scheme for scheme in (Serial(), Tcp(), Udp(), Rfc2217(), Ssh(), Sim())}
"""The schemes of the core, by name."""
SAVED = "the name of a saved connection"


def schemes() -> dict[str, Scheme]:
    """All schemes by name, those of features among them."""
    added = {scheme.name: scheme for scheme in registry.added(Scheme) if scheme.name not in CORE}  # type: ignore[type-abstract]
    names = [*CORE]
    registry.place({name: scheme.after for name, scheme in added.items()}, names)
    known = {**added, **CORE}
    return {name: known[name] for name in names}


def named(name: str) -> Scheme | None:
    """Find a scheme; None: there is none. Raises Diagnostic where its feature is gone.

    One that multidrop does not have may be of others, who are loaded for it: a URL may be read before a session opens.
    """
    if name in CORE:
        return CORE[name]
    answering = registry.answering(Scheme, f"{name}:")  # type: ignore[type-abstract]
    return next((scheme for scheme in answering if scheme.name == name), None)


def no_line(name: str) -> NoLine | None:
    """Find what is said of a kind of URL that leads to no drives; None: there is no such kind."""
    return next((declared for declared in registry.answering(NoLine, f"{name}:") if name in declared.names), None)


def sentence() -> str:
    """All forms in one line."""
    return f"a port, {', '.join(scheme.example for scheme in schemes().values())} or {SAVED}"


def table() -> list[str]:
    """All forms, a line each."""
    forms = schemes().values()
    width = max(len(form.example) for form in forms)
    return [f"  {form.example:<{width}}  {form.meaning}" for form in forms]


def local_ports() -> Iterator[PortInfo]:
    """The ports of this machine, of all schemes. The search may be slow."""
    for scheme in schemes().values():
        try:
            yield from scheme.ports()
        except Diagnostic as problem:  # by others
            registry.warn(str(problem))
