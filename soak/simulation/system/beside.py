"""The thread of the stop, as a thread that takes turns with the loop's: exactly one of the two runs.

It does the product's own work and may be held up in the middle of it, while the loop's thread goes on. A lock of the
code that both share is a `Lock` here: who finds it taken lets the other go on until it is free.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

LONGEST = 20.0
"""Real seconds in which a turn ends; a longer one is a deadlock of the simulation."""


class Gone(BaseException):
    """The process of this thread is dead: it does nothing more."""


class Beside:
    """A thread that runs while the loop's thread is in `go`, until it rests or ends. It begins with its first turn."""

    def __init__(self, work: Callable[[], None]) -> None:
        self.over = self.runs = False
        self.waits: Lock | None = None
        """The lock that it waits for."""
        self._work, self._gone = work, False
        self._failure: BaseException | None = None
        self._mine, self._theirs = threading.Semaphore(0), threading.Semaphore(0)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def go(self) -> None:
        """Let it run until it rests or ends. In the loop's thread. Raises what ended it."""
        if self.over or self.runs:
            return
        self.runs = True
        self._mine.release()
        assert self._theirs.acquire(timeout=LONGEST), "the stop's thread does not rest"
        self.runs = False
        if self.over:
            self._thread.join()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def rest(self) -> None:
        """Let the loop's thread go on until it gives the next turn. In this thread."""
        self._theirs.release()
        self._mine.acquire()
        if self._gone:
            raise Gone

    def kill(self) -> None:
        """End it where it is."""
        self._gone = True
        self.go()

    def _run(self) -> None:
        self._mine.acquire()
        try:
            if not self._gone:
                self._work()
        except Gone:
            pass
        except BaseException as failure:  # of any kind: `go` raises it
            self._failure = failure
        finally:
            self.over = True
            self._theirs.release()


class Lock:
    """A lock between the loop's thread and the one beside it, which `beside` gives. `defect` takes note of a deadlock.

    A wait that would never end is noted once, and ends: the rest of the story is lived.
    """

    def __init__(self, beside: Callable[[], Beside | None], defect: Callable[[str], None]) -> None:
        self._beside, self._defect = beside, defect
        self._holder: object = None

    def __enter__(self) -> None:
        thread = self._beside()
        me: object = thread if thread is not None and thread.runs else "the loop"
        while self._holder is not None:
            if problem := self._endless(me, thread):
                self._defect(f"deadlock: {problem}")
                break
            assert thread is not None
            if thread.runs:
                thread.waits = self
                thread.rest()
                thread.waits = None
            else:
                thread.go()  # it was held up with the lock
        self._holder = me

    def _endless(self, me: object, thread: Beside | None) -> str:
        """Say why nobody gives the lock back; empty where somebody may."""
        if self._holder is me or thread is None:
            return "a thread waits for a lock that it holds itself"
        if thread.over:
            return "a thread has ended with a lock"
        if not thread.runs and thread.waits is not None:
            return "two threads wait for each other"
        return ""

    def __exit__(self, *_: object) -> None:
        self._holder = None
        thread = self._beside()
        if thread is not None and not thread.runs and thread.waits is self:
            thread.go()
