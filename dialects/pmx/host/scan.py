"""The search for PMX controllers at one baud rate: every device number, then none. It only asks `ID`.

The first number is tried twice: the first question may follow the rest of another line. (PMX-2ED-SA manual 6.2.3, 6.3.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from multidrop.dialects.codec import Kind, Procedure
from multidrop.dialects.pmx.host.codec import FACTORY, Pmx
from multidrop.dialects.pmx.host.identify import find
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.scanning import WINDOW, Found, Outcome, Reach, Scan, Step

NUMBERS = tuple(f"{number:02}" for number in range(100))
NOTHING = "~~~"
"""A word that no controller knows."""
NO_REPLY = b"\r\n\0"
LATE = 4
"""Numbers before the present one whose reply may come now."""
CERTAIN = 5
"""Windows in which a late reply comes."""
BUSY = 2.5
"""The longest wait, in windows, where something else arrives."""


def search(reach: Reach, found: Found[PmxState], step: Step) -> Procedure[Outcome]:
    """Search for every controller at one baud rate; report each as soon as it is identified."""
    remarks: list[str] = []
    seen = set(reach.known)
    states = list(_states(reach))
    for at, state in enumerate(states):
        if state.address not in seen and not (seen and not state.address):
            heard = yield from _replies(state, reach.window)
            if heard.strip(NO_REPLY) and not (yield from _identified(states[max(0, at - LATE) : at + 1], seen, found)):
                remarks.append(f"{heard[:40]!r} was received at {state.address or 'no number'}: no controller's reply")
        step()
    yield from _identified([state for state in states if state.address == NUMBERS[-1]], seen, found)
    return Outcome(tuple(remarks))


def _identified(states: Sequence[PmxState], seen: set[str], found: Found[PmxState]) -> Procedure[bool]:
    """Identify the controllers whose replies came: the last of these, or those before it. A reply bears no number."""
    before = len(seen)
    for state in reversed(states):
        if state.address in seen or not (yield from _replies(state, CERTAIN * WINDOW)):
            continue
        if (yield from find(state)) is not None:
            seen.add(state.address)
            found(state)
    return len(seen) > before


def _states(reach: Reach) -> Iterator[PmxState]:
    numbered = () if reach.alone else (*NUMBERS, FACTORY)
    yield from (PmxState(Pmx(), number) for number in numbered)
    yield PmxState(Pmx(addressed=False))


def _places(reach: Reach) -> int:
    return sum(1 for _ in _states(reach))


def _replies(state: PmxState, quiet: float) -> Procedure[bytes]:
    """Ask for the identification; return what was received until it was quiet."""
    asked = state.codec.request(state.address, "ID")
    reply = yield replace(asked, kind=Kind.QUIET, settle=quiet, timeout=BUSY * quiet)
    return reply.raw


def _clear() -> Procedure[None]:
    """End a half-sent command, whose number no controller has."""
    asked = Pmx(addressed=False).request("", NOTHING)
    yield replace(asked, kind=Kind.QUIET, settle=WINDOW, timeout=BUSY * WINDOW)


CLEARS = "ends half a command in a controller with a word that no controller knows. It moves and erases nothing"
SCAN = Scan("PMX", (9600, 19200, 38400, 57600, 115200), _places, search, _clear, CLEARS)
