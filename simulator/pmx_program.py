"""A-SCRIPT programs in the memory of a simulated PMX-2ED-SA, run in virtual time (manual 7.19, 10).

Whoever owns the axes is a `Controller` here. `Programs.advance(now)` is the one loop that lets time pass for both:
it goes from what happens next to what happens next (a program's line, or a change of the controller's own) and tells
the controller each of these times with `settle`. So the controller's owner calls `programs.advance(now)` and then
`settle(now)`, and asks `programs.deadline` when something next happens; nothing here calls back into that.
"""

from __future__ import annotations

from typing import Protocol

LINES = 1275
PROGRAMS = 2
SUBROUTINES = 32
VARIABLES = 64
KEPT = 32
"""The first variable that STORE keeps; those below are zero after power-up."""


class Controller(Protocol):
    """What programs act upon: axes, inputs and outputs. Times never go back. It must not call `Programs.advance`."""

    @property
    def deadline(self) -> float | None:
        """When something of its own next happens (a motion ends, a switch is met), later than it is settled."""

    def settle(self, now: float) -> None:
        """Bring axes and world to `now`, what happens at that very time included."""

    def ask(self, text: str, now: float) -> str:
        """Carry out an ASCII command of table 9.0 as if a host had sent it, without being contact with a host (TOC).

        It answers `OK`, a value, or `?` and why. Besides table 9.0 it takes `JOYENA=<0-3>` (axes of the joystick).
        Never asked: SA, SR, SASTAT, SPC, GS, V.
        """

    def moving(self, axis: str) -> bool:
        """Whether X or Y is on its way: pulses, a homing that goes on, a StepNLoop correction."""

    def troubled(self, axis: str) -> bool:
        """Whether a limit error (not with IERR=1) or a StepNLoop error is latched on X or Y."""


class Programs:
    """Memory, variables and both programs. Line times are in seconds."""

    def __init__(self, controller: Controller, line_s: float = 200e-6) -> None:
        self.variables = [0] * VARIABLES
        self._controller = controller
        self._line_s = line_s
        self._lines = [""] * LINES

    def line(self, number: int) -> str:
        """What `SA<number>` answers, 0 to 1274."""
        return self._lines[number]

    def store(self, number: int, text: str) -> bool:
        """`SA<number>=<text>`, kept at once without STORE. False: it is no line (`?Invalid Answer`)."""
        self._lines[number] = text
        return True

    def control(self, program: int, value: int, now: float) -> bool:
        """`SR<program>=<value>`: 0 stop, 1 start, 2 pause, 3 continue. False: the value is none of these."""
        raise NotImplementedError

    def status(self, program: int) -> int:
        """`SASTAT<program>`: 0 idle, 1 running, 2 paused, 4 in error."""
        return 0

    def counter(self, program: int) -> int:
        """`SPC<program>`: the line it stands at."""
        return 0

    def call(self, subroutine: int, now: float) -> bool:
        """`GS<subroutine>`: program 0 calls it, and is started for it where it does not run. False: not defined."""
        raise NotImplementedError

    def power_up(self, now: float) -> None:
        """Nothing runs and V0 to V31 are zero; the lines and V32 to V63 are left (the owner loads what STORE kept)."""
        self.variables[:KEPT] = [0] * KEPT

    @property
    def deadline(self) -> float | None:
        """When something next happens by itself, here or in the controller."""
        return self._controller.deadline

    def advance(self, now: float) -> None:
        """Let programs and controller do everything that is due up to `now`."""
        self._controller.settle(now)
