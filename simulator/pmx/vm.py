"""One of the two programs of a simulated PMX-2ED-SA: its state, its value stack and its calls.

Values are 32-bit signed and wrap around. `lines` has what each compiled line does to a program.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from multidrop.dialects.pmx.manual.script_parser import HANDLER, WORDS
from multidrop.simulator.pmx.memory import Memory

STOP, START, PAUSE, CONTINUE = 0, 1, 2, 3
"""Values of SR."""
IDLE, RUNNING, PAUSED, ERROR = 0, 1, 2, 4
"""Values of SASTAT."""
DEEPEST = 32
"""The deepest nesting of calls; the manual does not give a unit's."""
MASK = 0xFFFFFFFF
JUMP_TO_FIRST = 1 << 13
"""The bit of POL that starts a program again after SUB 31, instead of repeating the statement that failed."""


class Fault(Exception):
    """An error that takes a program to SUB 31."""


@dataclass(frozen=True)
class Failure:
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


class Machine(Protocol):
    """What a program needs of the machine that runs it."""

    @property
    def memory(self) -> Memory: ...  # noqa: D102
    @property
    def variables(self) -> list[int]: ...  # noqa: D102
    @property
    def line_s(self) -> float:
        """Seconds that a line takes."""

    def ask(self, program: int, text: str, now: float, *, changes: bool) -> str:
        """Have the controller carry out an ASCII command for a program. `changes`: it may change something."""

    def control(self, program: int, value: int, now: float) -> bool:
        """Carry out SR of a program. False: the value is invalid."""

    def moving(self, axis: str, now: float) -> bool:
        """Whether an axis moves now."""

    def failed(self, failure: Failure) -> None:
        """Take note of an error."""

    def ended(self, now: float) -> None:
        """Take note that a program has ended by itself."""


def signed(value: int) -> int:
    """Wrap a value around, as a 32-bit register does."""
    value &= MASK
    return value - (1 << 32) if value >> 31 else value


class Thread:
    """A program. `due`: when it carries out its next line; None while it waits or does not run."""

    def __init__(self, number: int, machine: Machine) -> None:
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

    # -- what a host or a program does to it ----------------------------------------------------------------------

    def control(self, value: int, now: float) -> None:
        """Carry out SR."""
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

    def fail(self, fault: Fault, now: float) -> None:
        """Go to SUB 31; end in error if there is none, or if the error is in SUB 31."""
        self.failure, self.failed = f"{fault} at line {self.at}", now
        handler = self.machine.memory.subroutine(HANDLER)
        if any(each.handler for each in self._frames) or len(self._frames) >= DEEPEST:
            handler = None
        self.machine.failed(Failure(now, self.number, self._begin, str(fault), handler is not None))
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
        """Go on: the axis for which it waited has stopped."""
        self.waiting = ""
        self.at += 1
        self.due = now + self.machine.line_s

    def wait_for(self, axis: str) -> None:
        """Wait until an axis has stopped."""
        self.waiting, self.due = axis, None

    def end(self, state: int) -> None:
        """End, idle or in error."""
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

    # -- what lines need ------------------------------------------------------------------------------------------

    def begin_line(self) -> None:
        """Get ready for the next line: between statements a subroutine that the host wants comes first."""
        if self.stack:
            return
        if self._called is not None:
            self._frames.append(_Frame(self.at))
            self._go(self._called)
            self._called = None
        self._begin = self.at

    def enter(self, subroutine: int) -> None:
        """Call a subroutine. Raises Fault."""
        at = self.machine.memory.subroutine(subroutine)
        if at is None:
            raise Fault(f"SUB {subroutine} is not defined")
        if len(self._frames) >= DEEPEST:
            raise Fault(f"more than {DEEPEST} nested calls")
        self._frames.append(_Frame(self.at + 1))
        self.at = at

    def leave(self, now: float) -> None:
        """Return from a subroutine. Raises Fault."""
        if not self._frames:
            raise Fault("ENDSUB without a call")
        frame = self._frames.pop()
        if frame.to is None:
            self.end(IDLE)
        elif frame.handler and int(self.ask("POLX", now)) & JUMP_TO_FIRST:
            self._start_again()
        else:
            self.at = frame.to

    def _start_again(self) -> None:
        start = self.machine.memory.start_of(self.number)
        called_by_host = any(each.to is None for each in self._frames)
        self._frames.clear()
        if start is None or called_by_host:
            self.end(IDLE)
        else:
            self._go(start)

    def take(self, many: int) -> list[int | str]:
        """Take everything off the stack, which must be so many values. Raises Fault."""
        if len(self.stack) != many:
            held = self.machine.memory.line(self.at)
            raise Fault(f"{held} takes {many} values, and {len(self.stack)} are there")
        taken, self.stack = self.stack, []
        return taken

    def number_of(self, value: int | str, now: float) -> int:
        """Evaluate a value of the stack: a number, a variable or a register. Raises Fault."""
        if isinstance(value, int):
            return value
        if value[0] == "V":
            return self.machine.variables[int(value[1:])]
        text = self.ask(WORDS[value].ascii, now, changes=False)
        try:
            return signed(int(text))
        except ValueError:
            raise Fault(f"{value} answers {text}") from None

    def ask(self, text: str, now: float, *, changes: bool = True) -> str:
        """Have the controller carry out an ASCII command. Raises Fault if it refuses."""
        reply = self.machine.ask(self.number, text, now, changes=changes)
        if reply.startswith("?"):
            raise Fault(f"{text} is answered {reply}")
        return reply

    def assign(self, target: str, value: int, now: float) -> None:
        """Set a variable, a program's SR or a register. Raises Fault."""
        if target[0] == "V":
            self.machine.variables[int(target[1:])] = value
        elif target[:2] == "SR":
            if not self.machine.control(int(target[2:]), value, now):
                raise Fault(f"{target} takes no {value}")
        else:
            self.moved |= {target[-1]} if target[:4] == "SSPD" else set()
            self.ask(f"{WORDS[target].ascii}={value}", now)
