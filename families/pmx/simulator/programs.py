"""A-SCRIPT programs in the memory of a simulated PMX-2ED-SA, run in virtual time (manual 7.19, 10).

`PmxInterpreter.advance(now)` is the one loop that lets time pass, for programs and controller. It goes from event to
event (a program's line, or an event of the controller) and settles the controller at each of these times. So the owner
of both calls `programs.advance(now)`, and `programs.deadline` is the time of the next event; nothing here calls back
into that.

The compiled lines are described in docs/pmx-lines.md. Values are 32-bit signed and wrap around; division rounds down
(7.19.6). A line takes everything off the stack or is a ProgramFault, so lines in an unknown order never run as
something else.

An error in a program takes it to SUB 31, once: a refused command, a limit or StepNLoop error of an axis that it has
moved, an unknown line. Without SUB 31, or with an error in it, the program ends in error. An error of an axis that no
running program has moved takes every running program there.
"""

from __future__ import annotations

import operator
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from multidrop.families.pmx.manual.script_compiler import COMPARISON, MEMORY_LINES, MOVES, OPERANDS, OPERATION
from multidrop.families.pmx.manual.script_parser import AXES, HANDLER, PROGRAMS, VARIABLES, WORDS
from multidrop.families.pmx.simulator.commands import CommandedController
from multidrop.families.pmx.simulator.memory import PmxMemory
from multidrop.families.pmx.simulator.settings import wrapped

FIRST_KEPT_VARIABLE = 32
"""The first variable that STORE keeps; those below are zero after power-up."""
MOST_FAILURES = 1000
STOP, START, PAUSE, CONTINUE = 0, 1, 2, 3
"""Values of SR."""
IDLE, RUNNING, PAUSED, ERROR = 0, 1, 2, 4
"""Values of SASTAT."""
DEEPEST_CALLS = 32
"""The deepest nesting of calls; the manual does not give a unit's."""
MASK = 0xFFFFFFFF
JUMP_TO_FIRST = 1 << 13
"""The bit of POL that starts a program again after SUB 31, instead of repeating the statement that failed."""


class ProgramFault(Exception):
    """An error that takes a program to SUB 31."""


@dataclass(frozen=True)
class ProgramError:
    """An error in a program: its time, the program, its line in memory, the cause; whether there was a SUB 31."""

    t: float
    program: int
    line: int
    why: str
    handled: bool


@dataclass
class _Frame:
    """Where a subroutine returns to; None: the program ends there. `handler`: it is SUB 31, called for an error."""

    to: int | None
    handler: bool = False


_OPERATIONS: Mapping[str, Callable[[int, int], int]] = {
    OPERATION["+"]: operator.add,
    OPERATION["-"]: operator.sub,
    OPERATION["*"]: operator.mul,
    OPERATION["/"]: operator.floordiv,
    OPERATION["%"]: operator.mod,
    OPERATION[">>"]: lambda a, b: a >> (b & 31),
    OPERATION["<<"]: lambda a, b: a << (b & 31),
    OPERATION["&"]: operator.and_,
    OPERATION["|"]: operator.or_,
}
_COMPARISONS: Mapping[str, Callable[[int, int], bool]] = {
    COMPARISON[">"]: operator.gt,
    COMPARISON["<"]: operator.lt,
    COMPARISON["="]: operator.eq,
    COMPARISON[">="]: operator.ge,
    COMPARISON["<="]: operator.le,
    COMPARISON["!="]: operator.ne,
}
_TAKING = frozenset({"CV", "VR", "OX", "AM", "JI", "JW"})
"""Lines that values may precede."""


class PmxThread:
    """One of the two programs: its state, its value stack and its calls.

    `due`: when it carries out its next line; None while it waits or does not run.
    """

    def __init__(self, number: int, machine: PmxInterpreter) -> None:
        self.number, self.machine = number, machine
        self.state = IDLE
        self.at = 0
        self.due: float | None = None
        self.waiting = ""
        self.moved: set[str] = set()
        self.failure = ""
        self.failed: float | None = None
        """The time of its last failure."""
        self.stack: list[int | str] = []
        self._begin = 0  # the first line of the statement that is carried out
        self._called: int | None = None  # a subroutine that a host wants
        self._left = 0.0  # the rest of a delay while it is paused
        self._frames: list[_Frame] = []

    def control(self, value: int, now: float) -> None:
        if value == STOP:
            self.end(IDLE)
        elif value == START and self.state != RUNNING:
            self._start(self.machine.memory.start_of(self.number), now)
        elif value == PAUSE and self.state == RUNNING:
            self._left = max(self.due - now, 0.0) if self.due is not None else 0.0
            self.state, self.due, self.waiting = PAUSED, None, ""
        elif value == CONTINUE and self.state == PAUSED:
            self.state, self.due = RUNNING, now + self._left

    def call(self, at: int, now: float) -> None:
        """Carry out the subroutine at a line: before the next statement if the program runs, else alone."""
        if self.state in (RUNNING, PAUSED):
            self._called = at
            return
        self._start(at, now)
        self._frames.append(_Frame(None))

    def fail(self, fault: ProgramFault, now: float) -> None:
        """Go to SUB 31; end in error if there is none, or if the error is in SUB 31."""
        self.failure, self.failed = f"{fault} at line {self.at}", now
        handler = self.machine.memory.subroutine(HANDLER)
        if any(frame.handler for frame in self._frames) or len(self._frames) >= DEEPEST_CALLS:
            handler = None
        self.machine.failures.append(ProgramError(now, self.number, self._begin, str(fault), handler is not None))
        if handler is None:
            self.machine.ended(now)
            self.end(ERROR)
            return
        self._frames.append(_Frame(self._begin, handler=True))
        self.stack.clear()
        self.waiting = ""
        self._go(handler)
        if self.state == RUNNING:
            self.due = now + self.machine.line_s

    def wake(self, now: float) -> None:
        self.waiting = ""
        self.at += 1
        self.due = now + self.machine.line_s

    def end(self, state: int) -> None:
        self.state, self.due, self.waiting, self._called = state, None, "", None
        self.stack.clear()
        self._frames.clear()

    def _start(self, at: int | None, now: float) -> None:
        self.end(IDLE)
        self.failure, self.failed = "", None
        self.moved.clear()
        if at is None:
            self.state, self.failure = ERROR, f"no program {self.number} is stored"
            return
        self.state, self.due = RUNNING, now
        self._go(at)

    def _go(self, at: int) -> None:
        self.at = self._begin = at

    def step(self, now: float) -> None:
        """Carry out the next line. Between statements a subroutine that the host wants comes first."""
        machine, memory = self.machine, self.machine.memory
        if not self.stack:
            if self._called is not None:
                self._frames.append(_Frame(self.at))
                self._go(self._called)
                self._called = None
            self._begin = self.at
        compiled = memory.code[self.at] if self.at < len(memory.code) else None
        self.due = now + machine.line_s
        try:
            if compiled is None:
                held = memory.line(self.at) if self.at < len(memory.code) else "the end of the memory"
                raise ProgramFault(f"{held!r} cannot be executed")
            self._carry_out(*compiled, now)
        except ProgramFault as fault:
            self.fail(fault, now)
        if self.due is None and not self.waiting:
            machine.ended(now)

    def _carry_out(self, word: str, argument: str, now: float) -> None:
        """Carry out a line, and go on to the next one unless it says where. Raises ProgramFault."""
        if word[0] != "&" and word not in _TAKING:
            self.take(0)
        match word:
            case "CV":
                self.stack.append(int(argument))
            case "VR":
                self.stack.append(f"V{argument}")
            case "OX":
                self._operate(argument, now)
            case "AM":
                source, target = self.take(2)
                value = self.number_of(source, now)
                if isinstance(target, int) or (target[0] != "V" and not WORDS[target].settable):
                    raise ProgramFault(f"{target} cannot be set")
                self.assign(target, value, now)
            case "JI" | "JW":  # true skips the next line
                left, right = (self.number_of(operand, now) for operand in self.take(OPERANDS))
                self.at += _COMPARISONS[argument](left, right)
            case "JR" | "JO":
                self.at += int(argument) - 1
            case "JM-":  # back to a JW, which is carried out again from the first of its values
                to = self.at - int(argument)
                back = self.machine.memory.code[to] if to >= OPERANDS else None
                if back is None or back[0] != "JW":
                    raise ProgramFault(f"JM-{argument} goes back to no JW")
                self.at = to - OPERANDS
                return
            case "EI" | "PS" | "SS":
                pass
            case "DD" | "DV":
                milliseconds = int(argument) if word == "DD" else self.machine.variables[int(argument)]
                self.due = now + (milliseconds & MASK) / 1000
            case "WX":
                if self.machine.moving(axis := AXES[int(argument)], now):
                    self.waiting, self.due = axis, None
                    return
            case "GS":
                at = self.machine.memory.subroutine(int(argument))
                if at is None:
                    raise ProgramFault(f"SUB {int(argument)} is not defined")
                if len(self._frames) >= DEEPEST_CALLS:
                    raise ProgramFault(f"more than {DEEPEST_CALLS} nested calls")
                self._frames.append(_Frame(self.at + 1))
                self.at = at
                return
            case "SE":
                self._leave(now)
                return
            case "XX":
                self.end(IDLE)
                return
            case _:
                self._register(word[1:], argument, now)
        self.at += 1

    def _register(self, name: str, argument: str, now: float) -> None:
        """Set a register, move axes, carry out a command, or put the name on the stack."""
        if name[-1] == "=":
            self.take(0)
            self.assign(name[:-1], int(argument), now)
        elif name in MOVES:
            targets = [self.number_of(operand, now) for operand in self.take(len(name))]
            self.moved |= set(name)
            self.ask("".join(f"{axis}{target}" for axis, target in zip(name, targets, strict=True)), now)
        elif WORDS[name].command:
            self.take(0)
            named = set(name.rstrip("+-")[-1:]) & set(AXES)
            self.moved |= named if name[-1] in "+-" else set()
            self.ask(WORDS[name].ascii, now)
        else:
            self.stack.append(name)

    def _operate(self, argument: str, now: float) -> None:
        """Take right, left and target; `~` has no left."""
        alone = argument == OPERATION["~"]
        *operands, target = self.take(2 if alone else 3)
        values = [self.number_of(operand, now) for operand in operands]
        try:
            result = ~values[0] if alone else _OPERATIONS[argument](values[1], values[0])
        except ZeroDivisionError:
            raise ProgramFault("division by zero") from None
        if isinstance(target, int) or target[0] != "V":
            raise ProgramFault(f"OX{argument} cannot set {target}")
        self.machine.variables[int(target[1:])] = wrapped(result)

    def _leave(self, now: float) -> None:
        """Return from a subroutine; from SUB 31 perhaps to the begin of the program."""
        if not self._frames:
            raise ProgramFault("ENDSUB without a call")
        frame = self._frames.pop()
        if frame.to is None:
            self.end(IDLE)
        elif not (frame.handler and int(self.ask("POLX", now)) & JUMP_TO_FIRST):
            self.at = frame.to
        else:
            start = self.machine.memory.start_of(self.number)
            called_by_host = any(each.to is None for each in self._frames)
            self._frames.clear()
            if start is None or called_by_host:
                self.end(IDLE)
            else:
                self._go(start)

    def take(self, many: int) -> list[int | str]:
        """Take everything off the stack, which must be so many values. Raises ProgramFault."""
        if len(self.stack) != many:
            held = self.machine.memory.line(self.at)
            raise ProgramFault(f"{held} takes {many} values, and {len(self.stack)} are there")
        taken, self.stack = self.stack, []
        return taken

    def number_of(self, value: int | str, now: float) -> int:
        """Evaluate a number, a variable or a register. Raises ProgramFault."""
        if isinstance(value, int):
            return value
        if value[0] == "V":
            return self.machine.variables[int(value[1:])]
        text = self.ask(WORDS[value].ascii, now, changes=False)
        try:
            return wrapped(int(text))
        except ValueError:
            raise ProgramFault(f"{value} answers {text}") from None

    def ask(self, text: str, now: float, *, changes: bool = True) -> str:
        """Have the controller carry out an ASCII command. Raises ProgramFault if it refuses."""
        reply = self.machine.ask(self.number, text, now, changes=changes)
        if reply.startswith("?"):
            raise ProgramFault(f"{text} is answered {reply}")
        return reply

    def assign(self, target: str, value: int, now: float) -> None:
        """Set a variable, a program's SR or a register. Raises ProgramFault."""
        if target[0] == "V":
            self.machine.variables[int(target[1:])] = value
        elif target[:2] == "SR":
            if not self.machine.control(int(target[2:]), value, now):
                raise ProgramFault(f"{target} takes no {value}")
        else:
            self.moved |= {target[-1]} if target[:4] == "SSPD" else set()
            self.ask(f"{WORDS[target].ascii}={value}", now)


class PmxInterpreter:
    """Memory, variables and both programs. Line times are in seconds."""

    def __init__(self, controller: CommandedController, line_s: float = 200e-6) -> None:
        self.memory = PmxMemory()
        self.variables = [0] * VARIABLES
        self.line_s = line_s
        self.executed = 0
        """Lines carried out so far."""
        self.ended_at = 0.0
        """When a program has last come to its end by itself."""
        self.failures: deque[ProgramError] = deque(maxlen=MOST_FAILURES)
        """The last failures; the reader takes them out."""
        self.on_command: Callable[[float, int, str], None] | None = None
        """Called with what programs have the controller do: time, program, ASCII command."""
        self._before: Callable[[float, int, int], bool] | None = None
        self._after: Callable[[float, int], None] | None = None
        self._controller = controller
        self._changed = False  # a program has done something to the controller
        self._now = 0.0
        self._threads = [PmxThread(number, self) for number in range(PROGRAMS)]
        self._troubled = dict.fromkeys(AXES, False)

    def watch(
        self, before: Callable[[float, int, int], bool] | None, after: Callable[[float, int], None] | None
    ) -> None:
        """Call `before` each line with time, program and line, and `after` it with time and program.

        All programs end where `before` returns True.
        """
        self._before, self._after = before, after

    def control(self, program: int, value: int, now: float) -> bool:
        """`SR<program>=<value>`: 0 stop, 1 start, 2 pause, 3 continue. False: the value is none of these.

        Starting one that runs changes nothing; one that is paused begins at its first line.
        """
        if value not in (STOP, START, PAUSE, CONTINUE):
            return False
        self._threads[program].control(value, now)
        return True

    def status(self, program: int) -> int:
        """`SASTAT<program>`: 0 idle, 1 running, 2 paused, 4 in error."""
        return self._threads[program].state

    def counter(self, program: int) -> int:
        """`SPC<program>`: its current line."""
        return min(self._threads[program].at, MEMORY_LINES - 1)

    def failure(self, program: int) -> str:
        """The cause of the last error of a program, for a person; empty: there was none."""
        return self._threads[program].failure

    def call(self, subroutine: int, now: float) -> bool:
        """`GS<subroutine>`: program 0 calls it, and is started for it where it does not run. False: not defined."""
        at = self.memory.subroutine(subroutine)
        if at is None:
            return False
        self._threads[0].call(at, now)
        return True

    def power_up(self, now: float) -> None:
        """Begin without a running program and with V0 to V31 at 0; the owner loads what STORE kept."""
        self.variables[:FIRST_KEPT_VARIABLE] = [0] * FIRST_KEPT_VARIABLE
        self._threads = [PmxThread(number, self) for number in range(PROGRAMS)]
        self._troubled = dict.fromkeys(AXES, False)

    @property
    def running(self) -> bool:
        return any(thread.state == RUNNING for thread in self._threads)

    def ask(self, program: int, text: str, now: float, *, changes: bool) -> str:
        """Have the controller carry out an ASCII command for a program."""
        self._changed = self._changed or changes
        reply = self._controller.ask(text, now)
        if changes and self.on_command is not None and not reply.startswith("?"):
            self.on_command(now, program, text)
        return reply

    def moving(self, axis: str, now: float) -> bool:
        self._controller.settle(now)
        return self._controller.moving(axis)

    def ended(self, now: float) -> None:
        self.ended_at = now

    @property
    def deadline(self) -> float | None:
        """Time of the next event, of a program or of the controller."""
        dues = [thread.due for thread in self._threads if thread.due is not None]
        event = self._controller.deadline
        return min([*dues, event] if event is not None else dues, default=None)

    def advance(self, now: float) -> None:
        """Let programs and controller do everything that is due up to `now`."""
        self._look(self._now)  # what a host has done since
        settled = float("-inf")
        event = self._controller.deadline
        while True:
            thread = self._next()
            due = thread.due if thread is not None else None
            if event is not None and settled < event <= now and (due is None or event <= due):
                self._controller.settle(event)
                settled = event
                self._look(event)
                event = self._controller.deadline
            elif thread is not None and due is not None and due <= now:
                if self._before is not None and self._before(due, thread.number, thread.at):
                    self._controller.settle(due)
                    self._now = self.ended_at = due
                    for each in self._threads:
                        each.end(IDLE)
                    return
                self.executed += 1
                thread.step(due)
                if self._after is not None:
                    self._after(due, thread.number)
                if self._changed:  # most lines only calculate, and asking costs more than they do
                    self._changed = False
                    self._controller.settle(due)
                    self._look(due)
                    event = self._controller.deadline
            else:
                break
        self._controller.settle(now)
        self._look(now)
        self._now = now

    def _next(self) -> PmxThread | None:
        """The program whose line is due first; of two at the same time, the one that has waited longer."""
        first: PmxThread | None = None
        for thread in self._threads:
            if thread.due is not None and (first is None or first.due is None or thread.due < first.due):
                first = thread
        return first

    def _look(self, now: float) -> None:
        """Wake programs whose axis has stopped, and fail those whose axis has an error."""
        for axis in AXES:
            troubled = self._controller.troubled(axis)
            if troubled and not self._troubled[axis]:
                running = [thread for thread in self._threads if thread.state == RUNNING]
                for thread in [each for each in running if axis in each.moved] or running:
                    if thread.failed != now:  # else the command that led to it has been refused too
                        thread.fail(ProgramFault(f"axis {axis} is in error"), now)
            self._troubled[axis] = troubled
        for thread in self._threads:
            if thread.waiting and thread.state == RUNNING and not self._controller.moving(thread.waiting):
                thread.wake(now)
