"""URLs: where drives are, how they communicate, and which settings are given instead of found out.

`shell.connect.schemes` has their kinds; a bare port and the name of a saved connection are valid, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import unquote

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.text import acts_first, whole
from multidrop.dialects import Hints
from multidrop.dialects.families import Dialect, dialects
from multidrop.shell.configuration import SavedConnection
from multidrop.shell.connect.scheme import Connection, Scheme
from multidrop.shell.connect.schemes import CORE, named, no_line, sentence
from multidrop.shell.secrets import holds_password, url_without_secrets, without_secrets
from multidrop.transports.ssh import WAYS

OF_A_LINE = ("family", "drives", "baud", "party", "checksum", "em", "local_echo", "addressed")
"""What is not to be given of a connection to one drive."""


def parse(text: str, saved: Mapping[str, SavedConnection] | None = None) -> Connection:
    """Parse a URL, a bare port or a saved name. Raises Diagnostic, which never holds a password."""
    text = text.strip()
    if saved and text in saved:
        kept = saved[text]
        try:
            connection = parse(kept.url)
            connection = connection.scheme.in_folder(connection, kept.folder)
            return replace(connection, name=kept.name, labels=kept.names)
        except Diagnostic as problem:
            raise Diagnostic(str(problem), f"connection {kept.name}") from None
    try:
        return _parsed(text)
    except Diagnostic as problem:
        if holds_password(text):
            hint = "write it without the password; for ssh, set up a key with ssh-copy-id"
            raise Diagnostic("no URL here has a password", url_without_secrets(text), hint) from None
        raise Diagnostic(problem.message, without_secrets(problem.where), problem.hint) from None


def wrong_urls(connections: Iterable[SavedConnection]) -> Iterator[str]:
    """What is wrong with the URLs of saved connections, each with its key."""
    for connection in connections:
        try:
            parse(connection.url)
        except Diagnostic as problem:
            yield f"connections.{connection.name}.url: {problem}"


def _parsed(text: str) -> Connection:
    scheme, rest = _scheme(text)
    # The query and the fragment come in either order, as in `sim:#press?em=1`.
    match = re.fullmatch(r"([^?#]*)(?:\?([^#]*))?(?:#([^?]*))?(?:\?(.*))?", rest, re.DOTALL)
    if match is None or (match[2] is not None and match[4] is not None):
        raise Diagnostic("more than one ? or #", rest)
    body, query, fragment = match[1], match[2] or match[4] or "", match[3] or ""
    if fragment and not scheme.simulated:
        raise Diagnostic(f"#{fragment} names a bus of a simulated cell", text, "valid only with sim:")
    return _with_query(scheme.parse(Connection(scheme, text, bus=fragment), body), query)


def _scheme(text: str) -> tuple[Scheme, str]:
    match = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):", text)
    if match and (scheme := named(match[1].lower())) is not None:
        return scheme, text[match.end() :]
    if match and (elsewhere := no_line(match[1].lower())) is not None:
        raise Diagnostic(elsewhere.what, text, elsewhere.hint)
    if match and text[match.end() :].startswith("//"):
        raise Diagnostic(f"no kind of connection {match[1]}://", text, f"valid: {sentence()}")
    path = text.partition("?")[0]
    if "/" in path or re.match(r"[.~]|COM\d+$", path, re.IGNORECASE):  # the path or the name of a serial port
        return CORE["serial"], text
    raise Diagnostic("neither a URL nor a saved connection", text or "empty URL", f"valid: {sentence()}")


def _choice(*allowed: str) -> tuple[Callable[[str], Any], Callable[[], str]]:
    return (lambda value: value if value in allowed else None), lambda: " or ".join(allowed)


def _chosen() -> list[str]:
    """The languages that `dialect=` names."""
    return [name for name, dialect in dialects().items() if not dialect.scheme]


def _dialect(value: str) -> str | None:
    """Read the name of a language, which a family by others may speak. Raises Diagnostic where its family is gone."""
    if value not in dialects():
        [*registry.answering(Dialect, f"dialect={value}")]
    return value if value in _chosen() else None


def _number(low: float, high: float, kind: type) -> tuple[Callable[[str], Any], Callable[[], str]]:
    def read(value: str) -> Any:
        if kind is int:
            return whole(value, int(low), int(high))
        number = float(value) if re.fullmatch(r"\d+(\.\d+)?", value, re.ASCII) else -1.0
        return number if low <= number <= high else None

    return read, lambda: f"a number from {low} to {high}"


def _names(value: str) -> Any:
    names = tuple(name.strip() for name in value.split(","))
    good = all(re.fullmatch(r"[!-)+-\]_-~]{1,3}", name) and not acts_first(name) for name in names)
    return names if good and len(set(names)) == len(names) else None


KEYS: dict[str, tuple[str, Callable[[str], Any], Callable[[], str]]] = {
    "dialect": ("family", _dialect, lambda: " or ".join(_chosen())),
    "drives": ("drives", _names, lambda: "different names of one to three characters, as in a,b,c"),
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
        setting = read(unquote(value))
        if setting is None:
            what = f"no {key} {value}" if value else f"no value for {key}"
            raise Diagnostic(what, connection.text, f"valid: {allowed()}")
        values[name] = CONVERT.get(name, lambda same: same)(setting)
    if not values.get("addressed", True) and len(values.get("drives", ())) > 1:
        raise Diagnostic("address=none allows one drive only", connection.text, "drop one of the keys")
    if "relay" in values and not connection.scheme.relayed:
        raise Diagnostic("relay= is valid only with ssh://", connection.text, "drop relay=")
    if own := next((name for name, dialect in dialects().items() if dialect.scheme == connection.scheme.name), ""):
        if "family" in values:
            raise Diagnostic(f"dialect= is not valid with {connection.scheme.prefix}", connection.text, "drop dialect=")
        values["family"] = own
    if own := connection.scheme.direct:
        keys = [key for key, (name, *_) in KEYS.items() if name in values and name in OF_A_LINE]
        if keys:
            raise Diagnostic(
                f"{keys[0]}= is not valid {connection.scheme.direct_on}", connection.text, f"drop {keys[0]}="
            )
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
