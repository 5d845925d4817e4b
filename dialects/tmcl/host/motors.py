"""How many motors a module has: found by reading, which moves nothing."""

from __future__ import annotations

from dialects.codec import Priority, Procedure
from dialects.errors import Refused
from dialects.tmcl.host.codec import MOST_MOTORS
from dialects.tmcl.host.exchange import read
from dialects.tmcl.host.state import TmclState
from dialects.tmcl.manual.commands import Call, Command
from dialects.tmcl.manual.parameters import Axis


def motors(state: TmclState, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The number of motors; count them where that is not known: until the module refuses one. Raises NoAnswer."""
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
    return count
