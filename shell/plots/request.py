"""What a person asks of a plot: its target, its series, and its rate.

A target is a file, a server of our own, or a viewer elsewhere. A series is a drive's position and velocity, or a value
that the drive prints. The rate says how often each drive is read, at most.
"""

from __future__ import annotations

import os
import shlex
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from multidrop.base.errors import Diagnostic
from multidrop.base.text import real
from multidrop.drives.conversations import refuse_stranger
from multidrop.drives.drive import Drive
from multidrop.drives.telemetry import FASTEST, MODEST
from multidrop.shell.connect.urls import listening
from multidrop.shell.line_syntax import EVERYONE, split_target
from multidrop.shell.roles import DIFFERENCE, Series
from multidrop.shell.secrets import url_without_secrets
from multidrop.shell.session import Session

TABLES = (".csv", ".parquet")
ENDINGS = ".rrd, .csv or .parquet"
FILES = "FILE.rrd|.csv|.parquet"


@dataclass(frozen=True)
class PlotTarget:
    """A file, a server of our own at host and port (0: a free one), or a viewer elsewhere."""

    file: Path | None = None
    host: str = ""
    port: int = 0
    url: str = ""
    """The viewer elsewhere, `rerun+http://HOST:PORT/proxy`; `host` and `port` are the viewer's."""

    @property
    def serves(self) -> bool:
        return self.file is None and not self.url

    @property
    def text(self) -> str:
        if self.file is not None:
            return str(self.file)
        return self.url or f"rerun+http://{bracketed(self.host)}:{self.port}/proxy"

    @property
    def desk(self) -> str:
        """The line that a person types at another desk to see a plot that only this machine can reach; else empty."""
        if not self.serves or not ip_address(self.host).is_loopback:
            return ""
        forward = f"{self.port}:{bracketed(self.host)}:{self.port}"
        connection = os.environ.get("SSH_CONNECTION", "").split()
        here = connection[2] if len(connection) == 4 else socket.gethostname()  # as the person's own ssh has reached it
        return shlex.join(("ssh", "-L", forward, here))


def bracketed(host: str) -> str:
    """The host as part of an address: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host


def parse_target(to: str | None, serve: str | None) -> PlotTarget:
    """Parse `--to FILE.rrd|.csv|.parquet`, `--to rerun+http://HOST:PORT/proxy` or `--serve [HOST:]PORT`.

    Raises Diagnostic for a wrong target, for two targets and for none.
    """
    if (to is None) == (serve is None):
        what = "no target for the plot" if to is None else "two targets for one plot"
        raise Diagnostic(what, hint=f"valid: --to {FILES}, --to rerun+http://HOST:PORT/proxy or --serve [HOST:]PORT")
    if serve is not None:
        host, port = listening(serve)
        return PlotTarget(host=host, port=port)
    assert to is not None
    return _viewer(to) if "://" in to else _file(to)


def _file(text: str) -> PlotTarget:
    try:
        path = Path(text).expanduser()
    except RuntimeError:  # a ~ and no home
        path = Path(text)
    if path.suffix not in (".rrd", *TABLES):
        raise Diagnostic(f"no plot file {text!r}", hint=f"valid: a name that ends in {ENDINGS}")
    if not os.path.isdir(path.parent):  # Path's own methods raise for a name that is too long
        raise Diagnostic(f"no folder {path.parent}", hint="make it first")
    if os.path.exists(path) and not os.path.isfile(path):
        raise Diagnostic(f"{path} is not a file", hint="use another name")
    return PlotTarget(file=path)


def _viewer(text: str) -> PlotTarget:
    wrong = Diagnostic(f"no viewer address {url_without_secrets(text)!r}", hint="valid: rerun+http://HOST:PORT/proxy")
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise wrong from None
    proxy = (parts.scheme, parts.path) == ("rerun+http", "/proxy")
    extra = parts.query or parts.fragment or "@" in parts.netloc
    if not proxy or extra or not host or not port:
        raise wrong
    return PlotTarget(host=host, port=port, url=f"rerun+http://{bracketed(host)}:{port}/proxy")


FORMS = "valid: ADDR, ADDR.VALUE or VALUE, with BUS: before ADDR if it is on another bus; as b, b.I1, VM"


def parse_series(workspace: Session, texts: Sequence[str]) -> tuple[Series, ...]:
    """Return the series of these texts; without a text, all drives of all buses. Sends nothing. Raises Diagnostic."""
    found: dict[Series, None] = {}
    for text in texts:
        found |= dict.fromkeys(_parse(workspace, text))
    if not texts:
        found = {Series(bus.name, each): None for bus in workspace.buses.values() for each in bus.drives}
    return tuple(found)


def _parse(workspace: Session, text: str) -> list[Series]:
    if drives := _drives(workspace, text):
        return [Series(bus, address) for bus, address in drives]
    target, dot, word = text.rpartition(".")
    if not dot and ":" in text:
        raise Diagnostic(f"no drive {text}", hint=_valid(workspace, text))
    if not dot or not target:
        selected = workspace.selected
        if selected is None:
            raise Diagnostic(f"no drive {text}", hint="/open URL opens a line of drives")
        drives = [(selected.link.name, selected.address)]
    else:
        drives = _drives(workspace, target)
        if not drives:
            raise Diagnostic(f"no drive {target}", hint=_valid(workspace, target))
    found = [_value(workspace, bus, address, word, text) for bus, address in drives]
    if not dot and found[0].word != DIFFERENCE:
        drive = workspace.buses[found[0].bus].drives[found[0].address]
        if not drive.family.values.own(drive.state, found[0].word):  # a name that a person gave
            hint = f"{_valid(workspace, text)}; .{text} is a user's variable"
            raise Diagnostic(f"no drive and no value {text}", hint=hint)
    return found


def _drives(workspace: Session, target: str) -> list[tuple[str, str]]:
    """The drives that `ADDR`, `BUS:ADDR` or `BUS:*` names; none if there is no such drive."""
    name, address = split_target(target)
    bus = workspace.buses.get(name or workspace.selected_bus)
    if bus is None:
        return []
    if address in EVERYONE:
        return [(bus.name, each) for each in bus.drives]
    named = (drive.address for drive in bus.drives.values() if address and drive.label == address)
    found = address if address in bus.drives else next(named, None)
    return [] if found is None else [(bus.name, found)]


def _valid(workspace: Session, target: str) -> str:
    bus, _ = split_target(target)
    name = bus or workspace.selected_bus
    if name not in workspace.buses:
        return f"open: {', '.join(workspace.buses) or 'none'}"
    return f"valid on {name}: {', '.join(workspace.buses[name].drives) or 'none'}"


def _value(workspace: Session, bus: str, address: str, word: str, text: str) -> Series:
    drive: Drive = workspace.buses[bus].drives[address]
    if not word:
        raise Diagnostic(f"no value in {text!r}", hint=FORMS)
    if word.lower() == DIFFERENCE:
        if workspace.buses[bus] not in workspace.predicted:
            raise Diagnostic(f"{drive.shown}: no twin runs that it could differ from", hint="/twin on begins one")
        return Series(bus, address, DIFFERENCE)
    return Series(bus, address, drive.family.values.check(drive.state, word))


async def read_first(workspace: Session, series: Sequence[Series]) -> None:
    """Read each value once, as a person would, before it is polled. Raises the refusal of a drive that lacks it.

    Of a device that did not identify itself only values that a person named are read: Inexpressible for its motion.
    """
    for bus, address, word in series:
        drive = workspace.buses[bus].drives[address]
        if not word:
            refuse_stranger(drive.state, workspace.display_name(drive))
        elif word != DIFFERENCE:
            await drive.run(drive.family.values.first(drive.state, word), typed=True)


MAX = "max"
SLOWEST = 0.01
"""The lowest rate, samples a second."""
DEFAULT = f"{1 / MODEST:g}"


def parse_rate(text: str) -> float:
    """The period between two samples of a drive, s; 0 for `max`. Raises Diagnostic."""
    if text == MAX:
        return 0.0
    rate = real(text) or 0.0
    if not SLOWEST <= rate <= 1 / FASTEST:
        valid = f"valid: {SLOWEST:g} to {1 / FASTEST:g} samples a second of each drive, or {MAX}"
        raise Diagnostic(f"invalid rate {text!r}", "--rate", valid)
    return 1 / rate


def shown(period: float) -> str:
    if period <= FASTEST:
        return "as fast as the line allows"
    return f"at most {1 / period:g} samples a second of each drive"
