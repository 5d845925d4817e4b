"""One request of a procedure, and proof that its reply belongs to no other request.

Theory of operation. A reply repeats the command and not what it was for, so a late reply can pass for the next one's.
After a reply that did not come, or that may be another's, the host sends a mark: a reading command whose number no
lost reply bears. A module replies in order, so whatever comes before the reply to the mark is late. Nothing is sent
twice.
"""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import End, Priority, Procedure, Reply, Request
from multidrop.dialects.errors import NoAnswer, Refused, Stopped
from multidrop.dialects.tmcl.host import framing
from multidrop.dialects.tmcl.host.codec import late_reply_to
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.commands import Call, Command, Search, Version
from multidrop.dialects.tmcl.manual.parameters import Axis, Global
from multidrop.dialects.tmcl.manual.status import REFUSALS, Status

MARKS = (
    Call(Command.GGP, Global.HOST_ADDRESS),
    Call(Command.VERSION, Version.BINARY),
    Call(Command.RFS, Search.STATUS),
    Call(Command.GAP, Axis.ACTUAL_POSITION),
)
"""Reading commands. Each can prove that the replies to all other commands are over."""
ANY_VALUE = r"-?\d+"
END = "133 0, 0, 0"
"""The line that ends download mode."""


def who(state: TmclState) -> str:
    """The name of a module in a message."""
    return f"module {state.address}"


def answered(state: TmclState, request: Request) -> Procedure[Reply]:
    """Send a request once; its reply. Raises Refused or NoAnswer."""
    if state.programming:
        raise Refused(f"{who(state)} is in download mode and would store '{request.text}'; {END} ends that")
    yield from synchronised(state, request)
    if state.programming:
        raise Refused(f"{who(state)} is in download mode; '{request.text}' was not sent", int(Status.STORED))
    reply = yield from _replied(state, request)
    if reply.end in (End.TIMEOUT, End.DAMAGED):
        state.reply_lost(_command(request))
        raise NoAnswer(_unanswered(state, request, reply))
    if reply.doubtful:
        yield from _beyond_doubt(state, request)
    if reply.end is End.REFUSED:
        raise refusal(state, request, reply)
    state.settings_confirmed()
    return reply


def synchronised(state: TmclState, request: Request) -> Procedure[None]:
    """Make sure that no reply is outstanding before a request. Raises NoAnswer."""
    if state.reply_pending and not (yield from _mark(state, request.priority)):
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' was not sent")


def _replied(state: TmclState, request: Request) -> Procedure[Reply]:
    """The reply to a request; a reply that is not awaited to its end is lost."""
    try:
        reply = yield request
        status = status_of(reply)
        if status == Status.STORED:
            state.found_storing()
            state.note(f"{who(state)} is in download mode and stored '{request.text}'; {END} or a stop ends that")
        elif status == Status.DONE and state.restore is not None:
            state.owes_nothing()
        return reply
    except (Stopped, GeneratorExit):
        state.reply_lost(_command(request))
        raise


def status_of(reply: Reply) -> int | None:
    """The status in the frame of a reply; None: it is not one."""
    fields = framing.reply(reply.body) if len(reply.body) == framing.LENGTH else None
    return fields.status if fields is not None else None


def read(state: TmclState, call: Call, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The value of a reading command. Raises Refused or NoAnswer."""
    asked = state.codec.request(state.address, str(call), call)
    reply = yield from answered(state, replace(asked, priority=priority))
    return int(reply.text)


def refusal(state: TmclState, request: Request, reply: Reply) -> Refused:
    """The exception for a refusal: its status, meaning and remedy."""
    code = int(reply.text)
    meaning = REFUSALS.get(code)
    text = f"{meaning.text} ({meaning.advice})" if meaning else "unknown status"
    return Refused(f"{who(state)} refused '{request.text}': status {code}, {text}", code)


def _command(request: Request) -> int:
    return framing.call_of(request.body)[1].command


def _unanswered(state: TmclState, request: Request, reply: Reply) -> str:
    if reply.end is End.DAMAGED:
        return (
            f"{who(state)}: the reply to '{request.text}' is damaged ({reply.detail}); it may have been executed and "
            "was not sent again"
        )
    return f"{who(state)} does not reply: it is not known whether '{request.text}' was executed; it was sent once"


def _mark(state: TmclState, priority: Priority) -> Procedure[bool]:
    """Send a mark; whether its reply came."""
    return (yield from _late_before_mark(state, priority)) is not None


def _beyond_doubt(state: TmclState, request: Request) -> Procedure[None]:
    """Make sure that a reply was the one to this request. Raises NoAnswer where it may be another's."""
    name = f"{who(state)}: {late_reply_to(_command(request))}"
    late = yield from _late_before_mark(state, request.priority, _command(request))
    if late is None or any(name in line for line in late):
        raise NoAnswer(
            f"{who(state)}: a late reply came, perhaps to '{request.text}': it is not known whether that was "
            "executed; it was sent once"
        )


def _late_before_mark(state: TmclState, priority: Priority, besides: int = 0) -> Procedure[tuple[str, ...] | None]:
    """Lines that came before the reply to a mark; None where that did not come, or may be another's."""
    taken = state.lost_commands | {besides}
    call = next((each for each in MARKS if each.command not in taken), MARKS[0])
    asked = replace(state.codec.request(state.address, str(call), call), priority=priority)
    reply = yield from _replied(state, replace(asked, expect=ANY_VALUE, gather=True))
    if reply.end is not End.DONE or (call.command in taken and reply.doubtful):
        state.reply_lost(call.command)
        return None
    state.proved()
    return reply.lines[:-1]
