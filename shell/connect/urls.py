"""URLs: where drives are, how they communicate, and which settings are given instead of found out.

`url_forms` lists the forms; a bare port and the name of a saved connection are valid, too.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any
from urllib.parse import unquote

from multidrop.base.errors import Diagnostic
from multidrop.base.text import acts_first, whole
from multidrop.dialects import Hints
from multidrop.dialects.families import TABLE
from multidrop.shell.configuration import SavedConnection
from multidrop.shell.connect.url_forms import URL_FORMS, sentence
from multidrop.shell.secrets import holds_password, url_without_secrets, without_secrets
from multidrop.transports.ssh import WAYS, WORD, wrong_path

DEFAULT_PORTS = {scheme: form.port or None for scheme, form in URL_FORMS.items() if form.port is not None}
SCHEMES = tuple(URL_FORMS)
DIALECTS = tuple(name for name, row in TABLE.items() if not row.scheme)
"""The families that `dialect=` names."""
IMPLIED = {row.scheme: name for name, row in TABLE.items() if row.scheme}
"""The families that a scheme implies."""
DIRECT = {scheme: name for name, row in TABLE.items() for scheme in row.direct}
"""The families of schemes that lead to one drive, without an address."""
OF_A_LINE = ("family", "drives", "baud", "party", "checksum", "em", "local_echo", "addressed")
"""What is not to be given of such a connection."""
USB = r"(?:[!-?A-~]+(?:@\d+-\d+(?:\.\d+)*)?)?"
"""A controller on USB: its device number with the socket that it is plugged into, or its place in the list."""


@dataclass(frozen=True)
class Connection:
    """The place of drives, and the settings that the user states of them."""

    scheme: str
    """One of `URL_FORMS`."""
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
    hints: Hints = field(default_factory=Hints)
    """The keys on the drives: dialect, drives, party, checksum, em, address."""
    baud: int | None = None
    local_echo: bool = False
    timeout: float | None = None
    """The time to wait for a reply, s."""

    @property
    def short(self) -> str:
        """The default name of its bus: the saved name, the port's name, the host."""
        if self.scheme in ("ssh", "usbip") and not self.name:
            return f"{self.host}-{PurePath(self.target).name}"
        return self.name or (PurePath(self.target).name if self.target else self.host) or self.scheme

    @property
    def anchored(self) -> str:
        """The text with the whole path of a cell file, so that it means the same in any folder."""
        written = _parsed(self.text).target if self.scheme == "sim" else ""
        return self.text.replace(written, os.path.abspath(self.target), 1) if written else self.text

    @property
    def by_port(self) -> str:
        """The name of its bus beside another one of the same host; empty where no port tells them apart."""
        return f"{self.short}-{self.port}" if self.port and not (self.name or self.target) else ""


def parse(text: str, saved: Mapping[str, SavedConnection] | None = None) -> Connection:
    """Parse a URL, a bare port or a saved name. Raises Diagnostic, which never holds a password."""
    text = text.strip()
    if saved and text in saved:
        found = saved[text]
        try:
            return replace(_anchored(parse(found.url), found.folder), name=found.name, labels=found.names)
        except Diagnostic as problem:
            raise Diagnostic(str(problem), f"connection {found.name}") from None
    try:
        return _parsed(text)
    except Diagnostic as problem:
        if holds_password(text):
            hint = "write it without the password; for ssh, set up a key with ssh-copy-id"
            raise Diagnostic("no URL here has a password", url_without_secrets(text), hint) from None
        raise Diagnostic(problem.message, without_secrets(problem.where), problem.hint) from None


def wrong_urls(connections: Iterable[SavedConnection]) -> Iterator[str]:
    """What is wrong with the URLs of saved connections, each with its key."""
    for each in connections:
        try:
            parse(each.url)
        except Diagnostic as problem:
            yield f"connections.{each.name}.url: {problem}"


def _anchored(connection: Connection, folder: str) -> Connection:
    """Start a relative path at a folder (empty: the current one). The name of a port, as COM3, is not a path."""
    path = connection.target
    is_path = connection.scheme == "sim" or (connection.scheme == "serial" and re.search(r"[/\\]|^\.", path))
    if not path or not is_path:
        return connection
    return replace(connection, target=os.path.abspath(os.path.join(folder, os.path.expanduser(path))))


def _parsed(text: str) -> Connection:
    scheme, rest = _scheme(text)
    # The query and the fragment come in either order, as in `sim:#press?em=1`.
    found = re.fullmatch(r"([^?#]*)(?:\?([^#]*))?(?:#([^?]*))?(?:\?(.*))?", rest, re.DOTALL)
    if found is None or (found[2] is not None and found[4] is not None):
        raise Diagnostic("more than one ? or #", rest)
    body, query, fragment = found[1], found[2] or found[4] or "", found[3] or ""
    if fragment and scheme != "sim":
        raise Diagnostic(f"#{fragment} names a bus of a simulated cell", text, "valid only with sim:")
    base = Connection(scheme=scheme, text=text)
    if scheme == "sim":
        base = replace(base, target=body, bus=fragment)
    elif scheme == "serial":
        if not body:
            raise Diagnostic("serial: without a port", text, "as in serial:/dev/ttyUSB0?baud=9600")
        base = replace(base, target=body)
    elif scheme == "usb":
        if not re.fullmatch(USB, body):
            raise Diagnostic(f"no controller on USB {body}", text, "as in usb:2ED01, usb:2ED01@1-1.4 or usb:0")
        base = replace(base, target=body)
    elif scheme == "usbip":
        where, slash, bus_id = body.removeprefix("//").rpartition("/")
        if not slash or not re.fullmatch(r"\d+-\d+(\.\d+)*", bus_id):
            raise Diagnostic("usbip: needs //HOST[:PORT]/BUSID", text, "as in usbip://10.0.0.5/1-1")
        host, port = _host(f"//{where}", scheme, text)
        base = replace(base, host=host, port=port, target=bus_id)
    elif scheme == "ssh":
        base = _ssh(base, body)
    else:
        host, port = _host(body, scheme, text)
        base = replace(base, host=host, port=port)
    return _with_query(base, query)


def _ssh(base: Connection, body: str) -> Connection:
    """A host as `ssh` takes it, never one of its options, and the path of a port there."""
    example = "as in ssh://user@host/dev/ttyUSB0"
    found = re.fullmatch(rf"//(?:({WORD})@)?(\[[0-9A-Fa-f:.]+\]|{WORD})(?::(\d+))?(/.*)?", body, re.DOTALL)
    if found is None:
        raise Diagnostic("ssh: needs //[USER@]HOST[:PORT] and the path of a port there", base.text, example)
    if (port := whole(found[3], 1, 65535) if found[3] else 0) is None:
        raise Diagnostic(f"no port {found[3]}; valid: 1 to 65535", base.text, example)
    path = unquote(found[4] or "")
    if wrong := wrong_path(path):
        raise Diagnostic(f"{wrong}, on {found[2]}", base.text, example)
    return replace(base, user=found[1] or "", host=found[2].strip("[]"), port=port, target=path)


def _scheme(text: str) -> tuple[str, str]:
    found = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):", text)
    if found and found[1].lower() in SCHEMES:
        return found[1].lower(), text[found.end() :]
    if found and found[1].lower() in ("mqtt", "mqtts"):
        hint = "it only shows what was published; `multidrop plant URL` shows it"
        raise Diagnostic("a broker is no line, and no drive can be reached through one", text, hint)
    if found and text[found.end() :].startswith("//"):
        raise Diagnostic(f"no kind of connection {found[1]}://", text, f"valid: {sentence()}")
    path = text.partition("?")[0]
    if "/" in path or re.match(r"[.~]|COM\d+$", path, re.IGNORECASE):  # the path or the name of a serial port
        return "serial", text
    raise Diagnostic("neither a URL nor a saved connection", text or "empty URL", f"valid: {sentence()}")


def _host(body: str, scheme: str, text: str) -> tuple[str, int]:
    example = f"as in {scheme}://10.0.0.5:{DEFAULT_PORTS[scheme] or 2217}"
    found = re.fullmatch(rf"//(\[[0-9A-Fa-f:.]+\]|{WORD})(?::(\d+))?/?", body)
    if found is None:
        raise Diagnostic(f"{scheme}: needs //HOST:PORT", text, example)
    port = whole(found[2], 1, 65535) if found[2] else DEFAULT_PORTS[scheme]
    if port is None:
        what = f"no port {found[2]}; valid: 1 to 65535" if found[2] else "no port"
        raise Diagnostic(what, text, example)
    return found[1].strip("[]"), port


def _choice(*allowed: str) -> tuple[Callable[[str], Any], str]:
    return (lambda value: value if value in allowed else None), " or ".join(allowed)


def _number(low: float, high: float, kind: type) -> tuple[Callable[[str], Any], str]:
    def read(value: str) -> Any:
        if kind is int:
            return whole(value, int(low), int(high))
        number = float(value) if re.fullmatch(r"\d+(\.\d+)?", value, re.ASCII) else -1.0
        return number if low <= number <= high else None

    return read, f"a number from {low} to {high}"


def _names(value: str) -> Any:
    names = tuple(name.strip() for name in value.split(","))
    good = all(re.fullmatch(r"[!-)+-\]_-~]{1,3}", name) and not acts_first(name) for name in names)
    return names if good and len(set(names)) == len(names) else None


KEYS: dict[str, tuple[str, Callable[[str], Any], str]] = {
    "dialect": ("family", *_choice(*DIALECTS)),
    "drives": ("drives", _names, "different names of one to three characters, as in a,b,c"),
    "baud": ("baud", *_number(300, 1_000_000, int)),
    "party": ("party", *_choice("0", "1")),
    "checksum": ("checksum", *_number(0, 2, int)),
    "em": ("em", *_number(0, 3, int)),
    "echo": ("local_echo", *_choice("local")),
    "address": ("addressed", *_choice("none")),
    "timeout": ("timeout", *_number(0.01, 600, float)),
    "relay": ("relay", *_choice(*WAYS)),
}
"""Query key: the field of a Connection, the parser of its value (None: invalid), and the valid values."""
HINTED = {"family", "drives", "party", "checksum", "em", "addressed"}
"""The fields that describe the drives; the others describe the line."""
CONVERT: dict[str, Callable[[Any], Any]] = {
    "party": lambda value: value == "1",
    "local_echo": lambda value: True,
    "addressed": lambda value: False,
}


def _with_query(connection: Connection, query: str) -> Connection:
    values: dict[str, Any] = {}
    for item in filter(None, query.split("&")):
        key, _, value = item.partition("=")
        if key not in KEYS:
            raise Diagnostic(f"no key {key}", connection.text, f"valid: {', '.join(KEYS)}")
        name, read, allowed = KEYS[key]
        if name in values:
            raise Diagnostic(f"{key} is given twice", connection.text)
        found = read(unquote(value))
        if found is None:
            what = f"no {key} {value}" if value else f"no value for {key}"
            raise Diagnostic(what, connection.text, f"valid: {allowed}")
        values[name] = CONVERT.get(name, lambda same: same)(found)
    if not values.get("addressed", True) and len(values.get("drives", ())) > 1:
        raise Diagnostic("address=none allows one drive only", connection.text, "drop one of the keys")
    if "relay" in values and connection.scheme != "ssh":
        raise Diagnostic("relay= is valid only with ssh://", connection.text, "drop relay=")
    if own := IMPLIED.get(connection.scheme):
        if "family" in values:
            raise Diagnostic(f"dialect= is not valid with {connection.scheme}://", connection.text, "drop dialect=")
        values["family"] = own
    if own := DIRECT.get(connection.scheme):
        keys = [key for key, (name, *_) in KEYS.items() if name in values and name in OF_A_LINE]
        if keys:
            raise Diagnostic(f"{keys[0]}= is not valid on USB", connection.text, f"drop {keys[0]}=")
        values |= {"family": own, "addressed": False}
    hints = {name: values.pop(name) for name in list(values) if name in HINTED}
    return replace(connection, hints=Hints(**hints), **values)


def with_echo(connection: Connection) -> Connection:
    """The connection with `echo=local`, for an adapter that was found to repeat what it sends."""
    if connection.local_echo:
        return connection
    sign = "&" if "?" in connection.text else "?"
    return replace(connection, text=f"{connection.text}{sign}echo=local", local_echo=True)


HOST = "127.0.0.1"


def listening(text: str) -> tuple[str, int]:
    """Host and port (0: a free one). Raises Diagnostic."""
    host, _, port = text.rpartition(":")
    number = whole(port, 0, 65535)
    if number is None:
        raise Diagnostic(f"no port {url_without_secrets(text)!r} to serve at", hint="valid: PORT or HOST:PORT, as 9876")
    return host.removeprefix("[").removesuffix("]") or HOST, number
