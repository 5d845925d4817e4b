"""How many motors a module has, and from where they count relative moves: found by reading, which moves nothing."""

from __future__ import annotations

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.errors import NoAnswer, Refused
from multidrop.dialects.tmcl.host.codec import MOST_MOTORS
from multidrop.dialects.tmcl.host.exchange import read
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.commands import Call, Command
from multidrop.dialects.tmcl.manual.parameters import Axis


def motors(state: TmclState, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The number of motors; where it is not known, read motors until the module refuses one. Raises NoAnswer."""
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
    yield from _relative(state, priority)
    return count


def _relative(state: TmclState, priority: Priority) -> Procedure[None]:
    """Read parameter 127 of each motor; a module that refuses it for one lacks it."""
    try:
        for motor in range(state.motors):
            call = Call(Command.GAP, Axis.RELATIVE_FROM, motor)
            state.relative_read(motor, (yield from read(state, call, priority)))
    except (Refused, NoAnswer):
        pass
