"""Which cases of a sweep run where, and again, when processes end, do not begin, or are told to end: without one."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.features.sweeps import pools, trial
from multidrop.features.sweeps.pools import Pools
from multidrop.features.sweeps.trial import DIED, Case, TrialJob, TrialResult
from multidrop.shell.signals import FROM_TERMINAL, SIGNALS, Interruption
from multidrop.shell.streams.stdout import WATCHER
from tests.support.cases import for_each

JOB = TrialJob("", "", "", "", "", (), ())
DEADLY = 5
"""The case that ends the process that runs it."""


class Child:
    def __init__(self) -> None:
        self.terminated = False

    def terminate(self) -> None:
        self.terminated = True


class Machine:
    """Stands in for the pools: their calls are run by `wait`, in turn, one at a time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.pools: list[Executor] = []
        self.children: list[Child] = [Child()]
        self.ahead = 0
        """The most calls that were submitted and not done."""
        self.refusal: Exception | None = None
        """Why no process begins."""
        self.unusable: Exception | None = None
        """Why not even a pool can be made."""
        self.blocked: set[bool] = set()
        """Whether signals were held back as calls were submitted."""
        self.told = ""
        """A signal comes while this case runs."""
        monkeypatch.setattr(pools, "ProcessPoolExecutor", self.pool)
        monkeypatch.setattr(pools, "wait", self.wait)
        monkeypatch.setattr(multiprocessing, "active_children", lambda: list(self.children))

    def pool(self, size: int, mp_context: Any = None, initializer: Any = None) -> Executor:
        if self.unusable is not None:
            raise self.unusable
        assert mp_context is not None
        made = Executor(self, size, initializer)
        self.pools.append(made)
        return made

    def wait(self, futures: Iterable[Future[Any]], return_when: str = "") -> Any:
        waiting = list(futures)
        pool = self.pools[-1]
        self.ahead = max(self.ahead, len(waiting))
        if return_when:
            assert return_when == "FIRST_COMPLETED"
        pool.work()
        return SimpleNamespace(done={each for each in waiting if each.done()})


class Executor:
    def __init__(self, machine: Machine, size: int, initializer: Any) -> None:
        self.machine, self.size, self.initializer = machine, size, initializer
        self.calls: list[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = []
        self.ran: list[tuple[int, ...]] = []
        self.broken = False
        self.ended: dict[str, bool] | None = None

    def submit(self, call: Callable[..., Any], *given: Any) -> Future[Any]:
        now = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        self.machine.blocked.add(set(SIGNALS) <= now)
        if self.machine.refusal is not None:
            raise self.machine.refusal
        if self.broken:
            raise BrokenProcessPool
        self.machine.children.append(Child())
        future: Future[Any] = Future()
        self.calls.append((future, call, given))
        return future

    def work(self) -> None:
        if not self.calls:
            return
        future, call, given = self.calls.pop(0)
        numbers = tuple(number for number, _ in given[1]) if given else ()
        if DEADLY in numbers:
            self.broken = True
            for each in (future, *(other for other, _, _ in self.calls)):
                each.set_exception(BrokenProcessPool("a process ended"))
            self.calls.clear()
            return
        self.ran.append(numbers)
        future.set_result(call(*given))

    def shutdown(self, **how: bool) -> None:
        self.ended = how


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(monkeypatch)


def whole(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
    assert job is JOB
    return [TrialResult(number) for number, _ in cases]


def half(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
    return whole(job, cases)[: max(1, len(cases) // 2)]


def chunks(*numbers: int, size: int = 2) -> Iterator[list[Case]]:
    cases: list[Case] = [(number, ()) for number in numbers]
    return iter([cases[at : at + size] for at in range(0, len(cases), size)])


def ran(
    todo: Iterator[list[Case]], run: Any = whole, jobs: int = 2, said: list[str] | None = None
) -> list[list[TrialResult]]:
    with Interruption() as interruption:
        return list(Pools(JOB, jobs, interruption, run, (said if said is not None else []).append).results(todo))


def test_chunks_run_in_one_pool_and_few_are_submitted_ahead(machine: Machine) -> None:
    found = ran(chunks(*range(10, 60)))
    assert found == [[TrialResult(n), TrialResult(n + 1)] for n in range(10, 60, 2)]
    trial_pool, pool = machine.pools
    assert trial_pool.size == 1 and trial_pool.ended == {} and trial_pool.ran == []
    assert (pool.size, pool.ended, len(pool.ran)) == (2, {"cancel_futures": True}, 25)
    assert pool.initializer is not None
    assert machine.ahead == 2 * 3
    assert machine.blocked == {True}
    assert set(SIGNALS).isdisjoint(signal.pthread_sigmask(signal.SIG_BLOCK, ()))
    assert not any(each.terminated for each in machine.children)


def test_the_rest_of_a_chunk_runs_again_before_new_ones(machine: Machine) -> None:
    found = ran(chunks(*range(10, 18), size=4), half, jobs=1)
    assert [each.number for chunk in found for each in chunk] == [10, 11, 14, 15, 12, 16, 13, 17]
    assert machine.pools[-1].ran == [(10, 11, 12, 13), (14, 15, 16, 17), (12, 13), (16, 17), (13,), (17,)]


def test_after_the_death_of_a_process_its_cases_run_alone_and_the_others_in_a_new_pool(machine: Machine) -> None:
    found = ran(chunks(*range(1, 31)))
    results = sorted(each for chunk in found for each in chunk)
    assert [each.number for each in results] == list(range(1, 31))
    assert [each for each in results if not each.ok] == [
        TrialResult(DEADLY, DIED, "the process that ran it died: killed, or out of memory")
    ]
    first, *alone, last = machine.pools[1:]
    assert first.ran == [(1, 2), (3, 4)] and first.size == 2
    suspects = [5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]
    assert [each.size for each in alone] == [1] * len(suspects)
    assert sorted(each.ran for each in alone) == [[()] if n == DEADLY else [(), (n,)] for n in suspects]
    assert last.size == 2 and last.ran == [(n, n + 1) for n in range(17, 31, 2)]


REASONS = [
    (OSError(38, "Function not implemented"), "Function not implemented"),
    (ImportError("no semaphores here"), "no semaphores here"),
    (NotImplementedError("no processes here"), "no processes here"),
]


@for_each("problem, words", REASONS)
def test_where_no_pool_can_be_made_this_process_runs_all_and_says_why(
    machine: Machine, problem: Any, words: Any
) -> None:
    machine.unusable, said = problem, list[str]()
    assert ran(chunks(4, 5, 6), said=said) == [[TrialResult(4)], [TrialResult(5)], [TrialResult(6)]]
    assert said == [f"no other process can be started ({words}), so all cases run in this one, which takes longer"]


BUSY = OSError(11, "Resource temporarily unavailable")


@for_each("problem, words", [(BUSY, "Resource temporarily unavailable"), (BrokenProcessPool(), "it ends at once")])
def test_where_no_process_begins_this_one_runs_what_was_to_run_there(
    machine: Machine, problem: Any, words: Any
) -> None:
    machine.refusal, said = problem, list[str]()
    machine.pools.clear()
    assert ran(chunks(*range(4, 11)), said=said) == [[TrialResult(n)] for n in range(4, 11)]
    assert said == [f"no other process can be started ({words}), so all cases run in this one, which takes longer"]
    assert [each.size for each in machine.pools] == [1, 2, 1]


def test_a_signal_ends_the_processes_that_were_begun_and_keeps_what_is_done(machine: Machine) -> None:
    earlier = machine.children[0]
    kept: list[list[TrialResult]] = []
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        for found in Pools(JOB, 1, interruption, whole).results(chunks(*range(10, 30))):
            kept.append(found)
            if len(kept) == 3:
                signal.raise_signal(signal.SIGINT)
    assert kept == [[TrialResult(n), TrialResult(n + 1)] for n in (10, 12, 14)]
    assert not earlier.terminated and len(machine.children) > 3
    assert all(each.terminated for each in machine.children[1:])
    assert machine.pools[-1].ended == {"cancel_futures": True}


def test_a_signal_during_a_wait_keeps_the_results_that_are_there(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(futures: Iterable[Future[Any]], return_when: str = "") -> Any:
        machine.pools[-1].work()
        signal.raise_signal(signal.SIGTERM)
        raise AssertionError("it goes on")

    monkeypatch.setattr(pools, "wait", interrupted)
    kept: list[list[TrialResult]] = []
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        for found in Pools(JOB, 2, interruption, whole).results(chunks(*range(10, 30))):
            kept.append(found)
    assert kept == [[TrialResult(10), TrialResult(11)]]


def test_a_case_in_this_process_is_interrupted(machine: Machine) -> None:
    machine.unusable = OSError(38, "Function not implemented")

    def told(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
        signal.raise_signal(signal.SIGINT)
        return whole(job, cases)

    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        list(Pools(JOB, 2, interruption, told).results(chunks(4)))


# How a process begins


class Started:
    """The way in which pools begin their processes here, as a new one shows."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, threads: Sequence[str], methods: Sequence[str]) -> None:
        self.preloaded: list[str] = []
        self.method = ""
        shown = [SimpleNamespace(name=name) for name in threads]
        monkeypatch.setattr(threading, "enumerate", lambda: shown)
        monkeypatch.setattr(multiprocessing, "get_all_start_methods", lambda: list(methods))
        monkeypatch.setattr(multiprocessing, "get_context", self._context)
        monkeypatch.setattr(pools, "ProcessPoolExecutor", self._pool)
        Pools(JOB, 2, Interruption(), whole)

    def _context(self, method: str) -> Any:
        self.method = method
        return SimpleNamespace(set_forkserver_preload=self.preloaded.extend)

    def _pool(self, *_: Any, **__: Any) -> None:
        raise AssertionError("nothing begins before it is needed")


@for_each(
    "platform, threads, methods, method",
    [
        ("linux", ["MainThread"], ["fork", "spawn", "forkserver"], "fork"),
        ("linux", ["MainThread", WATCHER], ["fork", "spawn", "forkserver"], "fork"),
        ("linux", ["MainThread", "signals"], ["fork", "spawn", "forkserver"], "forkserver"),
        ("linux", ["MainThread", "signals"], ["spawn"], "spawn"),
        ("darwin", ["MainThread"], ["fork", "spawn", "forkserver"], "forkserver"),
        ("win32", ["MainThread"], ["spawn"], "spawn"),
    ],
)
def test_processes_are_forked_unless_this_one_has_threads(
    platform: Any, threads: Any, methods: Any, method: Any
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "platform", platform)
        started = Started(patch, threads, methods)
    assert started.method == method
    assert started.preloaded == ([trial.__name__] if method == "forkserver" else [])


def test_a_process_leaves_the_signals_of_the_terminal_to_its_parent(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran(chunks(10))
    begin = machine.pools[-1].initializer
    done: list[Any] = []
    handlers: dict[int, Any] = {}
    waited: list[Any] = []
    parent = SimpleNamespace(sentinel=object())
    monkeypatch.setattr(gc, "freeze", lambda: done.append("frozen"))
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(signal, "pthread_sigmask", lambda how, what: done.append((how, tuple(what))))
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: parent)
    monkeypatch.setattr(connection, "wait", waited.append)
    monkeypatch.setattr(os, "_exit", done.append)
    monkeypatch.setattr(threading, "Thread", Thread)
    begin()
    assert done == ["frozen", (signal.SIG_UNBLOCK, SIGNALS), 1]
    assert waited == [[parent.sentinel]]
    assert handlers == {each: signal.SIG_IGN if each in FROM_TERMINAL else signal.SIG_DFL for each in SIGNALS}


def test_a_process_without_a_parent_goes_on(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    ran(chunks(10))
    begin = machine.pools[-1].initializer
    monkeypatch.setattr(gc, "freeze", lambda: None)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: None)
    monkeypatch.setattr(os, "_exit", lambda code: pytest.fail("it ended"))
    monkeypatch.setattr(threading, "Thread", Thread)
    begin()


class Thread:
    """A thread that does its work as it is started; it ends with its process."""

    def __init__(self, target: Callable[[], None], daemon: bool) -> None:
        assert daemon
        self._target = target

    def start(self) -> None:
        self._target()
