"""The discrete events of a simulated drive, in virtual time, and the functions of its dedicated inputs.

Theory of operation. `advance(now)` works out the next thing that happens whatever the program does (the end of a
motion, a trip, an input, the end of a hold), lets the interpreter run up to it, lets it happen, and goes on until
`now`. Nothing here reads a clock.

Limits, home, clocks and trips act on motion, all other inputs on the program. What the manual leaves open (3.4.3,
5.1.64, 7.2.3): G0 does nothing while a program runs; a pause lasts as long as its input is active; a soft stop of a
motion is error 91, of a program 48, which is the one that stays if it stops both.
"""

from __future__ import annotations

from functools import partial
from math import inf, nextafter

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Number
from multidrop.families.lexium.simulator.motion.inputs import GO, JOG_MINUS, JOG_PLUS, PAUSE, RESET, SOFT_STOP
from multidrop.families.lexium.simulator.motion.motor import LexiumMotor
from multidrop.families.lexium.simulator.motion.outputs import Outputs
from multidrop.families.lexium.simulator.power import Power
from multidrop.families.lexium.simulator.state.errors import DriveFault, Event, nothing, when
from multidrop.families.lexium.simulator.state.interpreter import Core

JOGS = (JOG_PLUS, JOG_MINUS)
GO_ADDRESS = Number(1)
RESET_TIME = 0.01
"""s, before the line of SU that follows a reset by an input."""


class EventLoop:
    """The events of one drive, and its parts, which the language is given.

    `calm`: the last line changed nothing that there is to look at. `power_unit` is the supply, `bridges.powered`
    whether the drive has power and is up.
    """

    def __init__(self, core: Core, motor: LexiumMotor, outputs: Outputs, power: Power) -> None:
        self.core, self._timeline, self._printer, self.thread = core, core.timeline, core.printer, core.thread
        self.interpreter, self.motor, self._inputs, self.power_unit = core.interpreter, motor, motor.inputs, power
        self.output_lines, self.bridges = outputs, motor.bridges
        self.calm = False
        self._before: tuple[bool, bool, int] | None = None
        self._next: Event = inf, nothing

    def proceed(self, now: float) -> float | None:
        """Let time pass up to `now`, or to where there is news; return when that is, None for nothing.

        News is a print, the start or end of a program, a loss of power, a restart.
        """
        self._before, self._printer.watched = self._state(), True
        self.advance(now)
        news = self._news()
        self._before, self._printer.watched = None, False
        return self._timeline.now if news else None

    def advance(self, now: float, *, program: bool = False) -> None:
        """Let everything happen that is due up to `now`, in the order of its times.

        `program`: but stop when no program runs any more; the drive's time is then when it ended.
        """
        timeline = self._timeline
        self.calm = False
        while self.bridges.powered or self._comes_up(now):
            if self._news() or not self._run(now, program):
                return
            timeline.now = max(timeline.now, now)
            if not self._look():
                break
        timeline.now = max(timeline.now, now)

    @property
    def deadline(self) -> float | None:
        """When something next happens by itself; None if nothing will."""
        if not self.bridges.powered:
            return self.power_unit.boots_at
        if self._timeline.outdated:
            self._plan()
        due = min(self._next[0], self.thread.next_at if self.thread.live else inf)
        return None if due == inf else max(due, self._timeline.now)

    def quiet(self, now: float, running: bool) -> bool:
        """Return whether nothing changes up to `now`, if it was `running` before. Quick to ask.

        It has power and has printed nothing, nothing happens by itself, and its program has neither begun nor ended.
        """
        if self._timeline.outdated or self._printer.printed or not self.bridges.powered or self._next[0] <= now:
            return False
        thread = self.thread
        return thread.running == running and (not thread.live or thread.next_at > now)

    def _comes_up(self, now: float) -> bool:
        boots_at = self.power_unit.boots_at
        if boots_at is None or boots_at > now:
            return False
        self._timeline.now = max(self._timeline.now, boots_at)
        self.power_unit.come_up()
        return True

    def _run(self, now: float, program: bool) -> bool:
        """Let lines and events take turns up to `now`. Return whether that was reached."""
        timeline = self._timeline
        while not program or self.thread.running:
            if timeline.outdated:
                self._plan()
            at, event = self._next
            self.interpreter.run(nextafter(at, -inf) if at <= now else now)
            if self._news():
                break
            if timeline.outdated:
                continue
            if at > now:
                return True
            timeline.now = max(timeline.now, at)
            timeline.replan()
            event(timeline.now)
            if self._news():
                break
        return False

    def _state(self) -> tuple[bool, bool, int]:
        return self.thread.running, self.bridges.powered, self.power_unit.boots

    def _news(self) -> bool:
        """Return whether `proceed` waits for news, and there is some."""
        return self._before is not None and (bool(self._printer.printed) or self._state() != self._before)

    def _plan(self) -> None:
        """Work out what happens next whatever the program does."""
        self._timeline.outdated = False
        self._look()
        now, trips = self._timeline.now, self.motor.trips
        tripped, bit = trips.next(now)
        wakes_at = inf
        thread = self.thread
        if not thread.paused and (thread.waiting or thread.ending):
            wakes_at = max(self.motor.status.settled_at(), thread.next_at)
        self._next = min(
            (tripped, partial(trips.fire, bit) if bit else nothing),
            self.motor.next(now),
            (wakes_at, thread.wake),
            (self._inputs.next_change(now), nothing),
            key=when,
        )

    def _look(self) -> bool:
        """Act on inputs that have become active or inactive. Return whether any has."""
        inputs, motor, now = self._inputs, self.motor, self._timeline.now
        risen, fallen = inputs.refresh(now)
        motor.look(now)
        if not (risen or fallen):
            return False
        for n, active in (*((n, True) for n in risen), *((n, False) for n in fallen)):
            if active:
                motor.trips.input(n, now)
            kind = inputs.types[n][0]
            motor.input_changed(kind, active, now)
            self._changed(kind, active)
        self._timeline.replan()
        return True

    # Inputs.

    def _changed(self, kind: int, active: bool) -> None:
        thread, motor = self.thread, self.motor
        try:
            if kind in JOGS:
                motor.update_jog()
            elif kind == PAUSE and active and thread.running and not thread.paused:
                motor.pause_program()
            elif kind == PAUSE and not active and thread.paused:
                motor.resume_program()
            elif kind == GO and active and not thread.running:
                self.interpreter.start(GO_ADDRESS, self._timeline.now)
            elif kind == SOFT_STOP and active:
                self._soft_stop()
            elif kind == RESET and active:
                # SU takes a moment to start, or one that sets up such an input would reset the drive in no time.
                self.power_unit.restart()
                if thread.running:
                    thread.next_at = self._timeline.now + RESET_TIME
        except DriveFault as fault:
            self.interpreter.raise_error(fault.code)

    def wired(self, n: int, was: tuple[int, ...]) -> None:
        """Act on an input's new set-up. One that is active already stops or resets; a jog ends with its input.

        Where the level that is active has changed too, the next look at the inputs sees that.
        """
        kind, active = self._inputs.types[n][:2]
        if not self._inputs.watched:
            return
        if kind != was[0] and active == was[1] and self._inputs.active(n) and kind in (SOFT_STOP, RESET):
            self._changed(kind, True)
        if self.motor.jog or kind in JOGS:
            self.motor.update_jog()

    def _soft_stop(self) -> None:
        t, thread, motor = self._timeline.now, self.thread, self.motor
        running, moving = thread.running, motor.status.moving(t)
        if thread.paused or not (running or moving):
            return
        if moving:
            if not motor.torque.halt():
                motor.axis.slow_to(0, t)
            self.core.errors.set(E.MOTION_STOPPED_BY_INPUT)
        if running:
            thread.finish()
            self.core.errors.set(E.PROGRAM_STOPPED_BY_INPUT)
        motor.end_jog()
        self.interpreter.on_error(t)
        self._timeline.replan()
