"""The table `[mqtt]` of the configuration: how to log in at a broker.

[mqtt]
username = "shop-7"
password_file = "broker.password"   # or password = "..."
ca = "plant-ca.pem"                 # the authority of the broker's certificate, for mqtts://
cert = "shop-7.pem"                 # our certificate, where the broker requires one
key = "shop-7.key"
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import opened, text_of
from multidrop.shell.secrets import HIDDEN
from multidrop.shell.sections import Section

MQTT_FILES = ("password_file", "ca", "cert", "key")
KEYS = ("username", "password", *MQTT_FILES)


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


def read(table: Mapping[str, Any], where: str) -> MqttSettings:
    """Check the table. Raises Diagnostic without a value, which may be a secret."""
    texts: dict[str, str] = {}
    for key in KEYS:
        text = table.get(key, "")
        if not isinstance(text, str) or "\0" in text:
            raise Diagnostic(f"mqtt.{key} is not text", where, f'as in {key} = "..."')
        texts[key] = text
    if texts["password"] and texts["password_file"]:
        raise Diagnostic("mqtt.password_file: password is given, too", where, "keep one of them")
    if texts["key"] and not texts["cert"]:
        raise Diagnostic("mqtt.key: cert is missing", where, "name the certificate of this key")
    for key in MQTT_FILES:
        if text := texts[key]:
            try:
                path = Path(text).expanduser()
            except RuntimeError:  # a ~ and no home
                path = Path(text)
            texts[key] = str(Path(where).parent / path)
    return MqttSettings(**texts)


def _shown(found: MqttSettings) -> Mapping[str, object]:
    return {key: HIDDEN if key == "password" and value else value for key, value in asdict(found).items()}


SECTION = Section("mqtt", KEYS, "[mqtt]", read, _shown, MqttSettings.unreadable)
