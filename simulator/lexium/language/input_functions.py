"""The effect of an input of a dedicated type on the program, when it becomes active or inactive.

Limits, home, clocks and trips are the matter of motion. What the manual leaves open (3.4.3, 5.1.64, 7.2.3): G0 does
nothing while a program runs; a pause lasts as long as its input is active; a soft stop of a motion is error 91, of a
program 48, which is the one that stays if it stops both.
"""

from __future__ import annotations

from collections.abc import Callable

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Number
from multidrop.simulator.lexium.language.interpreter import Interpreter
from multidrop.simulator.lexium.language.pausing import Pausing
from multidrop.simulator.lexium.motion.inputs import GO, JOG_MINUS, JOG_PLUS, PAUSE, RESET, SOFT_STOP, Inputs
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.state.error_flag import ErrorFlag
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.timeline import Timeline

JOGS = (JOG_PLUS, JOG_MINUS)
GO_ADDRESS = Number(1)
RESET_TIME = 0.01
"""s, before the line of SU that follows a reset by an input."""


class InputFunctions:
    """The dedicated inputs of one drive. `restart` restarts the drive as at power-up."""

    def __init__(
        self,
        timeline: Timeline,
        errors: ErrorFlag,
        inputs: Inputs,
        motor: Motor,
        interpreter: Interpreter,
        pausing: Pausing,
        restart: Callable[[], None],
    ) -> None:
        self._timeline, self._errors, self._inputs, self._motor = timeline, errors, inputs, motor
        self._interpreter, self._thread, self._pausing = interpreter, interpreter.thread, pausing
        self._restart = restart
        self._risen = {
            GO: self._go,
            SOFT_STOP: self._soft_stop,
            PAUSE: self._pause,
            RESET: self._reset,
            **dict.fromkeys(JOGS, motor.jog.update),
        }
        self._fallen = {PAUSE: self._resume, **dict.fromkeys(JOGS, motor.jog.update)}

    def changed(self, kind: int, active: bool) -> None:
        """Act on an input of a type that has become active or inactive."""
        act = (self._risen if active else self._fallen).get(kind)
        if act is None:
            return
        try:
            act()
        except Fault as fault:
            self._interpreter.raise_error(fault.code)

    def wired(self, n: int, was: tuple[int, ...]) -> None:
        """Act on an input's new set-up. One that is active already stops or resets; a jog ends with its input.

        Where the level that is active has changed too, the next look at the inputs sees that.
        """
        kind, active = self._inputs.types[n][:2]
        if not self._inputs.watched:
            return
        if kind != was[0] and active == was[1] and self._inputs.active(n) and kind in (SOFT_STOP, RESET):
            self.changed(kind, True)
        if self._motor.jog.direction or kind in JOGS:
            self._motor.jog.update()

    def _go(self) -> None:
        if not self._thread.running:
            self._interpreter.start(GO_ADDRESS, self._timeline.now)

    def _pause(self) -> None:
        if self._thread.running and not self._thread.paused:
            self._pausing.pause()

    def _resume(self) -> None:
        if self._thread.paused:
            self._pausing.resume()

    def _reset(self) -> None:
        """Restart. SU takes a moment to start, or one that sets up such an input would reset the drive in no time."""
        self._restart()
        if self._thread.running:
            self._thread.next_at = self._timeline.now + RESET_TIME

    def _soft_stop(self) -> None:
        t, thread, motor = self._timeline.now, self._thread, self._motor
        running, moving = thread.running, motor.status.moving(t)
        if thread.paused or not (running or moving):
            return
        if moving:
            if not motor.torque.halt():
                motor.axis.slow_to(0, t)
            self._errors.set(E.MOTION_STOPPED_BY_INPUT)
        if running:
            thread.finish()
            self._errors.set(E.PROGRAM_STOPPED_BY_INPUT)
        motor.jog.direction = 0
        self._interpreter.on_error(t)
        self._timeline.replan()
