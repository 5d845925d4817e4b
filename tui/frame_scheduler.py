"""When a frame is painted: soon after something happened, thirty times a second at most, and at the terminal's pace.

Frames come in beats. One of three paints all; the others paint new records only. Values that change while no record
comes are painted ten times a second: no frame is begun that would show nothing new. While nothing happens, a frame is
painted now and then for the clock and the ages of values.

A frame goes out once the terminal has swallowed the one before. After each frame the terminal is asked for its cursor
position; its reply shows that it has processed the frame. A terminal that never replied, or has ceased to, is not
waited for. Then a frame goes out when the system has taken the one before.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

FRAMES = 30
"""Paints a second, at most."""
PANELS = 3
"""Frames of which one paints all."""
PACE = PANELS / FRAMES
"""Seconds between two paints of all, at least."""
EARLY = 0.005
"""Seconds by which a timer may end early."""
AGEING = 1.0
"""Seconds between two paints while nothing happens."""


class Frames:
    """Decides when to paint.

    `paint(True)` paints all, `paint(False)` new records; it returns whether the terminal takes it. `later` runs a
    function in the app's own queue. `behind` is true while records wait for another paint.
    """

    def __init__(
        self, paint: Callable[[bool], bool], later: Callable[[Callable[[], None]], bool], behind: Callable[[], bool]
    ) -> None:
        self._paint, self._later, self._behind = paint, later, behind
        self._beat = 0
        self._timer: asyncio.TimerHandle | None = None
        """Begins the next frame."""
        self._due = False
        """A frame is in the app's queue."""
        self._panels_owed = False
        """More than records has changed since all was painted."""
        self._painted_at = self._all_at = 0.0
        """When the last frame was painted, and the last one that painted all."""
        self._hurried = False
        """The reply to a typed line was painted early since the last frame."""
        self._owed = False
        """It is to be painted as soon as the terminal takes it."""

    def wake(self, panels: bool = True) -> None:
        """Paint soon: something has happened. `panels`: it may be more than a record."""
        self._panels_owed = self._panels_owed or panels
        skipped = not panels and self._behind()  # records that wait are shown by a later frame: every second is enough
        self._begin_at(self._painted_at + (1 + skipped) / FRAMES)

    def follow(self) -> None:
        """Paint values that have changed, with the next frame that paints all: nothing else has come."""
        self._panels_owed = True
        self._begin_at(self._all_at + PACE)

    def _begin_at(self, when: float) -> None:
        """Begin a frame at a time, unless one is begun before it."""
        loop = asyncio.get_running_loop()
        when = max(when, loop.time())
        if self._due or (self._timer is not None and self._timer.when() <= when):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = loop.call_at(when, self._begin)

    def _begin(self) -> None:
        self._timer, self._due = None, True
        self._later(self._frame)

    def age(self) -> None:
        """Paint what changes by itself, unless a frame was painted just now."""
        if asyncio.get_running_loop().time() - self._painted_at > AGEING / 2:
            self.wake()

    def hurry(self) -> None:
        """Paint the reply to a typed line now, once between two frames."""
        if not self._hurried:
            self._hurried = self._later(self._hurry)

    def ready(self) -> None:
        """Paint what waits for the terminal, which has swallowed the last frame."""
        if self._owed:
            self._hurry()

    def tick(self) -> bool:
        """Paint one beat; return whether the terminal takes it."""
        every = self._beat % PANELS == PANELS - 1
        if not self._paint(every):
            return False
        if every:
            self._all_at = asyncio.get_running_loop().time()
        self._beat += 1
        return True

    def first(self) -> None:
        """Paint all, as the first frame: now, or once the terminal takes it."""
        self._beat = PANELS - 1
        self._hurry()

    def _frame(self) -> None:
        """Paint a frame, and another one until all is painted that has come."""
        self._due = self._hurried = self._owed = False
        now = asyncio.get_running_loop().time()
        if now - self._all_at >= PACE - EARLY:  # the first for a while shows all
            self._beat += (PANELS - 1 - self._beat) % PANELS
        self._painted_at = now
        painted = self.tick()
        if painted and self._beat % PANELS == 0:
            self._panels_owed = False
        if not painted or self._behind():
            self.wake(panels=False)
        elif self._panels_owed:
            self.follow()

    def _hurry(self) -> None:
        self._owed = not self.tick()


REPLY_TIMEOUT = 2.0
"""Seconds to wait for a reply."""
MOST_UNANSWERED = 3
"""Number of missing replies in a row after which none is waited for."""


class TerminalPace:
    """The state of a terminal's replies. `clock` returns seconds; `handed_over` is true once the system took all
    output.
    """

    def __init__(self, clock: Callable[[], float], handed_over: Callable[[], bool]) -> None:
        self._clock, self._handed_over = clock, handed_over
        self._asked_at: float | None = None
        self._last = 0.0
        self._unanswered = 0
        self._answers = False
        """The terminal replies: wait for each reply."""
        self._known = False
        """The terminal has replied at some time."""

    def ready(self) -> bool:
        if not self._handed_over():
            return False
        if self._asked_at is None:
            return True
        if self._answers and self._clock() - self._asked_at < REPLY_TIMEOUT:
            return False
        self._asked_at = None
        self._unanswered += 1
        self._answers = self._answers and self._unanswered < MOST_UNANSWERED
        return True

    def ask(self) -> bool:
        """Return True if the terminal should be asked after the frame that was just written."""
        now = self._clock()
        seldom = self._unanswered >= MOST_UNANSWERED and (not self._known or now - self._last < REPLY_TIMEOUT)
        if self._asked_at is not None or seldom:
            return False
        self._asked_at = self._last = now
        return True

    def answered(self) -> None:
        self._asked_at, self._unanswered = None, 0
        self._answers = self._known = True
