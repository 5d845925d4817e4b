"""The thread of a running program: which line comes next and when, the stack of subroutines, holds and pauses.

H does not poll: a program that holds for a motion is not alive until the motion is over. A trip or the error handler is
a subroutine that is called between two lines; a hold that it interrupts goes on after its RT.
Manual 5.1.22, 5.1.35, 5.1.50, 5.1.103, 5.1.111, 5.1.112.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.timeline import Timeline

STACK_DEPTH = 10
"""How deep subroutines may be nested (of the maker's older drives; the manual does not say)."""
NORMAL, TRACED, STEPPED, SILENT = 0, 1, 2, 3
"""How a program runs: EX's modes, and SILENT: a stepped one that has not come to its break point yet."""
Resume = Callable[[float], None]


@dataclass
class Frame:
    """Where a subroutine returns to, and the hold that it interrupted: for motion, or until a time. `ending`: it is
    the end of the program that waits for motion.
    """

    back: int
    waiting: bool = False
    hold_until: float = -inf
    ending: bool = False


class Thread:
    """The one program that a drive can run. `next_at` is when line `pc` is due.

    `live`: lines are executed. It is asleep while `paused`, `waiting` (H for motion), `ending` (E after the motion), or
    stepped without a key. `handling` is the depth of the stack in the subroutine of OE, 0 outside.
    """

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self.running = self.paused = self.waiting = self.ending = False
        self.live = False
        self.mode = NORMAL
        self.steps = 0
        self.next_at = inf
        self.pc = 0
        self.stack: list[Frame] = []
        self.handling = 0
        self.stopped_motion: Resume | None = None
        self._hold_until = -inf

    def begin(self, entry: int, t: float, mode: int) -> None:
        self.running, self.paused, self.waiting, self.ending = True, False, False, False
        self.stack.clear()
        self.handling, self._hold_until, self.steps = 0, -inf, 0
        self.stopped_motion = None
        self.pc, self.next_at, self.mode = entry, t, mode
        self.refresh()

    def finish(self) -> None:
        self.running = self.paused = self.waiting = self.ending = False
        self.stack.clear()
        self.handling = 0
        self.next_at = inf
        self.refresh()

    def finish_after_motion(self) -> None:
        self.ending = True
        self.refresh()

    def refresh(self) -> None:
        stepped = self.mode == STEPPED and self.steps <= 0
        self.live = self.running and not (self.paused or self.waiting or self.ending or stepped)
        self._timeline.replan()

    # Time.

    @property
    def due(self) -> float:
        """When the next line is executed; infinite if none will be by itself."""
        return self.next_at if self.live else inf

    @property
    def waits_for_motion(self) -> bool:
        """Return whether a hold, or the end of the program, waits for the end of the motion."""
        return not self.paused and (self.waiting or self.ending)

    def wake(self, t: float) -> None:
        self.waiting = False
        self.next_at = max(self.next_at, t)
        if self.ending:
            self.finish()
        self.refresh()

    def delay(self, until: float) -> None:
        if self.live:
            self.next_at = max(self.next_at, until)

    # Pausing and stepping.

    def pause(self, stopped_motion: Resume | None) -> None:
        """Pause; `stopped_motion` takes up the motion that the pause has stopped, if it has stopped one."""
        self.paused = True
        self.stopped_motion = stopped_motion or self.stopped_motion
        self.refresh()

    def go_on(self, t: float) -> Resume | None:
        """Go on after a pause; return what takes up the motion that the pause has stopped."""
        self.paused = False
        self.next_at = max(self.next_at, t)
        again, self.stopped_motion = self.stopped_motion, None
        self.refresh()
        return again

    def drop_motion(self) -> None:
        """Forget the motion that a pause has stopped: RS does not take it up."""
        self.stopped_motion = None

    @property
    def stepping(self) -> bool:
        """Return whether it waits for the keys of single step."""
        return self.running and self.mode == STEPPED

    def step_from_here(self) -> None:
        """Wait for a key before each line from now on."""
        self.mode, self.steps = STEPPED, 0
        self.refresh()

    # What lines do.

    def hold_for_motion(self) -> None:
        """H: wait until the motion is over."""
        self.waiting = True
        self.refresh()

    def hold(self, seconds: float) -> None:
        """H with a time."""
        self._hold_until = self.next_at = max(self.next_at, self._timeline.now + seconds)

    def call(self, entry: int) -> None:
        """Go on elsewhere until RT. Raises Fault (43)."""
        self.push(Frame(self.pc))
        self.pc = entry

    def give_back(self) -> None:
        """RT. Raises Fault (43) where nothing was called."""
        if not self.stack:
            raise Fault(E.STACK_FULL, fatal=True)
        frame = self.stack.pop()
        if len(self.stack) < self.handling:
            self.handling = 0
        self.pc = frame.back
        if frame.waiting or frame.ending:
            self.waiting, self.ending = frame.waiting, frame.ending
            self.refresh()
        elif frame.hold_until > self.next_at:
            self._hold_until = self.next_at = frame.hold_until

    def interrupt(self, entry: int, t: float) -> None:
        """Call a subroutine before the next line, in the middle of a hold too. Raises Fault (43)."""
        holding = self._hold_until > t
        self.push(Frame(self.pc, self.waiting, self._hold_until if holding else -inf, self.ending))
        if self.waiting or holding or self.ending:
            self.next_at, self._hold_until = t, -inf
        self.waiting = self.ending = False
        self.pc = entry
        self.refresh()

    def push(self, frame: Frame) -> None:
        if len(self.stack) >= STACK_DEPTH:
            raise Fault(E.STACK_FULL, fatal=True)
        self.stack.append(frame)
