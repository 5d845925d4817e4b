"""One request of a procedure, and proof that its reply belongs to no other request; the motors of a module.

A reply repeats the command and not what it was for. So the sync mark is a reading command whose number no lost reply
bears.
"""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import End, Priority, Procedure, Reply, Request
from multidrop.dialects.errors import NoAnswer, Refused, Stopped
from multidrop.dialects.exchange import Exchange
from multidrop.dialects.tmcl.host.codec import LENGTH, MOST_MOTORS, TmclState, call_of, late_reply_to, parse_reply
from multidrop.dialects.tmcl.manual.commands import REFUSALS, Call, Command, Search, Status, Version
from multidrop.dialects.tmcl.manual.parameters import Axis, Global

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
    return f"module {state.address}"


def answered(state: TmclState, request: Request) -> Procedure[Reply]:
    """Send a request once; its reply. Raises Refused or NoAnswer."""
    if state.programming:
        raise Refused(f"{who(state)} is in download mode and would store '{request.text}'; {END} ends that")
    yield from synchronised(state, request)
    if state.programming:
        raise Refused(f"{who(state)} is in download mode; '{request.text}' was not sent", int(Status.STORED))
    return (yield from _EXCHANGE.answered(state, request))


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
        _lost(state, request)
        raise


def status_of(reply: Reply) -> int | None:
    """The status in the frame of a reply; None: it is not one."""
    fields = parse_reply(reply.body) if len(reply.body) == LENGTH else None
    return fields.status if fields is not None else None


def read(state: TmclState, call: Call, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The value of a reading command. Raises Refused or NoAnswer."""
    asked = state.codec.request(state.address, str(call), call)
    reply = yield from answered(state, replace(asked, priority=priority))
    return int(reply.text)


def refusal(state: TmclState, request: Request, reply: Reply) -> Refused:
    code = int(reply.text)
    meaning, advice = REFUSALS.get(code, ("", ""))
    text = f"{meaning} ({advice})" if meaning else "unknown status"
    return Refused(f"{who(state)} refused '{request.text}': status {code}, {text}", code)


def _lost(state: TmclState, request: Request) -> None:
    state.reply_lost(call_of(request.body)[1].command)


def _mark(state: TmclState, request: Request, sent: bool) -> Procedure[tuple[str, ...] | None]:
    """Send a mark; where the commands of all marks have lost replies, the first one twice before it.

    That one is sent again only once all have lost replies. So the second of two replies to it follows those to the
    others, and only its own and a stop's may still be late.
    """
    lines: list[str] = []
    if state.lost_commands.issuperset(each.command for each in MARKS):
        for _ in range(2):
            reply = yield from _asked(state, MARKS[0], request.priority)
            if reply is None:
                return None
            lines += reply.lines[:-1]
        state.late_again(MARKS[0].command)
    own = call_of(request.body)[1].command
    taken = state.lost_commands | ({own} if sent else set())
    call = next((each for each in MARKS if each.command not in taken), MARKS[0])
    reply = yield from _asked(state, call, request.priority)
    if reply is None or (call.command in taken and reply.doubtful):
        state.reply_lost(call.command)
        return None
    state.proved()
    name = f"{who(state)}: {late_reply_to(own)}"
    return tuple(line for line in (*lines, *reply.lines[:-1]) if not sent or name in line)


def _asked(state: TmclState, call: Call, priority: Priority) -> Procedure[Reply | None]:
    """Send a reading command, and gather what comes before its reply; None without a reply."""
    asked = replace(state.codec.request(state.address, str(call), call), priority=priority)
    reply = yield from _replied(state, replace(asked, expect=ANY_VALUE, gather=True))
    if reply.end is not End.DONE:
        state.reply_lost(call.command)
        return None
    return reply


_EXCHANGE = Exchange(who, _mark, _lost, refusal, _replied)
synchronised = _EXCHANGE.synchronised


def motors(state: TmclState, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The number of motors; where it is not known, read motors until the module refuses one. Raises NoAnswer.

    It is read together with parameter 127 of each motor; a module that refuses that for one lacks it.
    """
    if state.motors:
        return state.motors
    count = 1
    try:
        while count < MOST_MOTORS:
            yield from read(state, Call(Command.GAP, Axis.ACTUAL_POSITION, count), priority)
            count += 1
    except Refused:
        pass
    state.motors_counted(count)
    try:
        for motor in range(count):
            call = Call(Command.GAP, Axis.RELATIVE_FROM, motor)
            state.relative_read(motor, (yield from read(state, call, priority)))
    except (Refused, NoAnswer):
        pass
    return count
