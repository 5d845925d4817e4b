"""A person's own bytes on a link: past the queue, unchanged, once."""

from __future__ import annotations

from drives.events import Traffic
from drives.link import Link, loss_of


def write(link: Link, data: bytes) -> bool:
    """Write bytes; False where a stop went first, and nothing was written. Raises TransportLost."""
    if loss := loss_of(link):
        raise loss
    now = link.now()
    if not link.transport.write(data):
        return False
    link.line.wrote(data, now, whole=True)
    link.publish(Traffic(now, True, data))
    link.advance()
    return True
