"""What a line must not have before it is sent to a drive, whatever its language."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base.errors import Inexpressible
from multidrop.drives.port_journal import GLOBAL


def check_quantities(shown: str, text: str) -> None:
    """Raise Inexpressible for a line with a brace that no conversion has taken away. `shown`: its drive."""
    if "{" in text or "}" in text:
        from multidrop.dialects.units import unsendable

        if why := unsendable(text):
            raise Inexpressible(f"{shown}: '{text}': {why}; nothing was sent")


def check_name(shown: str, text: str, found: tuple[str, str] | None, drives: Sequence[tuple[str, str]]) -> None:
    """Raise Inexpressible for a line that begins with the name of a drive of this line, as on the wire.

    `found`: that name and what follows it; `drives`: the address and the name of each drive of the line.
    """
    if found is None:
        return
    name, line = found
    addresses = {address: f"@{name} {line}" for address, _ in drives if address}
    plain = {named: line for address, named in drives if not address}
    everyone = {address: f"@{address} {line}" for address in GLOBAL if addresses}
    if (right := (everyone | plain | addresses).get(name)) is not None:
        raise Inexpressible(f"{shown}: '{text}' is not a command: write {right}; nothing was sent")
