"""One request to a controller, and proof of its outcome.

Theory of operation. A controller replies to each command with one line: `OK`, a value, or `?` and a reason. A reply
carries neither the controller's number nor its command, except that `?` precedes an unknown word. So after a missing or
doubtful reply the host sends a sync mark: an unknown word with the controller's number and a number of its own.
Everything before the reply to the mark is late and is discarded. The host never repeats a command. (PMX-2ED-SA manual
6.2.3, 9; facts of real units.)
"""

from __future__ import annotations

import re
from dataclasses import replace

from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.errors import NoAnswer, Refused
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import errors
from multidrop.dialects.pmx.manual.help import suggestion
from multidrop.dialects.pmx.manual.table import lookup

MARK = "Q"
"""The first letter of a sync mark; no command begins with it."""
INTEGER = r"-?\d{1,19}"


def who(state: PmxState) -> str:
    """Name a controller in a message."""
    return state.address or "the controller"


def answered(state: PmxState, request: Request, doubts: list[Request] | None = None) -> Procedure[Reply]:
    """Send a request once; return the reply, which may be `OK`. Raises Refused or NoAnswer.

    `doubts`: a list for a request whose reply may belong to another; without it a sync mark follows at once.
    """
    if state.reply_pending and not (yield from mark(state, request.priority)):
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' was not sent")
    reply = yield request
    if reply.end in (End.TIMEOUT, End.DAMAGED):
        state.reply_outstanding()
        raise NoAnswer(_unanswered(state, request, reply))
    if reply.doubtful and doubts is not None:
        doubts.append(request)
    elif reply.doubtful:
        yield from beyond_doubt(state, request)
    state.settings_confirmed()
    if reply.end is End.REFUSED:
        raise refusal(state, request, reply)
    return reply


def _unanswered(state: PmxState, request: Request, reply: Reply) -> str:
    if reply.end is End.DAMAGED:
        return (
            f"{who(state)}: the reply to '{request.text}' is damaged ({reply.detail}); it may have been executed and "
            "was not sent again"
        )
    return f"{who(state)} does not reply: it is not known whether '{request.text}' was executed; it was sent once"


def beyond_doubt(state: PmxState, request: Request) -> Procedure[None]:
    """Prove that a reply was not the outstanding one of another request. Raises NoAnswer."""
    before = yield from _lines_before_mark(state, request.priority)
    if before is None or before:
        if before is None:
            state.reply_outstanding()
        else:
            state.synchronised()
        raise NoAnswer(
            f"{who(state)}: a late reply came, perhaps to '{request.text}': it is not known whether that was "
            "executed; it was sent once"
        )


def mark(state: PmxState, priority: Priority) -> Procedure[bool]:
    """Send a sync mark, so that everything before its reply is late; return whether it was replied to."""
    found = (yield from _lines_before_mark(state, priority)) is not None
    if found:
        state.synchronised()
    else:
        state.reply_outstanding()
    return found


def _lines_before_mark(state: PmxState, priority: Priority) -> Procedure[tuple[str, ...] | None]:
    """Return the lines before the reply to a sync mark; None without that reply."""
    text = f"{MARK}{state.address}{state.next_sync_mark() % 1000:03}"
    asked = replace(state.codec.request(state.address, text), kind=Kind.PRINT)
    reply = yield replace(asked, expect=re.escape(f"?{text}"), gather=True, priority=priority)
    return reply.lines[:-1] if reply.end is End.DONE else None


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
    if (found := errors.meaning(received)) is not None:
        return Refused(f"{head}: {received}: {found.text} ({found.advice})")
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
    """Suggest what is wrong with an unknown command."""
    if text != text.upper() and lookup(text.upper()) is not None:
        return f"it reads capitals only: {text.upper()}"
    if " " in text and lookup(text.replace(" ", "")) is not None:
        return f"no spaces: {text.replace(' ', '')}"
    row = lookup(text)
    if row is not None and "=" in text and "W" not in row.access:
        return f"{row.name} cannot be set"
    return suggestion(text) if row is None else ""
