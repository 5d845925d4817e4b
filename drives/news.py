"""The events of a link on their way to its watchers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from multidrop.drives.apart import apart
from multidrop.drives.events import BusEvent

Watcher = Callable[[BusEvent], None]


class News:
    """Publishes events in their order. A watcher that fails affects neither the others nor the caller."""

    def __init__(self, name: str) -> None:
        self.held = False
        """`publish` only collects events; the one who holds them calls `tell`."""
        self._events: deque[BusEvent] = deque()
        self._watchers: tuple[Watcher, ...] = ()
        self._telling = False
        self._apart = apart(f"a watcher of {name}")

    def watch(self, watcher: Watcher) -> Callable[[], None]:
        """Publish everything to `watcher` from now on; the function returned ends that."""
        self._watchers = (*self._watchers, watcher)
        return lambda: self._forget(watcher)

    def _forget(self, watcher: Watcher) -> None:
        if watcher in self._watchers:
            at = self._watchers.index(watcher)
            self._watchers = self._watchers[:at] + self._watchers[at + 1 :]

    def collect(self, event: BusEvent) -> None:
        """Add an event; `tell` publishes it."""
        self._events.append(event)

    def publish(self, event: BusEvent) -> None:
        """Publish an event, after those before it."""
        self._events.append(event)
        if not self.held:
            self.tell()

    def tell(self) -> None:
        """Publish what was collected; called by a watcher, it leaves that to the call under way."""
        if self._telling:
            return
        self._telling = True
        try:
            while self._events:
                event = self._events.popleft()
                for watcher in self._watchers:
                    with self._apart:
                        watcher(event)
        finally:
            self._telling = False
