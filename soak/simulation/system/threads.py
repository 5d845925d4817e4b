"""The product's threads in the simulation: each goes one step at a time, between two steps of the event loop.

A thread that writes from a queue (`BoundedWriter`) waits for its condition, takes what is there, and writes. Here each
such step is a call of the loop, after a time that the seed draws: a slow disk, or a terminal that nobody reads, is a
step that takes long. Any other thread of the product does one piece of work, and is one step.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from random import Random
from types import SimpleNamespace
from typing import Any

from multidrop.shell import threads
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.process import PROCESS, Process

SLOW = 2.0
"""The longest time of a slow step, s."""


class Scheduler:
    """Takes the steps of simulated threads. `slow`: the probability that a step takes long."""

    def __init__(self, loop: SimulatedLoop, rng: Random, slow: float = 0.0) -> None:
        self._loop, self._rng, self._slow = loop, rng, slow
        self._idents = 0
        self.running: set[Thread] = set()
        """Threads that have not ended."""

    def ident(self) -> int:
        """The number of a new thread."""
        self._idents += 1
        return self._idents

    def later(self, step: Callable[[], None]) -> None:
        """Take a step after a while."""
        long = self._rng.random() < self._slow
        self._loop.call_later(self._rng.random() * (SLOW if long else 0.0005), step)

    def forget(self, process: Process) -> None:
        """End the threads of a dead process."""
        self.running -= {each for each in self.running if each.process is process}

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Put simulated threads and conditions in place of those of `multidrop.shell.threads`."""
        seam: Any = threads
        before = seam.threading
        made = SimpleNamespace(
            Thread=lambda **given: Thread(self, **given), Condition=lambda lock=None: Condition(self), Lock=before.Lock
        )
        seam.threading = made
        try:
            yield
        finally:
            seam.threading = before


class Condition:
    """A condition of threads that never run at the same time."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.waiting: list[Callable[[], None]] = []
        """Steps of threads that wait for it."""

    def __enter__(self) -> None:
        """Nobody else holds it."""

    def __exit__(self, *_: object) -> None:
        """Nobody else waits for it."""

    def notify_all(self) -> None:
        """Wake the threads that wait."""
        waiting, self.waiting = self.waiting, []
        for step in waiting:
            self._scheduler.later(step)

    notify = notify_all

    def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
        """Return what holds now: nothing else runs while somebody waits here."""
        found = predicate()
        assert found or timeout is not None, "a simulated thread waits in the middle of a step"
        return found


class Thread:
    """A thread: a step for each turn of a writer, one step for any other work."""

    def __init__(
        self, scheduler: Scheduler, target: Callable[[], None], name: str = "", daemon: bool = False, args: Any = ()
    ) -> None:
        self.ident: int | None = None
        self.name, self.process = name, PROCESS.get()
        self._scheduler, self._target, self._args = scheduler, target, args

    def start(self) -> None:
        """Begin with the first step."""
        self.ident = self._scheduler.ident()
        self._scheduler.running.add(self)
        self._scheduler.later(self._step)

    def join(self, timeout: float | None = None) -> None:
        """Take the steps that are left, as if they took no time: the caller would wait for them."""
        while self in self._scheduler.running and self._ready():
            self._step()

    def is_alive(self) -> bool:
        """Whether it has not ended."""
        return self in self._scheduler.running

    def _writer(self) -> threads.BoundedWriter | None:
        owner = getattr(self._target, "__self__", None)
        return owner if isinstance(owner, threads.BoundedWriter) else None

    def _ready(self) -> bool:
        writer = self._writer()
        return writer is None or writer.due

    def _step(self) -> None:
        if self not in self._scheduler.running:
            return
        writer = self._writer()
        if writer is None:
            self._scheduler.running.discard(self)
            self._target(*self._args)
        elif not writer.due:
            writer._changed.waiting.append(self._step)  # type: ignore[attr-defined]
        elif writer.turn():
            self._scheduler.later(self._step)
        else:
            self._scheduler.running.discard(self)
