"""Prints that say whose they are: the host's questions, what a person has printed, marks.

Theory of operation. An answer carries neither its question's number nor a name. So the host has the drive print
something more behind the values: its own name (`PR P,DN`), where the drive was seen to do so, else a text with that
name (`PR P,"~a"`). The first is better: where a flipped bit makes one drive's name another's, that other one prints
whatever text it is given, but its own name. A mark is the same with a number that was not printed before; all that
comes in front of it is late. (MCode reference 5.1.33, 5.1.102; decision 0014.)
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from dialects.codec import Reply, Request
from dialects.errors import Inexpressible
from dialects.mcode.host import printed
from dialects.mcode.host.state import MCodeState


@dataclass(frozen=True)
class Sign:
    """What is printed behind the values: as an item of PR, and as it is read."""

    item: str
    shown: str


def sign(state: MCodeState) -> Sign:
    """How a drive signs."""
    if state.signs and state.codec.party:
        return Sign("DN", as_printed(state.address))
    text = _tag(state.address)
    return Sign(f'"{text}"', text)


def fresh(state: MCodeState, address: str, party: bool) -> Sign:
    """A mark: the sign of a drive that is called so, with a number that nobody has printed before."""
    number = state.next_sync_mark() % 10000
    if state.signs and party:
        return Sign(f'"~{number}",DN', f"~{number}{as_printed(address)}")
    text = f"{_tag(address)}{number}"
    return Sign(f'"{text}"', text)


def as_printed(name: str) -> str:
    """A name as PR DN prints it."""
    return f'"{name}"'


def _tag(address: str) -> str:
    return f"~{address}" if address.isalnum() else "~"


def question(state: MCodeState, items: str, answer: str) -> Request:
    """A print of values for the host's own sake; `answer` is what they look like."""
    own = sign(state)
    asked = state.codec.request(state.address, f"PR {items},{own.item}")
    return replace(asked, expect=f"({answer}){re.escape(own.shown)}", signed=True)


def value(state: MCodeState, reply: Reply) -> str:
    """The values in such an answer."""
    return reply.text.removesuffix(sign(state).shown)


def signed(state: MCodeState, request: Request) -> Request:
    """What a person has printed, with the sign behind its values; as it is, where it has none or has no room."""
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
