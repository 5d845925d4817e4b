"""Typed lines on their way to the session: in order, each sent when the line before it is answered, as in a paste.

Lines wait in lanes. A line joins the lane of the line before it if no answer can have been read in between. That
holds in three cases. Less than half a second lies between their Enters, or the second Enter had come before the first
was taken (a burst: a paste without brackets, a script at the terminal). Or the line is text for a bus on which a typed
line is not answered yet. Any other line runs at once, whatever else runs. So a person who asks for a position during
`/wait` gets an answer, and lines of one burst never overtake each other.

A line that fails holds the rest of its lane and of its burst: these lines are shown and not sent. A stop drops all
lines that wait. A line is for the drive that was selected at its Enter.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from multidrop.shell.line_syntax import Place, pinned
from multidrop.shell.prompt.line_queue import BURST, EnteredLine
from multidrop.shell.session import Session
from multidrop.tui.panels.view import name_at

MOST_NAMED_LINES = 4
"""Number of lines that a report of unsent lines quotes."""


@dataclass
class Lane:
    """Lines that are sent one after the other."""

    waiting: deque[EnteredLine] = field(default_factory=deque)
    running: EnteredLine | None = None
    failed: str = ""
    """The reason to hold the rest: the line that failed, or another one."""
    held: list[EnteredLine] = field(default_factory=list)
    """Lines that were not sent, and are not reported yet."""
    teller: asyncio.TimerHandle | None = None


class Outbox:
    """The lanes. `warn` shows a line to a person; `watch` awaits a coroutine, and lets its bugs be seen."""

    def __init__(
        self, session: Session, warn: Callable[[str], None], watch: Callable[[Coroutine[Any, Any, None]], object]
    ) -> None:
        self._session, self._warn, self._watch = session, warn, watch
        self._lanes: list[Lane] = []
        self._latest: Lane | None = None
        self._last = 0.0
        self.follows: Callable[[], bool] = lambda: False
        """Whether another Enter has come already."""
        self._followed = False
        """The next Enter had come before the last line was typed."""
        self._unsent: list[EnteredLine] = []
        """The lines that were last reported as not sent."""
        self._paused = self._closed = False
        self.left: list[str] = []
        """The lines that were not sent as the screen ended."""

    @property
    def idle(self) -> bool:
        return not any(lane.running or lane.waiting for lane in self._lanes)

    @property
    def waiting(self) -> int:
        """Number of lines that wait for one before them."""
        return sum(len(lane.waiting) for lane in self._lanes)

    def type(self, text: str) -> None:
        line, now = self._line(text), asyncio.get_running_loop().time()
        if line.leaves(self._session) and not self._closed:
            self._session.start(text, since=line.since)
            return
        burst = self._latest if now - self._last < BURST or self._followed else None
        self._latest = burst or self._talking(line.bus) or self._lane()
        self._last, self._followed = now, self.follows()
        self._add(self._latest, [line])

    def at_once(self, texts: Sequence[str]) -> None:
        """Take lines that wait for no other line, and that no other line's failure holds."""
        self._add(self._lane(), [self._line(text) for text in texts])

    def paste(self, texts: Sequence[str], place: Place | None = None) -> None:
        """Take lines that wait for each other. `place`: the drive that they are for; None: the selected one."""
        lines = [self._line(text, place) for text in texts]
        buses = {line.bus for line in lines if line.bus}
        lane = next(filter(None, map(self._talking, buses)), None) or self._lane()
        self._add(lane, lines)

    def paste_again(self, texts: Sequence[str], place: Place | None = None) -> None:
        """Take lines that were not sent, and that a person agreed to send now."""
        self._unsent = []
        self.paste(texts, place)

    def pause(self) -> None:
        """Start no line that waits for the one before it: a quit is being decided."""
        self._paused = True

    def go_on(self) -> None:
        """Start the lines that have waited for that."""
        self._paused = False
        for lane in [*self._lanes]:
            if lane.running is None and lane.waiting and not lane.failed:
                self._begin(lane)

    def close(self) -> None:
        """Send no line from now on; `left` has those that wait, and those that come."""
        self._closed = True
        for lane in self._lanes:
            self.left += [line.text for line in [*lane.held, *lane.waiting]]
            lane.waiting.clear()
            lane.held.clear()

    def using(self, place: Place) -> bool:
        """True if a `/use` runs that was typed while that drive was selected."""
        running = (lane.running for lane in self._lanes if lane.running is not None)
        return any(line.verb == "/use" and line.place == place for line in running)

    def drop(self) -> None:
        """Drop all lines that wait, after a stop; later lines follow none of them."""
        lanes, self._lanes, self._latest = self._lanes, [], None
        lines = [line for lane in lanes for line in [*lane.held, *lane.waiting]]
        for lane in lanes:
            lane.waiting.clear()
            lane.held.clear()
        if lines:
            self._report("stopped", lines)

    def _line(self, text: str, place: Place | None = None) -> EnteredLine:
        return EnteredLine.entered(text, self._session.stops, self._session.place if place is None else place)

    def _talking(self, bus: str) -> Lane | None:
        return next((lane for lane in self._lanes if bus and lane.running and lane.running.bus == bus), None)

    def _lane(self) -> Lane:
        lane = Lane()
        self._lanes.append(lane)
        return lane

    def _add(self, lane: Lane, lines: Sequence[EnteredLine]) -> None:
        if self._closed:
            self.left += [line.text for line in lines]
            return
        if lane not in self._lanes:
            self._lanes.append(lane)
        lane.waiting.extend(lines)
        if lane.failed:
            self._hold(lane, lane.failed)
        elif lane.running is None and not self._paused:
            self._begin(lane)

    def _begin(self, lane: Lane) -> None:
        """Start the first line that waits in a lane, and then the others in turn."""
        if (task := self._next(lane)) is not None:
            loop = asyncio.get_running_loop()
            loop.call_soon(lambda: self._watch(self._send(lane, task)))  # after the line is written: it costs 60 us

    async def _send(self, lane: Lane, task: asyncio.Task[bool] | None) -> None:
        """Send the lines that wait in a lane; its first line runs already. Raises a defect of a line, which failed."""
        while task is not None:
            await asyncio.wait([task])
            defect = None if task.cancelled() else task.exception()
            done = not task.cancelled() and defect is None and task.result()
            task = self._ended(lane, done)
            if defect is not None:
                raise defect

    def _next(self, lane: Lane) -> asyncio.Task[bool] | None:
        """Start the next line of a lane; None if it may not be sent."""
        line = lane.waiting[0]
        typed = line.sent
        if line.place != self._session.place:
            if line.verb:
                name = name_at(self._session, *line.place) or line.place.address
                self._hold(lane, f"another drive was selected than {':'.join(filter(None, (line.place.bus, name)))}")
                return None
            typed = pinned(line.text, *line.place)
        lane.running = lane.waiting.popleft()
        return self._session.start(typed, since=line.since)

    def _ended(self, lane: Lane, done: bool) -> asyncio.Task[bool] | None:
        """Take the end of the line that ran, and start the next one."""
        line, lane.running = lane.running, None
        if line is not None and not done:
            self._hold(lane, f"'{line.text}' failed")
            return None
        if line is not None and line.verb == "/use":
            now = self._session.place
            lane.waiting = deque(
                replace(each, place=now) if each.place == line.place else each for each in lane.waiting
            )
        if lane.waiting:
            return None if self._paused else self._next(lane)
        if lane in self._lanes:
            self._lanes.remove(lane)
        return None

    def _hold(self, lane: Lane, why: str) -> None:
        """Hold the lines that wait; report them when no more arrive."""
        lane.failed = why
        lane.held += lane.waiting
        lane.waiting.clear()
        if lane.teller is not None:
            lane.teller.cancel()
        lane.teller = asyncio.get_running_loop().call_later(BURST, self._report_held, lane)

    def _report_held(self, lane: Lane) -> None:
        if lane.held:
            self._report(lane.failed, lane.held)
            lane.held = []
        if lane in self._lanes:
            self._lanes.remove(lane)

    def _report(self, why: str, lines: Sequence[EnteredLine]) -> None:
        """Say which lines were not sent, and keep them, so that they can be offered again."""
        self._unsent = list(lines)
        self._warn(f"{why}; {not_sent([line.text for line in lines])}; /unsent offers {them(lines)} again")

    def unsent_lines(self) -> list[str]:
        """The lines that were last reported as not sent, each for the drive that it was typed for."""
        now = self._session.place
        return [
            line.text if line.verb or line.place == now else pinned(line.text, *line.place) for line in self._unsent
        ]


async def ended(task: asyncio.Task[bool]) -> None:
    """Wait for a line; a bug in it ends the app."""
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()


def them(lines: Sequence[object]) -> str:
    return "them" if len(lines) > 1 else "it"


def not_sent(lines: Sequence[str]) -> str:
    """`3 lines were not sent: MR 1 · MR 2 · MR 3`."""
    named = " · ".join(line[:40] for line in lines[:MOST_NAMED_LINES]) + (" …" if len(lines) > MOST_NAMED_LINES else "")
    return f"{len(lines)} lines were not sent: {named}" if len(lines) > 1 else f"not sent: {named}"
