"""Instructions with several settings: inputs, outputs, trips, print format, the device's name.

Manual 5.1.33, 5.1.64, 5.1.78, 5.1.93, 5.1.97, 5.1.104, 5.1.122 to 5.1.132.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import simulator.lexium.motion.reactions as reactions
from dialects.mcode.manual.device_name import device_name as device_name_of
from dialects.mcode.manual.grammar import Argument, Compare, Name, Number, Statement
from dialects.mcode.manual.table import lookup
from simulator.lexium.language.interpreter import Action
from simulator.lexium.motion.trips import BITS, Trip
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import whole
from simulator.lexium.state.variables import value_of

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

BAD_NUMBER, WRONG, ILLEGAL, SEPARATOR, EXECUTE_VARIABLE = 10, 21, 24, 38, 34
FIRST_INPUT = 1
ANALOG = 5


def numbers(device: MCodeDevice, statement: Statement, least: int, most: int) -> Callable[[], list[int]]:
    """A closure that gives all arguments as whole numbers. Raises Fault (24, 34, 38)."""
    count = len(statement.arguments)
    if not count:
        raise Fault(ILLEGAL if statement.equals else EXECUTE_VARIABLE)
    if count < least:
        raise Fault(SEPARATOR)
    if count > most:
        raise Fault(ILLEGAL)
    reads = [value_of(device, each) for each in statement.arguments]
    return lambda: [whole(read()) for read in reads]


def inputs(device: MCodeDevice, statement: Statement) -> Action:
    """IS (manual 5.1.64)."""
    read = numbers(device, statement, 2, 3)

    def set_up() -> None:
        n, *rest = read()
        was = device.inputs.types.get(n, (0, 0))
        device.inputs.set_up([n, *rest])
        device.motor.limits.wired(n, was[0], device.now)
        device.stale = True
        if n < ANALOG:
            reactions.wired(device, n, was)

    return set_up


def point(n: int) -> Callable[[MCodeDevice, Statement], Action]:
    """S<n> of an MDrivePlus: type, active level, and of a point that is either, whether it sources."""

    def compiler(device: MCodeDevice, statement: Statement) -> Action:
        fields = len(device.model.points.fresh[n])
        read = numbers(device, statement, 1 if n == ANALOG else 2, fields)

        def set_up() -> None:
            values = (*read(), 0, 0)[:fields]
            if any(each not in (0, 1) for each in values[1:]):
                raise Fault(WRONG)
            was = device.inputs.types[n]
            for each in device.model.points.clocks if n in device.model.points.clocks else (n,):
                _set_point(device, each, values)
            device.motor.limits.wired(n, was[0], device.now)
            device.stale = True
            if n != ANALOG:
                reactions.wired(device, n, was)

        return set_up

    return compiler


def _set_point(device: MCodeDevice, n: int, values: tuple[int, ...]) -> None:
    """Make a point an input or an output. Raises Fault (6, 8, 21)."""
    points, kind, active = device.model.points, values[0], values[1]
    if kind in points.output_types.get(n, ()):
        if any(values[2:]) and not points.sources:
            raise Fault(WRONG)
        device.output_lines.set_up([n, kind, active])
    else:
        device.inputs.set_up([n, kind, active])
        device.output_lines.release(n)
    device.inputs.types[n] = values


def outputs(device: MCodeDevice, statement: Statement) -> Action:
    """OS (manual 5.1.93)."""
    read = numbers(device, statement, 2, 3)
    return lambda: device.output_lines.set_up(read())


def software_limits(device: MCodeDevice, statement: Statement) -> Action:
    """LS; the minus limit must be below the plus limit while both are enabled (manual 5.1.78)."""
    read = numbers(device, statement, 3, 3)

    def set_up() -> None:
        which, position, enabled = read()
        if which not in (0, 1) or enabled not in (0, 1) or not -0x80000000 <= position <= 0x7FFFFFFF:
            raise Fault(WRONG)
        if enabled and device.limits[1 - which][1] and (position - device.limits[1 - which][0]) * (which or -1) <= 0:
            raise Fault(WRONG)
        device.motor.limits.jump(device.now, lambda: device.limits.update({which: (position, enabled)}))
        device.stale = True

    return set_up


def print_format(device: MCodeDevice, statement: Statement) -> Action:
    """PF (manual 5.1.97)."""
    read = numbers(device, statement, 1, 4)

    def set_up() -> None:
        values = (*read(), *(10, 6, 0, 0)[len(statement.arguments) :])
        width, decimals, scientific, left = values
        if not (0 <= width <= 16 and 0 <= decimals <= 16) or scientific not in (0, 1) or left not in (0, 1):
            raise Fault(WRONG)
        device.memory.texts["PF"] = ",".join(str(each) for each in values)

    return set_up


def settings(count: int) -> Callable[[MCodeDevice, Statement], Action]:
    """Numbers that are kept as they are."""

    def compiler(device: MCodeDevice, statement: Statement) -> Action:
        read = numbers(device, statement, count, count)
        word = statement.word

        def keep() -> None:
            device.memory.texts[word] = ",".join(str(each) for each in read())

        return keep

    return compiler


def device_name(device: MCodeDevice, statement: Statement) -> Action:
    """DN: a letter or digit, in the forms that the product takes (manual 5.1.33)."""
    if len(statement.arguments) != 1:  # `DN='a'` has none: its apostrophe begins a remark
        raise Fault(ILLEGAL if statement.arguments else WRONG if statement.equals else EXECUTE_VARIABLE)
    name = device_name_of(statement.arguments[0], not device.model.name_codes)

    def set_up() -> None:
        if not name:
            raise Fault(WRONG)
        device.memory.texts["DN"] = name

    return set_up


def trip(word: str) -> Callable[[MCodeDevice, Statement], Action]:
    """TI, TP, TT, TR, TA: a value and a place; TC, TM: a place."""
    bit, alone = BITS[word], word in ("TC", "TM")

    def compiler(device: MCodeDevice, statement: Statement) -> Action:
        arguments, row = statement.arguments, lookup(word, device.product)
        if not arguments:
            raise Fault(ILLEGAL if statement.equals else EXECUTE_VARIABLE)
        if word == "TA" and arguments == (Number(0),):
            return lambda: device.trips.forget(bit)
        if not alone and len(arguments) < 2 and word != "TR":
            raise Fault(SEPARATOR)
        value_at, *more = (Number(FIRST_INPUT), *arguments) if alone else arguments
        if len(more) > (2 if word == "TR" else 1) or any(not _is_place(each) for each in more[:1]):
            raise Fault(ILLEGAL)
        read = value_of(device, value_at)
        repeats = value_of(device, more[1]) if len(more) > 1 else lambda: 0
        target = None if not more or more[0] == Number(0) else more[0]

        def define() -> None:
            value, times = whole(read()), whole(repeats())
            if (row is not None and not row.accepts(value) and not alone) or not 0 <= times <= 65000:
                raise Fault(BAD_NUMBER if word == "TI" else WRONG)
            if word == "TI" and value not in device.inputs.numbers:
                raise Fault(BAD_NUMBER)
            if word == "TR" and not value:
                raise Fault(WRONG)
            if target is not None:
                device.program.check(target)
            device.trips.define(bit, Trip(value, target, times))

        return define

    return compiler


def _is_place(argument: Argument | None) -> bool:
    return isinstance(argument, (Name, Number)) and not isinstance(argument, Compare)
