"""Instructions that are matters of the motor and no moves: homing, locked rotor, make-up, configuration test.

Manual 5.1.20, 5.1.52 to 5.1.54, 5.1.87, 5.1.115.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Statement
from simulator.lexium.language.interpreter import Action
from simulator.lexium.language.setups import numbers
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import whole
from simulator.lexium.state.variables import value_of

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

NO_TYPE, WRONG, ILLEGAL = 81, 21, 24


def home(device: MCodeDevice, statement: Statement) -> Action:
    """HM, HI, HF. Without a type it is error 81 as for a type that there is not."""
    word = statement.word
    if len(statement.arguments) > 1:
        raise Fault(ILLEGAL)
    if not statement.arguments:
        raise Fault(NO_TYPE)
    read = value_of(device, statement.arguments[0])
    return lambda: device.motor.homing.start(word, whole(read()), device.now)


def clear_locked(device: MCodeDevice) -> None:
    """CF."""
    device.motor.hmt.clear()


def make_up(device: MCodeDevice, statement: Statement) -> Action:
    """MU: the mode, and 1 to clear lead and lag."""
    read = numbers(device, statement, 1, 2)

    def set_up() -> None:
        mode, clearing = (*read(), 0)[:2]
        if mode not in (0, 1, 2) or clearing not in (0, 1):
            raise Fault(WRONG)
        device.motor.hmt.make_up(mode, clearing, device.now)

    return set_up


def test(device: MCodeDevice, statement: Statement) -> Action:
    """SC 1. Raises Fault (24) without its number: it is no variable."""
    if not statement.arguments:
        raise Fault(ILLEGAL)
    read = numbers(device, statement, 1, 1)

    def start() -> None:
        if read() != [1]:
            raise Fault(WRONG)
        device.motor.hmt.test(device.now)

    return start
