"""What each compiled line does to a program of a simulated PMX-2ED-SA.

The lines are described in docs/pmx-lines.md. Division rounds down (7.19.6). A line takes everything off the stack or is
a Fault, so lines in an unknown order never run as something else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from multidrop.dialects.pmx.manual.script_compiler import COMPARISON, MOVES, OPERANDS, OPERATION
from multidrop.dialects.pmx.manual.script_parser import AXES, WORDS
from multidrop.simulator.pmx.vm import IDLE, MASK, Fault, Thread, signed


def step(thread: Thread, now: float) -> None:
    """Carry out the next line of a program."""
    machine, code = thread.machine, thread.machine.memory.code
    thread.begin_line()
    found = code[thread.at] if thread.at < len(code) else None
    thread.due = now + machine.line_s
    try:
        if found is None:
            held = machine.memory.line(thread.at) if thread.at < len(code) else "the end of the memory"
            raise Fault(f"{held!r} cannot be executed")
        _carry_out(thread, *found, now)
    except Fault as fault:
        thread.fail(fault, now)
    if thread.due is None and not thread.waiting:
        machine.ended(now)


def _carry_out(thread: Thread, word: str, argument: str, now: float) -> None:
    if word[0] == "&":
        _register(thread, word[1:], argument, now)
        thread.at += 1
        return
    if word not in _TAKING:
        thread.take(0)
    _STEPS[word](thread, argument, now)


def _divide(left: int, right: int) -> int:
    if right == 0:
        raise Fault("division by zero")
    return left // right


def _modulus(left: int, right: int) -> int:
    if right == 0:
        raise Fault("division by zero")
    return left % right


_OPERATIONS: Mapping[str, Callable[[int, int], int]] = {
    OPERATION["+"]: lambda a, b: a + b,
    OPERATION["-"]: lambda a, b: a - b,
    OPERATION["*"]: lambda a, b: a * b,
    OPERATION["/"]: _divide,
    OPERATION["%"]: _modulus,
    OPERATION[">>"]: lambda a, b: a >> (b & 31),
    OPERATION["<<"]: lambda a, b: a << (b & 31),
    OPERATION["&"]: lambda a, b: a & b,
    OPERATION["|"]: lambda a, b: a | b,
}
_COMPARISONS: Mapping[str, Callable[[int, int], bool]] = {
    COMPARISON[">"]: lambda a, b: a > b,
    COMPARISON["<"]: lambda a, b: a < b,
    COMPARISON["="]: lambda a, b: a == b,
    COMPARISON[">="]: lambda a, b: a >= b,
    COMPARISON["<="]: lambda a, b: a <= b,
    COMPARISON["!="]: lambda a, b: a != b,
}


def _register(thread: Thread, name: str, argument: str, now: float) -> None:
    if name[-1] == "=":
        thread.take(0)
        thread.assign(name[:-1], int(argument), now)
    elif name in MOVES:
        targets = [thread.number_of(each, now) for each in thread.take(len(name))]
        thread.moved |= set(name)
        thread.ask("".join(f"{axis}{target}" for axis, target in zip(name, targets, strict=True)), now)
    elif WORDS[name].command:
        thread.take(0)
        named = set(name.rstrip("+-")[-1:]) & set(AXES)
        thread.moved |= named if name[-1] in "+-" else set()
        thread.ask(WORDS[name].ascii, now)
    else:
        thread.stack.append(name)


def _constant(thread: Thread, argument: str, now: float) -> None:
    thread.stack.append(int(argument))
    thread.at += 1


def _variable(thread: Thread, argument: str, now: float) -> None:
    thread.stack.append(f"V{argument}")
    thread.at += 1


def _operate(thread: Thread, argument: str, now: float) -> None:
    """Take right, left and target; `~` has no left."""
    alone = argument == OPERATION["~"]
    *operands, target = thread.take(2 if alone else 3)
    values = [thread.number_of(each, now) for each in operands]
    result = ~values[0] if alone else _OPERATIONS[argument](values[1], values[0])
    if isinstance(target, int) or target[0] != "V":
        raise Fault(f"OX{argument} cannot set {target}")
    thread.machine.variables[int(target[1:])] = signed(result)
    thread.at += 1


def _assign(thread: Thread, argument: str, now: float) -> None:
    """Take source and target."""
    source, target = thread.take(2)
    value = thread.number_of(source, now)
    if isinstance(target, int) or (target[0] != "V" and not WORDS[target].settable):
        raise Fault(f"{target} cannot be set")
    thread.assign(target, value, now)
    thread.at += 1


def _compare(thread: Thread, argument: str, now: float) -> None:
    """Take left and right; true skips the next line."""
    left, right = (thread.number_of(each, now) for each in thread.take(OPERANDS))
    thread.at += 2 if _COMPARISONS[argument](left, right) else 1


def _forward(thread: Thread, argument: str, now: float) -> None:
    thread.at += int(argument)


def _back(thread: Thread, argument: str, now: float) -> None:
    """Go back to a JW, which is carried out again from the first of its values."""
    to = thread.at - int(argument)
    found = thread.machine.memory.code[to] if to >= OPERANDS else None
    if found is None or found[0] != "JW":
        raise Fault(f"JM-{argument} goes back to no JW")
    thread.at = to - OPERANDS


def _pass(thread: Thread, argument: str, now: float) -> None:
    thread.at += 1


def _delay(thread: Thread, argument: str, now: float) -> None:
    thread.due = now + max(int(argument) & MASK, 0) / 1000
    thread.at += 1


def _delay_by(thread: Thread, argument: str, now: float) -> None:
    _delay(thread, str(thread.machine.variables[int(argument)] & MASK), now)


def _wait(thread: Thread, argument: str, now: float) -> None:
    axis = AXES[int(argument)]
    if thread.machine.moving(axis, now):
        thread.wait_for(axis)
    else:
        thread.at += 1


def _call(thread: Thread, argument: str, now: float) -> None:
    thread.enter(int(argument))


def _return(thread: Thread, argument: str, now: float) -> None:
    thread.leave(now)


def _finish(thread: Thread, argument: str, now: float) -> None:
    thread.end(IDLE)


_STEPS: Mapping[str, Callable[[Thread, str, float], None]] = {
    "CV": _constant,
    "VR": _variable,
    "OX": _operate,
    "AM": _assign,
    "JI": _compare,
    "JW": _compare,
    "JR": _forward,
    "JO": _forward,
    "JM-": _back,
    "EI": _pass,
    "PS": _pass,
    "SS": _pass,
    "DD": _delay,
    "DV": _delay_by,
    "WX": _wait,
    "GS": _call,
    "SE": _return,
    "XX": _finish,
}
_TAKING = frozenset({"CV", "VR", "OX", "AM", "JI", "JW"})
"""Lines that values may precede."""
