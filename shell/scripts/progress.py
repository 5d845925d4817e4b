"""The progress of a macro: macro, step, round and line, published for every front end a few times a second."""

from __future__ import annotations

import asyncio

from multidrop.shell.channel import Channel
from multidrop.shell.events import Progressed
from multidrop.shell.jobs import PERIOD
from multidrop.shell.playing import Playing


class StepProgress:
    """Shows the step that is under way. The last one of a fast row is shown too: it may last."""

    def __init__(self, channel: Channel, playing: Playing) -> None:
        self._channel = channel
        self._playing = playing
        self._text = ""
        self._shown_at = float("-inf")
        self._timer: asyncio.TimerHandle | None = None

    def begins(self, step: int, line: str) -> None:
        """Take the beginning of a step."""
        self._playing.step = step
        self._text = f"{self._playing.name}, {self._playing.at}: {line}"
        late = self._shown_at + PERIOD - self._channel.now()
        if late <= 0:
            self.show()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(late, self.show)

    def show(self) -> None:
        """Publish it now."""
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
