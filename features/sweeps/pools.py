"""Pools of processes that run the chunks of a sweep.

They are forked with all that this process has read; where it has threads, a server of processes forks them.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection
from multiprocessing.context import BaseContext
from typing import ParamSpec, TypeVar

from multidrop.base.files import why
from multidrop.features.sweeps import trial
from multidrop.features.sweeps.trial import DIED, Case, TrialJob, TrialResult
from multidrop.shell.signals import FROM_TERMINAL, SIGNALS, Interruption
from multidrop.shell.streams.stdout import WATCHER

CHUNKS_AHEAD = 3
"""Chunks for each process that are submitted and not done."""
Run = Callable[[TrialJob, Sequence[Case]], list[TrialResult]]
P = ParamSpec("P")
T = TypeVar("T")


class Pools:
    """Pools of processes, one after the other: one in which a process dies is at its end."""

    def __init__(
        self,
        job: TrialJob,
        jobs: int,
        interruption: Interruption,
        run: Run,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        """`say` takes one line for a person where no process can begin."""
        self._job, self._jobs, self._interruption, self._run, self._say = job, jobs, interruption, run, say
        self._context = _context()
        self._suspects: list[Case] = []
        """The cases that the end of a pool cut off: one of them was the cause."""
        self._rests: list[list[Case]] = []
        """The rests of chunks that took long."""
        self._possible = True
        """Whether processes can begin at all; otherwise this one runs the cases."""

    def results(self, todo: Iterator[list[Case]]) -> Iterator[list[TrialResult]]:
        if not self._can_begin():
            for case in (case for cases in todo for case in cases):
                yield self._here(case)
            return
        yield from self._in_a_pool(todo)
        while self._suspects:
            suspects, self._suspects = self._suspects, []
            for case in suspects:
                yield self._alone(case) if self._possible else self._here(case)
            if self._possible:
                yield from self._in_a_pool(todo)
        for case in (case for cases in (*self._rests, *todo) for case in cases):
            yield self._here(case)

    def _can_begin(self) -> bool:
        """Whether this system has what processes share: semaphores, which need /dev/shm on Linux."""
        try:
            ProcessPoolExecutor(1, mp_context=self._context).shutdown()
        except (OSError, ImportError, NotImplementedError) as problem:
            self._impossible(why(problem) if isinstance(problem, OSError) else str(problem))
        return self._possible

    def _impossible(self, reason: str) -> None:
        self._possible = False
        self._say(f"no other process can be started ({reason}), so all cases run in this one, which takes longer")

    def _in_a_pool(self, todo: Iterator[list[Case]]) -> Iterator[list[TrialResult]]:
        running: dict[Future[list[TrialResult]], list[Case]] = {}
        with self._pool(self._jobs) as pool:
            self._submit(pool, todo, running)
            while running:
                for future in self._done(running):
                    cases = running.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        self._suspects += cases
                    else:
                        results = future.result()
                        self._rests += [cases[len(results) :]] if len(results) < len(cases) else []
                        yield results
                if self._interruption.came:
                    raise KeyboardInterrupt
                self._submit(pool, todo, running)

    def _submit(
        self,
        pool: ProcessPoolExecutor,
        todo: Iterator[list[Case]],
        running: dict[Future[list[TrialResult]], list[Case]],
    ) -> None:
        while len(running) < self._jobs * CHUNKS_AHEAD and not self._suspects:
            cases = self._rests.pop() if self._rests else next(todo, None)
            if cases is None:
                return
            try:
                with _signals_blocked():
                    running[pool.submit(self._run, self._job, cases)] = cases
            except (BrokenProcessPool, OSError):  # OSError: too many processes, or no memory for one more
                self._suspects += cases

    def _done(self, running: Iterable[Future[list[TrialResult]]]) -> set[Future[list[TrialResult]]]:
        try:
            with self._interruption.open():
                return wait(running, return_when=FIRST_COMPLETED).done
        except KeyboardInterrupt:
            return {future for future in running if future.done()}

    def _alone(self, case: Case) -> list[TrialResult]:
        """Run a case in a process of its own, if one begins."""
        with self._pool(1) as pool:
            try:
                self._outcome(pool, trial.version)
            except (BrokenProcessPool, OSError) as problem:
                self._impossible(why(problem) if isinstance(problem, OSError) else "it ends at once")
                return self._here(case)
            try:
                return self._outcome(pool, self._run, self._job, [case])
            except BrokenProcessPool:
                return [TrialResult(case[0], DIED, "the process that ran it died: killed, or out of memory")]

    def _outcome(self, pool: ProcessPoolExecutor, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        with _signals_blocked():
            future = pool.submit(call, *args, **kwargs)
        with self._interruption.open():
            wait([future])
        return future.result()

    def _here(self, case: Case) -> list[TrialResult]:
        with self._interruption.open():
            return self._run(self._job, [case])

    @contextmanager
    def _pool(self, size: int) -> Iterator[ProcessPoolExecutor]:
        before = multiprocessing.active_children()
        pool = ProcessPoolExecutor(size, mp_context=self._context, initializer=_begin)
        try:
            yield pool
        except BaseException:
            for child in multiprocessing.active_children():
                if child not in before:
                    child.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _context() -> BaseContext:
    """The way processes begin: as forks of this one, unless it has threads, whose locks a fork would copy."""
    others = [thread for thread in threading.enumerate() if thread.name != WATCHER]
    if sys.platform != "linux" or len(others) > 1:
        if "forkserver" not in multiprocessing.get_all_start_methods():
            return multiprocessing.get_context("spawn")
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([trial.__name__])
        return context
    return multiprocessing.get_context("fork")


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Hold signals back: a new process would take them before it can ignore them."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Begin a process: the signals of a terminal are its parent's, and it ends with its parent.

    The collector never visits what the fork has brought along, so that these pages of memory stay shared.
    """
    gc.freeze()
    for each in SIGNALS:
        signal.signal(each, signal.SIG_IGN if each in FROM_TERMINAL else signal.SIG_DFL)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
