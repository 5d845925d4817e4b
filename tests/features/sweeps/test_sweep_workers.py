"""The cases of a sweep in several processes: all run, once; one that ends its process is named; a signal ends all."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Sequence

import pytest

from multidrop.features.sweeps import pools, workers
from multidrop.features.sweeps.trial import DIED, Case, TrialJob, TrialResult
from multidrop.shell.signals import Interruption

pytestmark = pytest.mark.process

JOB = TrialJob("", "", "", "", "", (), ())
SLOW = 0.002
"""The time of a case, s: enough that further processes are worth it."""


def slow(job: TrialJob, cases: Sequence[Case], seconds: float = SLOW) -> list[TrialResult]:
    until = time.process_time() + seconds * len(cases)
    while time.process_time() < until:
        pass
    return [TrialResult(number) for number, _ in cases]


def lazy(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
    return slow(job, cases[:2])


def deadly(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
    """End the process of one case. Chunks are of two, so few cases run again alone, each in a process of its own."""
    if any(number == 17 for number, _ in cases):
        os._exit(1)
    return slow(job, cases, 0.01)


def found(run: Callable[[TrialJob, Sequence[Case]], list[TrialResult]], count: int, jobs: int) -> list[TrialResult]:
    with Interruption() as interruption:
        cases = iter([(number, ()) for number in range(1, count + 1)])
        return [each for chunk in workers.results(JOB, cases, count, jobs, interruption, run) for each in chunk]


def test_every_case_runs_once() -> None:
    results = found(slow, 150, 2)
    assert sorted(results) == [TrialResult(number) for number in range(1, 151)]
    assert multiprocessing.active_children() == []


def test_the_rest_of_a_chunk_that_took_long_runs_later() -> None:
    results = found(lazy, 150, 2)
    assert sorted(results) == [TrialResult(number) for number in range(1, 151)]


def test_little_work_needs_no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]

    def timed(job: TrialJob, cases: Sequence[Case]) -> list[TrialResult]:
        clock[0] += SLOW
        return [TrialResult(number) for number, _ in cases]

    monkeypatch.setattr(workers.time, "process_time", lambda: clock[0])
    monkeypatch.setattr(pools, "ProcessPoolExecutor", None)
    assert len(found(timed, 40, 2)) == 40 and len(found(timed, 150, 1)) == 150
    with pytest.raises(TypeError):
        found(timed, 150, 2)


def test_a_case_that_ends_its_process_is_named_and_the_others_run() -> None:
    results = sorted(found(deadly, 40, 2))
    assert [each.number for each in results] == list(range(1, 41))
    assert [(each.number, each.failed) for each in results if not each.ok] == [(17, DIED)]


def test_where_no_process_can_begin_this_one_runs_the_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(pools.ProcessPoolExecutor, "submit", refused)
    assert sorted(found(slow, 60, 2)) == [TrialResult(number) for number in range(1, 61)]


def test_a_signal_ends_the_processes_and_keeps_what_is_done() -> None:
    kept: list[TrialResult] = []
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        cases = iter([(number, ()) for number in range(1, 2001)])
        for chunk in workers.results(JOB, cases, 2000, 2, interruption, slow):
            kept += chunk
            if len(kept) > 50:
                signal.raise_signal(signal.SIGINT)
    assert 50 < len(kept) < 500 and all(each.ok for each in kept)
    assert multiprocessing.active_children() == []
