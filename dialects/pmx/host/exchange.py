"""One request to a controller, and proof of its outcome.

A controller replies to each command with one line: `OK`, a value, or `?` and a reason. A reply carries neither the
controller's number nor its command, except that `?` precedes an unknown word. So the sync mark is an unknown word with
the controller's number and a number of its own. (PMX-2ED-SA manual 6.2.3, 9; facts of real units.)
"""

from __future__ import annotations

import re
from dataclasses import replace

from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.errors import Refused
from multidrop.dialects.exchange import Exchange
from multidrop.dialects.pmx.host.codec import PmxState
from multidrop.dialects.pmx.manual import status
from multidrop.dialects.pmx.manual.help import suggestion
from multidrop.dialects.pmx.manual.table import lookup

MARK = "Q"
"""The first letter of a sync mark; no command begins with it."""
INTEGER = r"-?\d{1,19}"


def who(state: PmxState) -> str:
    return state.address or "the controller"


def _mark(state: PmxState, request: Request, sent: bool) -> Procedure[tuple[str, ...] | None]:  # noqa: ARG001
    """Send an unknown word with a fresh number, which precedes every reply to it."""
    text = f"{MARK}{state.address}{state.next_sync_mark() % 1000:03}"
    asked = replace(state.codec.request(state.address, text), kind=Kind.PRINT)
    reply = yield replace(asked, expect=re.escape(f"?{text}"), gather=True, priority=request.priority)
    if reply.end is not End.DONE:
        state.reply_outstanding()
        return None
    state.synchronised()
    return reply.lines[:-1]


def number(
    state: PmxState, text: str, priority: Priority = Priority.OPERATOR, doubts: list[Request] | None = None
) -> Procedure[int]:
    """Read a whole number for the host's own use. Raises Refused or NoAnswer."""
    asked = replace(state.codec.request(state.address, text), expect=INTEGER, priority=priority)
    reply = yield from answered(state, asked, doubts)
    return int(reply.text)


def refusal(state: PmxState, request: Request, reply: Reply) -> Refused:
    """Describe a refusal: the reply where it says more than the command, its meaning, the remedy."""
    received, text = reply.text, request.text
    head = f"{who(state)} refused '{text}'"
    if (found := status.meaning(received)) is not None:
        return Refused(f"{head}: {received}: {found[0]} ({found[1]})")
    if received != f"?{text}" and not text.startswith(received[1:]):
        return Refused(f"{head}: it received {received[1:]!r}, or does not accept it so (was the line disturbed?)")
    advice = _advice(text)
    row = lookup(text)
    moves = row is not None and text == text.upper() and {"place", "sign", "both"} & set(row.shapes)
    if moves:
        advice = "an axis with a limit error takes no move: /status shows it, CLRX and CLRY clear it"
    what = "it does not take that now" if moves else "it does not know that command"
    return Refused(f"{head}: {received}: {what}" + (f" ({advice})" if advice else ""))


def _advice(text: str) -> str:
    if text != text.upper() and lookup(text.upper()) is not None:
        return f"it reads capitals only: {text.upper()}"
    if " " in text and lookup(text.replace(" ", "")) is not None:
        return f"no spaces: {text.replace(' ', '')}"
    row = lookup(text)
    if row is not None and "=" in text and "W" not in row.access:
        return f"{row.name} cannot be set"
    return suggestion(text) if row is None else ""


_EXCHANGE = Exchange(who, _mark, lambda state, request: state.reply_outstanding(), refusal)
answered, beyond_doubt = _EXCHANGE.answered, _EXCHANGE.beyond_doubt
