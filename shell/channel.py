"""The channel between a session and its front ends: events out to all subscribers, on one clock."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from datetime import datetime, timedelta

from multidrop.drives.apart import apart
from multidrop.shell.events import Notified, Output, SessionEvent, StateChanged

Callback = Callable[[SessionEvent], None]


class Channel:
    """Publishes events to its subscribers, in the order of subscription. A failing subscriber delays no other."""

    def __init__(self) -> None:
        self._callbacks: tuple[Callback, ...] = ()
        self._apart = apart("a front end")

    def subscribe(self, callback: Callback) -> Callable[[], None]:
        """Call back with every event, from the event loop. The function returned ends the subscription."""
        self._callbacks = (*self._callbacks, callback)

        def leave() -> None:
            if callback in self._callbacks:
                at = self._callbacks.index(callback)
                self._callbacks = self._callbacks[:at] + self._callbacks[at + 1 :]

        return leave

    def publish(self, event: SessionEvent) -> None:
        """Pass an event to every subscriber."""
        for callback in self._callbacks:
            with self._apart:
                callback(event)

    def output(self, text: str, *, columns: bool = False) -> None:
        """Publish a line of a verb's result. `columns`: a screen breaks it between words."""
        self.publish(Output(self.now(), text, columns))

    def notify(self, text: str, *, bus: str = "", warning: bool = False, outcome: bool = False) -> None:
        """Publish a notice for a person. `outcome`: of what was asked for, so that every front end shows it."""
        self.publish(Notified(self.now(), text, bus, warning, outcome))

    def changed(self) -> None:
        """Publish that buses, drives, selection, recording or latch changed."""
        self.publish(StateChanged(self.now()))

    def now(self) -> float:
        """The time on the session's clock, s: the event loop's clock."""
        return asyncio.get_running_loop().time()

    def wall(self, at: float) -> datetime:
        """Convert a session time to the time of day in the local zone."""
        return datetime.now().astimezone() - timedelta(seconds=self.now() - at)
