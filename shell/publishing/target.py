"""The broker of `multidrop publish --to mqtt://[USER@]BROKER[:PORT]/PREFIX`."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import unquote, urlsplit

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import visible
from multidrop.shell.publishing.topics import MOST

PORTS = {"mqtt": 1883, "mqtts": 8883}
"""The usual port of each scheme; `mqtts` is encrypted."""
FORM = "valid: mqtt://[USER@]BROKER[:PORT]/PREFIX or mqtts://..."


@dataclass(frozen=True)
class Target:
    """A broker, and the topic above all that is published."""

    host: str
    port: int
    prefix: str
    encrypted: bool = False
    user: str = ""

    @property
    def text(self) -> str:
        """The broker for a person, without the user."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.encrypted else 'mqtt'}://{host}:{self.port}/{self.prefix}"


def parse_target(text: str) -> Target:
    """Parse the URL of a broker. Raises Diagnostic, which never holds a password."""
    scheme, mark, rest = text.partition("://")
    place, _, prefix = rest.partition("/")
    user, _, address = place.rpartition("@")
    if ":" in user or (":" in place and "@" in prefix):  # a password may hold a /
        hint = "write it in multidrop.toml: [mqtt] with password or password_file"
        raise Diagnostic("a password in a URL can be seen by everybody on this machine", "--to", hint)
    if not mark or scheme not in PORTS:
        raise Diagnostic("the URL of a broker begins with mqtt:// or mqtts://", "--to", FORM)
    host, port = _address(scheme, address)
    return Target(host, port, _prefix(prefix), scheme == "mqtts", unquote(user))


def _address(scheme: str, address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname, parts.port
    except ValueError:
        raise Diagnostic(f"no address {address!r} of a broker", "--to", FORM) from None
    whole = parts.netloc == address and port != 0
    if not (whole and host) or visible(host) != host or " " in host:
        raise Diagnostic(f"no address {address!r} of a broker", "--to", FORM)
    return host, port or PORTS[scheme]


def _prefix(text: str) -> str:
    """Check a prefix, which may have several levels."""
    prefix = text.removesuffix("/")
    if not prefix:
        raise Diagnostic("no PREFIX of the topics", "--to", FORM)
    wrong = next((each for each in prefix if each in "+#?" or visible(each) != each), "")
    if wrong:
        raise Diagnostic(f"a PREFIX has no {visible(wrong)!s}", "--to", FORM)
    if prefix.startswith("$") or "" in prefix.split("/"):
        hint = "a PREFIX begins without $, and no level of it is empty"
        raise Diagnostic(f"no PREFIX {prefix!r}", "--to", hint)
    if len(prefix.encode()) > MOST:
        raise Diagnostic(f"a PREFIX has at most {MOST} bytes", "--to")
    return prefix
