"""Whether other computers can reach an address that this one listens on."""

from __future__ import annotations

from ipaddress import ip_address


def exposed(host: str) -> bool:
    """True unless the host is a loopback address or localhost; an unknown name counts as reachable."""
    try:
        return host != "localhost" and not ip_address(host).is_loopback
    except ValueError:
        return True
