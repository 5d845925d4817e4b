"""A line or a drive that has not replied in this session: what came, and what may be the cause.

One place for every front end and family. It explains each failure until the first reply. From then on the line works,
unless another program takes its bytes. A drive that stays silent on a line that works has causes of its own.
"""

from __future__ import annotations

from typing import TypeVar

from multidrop.dialects.families import seen
from multidrop.drives.link import Link
from multidrop.drives.port_journal import GLOBAL

E = TypeVar("E", bound=Exception)
WIRING = "the baud rate, A and B (exchanged?), the termination, and an adapter that switches its direction late"
SERIAL = f"check power, the drive's name or address, {WIRING}"
NETWORK = f"check power, network, and the drive's name or address; behind a gateway also {WIRING}"
NOISE = "; also check A and B (exchanged?) and the termination"
ALONE = (
    "no reply came from it so far, while others on this line reply: check its power, its name or address, and its "
    "baud rate"
)
ECHO = "only our own bytes came back (an adapter that repeats what it sends), and no reply"


def explained(error: E, link: Link, family: str, address: str = "") -> E:
    """Return the failure, with what came and the likely causes where no drive of the link has replied yet.

    Another program on the port is named at any time. `address`: the drive that did not reply, if it is known.
    """
    if link.heard.answered:
        alone = ALONE if address and address not in (*GLOBAL, *link.heard.addresses) else ""
        why = link.transport.other_user() or alone
        return type(error)(f"{error}; {why}") if why else error
    why = reason(link, family)
    return type(error)(f"{error}; {why}") if why else error


def reason(link: Link, family: str) -> str:
    """Say what came in place of replies, and what to check; empty: whole messages came, and the failure names them."""
    check = NETWORK if link.transport.network else SERIAL
    came, echoed = link.heard.foreign(), link.heard.came
    what = seen(came, family) if came else ECHO if echoed else "nothing was received"
    if not what:
        return ""
    if other := link.transport.other_user():
        return f"{what}; {other}"
    advice = NOISE if came and what.endswith("another baud rate?") else f"; {check}"
    suspects = link.transport.suspects()
    return what + advice + (f"; a service may have the port open: {suspects}" if suspects else "")
