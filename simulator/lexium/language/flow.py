"""Instructions of programs: labels, branches, calls, holds, declarations, starting, listing, clearing.

Manual 3.3, 5.1.14, 5.1.22, 5.1.23, 5.1.42, 5.1.50, 5.1.68, 5.1.70, 5.1.71, 5.1.91, 5.1.98, 5.1.136.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Argument, Compare, Name, Number, Statement, Text, is_name
from dialects.mcode.manual.table import lookup
from simulator.lexium.language.interpreter import Action
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import compile_condition, whole
from simulator.lexium.state.memory import TABLE_SIZE
from simulator.lexium.state.program_memory import BAD_ADDRESS, FIRST, REDEFINED, SPACE
from simulator.lexium.state.variables import reader, value_of, writer

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

WRONG, ILLEGAL, EMBEDDED, TABLE_FULL, NOT_EXECUTABLE, SEPARATOR, LOCKED, UNKNOWN = 21, 24, 29, 31, 34, 38, 44, 60
MOST_PASSES = 65535
OPTIONS = (Number(0), Number(1))
"""CP's parameter: keep the user's variables, or delete them too."""
NOT_RUNNING, RUNNING, NOT_PROGRAMMING, INPUT_PENDING, MOVING_SAVE, MOVING_CLEAR = 40, 41, 46, 62, 73, 74


def end(device: MCodeDevice) -> None:
    """E: a program's own ends it at once, an immediate one after the motion (manual 5.1.35)."""
    if device.immediate:
        device.interpreter.end(device.now)
    else:
        device.interpreter.finish()


def nothing(device: MCodeDevice, statement: Statement) -> Action:
    """An instruction that is known and does nothing here yet; its values must be such as it takes."""
    row = lookup(statement.word, device.product)
    reads = [value_of(device, each) for each in statement.arguments if not _is_place(each)]

    def check() -> None:
        for read in reads[:1]:
            if row is not None and not row.accepts(read()):
                raise Fault(WRONG)

    return check


def number(device: MCodeDevice, statement: Statement) -> Action:
    """A bare number: what IV waits for, or with NE=1 another move of the last kind (manual 5.1.68, 5.1.89)."""
    figure = statement.arguments[0]
    if not isinstance(figure, Number):
        raise Fault(UNKNOWN)
    read = value_of(device, figure)

    def take() -> None:
        if device.pending:
            name, device.pending = device.pending, ""
            device.memory.values["IF"] = 0
            writer(device, name)(read())
        elif device.memory.values["NE"]:
            kind, value = device.memory.texts["MD"], whole(read())
            if kind == "SL":
                device.motor.slew(value, device.now)
            else:
                device.axis.go(kind, value, device.now)
            device.stale = True
        else:
            raise Fault(UNKNOWN)

    return take


def branch(device: MCodeDevice, statement: Statement) -> Action:
    """BR; its condition may also be a value, which holds while it is not 0 (manual 5.1.2, 5.1.14)."""

    def go(target: Argument) -> None:
        _check_running(device)
        device.interpreter.branch(target)

    return _jump(device, statement, go)


def call(device: MCodeDevice, statement: Statement) -> Action:
    """CL (manual 5.1.22)."""

    def go(target: Argument) -> None:
        _check_running(device)
        device.interpreter.call(target)

    return _jump(device, statement, go)


def _check_running(device: MCodeDevice) -> None:
    """Raises Fault (40) for a typed line that needs a program to act on."""
    if device.immediate and not device.interpreter.running:
        raise Fault(NOT_RUNNING)


def _jump(device: MCodeDevice, statement: Statement, go: Callable[[Argument], None]) -> Action:
    target, condition = _pair(statement)
    if not _is_place(target) or isinstance(target, Compare) or target is None:
        raise Fault(ILLEGAL)
    if condition is None:
        return lambda: go(target)
    if isinstance(condition, Text):
        raise Fault(ILLEGAL)
    holds = compile_condition(condition, lambda word: reader(device, word), device.model.floating)

    def go_if() -> None:
        if holds():
            go(target)

    return go_if


def _pair(statement: Statement) -> tuple[Argument | None, Argument | None]:
    if not 1 <= len(statement.arguments) <= 2:
        raise Fault(ILLEGAL)
    first, second = (*statement.arguments, None)[:2]
    return first, second


def _is_place(argument: Argument | None) -> bool:
    """Whether an argument can be a label or an address."""
    return isinstance(argument, (Name, Number))


def hold(device: MCodeDevice, statement: Statement) -> Action:
    """H (manual 5.1.50). Where 0 is taken it is for motion."""
    if len(statement.arguments) > 1:
        raise Fault(ILLEGAL)
    read = value_of(device, statement.arguments[0]) if statement.arguments else None
    row = lookup("H", device.product)

    def wait() -> None:
        _check_running(device)
        milliseconds = None if read is None else whole(read())
        if row is None or not (milliseconds is None or row.accepts(milliseconds)):
            raise Fault(WRONG)
        device.interpreter.hold(milliseconds or None)

    return wait


def input_variable(device: MCodeDevice, statement: Statement) -> Action:
    """IV: the next number that comes goes to a variable (manual 5.1.68)."""
    target, more = _pair(statement)
    if not isinstance(target, Name) or more is not None:
        raise Fault(ILLEGAL)
    word = target.word
    writer(device, word)

    def wait() -> None:
        if device.pending:
            raise Fault(INPUT_PENDING)
        device.pending = word
        device.memory.values["IF"] = 1

    return wait


def break_point(device: MCodeDevice, statement: Statement) -> Action:
    """BP with a place and how often; BP=0 takes it away; BP alone breaks a running program (manual 5.1.13)."""
    if not statement.arguments and device.model.break_here:
        return lambda: _break_here(device)
    target, count = _pair(statement)
    if not _is_place(target):
        raise Fault(ILLEGAL)
    if count is None and target != Number(0) and not device.model.break_here:
        raise Fault(SEPARATOR)
    read = value_of(device, count or Number(1))

    def set_up() -> None:
        passes = whole(read())
        if not 1 <= passes <= MOST_PASSES:
            raise Fault(WRONG)
        _show(device, target != Number(0))
        device.interpreter.break_at(None if target == Number(0) else target, passes)

    return set_up


def _break_here(device: MCodeDevice) -> None:
    _show(device, True)
    device.interpreter.break_here()


def _show(device: MCodeDevice, shown: int) -> None:
    """A locked program is not shown line by line, which would be a listing (manual 5.1.75). Raises Fault (44)."""
    if shown and device.memory.values["LK"]:
        raise Fault(LOCKED)


def on_error(device: MCodeDevice, statement: Statement) -> Action:
    """OE; 0 or nothing takes the handler away (manual 5.1.91)."""
    target = statement.arguments[0] if statement.arguments else Number(0)
    if len(statement.arguments) > 1 or not _is_place(target):
        raise Fault(ILLEGAL)

    def declare() -> None:
        if target == Number(0):
            device.interpreter.handler = None
        else:
            device.program.check(target)
            device.interpreter.handler = target

    return declare


def declare(device: MCodeDevice, statement: Statement) -> Action:
    """VA: global from outside, local in a program (manual 3.2.2, 5.1.136)."""
    if len(statement.arguments) != 1:
        raise Fault(ILLEGAL)
    target = statement.arguments[0]
    read: Callable[[], int | float] = lambda: 0  # noqa: E731
    if isinstance(target, Compare) and target.op == "=":
        read = value_of(device, target.right)
        target = target.left
    if not isinstance(target, Name):
        raise Fault(ILLEGAL)
    word = target.word
    check_new_name(device, word)

    def make() -> None:
        scope = "G" if device.immediate else "L"
        if word in device.program.labels or device.memory.scopes.get(word, "L") != "L":
            raise Fault(REDEFINED)
        value = whole(read())
        if not -0x80000000 <= value <= 0x7FFFFFFF:
            raise Fault(WRONG)
        if word not in device.memory.scopes:
            check_room(device)
        device.memory.declare(word, scope, value)

    return make


def check_new_name(device: MCodeDevice, word: str) -> None:
    """Whether a name may be given. Raises Fault (24 bad or reserved, 28 taken, 29 a mnemonic)."""
    row = lookup(word, device.product)
    if row is not None:
        raise Fault(ILLEGAL if row.kind == "reserved" else EMBEDDED)
    if not is_name(word) or len(word) > device.model.longest_name:
        raise Fault(ILLEGAL)
    if word in device.program.labels or device.memory.scopes.get(word) == "G":
        raise Fault(REDEFINED)


def check_room(device: MCodeDevice) -> None:
    """Whether one more name fits. Raises Fault (31)."""
    if len(device.program.labels) + len(device.memory.scopes) >= TABLE_SIZE:
        raise Fault(TABLE_FULL)


def label(device: MCodeDevice, statement: Statement) -> Action:
    """LB: a mark, which takes no time. Its name is entered when the line is stored."""
    if len(statement.arguments) != 1 or not isinstance(statement.arguments[0], Name) or statement.equals:
        raise Fault(ILLEGAL)
    return lambda: None


def new_label(device: MCodeDevice, statement: Statement) -> str:
    """The name that an LB line gives. Raises Fault (24, 28, 29, 31)."""
    name = statement.arguments[0]
    if not isinstance(name, Name):
        raise Fault(ILLEGAL)
    if name.word == "SU":
        if "SU" in device.program.labels:
            raise Fault(REDEFINED)
    else:
        check_new_name(device, name.word)
        if name.word in device.memory.scopes or name.word in device.program.declared:
            raise Fault(REDEFINED)
    check_room(device)
    return name.word


def execute(device: MCodeDevice, statement: Statement) -> Action:
    """EX (manual 5.1.42)."""
    target, option = _pair(statement)
    read = value_of(device, option or Number(0))

    def start() -> None:
        mode = whole(read())
        if mode not in (0, 1, 2):
            raise Fault(WRONG)
        _show(device, mode)
        if isinstance(target, Name) and target.word in device.memory.scopes:
            raise Fault(NOT_EXECUTABLE)
        device.interpreter.start(target, device.now, mode)

    return start


def listing(device: MCodeDevice, statement: Statement) -> Action:
    """L (manual 5.1.70)."""
    if len(statement.arguments) > 1:
        raise Fault(ILLEGAL)

    def show() -> None:
        if device.memory.values["LK"]:
            raise Fault(LOCKED)
        start = device.program.resolve(statement.arguments[0]) if statement.arguments else FIRST
        for row in device.program.listing(start):
            device.emit(row + "\r\n")

    return show


def clear(device: MCodeDevice, statement: Statement) -> Action:
    """CP; CP <0/1>; CP <label>; CP <0/1>,<label>; CP S also saves (manual 5.1.23)."""
    arguments = statement.arguments
    if len(arguments) > 2:
        raise Fault(ILLEGAL)
    if len(arguments) > 1 and not device.model.clears_variables:
        raise Fault(ILLEGAL)
    if arguments == (Name("S"),) and device.model.clears_variables:

        def clear_and_save() -> None:
            _clear(device, None, variables=False)
            device.save()

        return clear_and_save
    if len(arguments) == 1 and arguments[0] in OPTIONS and device.model.clears_variables:
        return lambda: _clear_all(device, variables=arguments[0] == Number(1))
    option = arguments[0] if len(arguments) == 2 else Number(0)
    if option not in OPTIONS:
        raise Fault(WRONG)
    target = arguments[-1] if arguments else None
    return lambda: _clear(device, target, variables=option == Number(1))


def _clear_all(device: MCodeDevice, variables: bool) -> None:
    """CP 0 and CP 1: all of program memory; only CP without a parameter opens a lock (manual 5.1.75)."""
    if device.memory.values["LK"]:
        raise Fault(LOCKED)
    _clear(device, None, variables)


def _clear(device: MCodeDevice, target: Argument | None, variables: bool) -> None:
    if device.interpreter.running:
        raise Fault(RUNNING)
    if device.axis.moving(device.now):
        raise Fault(MOVING_CLEAR)
    if target is None:
        device.memory.values["LK"] = 0
    elif device.memory.values["LK"]:
        raise Fault(LOCKED)
    everything = target is None or target == Number(FIRST)  # the beginning of memory is there in an empty one too
    device.program.clear(FIRST if everything else device.program.resolve(target))
    device.interpreter.forget()
    device.program_changed()
    if target is None and device.model.clear_ends_handler:
        device.interpreter.handler = None
    if variables:
        for name in list(device.memory.scopes):
            device.memory.forget(name)
    else:
        device.memory.forget_local()


def program_mode(device: MCodeDevice, statement: Statement) -> Action:
    """PG with an address; without one it ends program mode, which is not on here (manual 5.1.98)."""
    if len(statement.arguments) > 1:
        raise Fault(ILLEGAL)

    def enter() -> None:
        if not statement.arguments:
            raise Fault(NOT_PROGRAMMING)
        target = statement.arguments[0]
        if device.interpreter.running:
            raise Fault(RUNNING)
        if device.axis.moving(device.now):
            raise Fault(MOVING_SAVE)
        if device.memory.values["LK"]:
            raise Fault(LOCKED)
        if isinstance(target, Name):
            device.programming = device.program.resolve(target)
            return
        if not isinstance(target, Number) or not isinstance(target.value, int):
            raise Fault(BAD_ADDRESS)
        if not FIRST <= target.value < FIRST + SPACE:
            raise Fault(BAD_ADDRESS)
        device.programming = target.value

    return enter
