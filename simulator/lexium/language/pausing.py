"""PS and RS: the program and its motion pause, and go on (manual 5.1.103, 5.1.112)."""

from __future__ import annotations

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.language.thread import Thread
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.timeline import Timeline


class Pausing:
    """The pause of one drive."""

    def __init__(self, timeline: Timeline, thread: Thread, motor: Motor) -> None:
        self._timeline, self._thread, self._motor = timeline, thread, motor

    def pause(self) -> None:
        """PS: the motion slows down and stops too. Raises Fault (40)."""
        thread, t = self._thread, self._timeline.now
        if not thread.running:
            raise Fault(E.NO_PROGRAM_RUNNING)
        if not thread.paused and self._motor.status.moving(t):
            thread.stopped_motion = self._motor.pause(t)
        thread.pause()

    def resume(self) -> None:
        """RS. Raises Fault (40, 41, and the motion's own where it may not begin again)."""
        thread, t = self._thread, self._timeline.now
        if not thread.paused:
            raise Fault(E.PROGRAM_RUNNING if thread.running else E.NO_PROGRAM_RUNNING)
        again = thread.go_on(t)
        if again is not None:
            again(t)
