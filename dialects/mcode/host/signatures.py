"""Signed prints: the host's questions, a person's prints, sync marks.

Theory of operation. A reply carries neither its request's number nor a name. So the host appends an item to the values:
the drive's own name (`PR P,DN`) if the drive prints it, otherwise a text with that name (`PR P,"~a"`). The first is
better. A flipped bit may turn one drive's name into another's: that drive prints any text that it receives, but its own
name. A sync mark also has a fresh number; everything before it is late. (MCode reference 5.1.33, 5.1.102; decision
0014.)
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache

from multidrop.dialects.codec import Reply, Request
from multidrop.dialects.errors import Inexpressible
from multidrop.dialects.mcode.host import printed
from multidrop.dialects.mcode.host.state import MCodeState


@dataclass(frozen=True)
class Sign:
    """The item of PR that signs a print, and its printed form."""

    item: str
    shown: str


def sign(state: MCodeState) -> Sign:
    """Return the signature of a drive."""
    return _sign(state.address, state.signs and state.codec.party)


@lru_cache(maxsize=256)
def _sign(address: str, by_name: bool) -> Sign:
    if by_name:
        return Sign("DN", as_printed(address))
    text = _tag(address)
    return Sign(f'"{text}"', text)


def fresh(state: MCodeState, address: str, party: bool) -> Sign:
    """Return a sync mark: the signature of a drive at this address, with a fresh number."""
    number = state.next_sync_mark() % 10000
    if state.signs and party:
        return Sign(f'"~{number}",DN', f"~{number}{as_printed(address)}")
    text = f"{_tag(address)}{number}"
    return Sign(f'"{text}"', text)


def as_printed(name: str) -> str:
    """Return a name as PR DN prints it."""
    return f'"{name}"'


def _tag(address: str) -> str:
    return f"~{address}" if address.isalnum() else "~"


def question(state: MCodeState, items: str, answer: str) -> Request:
    """Print values for the host's own use; `answer` is a regular expression for them."""
    own = sign(state)
    asked = state.codec.request(state.address, f"PR {items},{own.item}")
    return replace(asked, expect=f"({answer}){re.escape(own.shown)}", signed=True)


def value(state: MCodeState, reply: Reply) -> str:
    """Return the values of such a reply."""
    return reply.text.removesuffix(sign(state).shown)


def signed(state: MCodeState, request: Request) -> Request:
    """Sign a person's print; unchanged where it has no value, or no room."""
    own = sign(state)
    text = printed.signed(request.text, own.item)
    if text is None:
        return request
    try:
        longer = state.codec.request(state.address, text)
    except Inexpressible:
        return request
    expect = f"{printed.form(request.text)}{re.escape(own.shown)}"
    return replace(longer, text=request.text, spoken=text, expect=expect, signed=True)
