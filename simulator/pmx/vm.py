"""One of the two programs of a simulated PMX-2ED-SA: its state, its stack, and what each compiled line does.

The lines are described in docs/pmx-lines.md. Values are 32-bit signed and wrap around; division rounds down (7.19.6). A
line takes everything off the stack or is a Fault, so lines in an order that is not known never run as something else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects.pmx.manual.script_compiler import COMPARISON, MOVES, OPERANDS, OPERATION
from dialects.pmx.manual.script_words import AXES, HANDLER, WORDS

if TYPE_CHECKING:
    from simulator.pmx.programs import Programs

STOP, START, PAUSE, CONTINUE = 0, 1, 2, 3
"""What SR takes."""
IDLE, RUNNING, PAUSED, ERROR = 0, 1, 2, 4
"""What SASTAT answers."""
DEEPEST = 32
"""Calls in one another that are kept; how many a unit keeps is not told."""
MASK = 0xFFFFFFFF
JUMP_TO_FIRST = 1 << 13
"""The bit of POL that has a program begin anew after SUB 31, instead of with the statement that failed."""


class Fault(Exception):
    """Something that takes a program to SUB 31."""


@dataclass(frozen=True)
class Failure:
    """What failed: when, in which program, its line in memory, why; whether SUB 31 was there for it."""

    t: float
    program: int
    line: int
    why: str
    handled: bool


@dataclass
class _Frame:
    """Where a subroutine returns to. `handler`: it is SUB 31, called for an error. None: the program ends there."""

    to: int | None
    handler: bool = False


def signed(value: int) -> int:
    """The value as a 32-bit register holds it."""
    value &= MASK
    return value - (1 << 32) if value >> 31 else value


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


class Thread:
    """A program. `due`: when it carries out its next line, None while it waits or does not run."""

    def __init__(self, number: int, home: Programs) -> None:
        self.number, self.home = number, home
        self.state = IDLE
        self.at = 0
        self.due: float | None = None
        self.waiting = ""
        self.moved: set[str] = set()
        self.failure = ""
        self.failed: float | None = None
        """When it has last failed."""
        self._begin = 0  # the first line of the statement that is carried out
        self._called: int | None = None  # a subroutine that a host wants
        self._left = 0.0  # what is left of a delay while it is paused
        self._stack: list[int | str] = []
        self._frames: list[_Frame] = []

    # What a host or a program does to it.

    def control(self, value: int, now: float) -> None:
        """Carry out SR."""
        if value == STOP:
            self._end(IDLE)
        elif value == START and self.state != RUNNING:
            self._start(self.home.start_of(self.number), now)
        elif value == PAUSE and self.state == RUNNING:
            self._left = max(self.due - now, 0.0) if self.due is not None else 0.0
            self.state, self.due, self.waiting = PAUSED, None, ""
        elif value == CONTINUE and self.state == PAUSED:
            self.state, self.due = RUNNING, now + self._left

    def call(self, at: int, now: float) -> None:
        """Carry out the subroutine at a line: before the next statement where it runs, else for that alone."""
        if self.state in (RUNNING, PAUSED):
            self._called = at
            return
        self._start(at, now)
        self._frames.append(_Frame(None))

    def fail(self, fault: Fault, now: float) -> None:
        """Go to SUB 31; in error where there is none, or where this comes from there."""
        self.failure, self.failed = f"{fault} at line {self.at}", now
        self.home.index()
        handler = self.home.subroutines.get(HANDLER)
        if any(each.handler for each in self._frames) or len(self._frames) >= DEEPEST:
            handler = None
        self.home.failures.append(Failure(now, self.number, self._begin, str(fault), handler is not None))
        if handler is None:
            self.home.ended = now
            self._end(ERROR)
            return
        self._frames.append(_Frame(self._begin, handler=True))
        self._stack.clear()
        self.waiting = ""
        self._go(handler)
        if self.state == RUNNING:
            self.due = now + self.home.line_s

    def wake(self, now: float) -> None:
        """The axis that it waited for stands."""
        self.waiting = ""
        self.at += 1
        self.due = now + self.home.line_s

    def _start(self, at: int | None, now: float) -> None:
        self._end(IDLE)
        self.failure, self.failed = "", None
        self.moved.clear()
        if at is None:
            self.state, self.failure = ERROR, f"there is no program {self.number}"
            return
        self.state, self.due = RUNNING, now
        self._go(at)

    def _end(self, state: int) -> None:
        self.state, self.due, self.waiting, self._called = state, None, "", None
        self._stack.clear()
        self._frames.clear()

    def _go(self, at: int) -> None:
        self.at = self._begin = at

    def _push(self, frame: _Frame) -> None:
        if len(self._frames) >= DEEPEST:
            raise Fault(f"more than {DEEPEST} calls in one another")
        self._frames.append(frame)

    # Carrying out lines.

    def step(self, now: float) -> None:
        """Carry out one line."""
        if self._called is not None and not self._stack:
            self._frames.append(_Frame(self.at))
            self._go(self._called)
            self._called = None
        found = self.home.code[self.at] if self.at < len(self.home.code) else None
        if not self._stack:
            self._begin = self.at
        self.due = now + self.home.line_s
        try:
            if found is None:
                held = self.home.line(self.at) if self.at < len(self.home.code) else "the end of the memory"
                raise Fault(f"{held!r} is no line that can be carried out")
            word, argument = found
            if word[0] == "&":
                self._register(word[1:], argument, now)
                self.at += 1
            else:
                if word not in _TAKING:
                    self._take(0)
                _STEPS[word](self, argument, now)
        except Fault as fault:
            self.fail(fault, now)
        if self.due is None and not self.waiting:
            self.home.ended = now

    def _take(self, many: int) -> list[int | str]:
        """Everything on the stack, which must be so many values."""
        if len(self._stack) != many:
            held = self.home.line(self.at)
            raise Fault(f"{held} takes {many} values, and {len(self._stack)} are there")
        taken, self._stack = self._stack, []
        return taken

    def _number(self, value: int | str, now: float) -> int:
        """A value that was on the stack, read where it is a register."""
        if isinstance(value, int):
            return value
        if value[0] == "V":
            return self.home.variables[int(value[1:])]
        text = self._ask(WORDS[value].ascii, now, changes=False)
        try:
            return signed(int(text))
        except ValueError:
            raise Fault(f"{value} answers {text}") from None

    def _ask(self, text: str, now: float, changes: bool = True) -> str:
        self.home.changed = self.home.changed or changes
        answer = self.home.controller.ask(text, now)
        if changes and self.home.heard is not None and not answer.startswith("?"):
            self.home.heard(now, self.number, text)
        if answer.startswith("?"):
            raise Fault(f"{text} is answered {answer}")
        return answer

    def _register(self, name: str, argument: str, now: float) -> None:
        if name[-1] == "=":
            self._take(0)
            self._set(name[:-1], int(argument), now)
        elif name in MOVES:
            targets = [self._number(each, now) for each in self._take(len(name))]
            self.moved |= set(name)
            self._ask("".join(f"{axis}{target}" for axis, target in zip(name, targets, strict=True)), now)
        elif WORDS[name].command:
            self._take(0)
            named = set(name.rstrip("+-")[-1:]) & set(AXES)
            self.moved |= named if name[-1] in "+-" else set()
            self._ask(WORDS[name].ascii, now)
        else:
            self._stack.append(name)

    def _constant(self, argument: str, now: float) -> None:
        self._stack.append(int(argument))
        self.at += 1

    def _variable(self, argument: str, now: float) -> None:
        self._stack.append(f"V{argument}")
        self.at += 1

    def _operate(self, argument: str, now: float) -> None:
        """Right, left and target; `~` has no left."""
        alone = argument == OPERATION["~"]
        *operands, target = self._take(2 if alone else 3)
        values = [self._number(each, now) for each in operands]
        result = ~values[0] if alone else _OPERATIONS[argument](values[1], values[0])
        if isinstance(target, int) or target[0] != "V":
            raise Fault(f"OX{argument} cannot set {target}")
        self.home.variables[int(target[1:])] = signed(result)
        self.at += 1

    def _assign(self, argument: str, now: float) -> None:
        """Source and target."""
        source, target = self._take(2)
        value = self._number(source, now)
        if isinstance(target, int) or (target[0] != "V" and not WORDS[target].settable):
            raise Fault(f"{target} cannot be set")
        self._set(target, value, now)
        self.at += 1

    def _set(self, target: str, value: int, now: float) -> None:
        if target[0] == "V":
            self.home.variables[int(target[1:])] = value
        elif target[:2] == "SR":
            if not self.home.control(int(target[2:]), value, now):
                raise Fault(f"{target} takes no {value}")
        else:
            self.moved |= {target[-1]} if target[:4] == "SSPD" else set()
            self._ask(f"{WORDS[target].ascii}={value}", now)

    def _compare(self, argument: str, now: float) -> None:
        """Left and right; true passes over the next line."""
        left, right = (self._number(each, now) for each in self._take(OPERANDS))
        self.at += 2 if _COMPARISONS[argument](left, right) else 1

    def _forward(self, argument: str, now: float) -> None:
        self.at += int(argument)

    def _back(self, argument: str, now: float) -> None:
        """To a JW, which is carried out anew from the first of its values."""
        to = self.at - int(argument)
        found = self.home.code[to] if to >= OPERANDS else None
        if found is None or found[0] != "JW":
            raise Fault(f"JM-{argument} goes back to no JW")
        self.at = to - OPERANDS

    def _pass(self, argument: str, now: float) -> None:
        self.at += 1

    def _delay(self, argument: str, now: float) -> None:
        self.due = now + max(int(argument) & MASK, 0) / 1000
        self.at += 1

    def _delay_by(self, argument: str, now: float) -> None:
        self._delay(str(self.home.variables[int(argument)] & MASK), now)

    def _wait(self, argument: str, now: float) -> None:
        self.home.controller.settle(now)
        if self.home.controller.moving(AXES[int(argument)]):
            self.waiting, self.due = AXES[int(argument)], None
        else:
            self.at += 1

    def _call(self, argument: str, now: float) -> None:
        self.home.index()
        at = self.home.subroutines.get(int(argument))
        if at is None:
            raise Fault(f"SUB {argument} is not defined")
        self._push(_Frame(self.at + 1))
        self.at = at

    def _return(self, argument: str, now: float) -> None:
        if not self._frames:
            raise Fault("ENDSUB without a call")
        frame = self._frames.pop()
        if frame.to is None:
            self._end(IDLE)
        elif frame.handler and int(self._ask("POLX", now)) & JUMP_TO_FIRST:
            start = self.home.start_of(self.number)
            alone = any(each.to is None for each in self._frames)  # a subroutine that a host called
            self._frames.clear()
            if start is None or alone:
                self._end(IDLE)
            else:
                self._go(start)
        else:
            self.at = frame.to

    def _finish(self, argument: str, now: float) -> None:
        self._end(IDLE)


_STEPS: Mapping[str, Callable[[Thread, str, float], None]] = {
    "CV": Thread._constant,
    "VR": Thread._variable,
    "OX": Thread._operate,
    "AM": Thread._assign,
    "JI": Thread._compare,
    "JW": Thread._compare,
    "JR": Thread._forward,
    "JO": Thread._forward,
    "JM-": Thread._back,
    "EI": Thread._pass,
    "PS": Thread._pass,
    "SS": Thread._pass,
    "DD": Thread._delay,
    "DV": Thread._delay_by,
    "WX": Thread._wait,
    "GS": Thread._call,
    "SE": Thread._return,
    "XX": Thread._finish,
}
_TAKING = frozenset({"CV", "VR", "OX", "AM", "JI", "JW"})
"""Lines that values may stand before."""
