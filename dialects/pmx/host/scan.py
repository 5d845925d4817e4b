"""The search for PMX controllers at one baud rate: every device number, then none. It only asks `ID`.

The first number is tried twice: the first question may follow the rest of another line. (PMX-2ED-SA manual 6.2.3, 6.3.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from dialects.codec import Kind, Procedure
from dialects.pmx.host.codec import FACTORY, Pmx
from dialects.pmx.host.identify import find
from dialects.pmx.host.state import PmxState
from dialects.scanning import WINDOW, Found, Outcome, Reach, Scan, Step

NUMBERS = tuple(f"{number:02}" for number in range(100))
NOTHING = "~~~"
"""A word that no controller knows."""
BUSY = 2.5
"""The longest wait, in windows, where something else arrives."""


def search(reach: Reach, found: Found[PmxState], step: Step) -> Procedure[Outcome]:
    """Search for every controller at one baud rate; report each as soon as it is identified."""
    remarks: list[str] = []
    seen: set[str] = set()
    for state in _states(reach):
        if state.address not in seen and not (seen and not state.address):
            heard = yield from _replies(state, reach)
            if heard and (yield from find(state)) is not None:
                seen.add(state.address)
                found(state)
            elif heard.strip(b"\r\n\0"):
                remarks.append(f"{state.address or 'a controller'} replies {heard[:40]!r}, which is no controller's ID")
        step()
    return Outcome(tuple(remarks))


def _states(reach: Reach) -> Iterator[PmxState]:
    numbered = () if reach.alone else (*NUMBERS, FACTORY)
    yield from (PmxState(Pmx(), number) for number in numbered)
    yield PmxState(Pmx(addressed=False))


def _places(reach: Reach) -> int:
    return sum(1 for _ in _states(reach))


def _replies(state: PmxState, reach: Reach) -> Procedure[bytes]:
    """Ask for the identification; return what was received until it was quiet."""
    asked = state.codec.request(state.address, "ID")
    reply = yield replace(asked, kind=Kind.QUIET, settle=reach.window, timeout=BUSY * reach.window)
    return reply.raw


def _clear() -> Procedure[None]:
    """End a half-sent command, whose number no controller has."""
    asked = Pmx(addressed=False).request("", NOTHING)
    yield replace(asked, kind=Kind.QUIET, settle=WINDOW, timeout=BUSY * WINDOW)


CLEARS = "ends half a command in a controller with a word that no controller knows. It moves and erases nothing"
SCAN = Scan("PMX", (9600, 19200, 38400, 57600, 115200), _places, search, _clear, CLEARS)
