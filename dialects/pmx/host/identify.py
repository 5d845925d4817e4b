"""The identification of the controllers on a line. It only asks: nothing moves, no error is cleared."""

from __future__ import annotations

import re
from dataclasses import replace

from multidrop.dialects.codec import End, Procedure
from multidrop.dialects.errors import Inexpressible, NoAnswer
from multidrop.dialects.family import Hints
from multidrop.dialects.pmx.host.codec import FACTORY, Pmx
from multidrop.dialects.pmx.host.exchange import who
from multidrop.dialects.pmx.host.operations import troubles
from multidrop.dialects.pmx.host.state import PmxState

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
