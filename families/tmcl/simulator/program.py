"""The program of a simulated TMCL module: its memory, its download, and its run in virtual time.

A program has an accumulator, an X register, flags, a stack and the user variables of the module. Its lines are the
commands of the direct mode, carried out by the module, and those that only a program has, carried out here. What a
line reads goes into the accumulator, and never into that of a host. (TMCM-1290 TMCL firmware manual, "TMCL commands by
subject", "TMCL control commands".)

Rulings where the manuals are silent: a line takes 1 ms; a line that the module refuses, and a division by 0, are passed
over; an empty line ends the program, and so does one that the module does not have; a download overwrites from its
first line on and erases nothing; 128 leaves the motor as it is; memory outlasts power.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import NamedTuple

from multidrop.families.tmcl.manual.commands import Command, SearchAction, Status, TmclCall
from multidrop.families.tmcl.manual.instructions import (
    CONTROL,
    EMPTY,
    MEMORY,
    STACK,
    Calculation,
    Flag,
    JumpCondition,
    ProgramWord,
    Wait,
)
from multidrop.families.tmcl.simulator.motor import wrapped

LINE_TIME = 0.001
TICK = 0.01
USERS, INTERRUPTS = 2, 3
"""The banks of the user variables, and of the settings of interrupts."""
VARIABLES = range(256)
TIMERS = range(3)
"""The interrupts that come by time."""
ALL = 255
"""The number that enables interrupts as a whole."""
BY_ACCUMULATOR = -1
"""A value that stands for the accumulator."""
ALL_PORTS = 255
EMPTY_LINE = TmclCall(EMPTY)
JUMPS = frozenset(
    {
        ProgramWord.JA,
        ProgramWord.JC,
        ProgramWord.CSUB,
        ProgramWord.CALL,
        ProgramWord.RSUB,
        ProgramWord.RST,
        ProgramWord.DJNZ,
        ProgramWord.STOP,
        ProgramWord.RETI,
    }
)
OPERANDS: Mapping[int, tuple[str, str]] = {
    ProgramWord.CALC: ("A", "value"),
    ProgramWord.CALCX: ("A", "X"),
    ProgramWord.CALCVV: ("V", "V2"),
    ProgramWord.CALCVA: ("V", "A"),
    ProgramWord.CALCAV: ("A", "V"),
    ProgramWord.CALCVX: ("V", "X"),
    ProgramWord.CALCXV: ("X", "V"),
    ProgramWord.CALCV: ("V", "value"),
}
"""Target and second operand: the accumulator, the X register, a user variable, a second one, the value of the line."""
FROM_ACCUMULATOR: Mapping[int, Command | ProgramWord] = {
    ProgramWord.AAP: Command.SAP,
    ProgramWord.AGP: Command.SGP,
    ProgramWord.ACO: ProgramWord.SCO,
    ProgramWord.MVPA: Command.MVP,
    ProgramWord.ROLA: Command.ROL,
    ProgramWord.RORA: Command.ROR,
}
"""The lines that are a command of the direct mode with the accumulator as its value."""
READS = frozenset({Command.GAP, Command.GGP, ProgramWord.GIO, ProgramWord.GCO})


class FailedLine(NamedTuple):
    """A line that was not carried out: when, its address, and why."""

    t: float
    at: int
    why: str


class Context(NamedTuple):
    """What an interrupt saves of the program."""

    counter: int
    accumulator: int
    x: int
    zero: bool | None
    order: int | None
    waits: TmclCall | None
    due: float


class NotKnown(Exception):
    """The module does not have this line."""


Execute = Callable[[TmclCall, float], tuple[int, int]]
"""Carries out a command of the direct mode; its status and its value."""
Over = Callable[[TmclCall, float], bool]
"""Whether what a WAIT waits for has come."""
Signals = Callable[[float], Mapping[int, bool]]
"""The states whose beginning is an interrupt, by its number."""


class TmclProgram:
    """One program, and the memory that holds it."""

    def __init__(self, execute: Execute, over: Over, signals: Signals = lambda t: {}) -> None:
        self._cells: dict[int, TmclCall] = {}
        self.storing = False
        """In download mode: every command but the control commands becomes a line."""
        self.running = False
        self.counter = 0
        """The address of the next line."""
        self.executed = 0
        """Lines carried out since power-up."""
        self.failures: list[FailedLine] = []
        self.before: Callable[[float, int], bool] | None = None
        """Called before each line; true: the program halts there."""
        self.after: Callable[[float, TmclCall], None] | None = None
        self._execute, self._over, self._signals = execute, over, signals
        self._pointer = 0
        self._due = inf
        self._waits: TmclCall | None = None
        self.accumulator = self.x = 0
        self._zero: bool | None = None
        self._order: int | None = None
        self._errors: set[Flag] = set()
        self._stack: list[int] = []
        self._vectors: dict[int, int] = {}
        self._enabled: set[int] = set()
        self._timers: dict[int, float] = {}
        self._seen: Mapping[int, bool] = {}
        self._context: Context | None = None

    # The memory

    @property
    def memory(self) -> Sequence[TmclCall]:
        """The lines, up to the last one that was stored."""
        return [self.line(at) for at in range(max(self._cells, default=-1) + 1)]

    def line(self, at: int) -> TmclCall:
        return self._cells.get(at, EMPTY_LINE)

    def load(self, lines: Mapping[int, TmclCall]) -> None:
        """Hold these lines, and no others."""
        self._cells = {at: call for at, call in lines.items() if call.command != EMPTY}

    def download(self, place: int) -> None:
        """Begin a download: lines are stored from here on."""
        self.halt()
        self.storing, self._pointer = True, max(0, place)

    def store(self, call: TmclCall) -> bool:
        """Store a line; whether there was room."""
        if self._pointer >= MEMORY:
            return False
        self._cells[self._pointer] = call
        if call.command == EMPTY:
            del self._cells[self._pointer]
        self._pointer += 1
        return True

    # The run

    @property
    def waiting(self) -> bool:
        """Whether a WAIT holds it."""
        return self._waits is not None

    @property
    def due(self) -> float:
        """When something next happens by itself."""
        return min((self._due, *self._timers.values())) if self.running else self._due

    def run(self, t: float, place: int | None = None) -> None:
        """Run from a line, or from where it was halted."""
        self.counter = self.counter if place is None else max(0, place)
        self.running, self._due, self._waits, self._seen = True, t + LINE_TIME, None, self._signals(t)

    def halt(self, *, reset: bool = False) -> None:
        """Carry out no more lines. `reset`: the next run begins with the first one, and with nothing in it."""
        self.running, self._due, self._waits = False, inf, None
        if reset:
            self._reset(0)

    def _reset(self, counter: int) -> None:
        self.counter, self.accumulator, self.x, self._context = counter, 0, 0, None
        self._zero = self._order = None
        self._errors.clear()
        self._stack.clear()
        self._enabled.clear()
        self._timers.clear()

    def step(self, t: float) -> None:
        """Carry out the next line, and no more; one that waits stays until its event has come."""
        self.halt()
        at = self.counter
        self._line(t)
        if self._waits is not None and not self._over(self._waits, t):
            self.counter = at
        self._waits, self._due = None, inf

    def live(self, t: float) -> None:
        if not self.running:
            return
        self._interrupt(t)
        if self._waits is not None and self._waits.type != Wait.TICKS and self._over(self._waits, t):
            self._waits, self._due = None, min(self._due, t + LINE_TIME)
        if self.running and self._due <= t:
            if self._waits is not None and self._waits.type != Wait.TICKS:
                self._errors.add(Flag.ETO)
            self._waits, self._due = None, t + LINE_TIME
            self._line(t)

    def _line(self, t: float) -> None:
        at, call = self.counter, self.line(self.counter)
        if self.before is not None and call.command != EMPTY and self.before(t, at):
            return self.halt()
        if call.command == EMPTY:
            return self.halt()
        self.counter, self.executed = at + 1, self.executed + 1
        try:
            self._carry_out(call, t)
        except NotKnown:
            self.failures.append(FailedLine(t, at, "the simulated module does not have it; the program ends"))
            self.halt()
        except ZeroDivisionError:
            self.failures.append(FailedLine(t, at, "division by 0; the line is passed over"))
        if self.after is not None:
            self.after(t, call)

    def _carry_out(self, call: TmclCall, t: float) -> None:
        number = call.command
        if number in JUMPS:
            return self._jump(call, t)
        if number in OPERANDS:
            return self._calculate(call, t)
        match number:
            case ProgramWord.SIV | ProgramWord.GIV | ProgramWord.AIV if self.x not in VARIABLES:
                pass  # the user variable whose number is in X: any other number is ignored
            case ProgramWord.GIV:
                self._take(self._variable(self.x, t))
            case ProgramWord.SIV | ProgramWord.AIV:
                self._set_variable(self.x, call.value if number == ProgramWord.SIV else self.accumulator, t)
            case ProgramWord.WAIT:
                ticks = self.accumulator if call.value == BY_ACCUMULATOR else call.value
                if call.type == Wait.TICKS:
                    self._waits, self._due = call, t + max(LINE_TIME, ticks * TICK)
                elif not self._over(call, t):
                    self._waits, self._due = call, t + ticks * TICK if ticks > 0 else inf
            case ProgramWord.COMP:
                self._compare(self.accumulator, call.value)
            case ProgramWord.CLE:
                self._errors -= {Flag(call.type)} if call.type in tuple(Flag)[1:] else set(Flag)
            case ProgramWord.VECT:
                self._vectors[call.type] = max(0, call.value)
            case ProgramWord.DI:
                self._enabled.discard(call.type)
                self._timers.pop(call.type, None)
            case ProgramWord.EI:
                self._enabled.add(call.type)
                self._start_timer(call.type, t)
            case ProgramWord.SIO if (call.type, call.value) == (ALL_PORTS, BY_ACCUMULATOR):
                self._do(TmclCall(number, call.type, call.motor, self.accumulator), t)
            case _ if number in FROM_ACCUMULATOR:
                self._do(TmclCall(FROM_ACCUMULATOR[number], call.type, call.motor, self.accumulator), t)
            case _:
                self._do(call, t)

    def _do(self, call: TmclCall, t: float) -> int:
        """Carry out a command of the direct mode; what it reads goes into the accumulator."""
        status, value = self._execute(call, t)
        if status == Status.INVALID_COMMAND or call.command >= CONTROL:
            raise NotKnown
        if status != Status.DONE:
            self.failures.append(
                FailedLine(t, self.counter - 1, f"refused with status {status}; the line is passed over")
            )
        elif call.command in READS or (call.command, call.type) == (Command.RFS, SearchAction.STATUS):
            self._take(value)
        return value

    def _take(self, value: int) -> None:
        self.accumulator, self._zero = value, value == 0

    def _compare(self, left: int, right: int) -> None:
        self._order = (left > right) - (left < right)

    # Jumps

    def _jump(self, call: TmclCall, t: float) -> None:
        match call.command:
            case ProgramWord.STOP:
                self.halt()
            case ProgramWord.RSUB:
                self.counter = self._stack.pop() if self._stack else self.counter
            case ProgramWord.RST:
                self._reset(max(0, call.value))
            case ProgramWord.RETI if self._context is not None:
                kept, self._context = self._context, None
                self.counter, self.accumulator, self.x = kept.counter, kept.accumulator, kept.x
                self._zero, self._order = kept.zero, kept.order
                self._waits, self._due = kept.waits, max(kept.due, self._due)
            case ProgramWord.RETI:
                pass
            case ProgramWord.DJNZ:
                left = wrapped(self._variable(call.type, t) - 1)
                self._set_variable(call.type, left, t)
                self.counter = max(0, call.value) if left else self.counter
            case ProgramWord.CSUB | ProgramWord.CALL:
                if len(self._stack) < STACK and (call.command == ProgramWord.CSUB or self._met(call.type)):
                    self._stack.append(self.counter)
                    self.counter = max(0, call.value)
            case _:
                self.counter = (
                    max(0, call.value) if call.command == ProgramWord.JA or self._met(call.type) else self.counter
                )

    def _met(self, condition: int) -> bool:
        order = self._order
        if condition in (JumpCondition.ZE, JumpCondition.NZ):
            return self._zero is (condition == JumpCondition.ZE)
        if condition in range(JumpCondition.ETO, JumpCondition.ESD + 1):
            return Flag[JumpCondition(condition).name] in self._errors
        if order is None:
            return condition == JumpCondition.NE
        by_order: Mapping[int, bool] = {
            JumpCondition.EQ: order == 0,
            JumpCondition.NE: order != 0,
            JumpCondition.GT: order > 0,
            JumpCondition.GE: order >= 0,
            JumpCondition.LT: order < 0,
            JumpCondition.LE: order <= 0,
        }
        return by_order.get(condition, False)

    # Registers and user variables

    def _variable(self, number: int, t: float) -> int:
        return self._execute(TmclCall(Command.GGP, number, USERS), t)[1] if number in VARIABLES else 0

    def _set_variable(self, number: int, value: int, t: float) -> None:
        self._do(TmclCall(Command.SGP, number, USERS, value), t)

    def _calculate(self, call: TmclCall, t: float) -> None:
        target, other = OPERANDS[call.command]
        if call.command == ProgramWord.CALCX and call.type in (Calculation.NOT, Calculation.LOAD):
            target, other = "X", "X" if call.type == Calculation.NOT else "A"
        left, right = self._operand(target, call, t), self._operand(other, call, t)
        if call.type == Calculation.COMP:
            return self._compare(left, right)
        if call.type == Calculation.SWAP:
            self._put(other, left, call, t)
        if call.type == Calculation.NOT and other == "value":
            right = left
        self._put(target, calculated(call.type, left, right), call, t)

    def _operand(self, place: str, call: TmclCall, t: float) -> int:
        if place == "A":
            return self.accumulator
        if place == "X":
            return self.x
        if place == "value":
            return call.value
        return self._variable(call.motor if place == "V" else call.value, t)

    def _put(self, place: str, value: int, call: TmclCall, t: float) -> None:
        self._zero = value == 0
        if place == "A":
            self.accumulator = value
        elif place == "X":
            self.x = value
        else:
            self._set_variable(call.motor if place == "V" else call.value, value, t)

    # Interrupts

    def _start_timer(self, number: int, t: float) -> None:
        period = self._execute(TmclCall(Command.GGP, number, INTERRUPTS), t)[1] if number in TIMERS else 0
        if period > 0:
            self._timers[number] = t + max(LINE_TIME, period / 1000)

    def _interrupt(self, t: float) -> None:
        """Go to the routine of an interrupt that has come; one at a time."""
        now = self._signals(t)
        come = {number for number, state in now.items() if state and not self._seen.get(number, True)}
        self._seen = now
        for number, at in list(self._timers.items()):
            if at <= t:
                come.add(number)
                self._start_timer(number, t)
        first = min((each for each in come if each in self._enabled and each in self._vectors), default=None)
        if first is None or ALL not in self._enabled or self._context is not None:
            return
        state = (self.counter, self.accumulator, self.x, self._zero, self._order)
        self._context = Context(*state, self._waits, self._due)
        self.counter, self._waits, self._due = self._vectors[first], None, t + LINE_TIME


def calculated(operation: int, left: int, right: int) -> int:
    """The result of an operation, as a signed number of 32 bits. Raises ZeroDivisionError."""
    match operation:
        case Calculation.ADD:
            return wrapped(left + right)
        case Calculation.SUB:
            return wrapped(left - right)
        case Calculation.MUL:
            return wrapped(left * right)
        case Calculation.DIV | Calculation.MOD:
            whole = abs(left) // abs(right) * (1 if (left < 0) == (right < 0) else -1)
            return wrapped(whole if operation == Calculation.DIV else left - whole * right)
        case Calculation.AND:
            return left & right
        case Calculation.OR:
            return left | right
        case Calculation.XOR:
            return left ^ right
        case Calculation.NOT:
            return ~right
    return right
