"""A kind of URL: how it is written, parsed, named, opened and opened again. Imports nothing that takes time.

`Scheme` has a default for everything but the form and the opening, so that `tcp://` is a few lines. The core's are in
`shell.connect.schemes`; a feature adds an instance of its own class to its record.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Kinds
from multidrop.base.text import whole

if TYPE_CHECKING:
    from multidrop.dialects import Hints
    from multidrop.shell.connect.reconnect import Reopen
    from multidrop.transports import Transport
    from multidrop.transports.serial_ports import PortInfo


def _no_hints() -> Hints:
    from multidrop.dialects import Hints

    return Hints()


@dataclass(frozen=True)
class Connection:
    """The place of drives, and the settings that the user states of them: what a URL says."""

    scheme: Scheme
    text: str
    """The text as typed."""
    target: str = ""
    """The port's path, or the cell file (empty: the demo cell)."""
    bus: str = ""
    """The one bus of a cell; empty for all."""
    host: str = ""
    port: int = 0
    """0, for ssh: as the user's own configuration of ssh says."""
    user: str = ""
    relay: str = ""
    """The program on the far side of ssh; empty: whichever is there."""
    name: str = ""
    """The name of the saved connection; empty if it is not saved."""
    labels: Mapping[str, str] = field(default_factory=dict)
    """The saved connection's names for its drives, by address."""
    hints: Hints = field(default_factory=_no_hints)
    """The keys on the drives: dialect, drives, party, checksum, em, address."""
    baud: int | None = None
    local_echo: bool = False
    timeout: float | None = None
    """The time to wait for a reply, s."""

    @property
    def short(self) -> str:
        """The default name of its bus: the saved name, or what the scheme calls it."""
        return self.name or self.scheme.short(self)

    @property
    def by_port(self) -> str:
        """The name of its bus beside another one of the same host; empty where no port tells them apart."""
        return f"{self.short}-{self.port}" if self.port and not (self.name or self.target) else ""

    @property
    def port_name(self) -> str:
        """One name for its port, whichever of its names is given; empty for a simulated bus. It is looked up."""
        return self.scheme.port_name(self)


class Open(Protocol):
    """Opens the byte pipe of a connection. Raises Unreachable."""

    def __call__(  # noqa: D102
        self, connection: Connection, *, within: float | None = None, baud: int | None = None
    ) -> Awaitable[Transport]: ...


class Scheme(ABC):
    """A kind of URL. Its attributes say how it is written and what is at its other end, its methods what it does.

    As it is, it leads to a line of drives at a host, `NAME://HOST[:PORT]`.
    """

    name: str
    """What stands before the colon."""
    prefix: str
    """The beginning of its URLs, for completion: `tcp://`."""
    example: str
    meaning: str
    """What it leads to, in a few words."""
    port: int | None = None
    """The default port; 0: there is none, it must be given; None: the form has no port."""
    after: str = ""
    """The scheme that it follows in lists; only for those of features."""

    bauded = False
    """Its ports have a baud rate."""
    simulated = False
    """It leads to buses of a simulated cell, and not to a port."""
    datagrams = False
    """It carries datagrams, which have no order and no end."""
    alone = False
    """At its other end is one drive at most."""
    direct = ""
    """The family of the one drive that it leads to, which takes no address there; empty: it leads to any drives."""
    direct_on = ""
    """Where that drive is, for a message: `on USB`."""
    relayed = False
    """A program on the far side lends the port: its URLs may have `relay=`."""
    logs_in = False
    """It is opened by a login, of which each further failure costs more time."""
    turns = 0.0
    """The part of the time of an opening that a question and its reply take, at most; 0: of a port on this machine."""

    def passes(self) -> Mapping[str, Kinds]:
        """What its callers expect to be raised, besides what a person reads; see `base.foreign`."""
        return {"open": (OSError,)}

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return (f"{self.name}:",)

    # Text

    def parse(self, base: Connection, body: str) -> Connection:
        """Complete a connection by what stands between the colon and the keys. Raises Diagnostic."""
        host, port = self.host_and_port(body, base.text)
        return replace(base, host=host, port=port)

    def host_and_port(self, body: str, text: str) -> tuple[str, int]:
        """Read `//HOST[:PORT]`. Raises Diagnostic."""
        from multidrop.transports.ssh import WORD

        example = f"as in {self.name}://10.0.0.5:{self.port or 2217}"
        match = re.fullmatch(rf"//(\[[0-9A-Fa-f:.]+\]|{WORD})(?::(\d+))?/?", body)
        if match is None:
            raise Diagnostic(f"{self.name}: needs //HOST:PORT", text, example)
        port = whole(match[2], 1, 65535) if match[2] else self.port or None
        if port is None:
            what = f"no port {match[2]}; valid: 1 to 65535" if match[2] else "no port"
            raise Diagnostic(what, text, example)
        return match[1].strip("[]"), port

    def in_folder(self, connection: Connection, folder: str) -> Connection:
        """Start a relative path at the folder of the file that has the URL; empty: the current one."""
        return connection

    def short(self, connection: Connection) -> str:
        """The name of a bus that was given none: the port's, or the host's."""
        return (last_part(connection.target) if connection.target else connection.host) or self.name

    def port_name(self, connection: Connection) -> str:
        """One name for a port, whichever of its names is given: two connections of one name share it."""
        return f"{connection.host.lower()}:{connection.port}" + (f"/{connection.target}" if connection.target else "")

    def shown(self, connection: Connection, bus: str = "") -> str:
        """The port for a person and a program, without keys. `bus`: the one of a cell."""
        host = f"[{connection.host}]" if ":" in connection.host else connection.host
        return f"{self.name}://{host}:{connection.port}"

    def lasting(self, connection: Connection, bus: str) -> str:
        """The URL of an open bus, so that it means the same later and elsewhere. `bus`: its name in a cell."""
        return connection.text

    def found(self, connection: Connection, port: str) -> str:
        """The URL, without keys, of a port on which drives were found. `port`: as `shown` gave it then."""
        return port

    # Ports

    @abstractmethod
    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        """Open the byte pipe. Raises Unreachable.

        `baud`: for a port that has one. `within`: the time for a host, s; None: as long as it takes.
        """

    def again(self, connection: Connection, open_: Open, took: float) -> Reopen | None:
        """The way to open a port again after a loss; None: it cannot be found again. `took`: the first opening, s."""
        from multidrop.shell.connect.reconnect import host_again

        return host_again(lambda within: open_(connection, within=within), took)

    def ports(self) -> Iterable[PortInfo]:
        """The ports of this machine that it can open. The search may be slow."""
        return ()

    def searched(self, text: str) -> Sequence[str]:
        """The URLs that a search for drives opens one after the other, where this is typed."""
        return [text]


class NoLine(NamedTuple):
    """Kinds of URLs that a feature takes elsewhere, and that lead to no drives."""

    names: tuple[str, ...]
    """What stands before the colon."""
    what: str
    """Why none can be opened, and what to do instead."""
    hint: str

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return tuple(f"{name}:" for name in self.names)


def last_part(path: str) -> str:
    """The last part of a path, by the rules of this machine."""
    from pathlib import PurePath

    return PurePath(path).name
