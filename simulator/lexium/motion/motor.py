"""Everything that has a hand in a simulated drive's motion, put together: what it sees, and what happens next.

The axis moves, the rotor follows; homing, limits, encoder, hMT, heat and the clock inputs watch both and command the
axis in turn. The device asks `next` what happens next and lets it happen; `look` is for what has changed from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING

from simulator.lexium.motion.axis import HOMING, Axis
from simulator.lexium.motion.encoder import Encoder
from simulator.lexium.motion.heat import Heat
from simulator.lexium.motion.hmt import TEST, TORQUE_MODE, Hmt
from simulator.lexium.motion.homing import Homing
from simulator.lexium.motion.limits import Limits
from simulator.lexium.state.models import STEP_DIRECTION, UP_DOWN

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice
    from simulator.lexium.motion.rotor import Event

BUSY, CALIBRATING = 85, 88
_TURNS = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (1, 0): 3}
"""The four states of A and B in the order that counts up."""
CRLF = "\r\n"


class Motor:
    """The motor of one drive with all that minds it."""

    axis: Axis
    homing: Homing
    limits: Limits
    encoder: Encoder
    hmt: Hmt
    heat: Heat

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self.axis = device.axis
        self.homing = Homing(device)
        self.limits = Limits(device)
        self.encoder = Encoder(device)
        self.hmt = Hmt(device)
        self.heat = Heat(device)
        self._clock = (1, 1)
        self._part = 0.0
        self.axis.busy = lambda: bool(self.homing.phase)
        self.axis.locked = lambda: self.hmt.locked
        self.axis.refuse = self.refuse
        self.axis.begun = self._begun

    def refuse(self, t: float, way: float) -> int:
        """What forbids a motion in a direction, or 0."""
        if self.hmt.calibrating or (self.axis.kind == TEST and self.axis.profile.moving(t)):
            return CALIBRATING
        return BUSY if self.hmt.mode == TORQUE_MODE else self.limits.refuse(t, way)

    def next(self, t: float) -> Event:
        """What happens next."""
        axis = self.axis
        return min(
            self.limits.next(t),
            axis.rotor.next(t),
            self.hmt.next(t),
            (axis.profile.end if axis.arriving else inf, self._arrive),
            (self.homing.mark_at(t), self.homing.pass_mark),
            (inf if axis.mark is None else axis.mark, self._pass_mark),
            self.encoder.next(t),
            self.heat.next(t),
            key=lambda each: each[0],
        )

    def look(self, t: float) -> None:
        """See what hands, loads and clocks have done."""
        was = self.axis.place(t)
        driven = bool(self.device.memory.values["DE"])
        pushed = self.axis.rotor.look(t, driven, not driven and self.device.model.disabled_moves)
        if pushed:
            self.device.trips.jumped(was, self.axis.place(t), t)
            self.hmt.pushed()
            self.encoder.look(t)
            self.device.stale = True
        self.hmt.look(t)
        self.heat.look(t)
        self._follow_clock(t)

    def stop(self, t: float) -> None:
        """Stand at once, whatever it was doing."""
        self.homing.cancel()
        self.axis.stop(t)
        self.encoder.begin()
        self.device.jogging = 0  # letting go of the jog input then stops nothing that was begun since

    def pause(self, t: float) -> Callable[[float], None]:
        """Slow down and stop; what is given takes up the same motion again."""
        if self.hmt.halt():
            return self.hmt.go_on
        homing = self.homing.again()
        if homing is None:
            return self.axis.pause(t)
        self.axis.slow_to(0, t)
        return homing

    def slew(self, velocity: int, t: float) -> None:
        """SL; 0 stops torque mode too."""
        if velocity or not self.hmt.halt():
            self.axis.slew(velocity, t)

    def slow_down(self, t: float) -> None:
        """Slow down and stop, whatever it was doing."""
        self.homing.cancel()
        self.axis.slow_to(0, t)

    def enable(self, on: int, t: float) -> None:
        """DE."""
        was, self.device.memory.values["DE"] = self.device.memory.values["DE"], on
        if not on:
            self.stop(t)
            self.hmt.disable()
        elif not was:
            self.axis.align(t)
        self.tune()
        self.device.stale = True

    def tune(self) -> None:
        """AS, DE, LR or the supply may have changed: where the loop opens or closes, lead and lag are forgotten."""
        rotor, closed = self.axis.rotor, self.hmt.closed
        if rotor.closed != closed:
            rotor.closed = closed
            rotor.let_go(self.device.now)

    def restart(self, t: float) -> None:
        """Power-up or reset."""
        self.homing.cancel()
        self.encoder.restart()
        self.hmt.restart()
        self.axis.restart(t)
        self.tune()

    def _begun(self) -> None:
        """A motion has begun, which is the end of what another kind of motion was about."""
        self.encoder.begin()
        if self.axis.kind != HOMING:
            self.homing.cancel()

    def _arrive(self, t: float) -> None:
        self.encoder.arrive(t)
        self.hmt.arrive(t)
        self.limits.turn_back(t)
        if self.axis.arrive(t):
            self.device.emit(self.device.name + CRLF)
        if self.homing.phase:
            self.homing.arrive(t)

    def _pass_mark(self, t: float) -> None:
        if self.axis.pass_mark():
            self.device.emit(self.device.name + CRLF)

    def _follow_clock(self, t: float) -> None:
        """FL or CM: one step for each pulse, or each edge of a quadrature, times CR (manual 5.1.46; 5-13, 5-14)."""
        values, inputs = self.device.memory.values, self.device.inputs
        clocks, points = inputs.points.clocks, inputs.points
        kind = points.clock_types.get(inputs.types[clocks[0]][0]) if clocks else None
        if kind is None:
            return
        was, now = self._clock, tuple(int(inputs.level(n) == inputs.types[n][1]) for n in clocks)
        self._clock = (now[0], now[1])
        if not values.get(points.follow) or was == now:
            return
        self._part += _pulses(kind, was, self._clock) * values.get("CR", 1)
        steps = int(self._part)
        self._part -= steps
        if steps and not self.hmt.calibrating and self.hmt.mode != TORQUE_MODE and not self.limits.bars(t, steps):
            self._step(steps, t)

    def _step(self, steps: int, t: float) -> None:
        """A jump of the command, which nothing could see coming: look at what it has led to."""
        before = self.axis.place(t)
        self.axis.step(steps, t)
        self.device.stale = True
        self.device.trips.jumped(before, self.axis.place(t), t)
        self.encoder.look(t)


def _pulses(kind: str, was: tuple[int, int], now: tuple[int, int]) -> int:
    """What a clock has counted between two states of its inputs, with a sign."""
    rises = [int(new and not old) for old, new in zip(was, now, strict=True)]
    if kind == STEP_DIRECTION:
        return rises[0] * (1 if now[1] else -1)
    if kind == UP_DOWN:
        return rises[0] - rises[1]
    steps = (_TURNS[now] - _TURNS[was] + 1) % 4 - 1
    return 0 if steps == 2 else steps
