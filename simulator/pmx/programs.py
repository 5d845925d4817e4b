"""A-SCRIPT programs in the memory of a simulated PMX-2ED-SA, run in virtual time (manual 7.19, 10).

`Programs.advance(now)` is the one loop that lets time pass, for programs and controller. It goes from event to event (a
program's line, or an event of the controller) and settles the controller at each of these times. So the owner of both
calls `programs.advance(now)`, and `programs.deadline` is the time of the next event; nothing here calls back into that.

An error in a program takes it to SUB 31, once: a refused command, a limit or StepNLoop error of an axis that it has
moved, an unknown line. Without SUB 31, or with an error in it, the program ends in error. An error of an axis that no
running program has moved takes every running program there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

from multidrop.dialects.pmx.manual.script_compiler import LINES
from multidrop.dialects.pmx.manual.script_parser import AXES, PROGRAMS, VARIABLES
from multidrop.simulator.pmx import lines
from multidrop.simulator.pmx.memory import Memory
from multidrop.simulator.pmx.vm import CONTINUE, IDLE, PAUSE, RUNNING, START, STOP, Failure, Fault, Thread

KEPT = 32
"""The first variable that STORE keeps; those below are zero after power-up."""
MOST_FAILURES = 1000


class Controller(Protocol):
    """What programs act upon: axes, inputs and outputs. Times never go back. It must not call `Programs.advance`."""

    @property
    def deadline(self) -> float | None:
        """Time of its next event (the end of a motion, a switch), later than it is settled."""

    def settle(self, now: float) -> None:
        """Bring axes and world to `now`, with what happens at that very time."""

    def ask(self, text: str, now: float) -> str:
        """Carry out an ASCII command of table 9.0 as from a host, without restarting the watchdog (TOC).

        The reply is `OK`, a value, or `?` and the cause. Besides table 9.0 it takes `JOYENA=<0-3>` (axes of the
        joystick). Never used: SA, SR, SASTAT, SPC, GS, V.
        """

    def moving(self, axis: str) -> bool:
        """Whether X or Y moves: pulses, a homing that goes on, a StepNLoop correction."""

    def troubled(self, axis: str) -> bool:
        """Whether a limit error (not with IERR=1) or a StepNLoop error is latched on X or Y."""


class Observer(Protocol):
    """Somebody who looks at each compiled line in virtual time; a unit has no such thing."""

    def starts(self, t: float, program: int, line: int) -> bool:
        """Return whether all programs end before this line."""

    def ends(self, t: float, program: int) -> None:
        """Take note that the line was executed."""


class Programs:
    """Memory, variables and both programs. Line times are in seconds."""

    observer: Observer | None = None

    def __init__(self, controller: Controller, line_s: float = 200e-6) -> None:
        self.memory = Memory()
        self.variables = [0] * VARIABLES
        self.line_s = line_s
        self.executed = 0
        """Lines carried out so far."""
        self.ended_at = 0.0
        """When a program has last come to its end by itself."""
        self.failures: deque[Failure] = deque(maxlen=MOST_FAILURES)
        """The last failures; the reader takes them out."""
        self.on_command: Callable[[float, int, str], None] | None = None
        """Called with what programs have the controller do: time, program, ASCII command."""
        self._controller = controller
        self._changed = False  # a program has done something to the controller
        self._now = 0.0
        self._threads = [Thread(number, self) for number in range(PROGRAMS)]
        self._troubled = dict.fromkeys(AXES, False)

    # Control.

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
        return min(self._threads[program].at, LINES - 1)

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
        self.variables[:KEPT] = [0] * KEPT
        self._threads = [Thread(number, self) for number in range(PROGRAMS)]
        self._troubled = dict.fromkeys(AXES, False)

    @property
    def running(self) -> bool:
        """Whether a program runs."""
        return any(each.state == RUNNING for each in self._threads)

    # What a program needs: see `vm.Machine`.

    def ask(self, program: int, text: str, now: float, *, changes: bool) -> str:
        """Have the controller carry out an ASCII command for a program."""
        self._changed = self._changed or changes
        reply = self._controller.ask(text, now)
        if changes and self.on_command is not None and not reply.startswith("?"):
            self.on_command(now, program, text)
        return reply

    def moving(self, axis: str, now: float) -> bool:
        """Whether an axis moves now."""
        self._controller.settle(now)
        return self._controller.moving(axis)

    def failed(self, failure: Failure) -> None:
        """Take note of an error in a program."""
        self.failures.append(failure)

    def ended(self, now: float) -> None:
        """Take note that a program has ended by itself."""
        self.ended_at = now

    # Time.

    @property
    def deadline(self) -> float | None:
        """Time of the next event, of a program or of the controller."""
        dues = [each.due for each in self._threads if each.due is not None]
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
                if self.observer is not None and self._ends_before(thread, due):
                    return
                self.executed += 1
                lines.step(thread, due)
                if self.observer is not None:
                    self.observer.ends(due, thread.number)
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

    def _ends_before(self, thread: Thread, due: float) -> bool:
        """Whether the observer ends all programs before the next line of this one."""
        if self.observer is None or not self.observer.starts(due, thread.number, thread.at):
            return False
        self._controller.settle(due)
        self._now = self.ended_at = due
        for each in self._threads:
            each.end(IDLE)
        return True

    def _next(self) -> Thread | None:
        """The program whose line is due first; of two at the same time, the one that has waited longer."""
        first: Thread | None = None
        for each in self._threads:
            if each.due is not None and (first is None or first.due is None or each.due < first.due):
                first = each
        return first

    def _look(self, now: float) -> None:
        """Wake programs whose axis has stopped, and fail those whose axis has an error."""
        for axis in AXES:
            troubled = self._controller.troubled(axis)
            if troubled and not self._troubled[axis]:
                running = [each for each in self._threads if each.state == RUNNING]
                for each in [each for each in running if axis in each.moved] or running:
                    if each.failed != now:  # else the command that led to it has been refused too
                        each.fail(Fault(f"axis {axis} is in error"), now)
            self._troubled[axis] = troubled
        for each in self._threads:
            if each.waiting and each.state == RUNNING and not self._controller.moving(each.waiting):
                each.wake(now)
