"""Procedures with a module: a typed line, and the motion of its motors."""

from __future__ import annotations

from dialects.codec import Kind, Priority, Procedure
from dialects.errors import Inexpressible, Refused
from dialects.family import Motion
from dialects.tmcl.host.exchange import answered, read, who
from dialects.tmcl.host.motors import motors
from dialects.tmcl.host.state import TmclState
from dialects.tmcl.manual import grammar
from dialects.tmcl.manual.commands import Call, Command, Search
from dialects.tmcl.manual.parameters import Axis, Global


def perform(state: TmclState, text: str) -> Procedure[tuple[str, ...]]:
    """Send a command in TMCL's notation; the value where it prints one.

    Raises Refused, NoAnswer, Stopped or Inexpressible.
    """
    try:
        call = grammar.parse(text)
    except grammar.LineError as error:
        raise Inexpressible(f"'{text.strip()}': {error}; nothing was sent") from None
    request = state.codec.request(state.address, text.strip(), call)
    if call.command == Command.FACTORY or (
        call.command in (Command.SAP, Command.RSAP) and call.type == Axis.RELATIVE_FROM
    ):
        state.relative_forgotten()
    reply = yield from answered(state, request)
    _remark(state, call)
    return reply.lines if request.kind is Kind.PRINT else ()


def motion(state: TmclState, priority: Priority) -> Procedure[tuple[Motion, ...]]:
    """Position and velocity of each motor."""
    found = []
    count = yield from motors(state, priority)
    for motor in range(count):
        position = yield from read(state, Call(Command.GAP, Axis.ACTUAL_POSITION, motor), priority)
        velocity = yield from read(state, Call(Command.GAP, Axis.ACTUAL_VELOCITY, motor), priority)
        found.append(Motion(position, velocity, str(motor) if count > 1 else ""))
    return tuple(found)


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
    """Whether a program runs: direct mode runs none."""
    yield from ()
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
