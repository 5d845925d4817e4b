"""The search for controllers at one baud rate. It only asks: every device number, then none, for `ID`.

The first number is tried twice: the first question may follow the rest of another line. (PMX-2ED-SA manual 6.2.3, 6.3.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.codec import Kind, Procedure
from multidrop.dialects.scanning import WINDOW, Found, Reach, Scan, SearchOutcome, Step
from multidrop.families.pmx.host.codec import FACTORY, Pmx, PmxState
from multidrop.families.pmx.host.operations import find

NUMBERS = tuple(f"{number:02}" for number in range(100))
NOTHING = "~~~"
"""A word that no controller knows."""
NO_REPLY = b"\r\n\0"
LATE_ADDRESSES = 4
"""Numbers before the present one whose reply may come now."""
CERTAIN = 5
"""Windows in which a late reply comes."""
MOST_SHOWN_REMARKS = 3
"""Replies that could not be read, until the rest is only counted."""
BUSY = 2.5
"""The longest wait, in windows, where something else arrives."""


def _numbers(reach: Reach) -> tuple[str, ...]:
    """The device numbers to try; the empty one is for a unit that takes none."""
    return ("",) if reach.alone else (*NUMBERS, FACTORY, "")


def _identified(states: Sequence[PmxState], seen: set[str], found: Found) -> Procedure[bool]:
    """Identify the controllers whose replies came: the last of these, or those before it. A reply bears no number."""
    before = len(seen)
    for state in reversed(states):
        if state.address in seen or not (yield from _replies(state, CERTAIN * WINDOW)):
            continue
        if (yield from find(state)) is not None:
            seen.add(state.address)
            found(state)
    return len(seen) > before


def _replies(state: PmxState, quiet: float) -> Procedure[bytes]:
    """Ask for the identification; return what was received until it was quiet."""
    asked = state.codec.request(state.address, "ID")
    reply = yield replace(asked, kind=Kind.QUIET, settle=quiet, timeout=BUSY * quiet)
    return reply.raw


CLEARS = "ends half a command in a controller with a word that no controller knows. It moves and erases nothing"


class PmxScan(Scan):
    """The search for PMX controllers."""

    title = "PMX"
    bauds = (9600, 19200, 38400, 57600, 115200)
    clears = CLEARS

    def places(self, reach: Reach) -> int:
        return len(_numbers(reach))

    def search(self, reach: Reach, found: Found, step: Step) -> Procedure[SearchOutcome]:
        """Search for every controller at one baud rate; report each as soon as it is identified."""
        remarks: list[str] = []
        seen = set(reach.known)
        states = [PmxState(Pmx(addressed=bool(number)), number) for number in _numbers(reach)]
        for at, state in enumerate(states):
            if state.address not in seen and not (seen and not state.address):
                heard = yield from _replies(state, reach.window)
                if heard.strip(NO_REPLY) and not (
                    yield from _identified(states[max(0, at - LATE_ADDRESSES) : at + 1], seen, found)
                ):
                    remarks.append(
                        f"{heard[:40]!r} was received at {state.address or 'no number'}: no controller's reply"
                    )
            step()
        yield from _identified([state for state in states if state.address == NUMBERS[-1]], seen, found)
        more = (
            [f"at {len(remarks) - MOST_SHOWN_REMARKS} more numbers something was received"]
            if len(remarks) > MOST_SHOWN_REMARKS
            else []
        )
        return SearchOutcome((*remarks[:MOST_SHOWN_REMARKS], *more))

    def clear(self) -> Procedure[None]:
        """End a half-sent command, whose number no controller has."""
        asked = Pmx(addressed=False).request("", NOTHING)
        yield replace(asked, kind=Kind.QUIET, settle=WINDOW, timeout=BUSY * WINDOW)

    def asked(self, reach: Reach) -> str:
        return "numbers 00 to 99"


SCAN = PmxScan()
