"""The PMX-2ED-SA without its stored programs: axes, inputs and outputs, flash, the watchdog, and their time.

Theory of operation. `settle(now)` goes from event to event: of the axes, of the joystick, of the watchdog. A command is
carried out at its time after everything before it. Nothing here knows a clock or bytes.
"""

from __future__ import annotations

from math import inf

from multidrop.families.pmx.simulator.axis import PmxAxis
from multidrop.families.pmx.simulator.motions import Stick, StraightMove, go
from multidrop.families.pmx.simulator.pulses import JOYSTICK, TIMED_OUT, Doing
from multidrop.families.pmx.simulator.settings import AXES, PmxSettings
from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.world import World

BAUDS = {1: 9600, 2: 19200, 3: 38400, 4: 57600, 5: 115200}
"""By DB (table 6.1)."""
INPUTS = 8
POLARITY_DI, POLARITY_DO = 1 << 10, 1 << 11
PRODUCT, VERSION = "Performax-2ED-SA", "V128BL"
"""The replies to ID and VER of a unit whose cell file gives no other."""
MOST_EVENTS = 100_000
"""Events in one `settle`; more would be an endless loop."""
BOTH = 3


class Watchdog:
    """The time-out watchdog (TOC): `alarms` has a bit for each axis whose alarm is not cleared."""

    def __init__(self, settings: PmxSettings) -> None:
        self._settings = settings
        self._heard_at = 0.0
        self.alarms = 0

    @property
    def due(self) -> float:
        """The time of its alarm; infinite: never."""
        milliseconds = self._settings["TOC"]
        return self._heard_at + milliseconds / 1000 if milliseconds and self.alarms != BOTH else inf

    def look(self, t: float) -> None:
        if self.due <= t:
            self.alarms = BOTH

    def restart(self, now: float) -> None:
        """Begin its time again; an alarm stays."""
        self._heard_at = now

    def power_up(self, now: float) -> None:
        self._heard_at, self.alarms = now, 0

    def clear(self, n: int, t: float) -> None:
        self.alarms &= ~(1 << n)
        if self.alarms != BOTH and self._settings["TOC"]:
            self._heard_at = max(self._heard_at, t)


class PmxController:
    """One controller, without power at first."""

    def __init__(self, number: str, worlds: tuple[World, World], specs: tuple[WorldSpec, WorldSpec]) -> None:
        self.settings: PmxSettings = PmxSettings(number)
        self.worlds = worlds
        self.axes: tuple[PmxAxis, PmxAxis] = (
            PmxAxis("X", self.settings, worlds[0], specs[0]),
            PmxAxis("Y", self.settings, worlds[1], specs[1]),
        )
        self.line = StraightMove(self.axes, self.settings)
        self.sticks = tuple(Stick(axis) for axis in self.axes)
        self.powered: bool = False
        self.supplied: bool = True
        self.incremental: bool = False
        self.enabled: int = 0
        self.outputs: int = 0
        self.watchdog = Watchdog(self.settings)
        self.now = 0.0
        self.baud = BAUDS[1]
        self.product, self.version = PRODUCT, VERSION
        self._due: float | None = None
        """What `deadline` found, until something changes."""

    @property
    def deadline(self) -> float | None:
        """Time of its next event; None if only new input can cause one."""
        if self._due is None:
            self._due = inf
            if self.powered:
                times = [axis.next_event(self.now) for axis in self.axes]
                times += [stick.due for stick in self.sticks if stick.due is not None]
                times += [at for stick in self.sticks if (at := stick.fence(self.now)) > self.now]
                self._due = min(*times, self.watchdog.due)
        return None if self._due == inf else self._due

    def settle(self, now: float) -> None:
        """Live up to `now`, with what happens at that very time."""
        for _ in range(MOST_EVENTS):
            at = self.deadline
            if at is None or at >= now:
                self.now = max(now, self.now)
                self._happen(self.now)
                return
            self.now = max(at, self.now)
            self._happen(self.now)
        raise AssertionError("no end of events")

    def _happen(self, t: float) -> None:
        self.look(t)
        for stick in self.sticks:
            if stick.due is not None and (stick.due <= t or stick.fence(t) <= t):
                stick.steer(self.analog(stick.number + 1, t), t)
        self.watchdog.look(t)
        self._due = None

    def look(self, t: float) -> None:
        """Bring the axes up to date, after a change from outside too."""
        self._due = None
        for axis in self.axes:
            bit = 1 << AXES.index(axis.name)
            axis.polarize(t, self.supplied and self.powered and bool(self.enabled & bit))
            axis.live(t)
        self.line.watch(t)

    def heard(self, now: float) -> None:
        """Restart the watchdog: a host has sent something."""
        self.watchdog.restart(now)
        self._due = None

    def power_off(self, now: float) -> None:
        self.powered = False
        for axis in self.axes:
            axis.abort(now)
        self.look(now)

    def power_up(self, now: float) -> None:
        self.powered, self.now = True, now
        self.settings.power_up()
        self.incremental = False
        self.watchdog.power_up(now)
        self.baud = BAUDS[self.settings["DB"]]
        for axis in self.axes:
            axis.rotor.world.powered_up(now)
            axis.power_up(now)
        for stick in self.sticks:
            stick.switch(bool(self.settings["JO"] >> stick.number & 1), now)
        self.boot_outputs(now)

    def boot_outputs(self, now: float) -> None:
        self.outputs, self.enabled = self.settings["DOBOOT"], self.settings["EOBOOT"]
        self.look(now)

    def supply(self, on: bool, now: float) -> None:
        self.supplied = on
        self.look(now)

    def inputs(self, now: float) -> int:
        """`DI`: a bit is 1 if the input is at ground; with POL's bit 10, if it is not."""
        inverted = bool(self.settings["POLX"] & POLARITY_DI)
        grounded = [any(world.level(n + 1, now) == 0 for world in self.worlds) for n in range(INPUTS)]
        return sum((ground != inverted) << n for n, ground in enumerate(grounded))

    def output_level(self, number: int) -> int:
        """The level at a digital output, from 1 on: 0 if it sinks, 1 if it is pulled up."""
        on = bool(self.outputs >> number - 1 & 1)
        return int(on == bool(self.settings["POLX"] & POLARITY_DO))

    def analog(self, number: int, now: float) -> int:
        """`AI1`, `AI2`: millivolts."""
        return min(self.worlds[number - 1].analog(now), 5000)

    def status(self, axis: PmxAxis, t: float) -> int:
        """`MSTX`, with joystick and time-out."""
        n = AXES.index(axis.name)
        stick = self.sticks[n].due is not None
        return axis.status(t) | stick * JOYSTICK | (self.watchdog.alarms >> n & 1) * TIMED_OUT

    def go(self, axis: PmxAxis, value: int, t: float) -> None:
        """`X1000`: move to a position, or by a distance."""
        go(axis, value + (axis.position(t) if self.incremental else 0), t)

    def go_both(self, values: tuple[int, int], t: float) -> None:
        """`I1000:2000`: move in a straight line."""
        by = [axis.position(t) if self.incremental else 0 for axis in self.axes]
        self.line.begin((values[0] + by[0], values[1] + by[1]), t)

    def stop(self, axis: PmxAxis, t: float) -> None:
        """`STOPX`: decelerate; a line stops as a whole, and the joystick releases the axis."""
        for other in self.line.others(axis):
            self._release(other, t)
            other.stop(t)

    def abort(self, axis: PmxAxis, t: float) -> None:
        """`ABORTX`: stop at once; a line stops as a whole, and the joystick releases the axis."""
        for other in self.line.others(axis):
            self._release(other, t)
            other.abort(t)

    def clear(self, axis: PmxAxis, t: float) -> None:
        """`CLRX`: clear limit and StepNLoop errors and the watchdog's alarm."""
        axis.clear(t)
        self.watchdog.clear(AXES.index(axis.name), t)
        self.look(t)

    def set_joystick(self, mask: int, t: float) -> None:
        """`JO`, `JF`: choose the axes that the joystick steers; StepNLoop is switched off there."""
        self.settings["JO"] = mask
        for axis, stick in zip(self.axes, self.sticks, strict=True):
            on = bool(mask >> stick.number & 1)
            if on == (stick.due is not None):
                continue
            if on:
                self.settings["SL" + axis.name] = 0
                axis.loop.enable(False, t)
            elif axis.pulses.doing is Doing.STICK:
                axis.stop(t)
            stick.switch(on, t)

    def _release(self, axis: PmxAxis, t: float) -> None:
        n = AXES.index(axis.name)
        self.sticks[n].switch(False, t)
        self.settings["JO"] &= ~(1 << n)

    def axis(self, name: str) -> PmxAxis:
        return self.axes[AXES.index(name)]

    def moving(self, axis: str) -> bool:
        """Whether an axis moves: pulses, a homing that goes on, a correction."""
        own = self.axis(axis)
        return own.pulses.profile.moving(self.now) or own.homing is not None

    def troubled(self, axis: str) -> bool:
        """Whether a limit error or a StepNLoop error is latched."""
        own = self.axis(axis)
        return bool(own.trouble or own.loop.error)
