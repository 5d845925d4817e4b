"""Typed lines on their way to the session: in their order, each when the one before it was answered, as in a paste.

Lines wait in lanes. A line joins the lane of the line before it where nobody can have seen an answer in between: where
less than half a second lies between their Enters (a burst: a paste without brackets, a script at the terminal), or
where it is text for a bus on which a typed line is not answered yet. Any other line runs at once, whatever else still
runs. So a person who asks for a position while `/wait` goes on is answered, and lines that came in one go never
overtake each other.

A line that fails holds the rest of its lane, and what still comes of its burst: shown, and not sent. A stop drops
everything that waits. A line is for the drive that was selected as its Enter came.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dialects import Diagnostic
from shell.lines import DriveLine, VerbLine, parse, pinned
from tui.session_view import Place, SessionView, selected_place

BURST = 0.5
"""Seconds between two Enters below which no person has typed the second line in the knowledge of the first."""
NAMED = 4
"""Lines that are named of those that were not sent."""


@dataclass(frozen=True)
class Line:
    """A line, the count of stops and the selected drive as its Enter came."""

    text: str
    since: int
    place: Place
    parsed: DriveLine | VerbLine | None

    @property
    def bus(self) -> str:
        """The bus that it is text for; empty for a verb."""
        return (self.parsed.bus or self.place.bus) if isinstance(self.parsed, DriveLine) else ""

    @property
    def verb(self) -> str:
        """The verb's name; empty for text."""
        return self.parsed.name if isinstance(self.parsed, VerbLine) else ""


@dataclass
class Lane:
    """Lines that are sent one after the other."""

    waiting: deque[Line] = field(default_factory=deque)
    running: Line | None = None
    failed: str = ""
    """The line that failed, or what else holds the rest."""
    held: list[str] = field(default_factory=list)
    """Lines that were not sent, and of which nothing was said yet."""
    teller: asyncio.TimerHandle | None = None


class Outbox:
    """The lanes. `tell` shows a line to a person; `watch` awaits what it is given, and lets its bugs be seen."""

    def __init__(
        self, session: SessionView, tell: Callable[[str], None], watch: Callable[[Coroutine[Any, Any, None]], object]
    ) -> None:
        self._session, self._tell, self._watch = session, tell, watch
        self._lanes: list[Lane] = []
        self._latest: Lane | None = None
        self._last = 0.0

    @property
    def idle(self) -> bool:
        """Whether no line runs or waits."""
        return not any(lane.running or lane.waiting for lane in self._lanes)

    @property
    def waiting(self) -> int:
        """Lines that wait for one before them."""
        return sum(len(lane.waiting) for lane in self._lanes)

    def type(self, text: str) -> None:
        """A person pressed Enter on a line."""
        line, now = self._line(text), asyncio.get_running_loop().time()
        if line.verb == "/quit":
            self._session.start(text, since=line.since)
            return
        burst = self._latest if now - self._last < BURST else None
        self._latest = burst or self._talking(line.bus) or self._lane()
        self._last = now
        self._add(self._latest, [line])

    def paste(self, texts: Sequence[str]) -> None:
        """A person agreed to send several lines."""
        lines = [self._line(text) for text in texts]
        buses = {line.bus for line in lines if line.bus}
        lane = next(filter(None, map(self._talking, buses)), None) or self._lane()
        self._add(lane, lines)

    def using(self, place: Place) -> bool:
        """Whether a `/use` that was typed while that drive was selected is being done."""
        running = (lane.running for lane in self._lanes if lane.running is not None)
        return any(line.verb == "/use" and line.place == place for line in running)

    def drop(self) -> None:
        """A stop came: nothing that waits is sent, and what comes now follows nothing."""
        lanes, self._lanes, self._latest = self._lanes, [], None
        lines = [text for lane in lanes for text in [*lane.held, *(line.text for line in lane.waiting)]]
        for lane in lanes:
            lane.waiting.clear()
            lane.held.clear()
        if lines:
            self._tell(f"stopped; {not_sent(lines)}")

    def _line(self, text: str) -> Line:
        try:
            parsed = parse(text)
        except Diagnostic:
            parsed = None  # the session says what is wrong with it
        return Line(text, self._session.stops, selected_place(self._session), parsed)

    def _talking(self, bus: str) -> Lane | None:
        """The lane in which a typed line for that bus waits for its answer."""
        return next((lane for lane in self._lanes if bus and lane.running and lane.running.bus == bus), None)

    def _lane(self) -> Lane:
        lane = Lane()
        self._lanes.append(lane)
        return lane

    def _add(self, lane: Lane, lines: Sequence[Line]) -> None:
        if lane not in self._lanes:
            self._lanes.append(lane)
        lane.waiting.extend(lines)
        if lane.failed:
            self._hold(lane, lane.failed)
        elif lane.running is None and (task := self._next(lane)) is not None:
            self._watch(self._send(lane, task))

    async def _send(self, lane: Lane, task: asyncio.Task[bool] | None) -> None:
        """Send what waits in a lane, of which a line runs already."""
        while task is not None:
            await asyncio.wait([task])
            task = self._ended(lane, done=not task.cancelled() and task.result())

    def _next(self, lane: Lane) -> asyncio.Task[bool] | None:
        """Begin with the next line of a lane; None where it may not be sent."""
        line = lane.waiting[0]
        text = line.text
        if line.place != selected_place(self._session):
            if line.verb:
                self._hold(lane, f"another drive was selected than {':'.join(filter(None, line.place))}")
                return None
            text = pinned(line.text, *line.place)
        lane.running = lane.waiting.popleft()
        return self._session.start(text, since=line.since)

    def _ended(self, lane: Lane, done: bool) -> asyncio.Task[bool] | None:
        """The line that ran has ended; the next one begins."""
        line, lane.running = lane.running, None
        if line is not None and not done:
            self._hold(lane, f"'{line.text}' failed")
            return None
        if line is not None and line.verb == "/use":
            self._follow(lane, line.place)
        if lane.waiting:
            return self._next(lane)
        if lane in self._lanes:
            self._lanes.remove(lane)
        return None

    def _follow(self, lane: Lane, before: Place) -> None:
        """The lines behind a `/use` are for what it selected."""
        now = selected_place(self._session)
        lane.waiting = deque(replace(each, place=now) if each.place == before else each for each in lane.waiting)

    def _hold(self, lane: Lane, why: str) -> None:
        """Keep what waits from being sent; it is told when no more comes."""
        lane.failed = why
        lane.held += [line.text for line in lane.waiting]
        lane.waiting.clear()
        if lane.teller is not None:
            lane.teller.cancel()
        lane.teller = asyncio.get_running_loop().call_later(BURST, self._tell_held, lane)

    def _tell_held(self, lane: Lane) -> None:
        if lane.held:
            self._tell(f"{lane.failed}; {not_sent(lane.held)}")
            lane.held = []
        if lane in self._lanes:
            self._lanes.remove(lane)


def not_sent(lines: Sequence[str]) -> str:
    """`3 lines were not sent: MR 1 · MR 2 · MR 3`."""
    named = " · ".join(line[:40] for line in lines[:NAMED]) + (" …" if len(lines) > NAMED else "")
    return f"{len(lines)} lines were not sent: {named}" if len(lines) > 1 else f"not sent: {named}"
