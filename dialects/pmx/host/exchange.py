"""Asking a controller something, and making sure what came of it.

Theory of operation. Every command is answered by one line: `OK`, a value, or `?` and why not. An answer carries neither
the number of whom it is from nor what it answers, except that a word that there is not comes back behind a `?`. So
after an answer that did not come, or may be another's, such a word is sent, with the controller's number and one of its
own: a mark. All that comes before its answer is late and belongs to nobody. Nothing is ever sent again.
(PMX-2ED-SA manual 6.2.3, 9; facts of real units.)
"""

from __future__ import annotations

import re
from dataclasses import replace

from dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from dialects.errors import NoAnswer, Refused
from dialects.pmx.host.state import PmxState
from dialects.pmx.manual import errors
from dialects.pmx.manual.help import suggestion
from dialects.pmx.manual.table import lookup

MARK = "Q"
"""How a mark begins: as no command does."""
INTEGER = r"-?\d{1,19}"


def who(state: PmxState) -> str:
    """How a controller is named in a message."""
    return state.address or "the controller"


def answered(state: PmxState, request: Request, doubts: list[Request] | None = None) -> Procedure[Reply]:
    """Send it once; the answer, which may be `OK`. Raises Refused or NoAnswer.

    `doubts`: where the request is put down, in place of a mark behind it, if its answer may be another's.
    """
    if state.reply_pending and not (yield from mark(state, request.priority)):
        raise NoAnswer(f"{who(state)} does not answer: '{request.text}' was not sent")
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
            f"{who(state)}: the answer to '{request.text}' is damaged ({reply.detail}); it may have been executed and "
            "was not sent again"
        )
    return f"{who(state)} does not answer: it is not known whether '{request.text}' was executed; it was sent once"


def beyond_doubt(state: PmxState, request: Request) -> Procedure[None]:
    """An answer is outstanding on the line: make sure that this was not that one."""
    before = yield from _lines_before_mark(state, request.priority)
    if before is None or before:
        if before is None:
            state.reply_outstanding()
        else:
            state.synchronised()
        raise NoAnswer(
            f"{who(state)}: a late answer came, maybe as the one to '{request.text}': it is not known whether that was "
            "executed; it was sent once"
        )


def mark(state: PmxState, priority: Priority) -> Procedure[bool]:
    """Send a mark: all that comes in front of its answer is late. Whether it was answered."""
    found = (yield from _lines_before_mark(state, priority)) is not None
    if found:
        state.synchronised()
    else:
        state.reply_outstanding()
    return found


def _lines_before_mark(state: PmxState, priority: Priority) -> Procedure[tuple[str, ...] | None]:
    """What came before the mark; None where that did not come."""
    text = f"{MARK}{state.address}{state.next_sync_mark() % 1000:03}"
    asked = replace(state.codec.request(state.address, text), kind=Kind.PRINT)
    reply = yield replace(asked, expect=re.escape(f"?{text}"), gather=True, priority=priority)
    return reply.lines[:-1] if reply.end is End.DONE else None


def number(
    state: PmxState, text: str, priority: Priority = Priority.OPERATOR, doubts: list[Request] | None = None
) -> Procedure[int]:
    """A value that is a whole number; for the host's own sake. Raises Refused or NoAnswer."""
    asked = replace(state.codec.request(state.address, text), expect=INTEGER, priority=priority)
    reply = yield from answered(state, asked, doubts)
    return int(reply.text)


def refusal(state: PmxState, request: Request, reply: Reply) -> Refused:
    """What is said of a refusal: the reply where it says more than what was sent, what it means, what to do."""
    told, text = reply.text, request.text
    head = f"{who(state)} refused '{text}'"
    if (found := errors.meaning(told)) is not None:
        return Refused(f"{head}: {told}: {found.text} ({found.advice})")
    if told != f"?{text}" and not text.startswith(told[1:]):
        return Refused(f"{head}: it heard {told[1:]!r}, or does not take it so (was the line disturbed?)")
    advice = _advice(text)
    row = lookup(text)
    moves = row is not None and text == text.upper() and {"place", "sign", "both"} & set(row.shapes)
    if moves:
        advice = "an axis with a limit error takes no move: /status tells, CLRX and CLRY clear it"
    what = "it does not take that now" if moves else "it does not know that command"
    return Refused(f"{head}: {told}: {what}" + (f" ({advice})" if advice else ""))


def _advice(text: str) -> str:
    """What may be wrong with a command that is not known."""
    if text != text.upper() and lookup(text.upper()) is not None:
        return f"it reads capitals only: {text.upper()}"
    if " " in text and lookup(text.replace(" ", "")) is not None:
        return f"no spaces: {text.replace(' ', '')}"
    row = lookup(text)
    if row is not None and "=" in text and "W" not in row.access:
        return f"{row.name} cannot be set"
    return suggestion(text) if row is None else ""
