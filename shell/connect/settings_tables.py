"""The tables of the configuration beside its connections.

[guards]
off = ["BD", "*"]       # guards that ask no more; "*": what can start every drive of a line
also = ["S", "EX"]      # words that ask, too

[log]
always = true               # a log of each session, in the state folder
megabytes = 16              # the size at which a part is full
files = 8                   # the parts that are kept

[screen]
theme = "multidrop-light"
signs = "ascii"             # auto, full, boxes, ascii
times = "last"              # of the lines in a transcript: off, clock, start, last

[keys]                      # keys by the names of functions
palette = "^G"
panel-plot = "F9"

[mqtt]                              # for `multidrop publish`
username = "shop-7"
password_file = "broker.password"   # or password = "..."
ca = "plant-ca.pem"                 # the authority of the broker's certificate, for mqtts://
cert = "shop-7.pem"                 # our certificate, where the broker requires one
key = "shop-7.key"

A relative path begins at the folder of the configuration file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import opened, text_of
from multidrop.shell.transcripts import TIMES

if TYPE_CHECKING:
    from multidrop.dialects import DriveState, Family


GUARD_KEYS = ("also", "off")


@dataclass(frozen=True)
class Guarding:
    """The changes of the configuration to the families' guards, in capitals."""

    off: frozenset[str] = frozenset()
    also: frozenset[str] = frozenset()

    def what(self, family: Family[Any], state: DriveState, text: str) -> str:
        """What a line for a drive will do, if a person must agree to it; empty: it needs no yes."""
        guards = family.guards
        if guards is None or state.programming:
            return ""
        found = guards.find(state, text)
        if found is not None and found.name not in self.off:
            return found.what
        word = guards.word_of(text) if self.also else ""
        return f"'{text.strip()}' is sent: [guards] also has {word}" if word in self.also else ""


def read_guards(table: Any, where: str) -> Guarding:
    """Read the table `guards` of the configuration. Raises Diagnostic with file and key."""
    if not isinstance(table, dict):
        raise Diagnostic("guards is not a table", where, 'write [guards] with off = ["WORD"] or also = ["WORD"]')
    for key in table:
        if key not in GUARD_KEYS:
            raise Diagnostic(f"no key guards.{key}", where, f"valid: {', '.join(GUARD_KEYS)}")
    return Guarding(_off(_words(table, "off", where), where), _also(_words(table, "also", where), where))


def _words(table: Mapping[str, Any], key: str, where: str) -> frozenset[str]:
    words = table.get(key, [])
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise Diagnostic(f"guards.{key} is not a list of words", where, f'as in {key} = ["BD"]')
    return frozenset(word.upper() for word in words)


def _off(words: frozenset[str], where: str) -> frozenset[str]:
    if words:
        known = sorted({name for family in _families() if family.guards for name in family.guards.names})
        for word in sorted(words):
            if word not in known:
                raise Diagnostic(f"guards.off: no guard {word}", where, f"valid: {', '.join(known)}")
    return words


def _also(words: frozenset[str], where: str) -> frozenset[str]:
    for word in sorted(words):
        if not any(family.language.knows(word) for family in _families()):
            raise Diagnostic(f"guards.also: no drive has a word {word}", where, "valid: words that /help lists")
    return words


def _families() -> list[Family[Any]]:
    """Every family; only a configuration with guards imports them all."""
    from multidrop.dialects.families import FAMILIES

    return list(FAMILIES.values())


MEGABYTE = 1_000_000


@dataclass(frozen=True)
class LogSettings:
    """How logs are kept; `size` is that of a part, bytes."""

    always: bool = False
    size: int = 16 * MEGABYTE
    files: int = 8


def read_log(table: Any, where: str) -> LogSettings:
    """Check the table of the configuration file. Raises Diagnostic with file and key."""
    if not isinstance(table, dict):
        raise Diagnostic("log is not a table", where, "write [log]")
    for key in table:
        if key not in ("always", "megabytes", "files"):
            raise Diagnostic(f"no key log.{key}", where, "valid: always, files, megabytes")
    always = table.get("always", False)
    if not isinstance(always, bool):
        raise Diagnostic("log.always is not true or false", where)
    size = _number(table, "megabytes", 16, 0.01, 10_000, where)
    files = _number(table, "files", 8, 1, 1000, where)
    if files != int(files):
        raise Diagnostic("log.files is not a whole number", where)
    return LogSettings(always, int(size * MEGABYTE), int(files))


def _number(table: dict[str, Any], key: str, default: float, least: float, most: float, where: str) -> float:
    found = table.get(key, default)
    if isinstance(found, bool) or not isinstance(found, int | float) or not least <= found <= most:
        raise Diagnostic(f"log.{key} is not a number from {least:g} to {most:g}", where)
    return found


SIGNS = ("auto", "full", "boxes", "ascii")
CHOICES = {"signs": SIGNS, "times": tuple(TIMES)}
"""The settings that have one of a few words."""


@dataclass(frozen=True)
class Look:
    """The settings of the screen. The screen itself checks the names of themes, functions and keys."""

    theme: str = ""
    signs: str = "auto"
    keys: Mapping[str, str] = field(default_factory=dict)
    where: str = ""
    """The file, for messages."""
    times: str = "clock"


DEFAULT_LOOK = Look()


def read_look(screen: Any, keys: Any, where: str) -> Look:
    """Read the tables `[screen]` and `[keys]`. Raises Diagnostic."""
    if not isinstance(screen, dict) or not isinstance(keys, dict):
        table = "keys" if isinstance(screen, dict) else "screen"
        raise Diagnostic(f"{table} is not a table", where, f"write [{table}]")
    for key, value in screen.items():
        if key != "theme" and key not in CHOICES:
            raise Diagnostic(f"no key screen.{key}", where, f"valid: {', '.join([*CHOICES, 'theme'])}")
        if not isinstance(value, str):
            raise Diagnostic(f"screen.{key} is not text", where)
        if key in CHOICES and value not in CHOICES[key]:
            raise Diagnostic(f"screen.{key}: {value!r} is unknown", where, f"valid: {', '.join(CHOICES[key])}")
    for name, key in keys.items():
        if not isinstance(key, str):
            raise Diagnostic(f"keys.{name} is not text", where, 'write a key as in "^T" or "F9"')
    chosen = {key: screen[key] for key in CHOICES if key in screen}
    return Look(screen.get("theme", ""), keys=keys, where=where, **chosen)


MQTT_FILES = ("password_file", "ca", "cert", "key")
MQTT_KEYS = ("username", "password", *MQTT_FILES)


@dataclass(frozen=True)
class MqttSettings:
    """A login, and paths of files; an empty one is not given."""

    username: str = ""
    password: str = field(default="", repr=False)
    password_file: str = ""
    ca: str = ""
    cert: str = ""
    key: str = ""

    def secret(self) -> str:
        """The password. Raises Diagnostic where its file cannot be read."""
        return text_of(self.password_file).rstrip("\r\n") if self.password_file else self.password

    def unreadable(self) -> Iterator[str]:
        """Yield the keys whose files cannot be opened, with the reason."""
        for name in MQTT_FILES:
            path = getattr(self, name)
            try:
                if path:
                    opened(path).close()
            except OSError as problem:
                yield f"mqtt.{name}: {path} cannot be read: {problem.strerror}"
            except Diagnostic as problem:
                yield f"mqtt.{name}: {problem}"


def read_mqtt(table: Any, where: str) -> MqttSettings:
    """Check the table of the configuration file. Raises Diagnostic with file and key, and without a value."""
    if not isinstance(table, dict):
        raise Diagnostic("mqtt is not a table", where, "write [mqtt]")
    for key in table:
        if key not in MQTT_KEYS:
            raise Diagnostic(f"no key mqtt.{key}", where, f"valid: {', '.join(MQTT_KEYS)}")
    found = {key: _text(table, key, where) for key in MQTT_KEYS}
    if found["password"] and found["password_file"]:
        raise Diagnostic("mqtt.password_file: password is given, too", where, "keep one of them")
    if found["key"] and not found["cert"]:
        raise Diagnostic("mqtt.key: cert is missing", where, "name the certificate of this key")
    folder = Path(where).parent
    return MqttSettings(**{key: _placed(folder, text) if key in MQTT_FILES else text for key, text in found.items()})


def _text(table: Mapping[str, Any], key: str, where: str) -> str:
    found = table.get(key, "")
    if not isinstance(found, str) or "\0" in found:
        raise Diagnostic(f"mqtt.{key} is not text", where, f'as in {key} = "..."')
    return found


def _placed(folder: Path, text: str) -> str:
    """The path of a file; empty where none is given."""
    if not text:
        return ""
    try:
        path = Path(text).expanduser()
    except RuntimeError:  # a ~ and no home
        path = Path(text)
    return str(folder / path)
