"""The topics: `PREFIX/BUS/DRIVE/position` and others, with names escaped so that each is one level."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import unquote

from multidrop.dialects.text import visible

RESERVED = "+#/%"
"""The wildcards and the separator of MQTT, and the sign of an escape."""
UNNAMED = "!"
"""The level of a drive without an address; it is also a drive's name from the factory."""
MOST = 1000
"""The most bytes of a prefix."""


def escape(name: str) -> str:
    """Make one level of a topic of a name; `unescape` gives the name again.

    Escaped by percent signs, as in URLs: reserved, control and direction characters, and a `$` at the beginning.
    """
    if name in ("", UNNAMED):
        return UNNAMED if not name else _percent(name)
    first = _percent("$") if name.startswith("$") else ""
    return first + "".join(
        _percent(each) if each in RESERVED or not _plain(each) else each for each in name[bool(first) :]
    )


def unescape(level: str) -> str:
    """The name of a level."""
    return "" if level == UNNAMED else unquote(level, errors="surrogatepass")


def _plain(character: str) -> bool:
    """Whether MQTT takes a character: no control or direction character, no half of one, no non-character."""
    return visible(character) == character and ord(character) & 0xFFFE != 0xFFFE and character not in _NON_CHARACTERS


_NON_CHARACTERS = frozenset(map(chr, range(0xFDD0, 0xFDF0)))


def _percent(text: str) -> str:
    return "".join(f"%{byte:02X}" for byte in text.encode("utf-8", "surrogatepass"))


@dataclass(frozen=True)
class Topics:
    """The topics under a prefix."""

    prefix: str

    @property
    def status(self) -> str:
        """The topic of this program's state: `online`, `lost` or `bye`."""
        return f"{self.prefix}/status"

    def bus_status(self, bus: str) -> str:
        """The topic of a line's state: `online` or `lost`."""
        return f"{self.prefix}/{escape(bus)}/status"

    def transcript(self, bus: str) -> str:
        """The topic of the lines that are typed and printed on a bus."""
        return f"{self.prefix}/{escape(bus)}/transcript"

    def drive(self, bus: str, address: str, what: str) -> str:
        """The topic of a drive's `state`, `position`, `velocity` or `error`."""
        return f"{self.prefix}/{escape(bus)}/{escape(address)}/{what}"
