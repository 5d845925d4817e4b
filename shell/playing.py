"""A macro that plays: how far it is."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

from multidrop.shell.channel import PROGRESS_PERIOD, Channel
from multidrop.shell.events import Progressed

FOREVER = "forever"
"""The word for rounds without an end."""


@dataclass(eq=False)
class Playing:
    """A macro under way. `times` None: it plays until it is stopped. Steps and rounds count from 1."""

    name: str
    steps: int
    times: int | None = 1
    key: str = ""
    rounds: int = 0
    """The rounds that are done."""
    step: int = 0
    """The step under way; 0 before the first one."""
    progress: StepProgress | None = None
    task: asyncio.Task[object] | None = field(default_factory=asyncio.current_task)
    ended: bool = False
    """Its end was asked for (`/play stop`)."""

    def end(self) -> None:
        """End it as a failure would."""
        self.ended = True
        if self.task is not None:
            self.task.cancel()

    @property
    def round(self) -> int:
        return self.rounds + 1

    @property
    def short(self) -> str:
        """The progress for a narrow place: `F3 2/5`."""
        return f"{self.key or self.name} {self.step}/{self.steps}"

    @property
    def at(self) -> str:
        """The place in the macro: `step 2 of 5, round 2 of 3`."""
        step = f"step {self.step} of {self.steps}" if self.step else "its beginning"
        if self.times == 1:
            return step
        return f"{step}, round {self.round}" + (f" of {self.times}" if self.times else "")


class StepProgress:
    """Shows the step that is under way. The last one of a fast row is shown too: it may last."""

    def __init__(self, channel: Channel, playing: Playing) -> None:
        self._channel = channel
        self._playing = playing
        self._text = ""
        self._shown_at = float("-inf")
        self._timer: asyncio.TimerHandle | None = None

    def begins(self, step: int, line: str) -> None:
        self._playing.step = step
        self._text = f"{self._playing.name}, {self._playing.at}: {line}"
        late = self._shown_at + PROGRESS_PERIOD - self._channel.now()
        if late <= 0:
            self.show()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(late, self.show)

    def show(self) -> None:
        self._cancel()
        if self._text:
            self._shown_at = self._channel.now()
            self._channel.publish(Progressed(self._shown_at, self._text, 0, 1))

    def end(self) -> None:
        """Publish the end, if anything was published."""
        self._cancel()
        if self._shown_at > float("-inf"):
            self._channel.publish(Progressed(self._channel.now(), self._text, 1, 1, 0.0))

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
