"""The login and certificates for a broker, which `multidrop publish` uses.

[mqtt]
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
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import opened, text_of

FILES = ("password_file", "ca", "cert", "key")
KEYS = ("username", "password", *FILES)


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
        for name in FILES:
            path = getattr(self, name)
            try:
                if path:
                    opened(path).close()
            except OSError as problem:
                yield f"mqtt.{name}: {path} cannot be read: {problem.strerror}"
            except Diagnostic as problem:
                yield f"mqtt.{name}: {problem}"


def read(table: Any, where: str) -> MqttSettings:
    """Check the table of the configuration file. Raises Diagnostic with file and key, and without a value."""
    if not isinstance(table, dict):
        raise Diagnostic("mqtt is not a table", where, "write [mqtt]")
    for key in table:
        if key not in KEYS:
            raise Diagnostic(f"no key mqtt.{key}", where, f"valid: {', '.join(KEYS)}")
    found = {key: _text(table, key, where) for key in KEYS}
    if found["password"] and found["password_file"]:
        raise Diagnostic("mqtt.password_file: password is given, too", where, "keep one of them")
    if found["key"] and not found["cert"]:
        raise Diagnostic("mqtt.key: cert is missing", where, "name the certificate of this key")
    folder = Path(where).parent
    return MqttSettings(**{key: _placed(folder, text) if key in FILES else text for key, text in found.items()})


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
