"""The wire between a shared screen and a watcher: JSON lines there, one byte back.

Each end first sends a greeting with its version. Then the host sends lines. Each is a list of items, and an item is
the name of a type, a bus, and the value: named tuples and dataclasses as lists of their fields, enumerations by name.
A watcher sends nothing but the stop, 0x18, which the host confirms at once with `StopHeard`.
"""

from __future__ import annotations

import dataclasses
import getpass
import json
import socket
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import multidrop
from multidrop.base.text import visible
from multidrop.shell.secrets import without_secrets

WORD = "multidrop-screen"
STOP = b"\x18"
LONGEST_MESSAGE_LINE = 4 * 1024 * 1024
"""The greatest length of a line, bytes."""
LONGEST_GREETING = 200
NAME = 40
"""The greatest length of a watcher's name."""


class GarbledMessage(ValueError):
    """The bytes are not those of a shared screen."""


class StopHeard(NamedTuple):
    """The host has written the stop that a watcher sent, once for each of its stops so far."""

    stops: int


class Dropped(NamedTuple):
    """A watcher was not read in time: so many items were dropped, and the state follows anew."""

    items: int


class Now(NamedTuple):
    """The time of the host's clock, s: a sign of life, once a second."""

    at: float


class Item(NamedTuple):
    """A value for a bus; an empty name is none."""

    value: Any
    bus: str = ""


def own_version() -> str:
    return multidrop.__version__


def greeting() -> bytes:
    name = f"{getpass.getuser()}@{socket.gethostname()}"
    return f"{WORD} {own_version()} {visible(name)[:NAME]}\n".encode()


def greeted(line: bytes) -> tuple[str, str]:
    """The version and the name in a greeting. Raises GarbledMessage."""
    word, _, rest = line.decode(errors="replace").strip().partition(" ")
    version, _, name = rest.partition(" ")
    if word != WORD or not version or len(line) > LONGEST_GREETING:
        raise GarbledMessage("no greeting of a shared screen")
    return visible(version), visible(name)[:NAME] or "a watcher"


def other_version(version: str, there: str) -> str:
    """The refusal of another version; empty for the own one."""
    own = own_version()
    return "" if version == own else f"{there} is multidrop {version}, this is {own}; install one version on both sides"


def line(items: Iterable[Item]) -> bytes:
    """One line of items; it has no secrets of URLs and keys."""
    rows = [[type(value).__name__, bus, _plain(value)] for value, bus in items]
    return json.dumps(rows, separators=(",", ":")).encode() + b"\n"


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return without_secrets(value)
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, tuple | frozenset):
        return [_plain(item) for item in value]
    if dataclasses.is_dataclass(value):
        return [_plain(getattr(value, field.name)) for field in dataclasses.fields(value)]
    return value


class Items:
    """The items of the lines that arrive, whatever pieces they come in. `types`: the types of values that are known."""

    def __init__(self, types: Iterable[type]) -> None:
        self._types: Mapping[str, type] = {kind.__name__: kind for kind in types}
        self._held = b""

    def take(self, data: bytes) -> list[Item]:
        """Take bytes; return the items of the lines that are complete. Raises GarbledMessage."""
        *lines, self._held = (self._held + data).split(b"\n")
        if len(self._held) > LONGEST_MESSAGE_LINE:
            raise GarbledMessage(f"a line of more than {LONGEST_MESSAGE_LINE} bytes")
        return [item for line in lines for item in self._items(line)]

    def _items(self, line: bytes) -> list[Item]:
        try:
            rows = json.loads(line)
        except (ValueError, RecursionError):
            raise GarbledMessage("a line that is not JSON") from None
        if not isinstance(rows, list):
            raise GarbledMessage("a line that is not a list")
        return [self._item(row) for row in rows]

    def _item(self, row: Any) -> Item:
        match row:
            case [str(name), str(bus), value] if name in self._types:
                return Item(_read(self._types[name], value), bus)
        raise GarbledMessage("an item of no known type")


def _read(kind: Any, value: Any) -> Any:
    """Make a value of a type from JSON. Raises GarbledMessage for any other value."""
    form, inner, taken = _form(kind)
    if form is None:
        if isinstance(value, taken) and (kind is bool or not isinstance(value, bool)):
            return value
    elif form is UnionType:
        return None if value is None else _read(inner[0], value)
    elif form is Enum:
        if isinstance(value, str) and value in kind.__members__:
            return kind[value]
    elif isinstance(value, list):
        kinds = inner * len(value) if form is Sequence else inner
        if len(kinds) == len(value):
            fields = map(_read, kinds, value)
            return tuple(fields) if form is tuple or form is Sequence else kind(*fields)
    raise GarbledMessage(f"{str(value)[:NAME]!r} is no {getattr(kind, '__name__', 'tuple')}")


@cache
def _form(kind: Any) -> tuple[Any, list[Any], tuple[type, ...]]:
    """How a type is read, the types in it, and those of JSON that it takes: a scalar has the form None."""
    origin, inner = get_origin(kind), list(get_args(kind))
    if origin is UnionType:
        return UnionType, [form for form in inner if form is not NoneType], ()
    if origin is tuple:
        return (Sequence, inner[:1], ()) if inner[1:] == [...] else (tuple, inner, ())
    if issubclass(kind, Enum):
        return Enum, [], ()
    if kind in (str, bool, int, float):
        return None, [], (float, int) if kind is float else (kind,)
    hints = get_type_hints(kind)
    names = kind._fields if issubclass(kind, tuple) else [field.name for field in dataclasses.fields(kind)]
    return kind, [hints[name] for name in names], ()
