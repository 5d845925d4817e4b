"""A person's own bytes on a link: past the queue, unchanged, once."""

from __future__ import annotations

import asyncio

from multidrop.drives.events import Traffic
from multidrop.drives.link import Link, loss_of

TERMINATORS = (b"\r", b"\n")


def write(link: Link, data: bytes) -> bool:
    """Write bytes; False where a stop went first, and nothing was written. Raises TransportLost.

    Until their end has left, they are on record as a command that may be cut off; without a terminator until more come.
    """
    if loss := loss_of(link):
        raise loss
    now = link.now()
    if not link.transport.write(data):
        return False
    link.departure.typed(data)
    link.line.wrote(data, now, whole=True)
    if data.endswith(TERMINATORS):
        asyncio.get_running_loop().call_at(link.line.transmitted, _left, link, data.decode("latin-1"))
    link.publish(Traffic(now, True, data))
    link.advance()
    return True


def _left(link: Link, text: str) -> None:
    """Note that bytes have left, unless others were written since or the port broke."""
    if link.departure.under_way == text and not link.lost:
        link.departure.arrived()
