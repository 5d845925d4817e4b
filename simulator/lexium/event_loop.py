"""The discrete events of a simulated drive, in virtual time.

Theory of operation. `advance(now)` works out the next thing that happens whatever the program does (the end of a
motion, a trip, an input, the end of a hold), lets the interpreter run up to it, lets it happen, and goes on until
`now`. Nothing here reads a clock.
"""

from __future__ import annotations

from functools import partial
from math import inf, nextafter

from multidrop.simulator.lexium.language.input_functions import InputFunctions
from multidrop.simulator.lexium.language.interpreter import Interpreter
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.power import Power
from multidrop.simulator.lexium.state.printer import Printer
from multidrop.simulator.lexium.state.timeline import Event, Timeline, nothing, when


class EventLoop:
    """The events of one drive. `calm`: the last line changed nothing that there is to look at."""

    def __init__(
        self,
        timeline: Timeline,
        printer: Printer,
        power: Power,
        inputs: Inputs,
        motor: Motor,
        interpreter: Interpreter,
        functions: InputFunctions,
    ) -> None:
        self._timeline, self._printer, self._power = timeline, printer, power
        self._inputs, self._motor, self._functions = inputs, motor, functions
        self._interpreter, self._thread = interpreter, interpreter.thread
        self.calm = False
        self._before: tuple[bool, bool, int] | None = None
        self._next: Event = inf, nothing

    def proceed(self, now: float) -> float | None:
        """Let time pass up to `now`, or to where there is news; gives when that is, None for nothing.

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
        while self._power.on or self._comes_up(now):
            if self._news() or not self._run(now, program):
                return
            timeline.now = max(timeline.now, now)
            if not self._look():
                break
        timeline.now = max(timeline.now, now)

    def advance_to_line(self, now: float) -> None:
        """Advance to a typed line: quickly where nothing has happened since the one before."""
        if self.calm and self.quiet(now, self._interpreter.running):
            self._timeline.now = max(self._timeline.now, now)
        else:
            self.advance(now)

    @property
    def deadline(self) -> float | None:
        """When something next happens by itself; None if nothing will."""
        if not self._power.on:
            return self._power.boots_at
        if self._timeline.outdated:
            self._plan()
        due = min(self._next[0], self._thread.due)
        return None if due == inf else max(due, self._timeline.now)

    def quiet(self, now: float, running: bool) -> bool:
        """Whether nothing changes up to `now`, if it was `running` before. Quick to ask.

        It has power and has printed nothing, nothing happens by itself, and its program has neither begun nor ended.
        """
        if self._timeline.outdated or self._printer.pending or not self._power.on or self._next[0] <= now:
            return False
        thread = self._thread
        return thread.running == running and (not thread.live or thread.next_at > now)

    def _comes_up(self, now: float) -> bool:
        """Whether it has booted by now."""
        boots_at = self._power.boots_at
        if boots_at is None or boots_at > now:
            return False
        self._timeline.now = max(self._timeline.now, boots_at)
        self._power.come_up()
        return True

    def _run(self, now: float, program: bool) -> bool:
        """Let lines and events take turns up to `now`. Gives whether that was reached."""
        timeline = self._timeline
        while not program or self._thread.running:
            if timeline.outdated:
                self._plan()
            at, event = self._next
            self._interpreter.run(nextafter(at, -inf) if at <= now else now)
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
        return self._thread.running, self._power.on, self._power.boots

    def _news(self) -> bool:
        """Whether `proceed` waits for news, and there is some."""
        return self._before is not None and (self._printer.pending or self._state() != self._before)

    def _plan(self) -> None:
        """Work out what happens next whatever the program does."""
        self._timeline.outdated = False
        self._look()
        now, trips = self._timeline.now, self._motor.trips
        tripped, bit = trips.next(now)
        self._next = min(
            (tripped, partial(trips.fire, bit) if bit else nothing),
            self._motor.next(now),
            (self._wakes_at(), self._thread.wake),
            (self._inputs.next_change(now), nothing),
            key=when,
        )

    def _wakes_at(self) -> float:
        """When the motion is over for which a hold, or the end of the program, waits."""
        if not self._thread.waits_for_motion:
            return inf
        return max(self._motor.status.settled_at(), self._thread.next_at)

    def _look(self) -> bool:
        """Act on inputs that have become active or inactive. Gives whether any has."""
        inputs, motor, now = self._inputs, self._motor, self._timeline.now
        risen, fallen = inputs.refresh(now)
        motor.look(now)
        motor.look_at_limits()
        if not (risen or fallen):
            return False
        for n, active in (*((n, True) for n in risen), *((n, False) for n in fallen)):
            if active:
                motor.trips.input(n, now)
            kind = inputs.types[n][0]
            motor.input_changed(kind, active, now)
            self._functions.changed(kind, active)
        self._timeline.replan()
        return True
