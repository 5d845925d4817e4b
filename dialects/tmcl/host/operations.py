"""Procedures with a module: a typed line, and the motion of its motors."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import Kind, Priority, Procedure, Request
from multidrop.dialects.errors import Inexpressible, NoAnswer, Refused
from multidrop.dialects.family import Motion, Referencing
from multidrop.dialects.tmcl.host.exchange import END, answered, read, refusal, status_of, synchronised, who
from multidrop.dialects.tmcl.host.motors import motors
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual import grammar
from multidrop.dialects.tmcl.manual.commands import Call, Command, Running, Search
from multidrop.dialects.tmcl.manual.parameters import Axis, Global
from multidrop.dialects.tmcl.manual.status import Status

LACKS = (Status.INVALID_COMMAND, Status.WRONG_TYPE, Status.INVALID_VALUE)
"""The statuses of a module that does not know a command or a parameter."""


def perform(state: TmclState, text: str) -> Procedure[tuple[str, ...]]:
    """Send a command in TMCL's notation; the value where it prints one.

    Raises Refused, NoAnswer, Stopped or Inexpressible.
    """
    request, call = parsed(state, text)
    if state.programming or call.command == Command.DOWNLOAD:
        yield from _store(state, request, call)
        return ()
    if call.command == Command.FACTORY or (
        call.command in (Command.SAP, Command.RSAP) and call.type == Axis.RELATIVE_FROM
    ):
        state.relative_forgotten()
    reply = yield from answered(state, request)
    _remark(state, call)
    return reply.lines if request.kind is Kind.PRINT else ()


def parsed(state: TmclState, text: str) -> tuple[Request, Call]:
    """Build the request for a command. Raises Inexpressible for one that no module gets."""
    try:
        call = grammar.parse(text)
    except grammar.LineError as error:
        raise Inexpressible(f"'{text.strip()}': {error}; nothing was sent") from None
    return state.codec.request(state.address, text.strip(), call), call


def _store(state: TmclState, request: Request, call: Call) -> Procedure[None]:
    """Begin a download, store a line, or end the download; nothing else may go to the module meanwhile."""
    if not state.programming:
        yield from synchronised(state, request)
        state.found_storing()
        state.remark(f"{who(state)}: download mode: every command is stored until {END}, or a stop")
    begins, ends = call.command == Command.DOWNLOAD, call.command == Command.END_DOWNLOAD
    reply = yield replace(request, kind=Kind.PROGRAM)
    status = status_of(reply)
    if status is None:
        state.reply_lost(call.command)
        raise NoAnswer(f"{who(state)}: it is not known whether '{request.text}' was stored; it was sent once")
    if status == Status.STORED or (begins and status == Status.DONE):
        return
    if status == Status.DONE or begins:
        state.executes()
        state.owes_nothing()
    if status != Status.DONE:
        raise refusal(state, request, reply)
    if not ends:
        raise Refused(f"{who(state)} was not in download mode any more: '{request.text}' was executed and not stored")


def motion(state: TmclState, priority: Priority) -> Procedure[tuple[Motion, ...]]:
    """Position and velocity of each motor."""
    found = []
    count = yield from motors(state, priority)
    for motor in range(count):
        position = yield from read(state, Call(Command.GAP, Axis.ACTUAL_POSITION, motor), priority)
        velocity = yield from read(state, Call(Command.GAP, Axis.ACTUAL_VELOCITY, motor), priority)
        found.append(Motion(position, velocity, str(motor) if count > 1 else ""))
    return tuple(found)


def referencing(state: TmclState, text: str) -> Referencing | None:
    """Find out whether a command searches the reference of a motor or sets its position."""
    try:
        call = grammar.parse(text)
    except grammar.LineError:
        return None
    searches = call.command == Command.RFS and call.type == Search.START
    if searches or (call.command == Command.SAP and call.type == Axis.ACTUAL_POSITION):
        return Referencing(str(call.motor) if state.motors > 1 else "", searches)
    return None


def homed(state: TmclState) -> Procedure[bool]:
    """A module shows no failure of a search: its end is all that is seen."""
    yield from ()
    return True


def moving(state: TmclState) -> Procedure[bool]:
    """Whether a motor has a velocity, or searches its reference."""
    for motor in range((yield from motors(state))):
        if (yield from read(state, Call(Command.GAP, Axis.ACTUAL_VELOCITY, motor))):
            return True
        if (yield from _searching(state, motor)):
            return True
    return False


def _searching(state: TmclState, motor: int) -> Procedure[bool]:
    try:
        return bool((yield from read(state, Call(Command.RFS, Search.STATUS, motor))))
    except Refused:  # a module without reference search
        return False


def busy(state: TmclState) -> Procedure[bool]:
    """Whether its program runs; a module that knows neither question has none."""
    for call in (Call(Command.PROGRAM_STATUS), Call(Command.GGP, Global.PROGRAM_STATUS)):
        try:
            return (yield from read(state, call)) == Running.RUNS
        except Refused as refused:
            if refused.code not in LACKS:
                raise
    return False


def status(state: TmclState) -> Procedure[tuple[str, ...]]:
    """Position, velocity, target and switches of each motor, one line each."""
    lines = []
    for motor in range((yield from motors(state))):
        parts = []
        for name, parameter in (
            ("position", Axis.ACTUAL_POSITION),
            ("target", Axis.TARGET_POSITION),
            ("velocity", Axis.ACTUAL_VELOCITY),
        ):
            parts.append(f"{name} {(yield from read(state, Call(Command.GAP, parameter, motor)))}")
        for name, parameter in (("left", Axis.LEFT_SWITCH), ("right", Axis.RIGHT_SWITCH), ("home", Axis.HOME_SWITCH)):
            try:
                closed = yield from read(state, Call(Command.GAP, parameter, motor))
            except Refused:  # not every module has each switch
                continue
            parts.append(f"{name} switch {'on' if closed else 'off'}")
        lines.append(f"motor {motor}: {', '.join(parts)}")
    return tuple(lines)


def _remark(state: TmclState, call: Call) -> None:
    """Tell a person that the module is reached in another way from now on; follow it to its new address."""
    if call.command == Command.SAP and call.type == Axis.RELATIVE_FROM:
        state.relative_read(call.motor, call.value)
    if call.command == Command.FACTORY:
        state.remark(f"{who(state)}: factory settings; it may now have address 1 and 9600 baud: open the line again")
    if call.command == Command.SGP and call.type == Global.BAUD:
        state.remark(f"{who(state)}: its baud code is {call.value} from now on: open the line again with it")
    if call.command == Command.SGP and call.type == Global.ADDRESS:
        state.remark(f"{who(state)}: its address is {call.value} from now on: type @{call.value}")
        state.readdressed(call.value)
