"""The controllers on a line: identification, and the search at one baud rate. Both only ask.

The search asks every device number, then none, for `ID`. The first number is tried twice: the first question may follow
the rest of another line. (PMX-2ED-SA manual 6.2.3, 6.3.)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.codec import End, Kind, Procedure
from multidrop.dialects.errors import Inexpressible, NoAnswer
from multidrop.dialects.family import Hints
from multidrop.dialects.pmx.host.codec import FACTORY, Pmx, PmxState
from multidrop.dialects.pmx.host.exchange import who
from multidrop.dialects.pmx.host.operations import troubles
from multidrop.dialects.scanning import WINDOW, Found, Outcome, Reach, Scan, Step

PRODUCT = re.compile(r"(?i)performax-(\S+)")
NAME = re.compile(r"\d[A-Za-z]+(\d\d)")
SEARCH = "multidrop scan PORT --dialect pmx tries every number and baud rate"
TRIES = 2
"""The first question may follow the rest of another line."""


def identify(hints: Hints) -> Procedure[list[PmxState]]:
    """Find the controllers on a line, in the order of `hints.drives`. Raises NoAnswer where none replies.

    Without numbers, try the factory's number, then none, as on a gateway.
    """
    if hints.checksum is not None or hints.em is not None:
        raise Inexpressible("checksum= and em= are for MCode; this controller has neither")
    if not hints.addressed:
        alone = yield from find(PmxState(Pmx(addressed=False)))
        if alone is None:
            raise NoAnswer("no controller replies without an address; check power, wiring and the gateway")
        return [alone]
    if wrong := [name for name in hints.drives if not re.fullmatch(r"\d\d", name, re.ASCII)]:
        raise Inexpressible(f"no device number '{wrong[0]}'; valid: 00 to 99, as in drives=00,01")
    named = tuple(name for name in hints.tried if re.fullmatch(r"\d\d", name, re.ASCII))
    found = []
    for name in hints.drives or named or (FACTORY,):
        state = PmxState(Pmx(), name)
        if (yield from find(state)) is None:
            state.note(f"{who(state)} does not reply")
        found.append(state)
    if any(state.product for state in found):
        return found
    if not hints.drives:
        alone = yield from find(PmxState(Pmx(addressed=False)))
        if alone is not None:
            return [alone]
    tried = ", ".join(state.address for state in found)
    raise NoAnswer(f"no controller replies at {tried}; check power, baud and numbers (drives=00,01,...); {SEARCH}")


def find(state: PmxState) -> Procedure[PmxState | None]:
    """Identify one controller; None where it is silent."""
    text = ""
    for _ in range(TRIES):
        text = yield from _ask(state, "ID")
        if not text or PRODUCT.search(text):
            break
    if not text:
        return None
    product = PRODUCT.search(text)
    if product is None:
        if text.startswith("?"):
            return None  # it does not understand the command, perhaps because of the number before it
        state.note(f"{who(state)} says that it is {text!r}: its commands may mean other things")
    state.identified(f"PMX-{product[1]}" if product else text, (yield from _ask(state, "VER", r"(?i)v.+")))
    state.named((yield from _ask(state, "DN", NAME.pattern)))
    number = NAME.fullmatch(state.name)
    if state.address and number and number[1] != state.address:
        state.note(f"{who(state)}: its DN is {state.name}, so it will answer at {number[1]} after a power cycle")
    try:
        yield from troubles(state)
    except NoAnswer:
        state.reply_outstanding()
    return state


def _ask(state: PmxState, text: str, expect: str | None = None) -> Procedure[str]:
    """Return its reply, also a refusal; empty without a reply."""
    reply = yield replace(state.codec.request(state.address, text), expect=expect)
    return reply.text if reply.end in (End.DONE, End.REFUSED) else ""


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
    states = [PmxState(Pmx(addressed=bool(number)), number) for number in _numbers(reach)]
    for at, state in enumerate(states):
        if state.address not in seen and not (seen and not state.address):
            heard = yield from _replies(state, reach.window)
            if heard.strip(NO_REPLY) and not (yield from _identified(states[max(0, at - LATE) : at + 1], seen, found)):
                remarks.append(f"{heard[:40]!r} was received at {state.address or 'no number'}: no controller's reply")
        step()
    yield from _identified([state for state in states if state.address == NUMBERS[-1]], seen, found)
    return Outcome(tuple(remarks))


def _numbers(reach: Reach) -> tuple[str, ...]:
    """The device numbers to try; the empty one is for a unit that takes none."""
    return ("",) if reach.alone else (*NUMBERS, FACTORY, "")


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
SCAN = Scan("PMX", (9600, 19200, 38400, 57600, 115200), lambda reach: len(_numbers(reach)), search, _clear, CLEARS)
