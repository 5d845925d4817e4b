"""Calls at a time, from a thread of its own: what must not wait for the event loop is called whatever that does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class Pacer:
    """One thread for all owners. What it calls must not block."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._due: dict[object, tuple[float, Callable[[], None]]] = {}
        """The time and the work of each owner."""
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Start the thread, so that nobody waits for that later."""
        with self._changed:
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="pacer", daemon=True)
                self._thread.start()

    def after(self, owner: object, seconds: float, work: Callable[[], None]) -> None:
        """Call `work` so many seconds from now, in place of what this owner has asked for before. From any thread."""
        self.begin()
        with self._changed:
            self._due[owner] = time.monotonic() + seconds, work
            self._changed.notify()

    def _run(self) -> None:
        try:
            while True:
                self._next()()
        finally:  # by a defect of one owner's work, which is reported: that of the others is still due
            with self._changed:
                self._thread = None
            self.begin()

    def _next(self) -> Callable[[], None]:
        """Wait for the next work that is due."""
        with self._changed:
            while True:
                owner, (due, work) = min(self._due.items(), key=lambda each: each[1][0], default=(None, (0.0, None)))
                left = due - time.monotonic()
                if work is None or left > 0:
                    self._changed.wait(None if work is None else left)
                else:
                    del self._due[owner]
                    return work


PACER = Pacer()
"""The thread of this process."""
