"""A line of the host stepped from deadline to deadline: bytes come at their times, events are kept with theirs."""

from __future__ import annotations

from multidrop.dialects import End
from multidrop.drives.events import Unsolicited
from multidrop.drives.line import EchoFound, Finished, Line, LineEvent, Write


class LineRun:
    """What came of a line up to a time."""

    def __init__(self, line: Line, until: float, answers: dict[float, bytes] | None = None, start: float = 0.0) -> None:
        coming, now = dict(answers or {}), start
        self.seen: list[tuple[float, LineEvent]] = []
        while True:
            self.seen += [(round(now, 4), event) for event in line.events(now)]
            times = [t for t in (line.deadline, *coming) if t is not None]
            if not times or min(times) > until:
                return
            now = max(now, min(times))
            if now in coming:
                line.receive(coming.pop(now), now)

    @property
    def written(self) -> list[tuple[float, bytes]]:
        return [(at, event.data) for at, event in self.seen if isinstance(event, Write)]

    @property
    def ended(self) -> list[tuple[float, str, End, tuple[str, ...]]]:
        """Each request that ended, with its time."""
        return [(at, e.request.text, e.reply.end, e.reply.lines) for at, e in self.seen if isinstance(e, Finished)]

    @property
    def finished(self) -> list[tuple[str, End, tuple[str, ...]]]:
        return [(text, end, lines) for _, text, end, lines in self.ended]

    @property
    def doubts(self) -> list[tuple[str, bool]]:
        """Each request that ended, and whether its reply is doubtful."""
        return [(e.request.address + e.request.text, e.reply.doubtful) for _, e in self.seen if isinstance(e, Finished)]

    @property
    def strays(self) -> list[str]:
        return [text for _, event in self.seen if isinstance(event, Unsolicited) for text in event.lines]

    @property
    def echoes(self) -> int:
        """How often it was found that the adapter repeats what it sends."""
        return sum(isinstance(event, EchoFound) for _, event in self.seen)
