"""The rotor of a simulated motor: where it really is, which the encoder sees, and what keeps it from following.

Theory of operation. The drive commands steps (a `Profile`, the stator); the rotor follows them at a constant distance,
`slip`, unless something is in its way: a wall (`stall_at`) or a hand that holds it (`locked`, or a load of 1 or more),
or unless the motion asks for more torque than its motor has: it is pulled out until the command is at rest or turns
back. Then it stops. What happens once it is free again depends on who drives it: an open loop (AS=0) has lost the
steps, so the rotor follows on from where it is; with hMT (AS=1, 2) the drive knows what is missing and the rotor
catches up, on a profile of its own, until it is where the command is. So the rotor is always on one of three profiles
(following, standing, catching up), and when it changes from one to another is solved, like everything else.

Positions are the axis's motor steps, as the user counts them; `frame` turns them into the world's. A step of the world
is 1/51200 of a turn whatever MS is, and RD turns the axis round. Manual 5.1.18, 5.1.87, 5.1.110, 8.1, 8.3.
"""

from __future__ import annotations

from math import copysign, floor, inf

from multidrop.families.lexium.simulator.state.errors import Event, nothing, when
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.simulator.kinematics import MotionPace, Profile, halt, meeting, move, slew
from multidrop.simulator.world import AFTER, REVOLUTION, TOUCH, World


class WorldFrame:
    """Positions of one axis, turned into the world's and back: for the switches, the wall and the index marks."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._side = 1.0 if (world.stall_at or 0.0) >= 0 else -1.0
        self._rate = 1.0
        self._origin = world.pushed

    @property
    def turn(self) -> float:
        return REVOLUTION / abs(self._rate)

    def orient(self, here: float, steps_per_turn: float, reverse: bool) -> None:
        """MS, SA or RD may have changed: the rotor stays, at `here`, and a step means something else from now on."""
        rate = REVOLUTION / steps_per_turn * (-1 if reverse else 1)
        if rate != self._rate:
            self._origin += (self._rate - rate) * here
            self._rate = rate

    def physical(self, steps: float) -> float:
        """A place in the world's steps."""
        return self._origin + self._rate * steps

    def next_switch(self, profile: Profile, shift: float, t: float) -> float:
        """When a switch of the world next changes because the rotor moves on a profile; infinite: never."""
        if profile.end <= t:
            return inf
        physical = profile if self._rate == 1.0 else profile.scaled(self._rate)
        when = self._world.next_switch(physical, t, self._origin + self._rate * shift)
        if when == inf or (physical is profile and not (self._origin or shift)):
            return when

        def switches(t: float) -> tuple[bool, bool, bool]:
            return self._world.switches(self.physical(profile.position(t) + shift))

        before = switches(t)
        return next((when + later for later in AFTER if switches(when + later) != before), when + AFTER[-1])

    def index_ahead(self, here: float, direction: float, offset: float = 0.0) -> float:
        """The next place beyond `here` that is `offset` (steps of 1/51200 turn) from an index mark."""
        zero = (0.0 - self._origin) / self._rate + offset * self.turn / REVOLUTION
        turns = (here - zero) / self.turn
        return zero + self.turn * (floor(turns + TOUCH) + 1 if direction > 0 else -floor(-turns + TOUCH) - 1)

    def wall(self) -> tuple[float, float] | None:
        """Where the rotor cannot pass, and in which direction that lies."""
        if self._world.stall_at is None:
            return None
        return (self._world.stall_at - self._origin) / self._rate, copysign(1.0, self._side * self._rate)

    def pushed(self, steps: float, here: float) -> float:
        if self._world.stall_at is not None:
            room = (self._world.stall_at - self.physical(here)) * self._side
            steps = steps if steps * self._side <= room else room * self._side
        return steps / self._rate


FOLLOWING, STANDING, CATCHING = "following", "standing", "catching"
WALL, HAND, PULL_OUT = "wall", "hand", "pull-out"
TORQUE_MODE = 3
"""The value of AS with which the torque is commanded, and no motion asks for too much."""
MAKE_UP_VI, MAKE_UP_RATE = 916.0, 16_763_806.0
"""Fixed values of make-up: steps/s, steps/s2 (manual 8.3)."""
SYSTEM_SPEED = 10000.0
"""The fastest that make-up is, steps/s for each microstep: 3000 turns a minute (manual 8.3)."""


class LexiumRotor:
    """One rotor. `closed`: hMT keeps track of it; `command` is the profile that it follows."""

    def __init__(self, core: Core) -> None:
        self.values, self.world, self.frame = core.values, core.world, WorldFrame(core.world)
        self._torque, self._timeline = core.world.torque, core.timeline
        self.command: Profile = halt(0.0, 0.0)
        self.closed = False
        self.state = FOLLOWING
        self.slip = 0.0
        self._own: Profile = self.command
        self._cause = ""
        self._meets = inf
        self._braked = False
        self._seen = core.world.pushed

    # Where it is.

    @property
    def path(self) -> tuple[Profile, float]:
        """The profile that it is on, and what is added to that."""
        return (self.command, -self.slip) if self.state == FOLLOWING else (self._own, 0.0)

    def position(self, t: float) -> float:
        """The axis's steps."""
        return self.command.position(t) - self.slip if self.state == FOLLOWING else self._own.position(t)

    def velocity(self, t: float) -> float:
        """Signed, steps/s."""
        return self.path[0].velocity(t)

    def lag(self, t: float) -> float:
        """How far the command is ahead of it, with a sign; 0 while it follows."""
        return 0.0 if self.state == FOLLOWING else self.command.position(t) - self.slip - self.position(t)

    def field_lag(self, t: float) -> float:
        """How far it lags its field while it follows, as the torque on it makes it; only an encoder sees that."""
        if self.state != FOLLOWING or self.values.get("AS") == TORQUE_MODE:
            return 0.0
        return self._torque.lag(self.command, t, self._current, self.frame.turn)

    def physical(self, t: float) -> float:
        """The world's steps."""
        return self.frame.physical(self.position(t))

    def next_switch(self, t: float) -> float:
        """When a switch of the world next changes because the rotor moves; infinite if none does."""
        return self.frame.next_switch(*self.path, t)

    def holds(self, direction: float) -> bool:
        """Return whether it is at rest and cannot turn in a direction."""
        if self.state != STANDING:
            return False
        wall = self.frame.wall()
        return self._cause == HAND or (wall is not None and wall[1] == direction)

    # What changes it.

    def orient(self, t: float, steps_per_turn: float, reverse: bool) -> None:
        self.frame.orient(self.position(t), steps_per_turn, reverse)

    def follow(self, command: Profile, t: float) -> None:
        """Follow another command, which begins where the one before is at that time."""
        self._braked = self._braked and not command.moving(t)
        if self.state == CATCHING:
            here, now = self._own.position(t), self._own.velocity(t)
            self.command = command
            self._catch(here, now, t)
        else:
            self.command = command

    def jump(self, command: Profile, t: float) -> None:
        """Jump with the command by a few steps, as far as the wall, or away from it."""
        wall, steps = self.frame.wall(), command.position(t) - self.command.position(t)
        place, direction = wall or (0.0, 0.0)
        away = self.state == STANDING and self._cause == WALL and steps * direction < 0
        if away and not self.closed:
            self.leave(t)
        self.follow(command, t)
        if away and self.closed and (command.position(t) - self.slip - place) * direction <= TOUCH:
            self.leave(t)
        if self.state == FOLLOWING and (self.position(t) - place) * direction > TOUCH:
            self._stand(WALL, t)

    def release(self, t: float) -> None:
        """Forget lead and lag: follow again from here."""
        here = self.position(t)
        self.slip = self.command.position(t) - here
        if self.state == CATCHING:
            self.state = FOLLOWING

    @property
    def pushed(self) -> bool:
        return self.world.pushed != self._seen

    def look(self, t: float, driven: bool, coasts: bool = False) -> bool:
        """See whether hands have pushed it, taken hold of it or released it. Return whether it was pushed.

        `coasts`: no current turns it, while the command may go on.
        """
        steps, self._seen = self.world.pushed - self._seen, self.world.pushed
        if steps:
            self._push(self.frame.pushed(steps, self.position(t)), t, driven)
        locked = coasts or self.world.locked(t)
        if locked != (self._cause == HAND):
            self._timeline.replan()
            if locked:
                self._stand(HAND, t)
            else:
                self.leave(t)
        return bool(steps)

    def leave(self, t: float) -> None:
        """Nothing holds it up any more."""
        here = self._own.position(t)
        self._cause = ""
        if self.closed and abs(self.lag(t)) > TOUCH:
            self._catch(here, 0.0, t)
        else:
            self.slip = self.command.position(t) - here
            self.state = FOLLOWING

    def next(self, t: float) -> Event:
        """When it next goes over to another profile, and what does that."""
        pulled = inf
        if self.state == FOLLOWING and self.values.get("AS") != TORQUE_MODE:
            pulled = self._torque.fails_at(self.command, t, self._current, self.frame.turn)
        return min(
            self._hit(t),
            self._free(t),
            (pulled, lambda at: self._stand(PULL_OUT, at)),
            (self.world.next_lock(t), nothing),
            key=when,
        )

    def caught_up_at(self) -> float:
        """When it will be where the command is; infinite while it rests in lag, or while that is unknown."""
        return -inf if self.state == FOLLOWING else self._meets if self.state == CATCHING else inf

    def _push(self, steps: float, t: float, driven: bool) -> None:
        here = self.position(t) + steps
        if self.state == STANDING:
            self._own = halt(t, here)
            self._cause = self._cause if self._cause in (HAND, PULL_OUT) else ""
            if not self._cause:
                self.leave(t)
        elif self.closed and driven:
            self._disturbed(t)
            self._catch(here, self.velocity(t) if self.state == CATCHING else 0.0, t)
        else:
            self.slip -= steps

    def _hit(self, t: float) -> Event:
        wall = self.frame.wall()
        if wall is None or self.state == STANDING:
            return inf, nothing
        place, direction = wall
        profile, shift = self.path
        if (profile.position(t) + shift - place) * direction > -TOUCH:
            when = profile.turning(direction, t)
        else:
            when = profile.crossing(place - shift, t, direction)
        return when, lambda at: self._stand(WALL, at)

    @property
    def _current(self) -> float:
        return float(self.values["RC"]) / 100

    def _stand(self, cause: str, t: float) -> None:
        here = self.position(t)
        wall = self.frame.wall()
        self._disturbed(t)
        if cause == WALL and wall is not None:
            here = wall[0]
        self._own, self.state, self._cause = halt(t, here), STANDING, cause

    def _disturbed(self, t: float) -> None:
        """What is lost while the command slows down is made up slowly (manual 8.3)."""
        if self.state == FOLLOWING:
            self._braked = self.command.velocity(t) * self.command.acceleration(t) < 0

    def _free(self, t: float) -> Event:
        if self.state == CATCHING:
            return self._meets, self._caught
        if self._cause == PULL_OUT:
            return self._in_step_at(t), self.leave
        wall = self.frame.wall()
        if self._cause != WALL or wall is None:
            return inf, nothing
        place, direction = wall
        if self.closed and (self.command.position(t) - self.slip - place) * direction > TOUCH:
            return self.command.crossing(place + self.slip, t, -direction), self.leave
        return self.command.turning(-direction, t), self.leave

    def _in_step_at(self, t: float) -> float:
        """When a rotor that was pulled out turns again; with hMT once the current is enough for the load."""
        command = self.command
        if self.closed and not self._torque.starts(self._current):
            return inf
        if not command.moving(t):
            return t
        return min(command.turning(-command.direction(t), t), command.end)

    def _catch(self, here: float, velocity: float, t: float) -> None:
        """Make up what is missing, as MU says (8.3): to the target, or after a command that leads away from it."""
        command = self.command
        if command.end < inf and command.velocity(t) * (command.target - command.position(t)) >= 0:
            top = self._make_up_speed(float(self.values["VM"]) if command.end > t else 0.0)
            pace = MotionPace(MAKE_UP_VI, top, MAKE_UP_RATE, MAKE_UP_RATE)
            self._own = move(t, here, velocity, command.target - self.slip, pace)
        else:
            speed = float(self.values["VM"]) if command.end < inf else abs(command.segments[-1].velocity)
            direction = copysign(1.0, command.position(t) - self.slip - here)
            pace = MotionPace(MAKE_UP_VI, self._make_up_speed(speed), MAKE_UP_RATE, MAKE_UP_RATE)
            self._own = slew(t, here, velocity, direction * pace.vm, pace)
        self.state, self._cause = CATCHING, ""
        met = meeting(self._own, command, -self.slip, t)
        self._meets = self._own.end if met == inf else met

    def _make_up_speed(self, speed: float) -> float:
        """How fast MU lets it be, beside a command of that speed."""
        mode, fastest = self.values.get("MU", 0), SYSTEM_SPEED * self.values["MS"]
        if mode == 0:
            return float(self.values["VI"]) if self._braked else max(speed, float(self.values["VM"]))
        return fastest if mode == 2 else min(max(2 * speed, float(self.values["MF"])), fastest)

    def _caught(self, t: float) -> None:
        self.state, self._meets = FOLLOWING, inf
