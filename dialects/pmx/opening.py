"""Finding out which controllers are on a line. Only questions: nothing moves, no error is cleared."""

from __future__ import annotations

import re
from dataclasses import replace

from dialects.base import End, Hints, Known, Talk
from dialects.errors import Inexpressible, NoAnswer
from dialects.pmx.asking import pmx, who
from dialects.pmx.dialect import FACTORY, Pmx
from dialects.pmx.talk import troubles

PRODUCT = re.compile(r"(?i)performax-(\S+)")
NAME = re.compile(r"\d[A-Za-z]+(\d\d)")
TRIES = 2
"""The first question may fall on the rest of somebody's line."""


def identify(hints: Hints) -> Talk[list[Known]]:
    """The controllers on a line, in the order of `hints.drives`. Raises NoAnswer where nobody answers.

    Where no number is said, the factory's is tried, and then none at all, as behind a gateway.
    """
    if hints.checksum is not None or hints.em is not None:
        raise Inexpressible("checksum= and em= are for MCode; this controller has neither")
    if not hints.addressed:
        alone = yield from _found(Known(Pmx(addressed=False)))
        if alone is None:
            raise NoAnswer("no controller answers without an address; check power, wiring and the gateway")
        return [alone]
    if wrong := [name for name in hints.drives if not re.fullmatch(r"\d\d", name, re.ASCII)]:
        raise Inexpressible(f"'{wrong[0]}' is no device number: they are 00 to 99, as in drives=00,01")
    found = []
    for name in hints.drives or (FACTORY,):
        known = Known(Pmx(), name)
        if (yield from _found(known)) is None:
            known.notes.append(f"{who(known)} does not answer")
        found.append(known)
    if any(known.product for known in found):
        return found
    if not hints.drives:
        alone = yield from _found(Known(Pmx(addressed=False)))
        if alone is not None:
            return [alone]
    tried = ", ".join(known.address for known in found)
    raise NoAnswer(f"no controller answers at {tried}; check power, baud and numbers (drives=00,01,...)")


def _found(known: Known) -> Talk[Known | None]:
    """One controller and what it is; None where it is silent."""
    text = ""
    for _ in range(TRIES):
        text = yield from _ask(known, "ID")
        if not text or PRODUCT.search(text):
            break
    if not text:
        return None
    product = PRODUCT.search(text)
    if product is None:
        if text.startswith("?"):
            return None  # it is told something that it does not understand: a number in front, maybe
        known.notes.append(f"{who(known)} says that it is {text!r}: its commands may mean other things")
    known.product = f"PMX-{product[1]}" if product else text
    known.version = yield from _ask(known, "VER", r"(?i)v.+")
    known.name = yield from _ask(known, "DN", NAME.pattern)
    number = NAME.fullmatch(known.name)
    if known.address and number and number[1] != known.address:
        known.notes.append(
            f"{who(known)}: its DN is {known.name}, so it will answer at {number[1]} after a power cycle"
        )
    try:
        yield from troubles(known)
    except NoAnswer:
        known.unsure = True
    return known


def _ask(known: Known, text: str, expect: str | None = None) -> Talk[str]:
    """What it answers, a refusal too; empty where nothing comes."""
    reply = yield replace(pmx(known).request(known.address, text), expect=expect)
    return reply.text if reply.end in (End.DONE, End.REFUSED) else ""
