"""The program of a simulated TMCL module: its memory, its download, and its run in virtual time.

Lines are the commands of the direct mode, and JA, WAIT and STOP. Rulings where the manuals are silent: a line takes
1 ms; a line that the module refuses is passed over; other commands of programs end the program; 128 leaves the motor
as it is; memory outlasts power.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from math import inf

from multidrop.dialects.tmcl.manual.commands import Call, Command
from multidrop.simulator.tmcl.motor import Motor

LINE_TIME = 0.001
TICK = 0.01
MOST_LINES = 2048
JA, WAIT, STOP = 22, 27, 28
PROGRAM_ONLY = range(14, 64)
"""Commands that only a program has, as far as the direct mode does not have them."""


class Wait(IntEnum):
    """The types of WAIT."""

    TICKS = 0
    POS = 1
    REFSW = 2
    LIMSW = 3
    RFS = 4


class Program:
    """One program. `execute` carries out a line, and drops its refusal."""

    def __init__(self, execute: Callable[[Call, float], None], motor: Motor, searching: Callable[[], bool]) -> None:
        self.memory: list[Call] = []
        self.storing = False
        """In download mode: every command but 133 becomes a line."""
        self.running = False
        self.due = inf
        """When the next line is carried out, or a WAIT gives up."""
        self._execute = execute
        self._motor = motor
        self._searching = searching
        self._place = 0
        self._waits: Call | None = None

    def download(self, place: int) -> None:
        """Begin a download: lines are stored from here on."""
        self.halt()
        self.storing = True
        del self.memory[place:]

    def store(self, call: Call) -> bool:
        """Store a line; whether there was room."""
        if len(self.memory) == MOST_LINES:
            return False
        self.memory.append(call)
        return True

    def run(self, t: float, place: int | None = None) -> None:
        """Run from a line, or from where it was halted."""
        self._place = self._place if place is None else max(0, place)
        self.running, self.due, self._waits = True, t + LINE_TIME, None

    def halt(self, *, reset: bool = False) -> None:
        """Carry out no more lines. `reset`: the next run begins with the first one."""
        self.running, self.due, self._waits = False, inf, None
        if reset:
            self._place = 0

    def step(self, t: float) -> None:
        self.halt()
        self._line(t)
        self.due = inf

    def live(self, t: float) -> None:
        if self._waits is not None and self._over(self._waits, t):
            self._waits, self.due = None, min(self.due, t + LINE_TIME)
        if self.running and self.due <= t:
            self._waits, self.due = None, t + LINE_TIME
            self._line(t)

    def _line(self, t: float) -> None:
        if self._place >= len(self.memory):
            return self.halt()
        call = self.memory[self._place]
        self._place += 1
        if call.command == JA:
            self._place = max(0, call.value)
        elif call.command == WAIT:
            self._wait(call, t)
        elif call.command in PROGRAM_ONLY:  # STOP, and what is not simulated
            self.halt()
        elif call.command < Command.STOP_PROGRAM:
            self._execute(call, t)

    def _over(self, call: Call, t: float) -> bool:
        """Whether what a WAIT waits for has come."""
        home, right, left = self._motor.shaft.switches(t)
        match call.type:
            case Wait.POS:
                return self._motor.reached(t)
            case Wait.REFSW:
                return home
            case Wait.LIMSW:
                return right or left
            case Wait.RFS:
                return not self._searching()
        return True

    def _wait(self, call: Call, t: float) -> None:
        if call.type == Wait.TICKS:
            self.due = t + max(LINE_TIME, call.value * TICK)
        elif not self._over(call, t):
            self._waits, self.due = call, t + call.value * TICK if call.value else inf
