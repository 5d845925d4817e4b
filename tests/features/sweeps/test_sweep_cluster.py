"""A cluster that is lost in the middle of a sweep: it ends, it is silent, or it replies with something else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.features.sweeps import trial, workers
from multidrop.features.sweeps.trial import Case, TrialJob, TrialResult
from multidrop.shell.signals import Interruption

comm = pytest.importorskip("distributed.comm", reason="the extra cluster is not installed")


class Dying:
    """A client whose scheduler closes the connection when a task is submitted."""

    def map(self, *_: object, **__: object) -> object:
        raise comm.CommClosedError("in <TCP>: Stream is closed")


@contextmanager
def dying(*_: object) -> Iterator[Dying]:
    yield Dying()


work_of: Any = workers._Work
"""The chunks of a sweep on a cluster."""


def test_a_scheduler_that_ends_in_the_middle_of_a_question_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is done was yielded before, and is reported."""

    def run(job: TrialJob, cases: list[Case]) -> list[TrialResult]:
        return [TrialResult(number) for number, _ in cases]

    monkeypatch.setattr(workers, "_client", dying)
    monkeypatch.setattr(workers, "_check_workers", lambda *_: None)
    monkeypatch.setattr(trial, "chunk", run)
    cases: Iterator[Case] = iter([(number, ()) for number in (1, 2, 3)])
    found: list[TrialResult] = []
    job = TrialJob("", "", "", "", "", (), ())
    with Interruption() as interruption, pytest.raises(TransportLost, match=r"^tcp://h:1: the scheduler was lost$"):
        for chunk in workers.cluster_results(job, [cases], "tcp://h:1", interruption, lambda: None):
            found += chunk
    assert found == [TrialResult(1)]


def test_an_address_with_a_password_is_refused_before_it_is_shown_or_agreed_to() -> None:
    asked: list[str] = []
    with Interruption() as interruption, pytest.raises(Diagnostic) as refused:
        job = TrialJob("", "", "", "", "", (), ())
        next(workers.cluster_results(job, [], "tcp://me:pw@h:1", interruption, lambda: asked.append("asked")))
    assert "pw" not in str(refused.value) and not asked


class Silent:
    """A client, and its `as_completed`: `replies` is what each look at the scheduler gives; no chunk is ever done."""

    def __init__(self, replies: Callable[[int], dict[str, float] | None]) -> None:
        self.now, self._looks, self._replies = 0.0, 0, replies
        self.loop, self.status, self.scheduler = None, "running", SimpleNamespace(identity=None)
        self.cancelled = 0

    def map(self, _: object, jobs: list[TrialJob], *__: object, **___: object) -> list[int]:
        return list(range(len(jobs)))

    def sync(self, *_: object, callback_timeout: float) -> dict[str, Any]:
        self._looks += 1
        if (found := self._replies(self._looks)) is None:
            self.now += callback_timeout
            raise TimeoutError
        return {"workers": {name: {"last_seen": seen} for name, seen in found.items()}}

    def cancel(self, futures: list[int]) -> None:
        self.cancelled += len(futures)

    def has_ready(self) -> bool:
        return False

    def __call__(self, *_: object, **__: object) -> Silent:
        return self


@pytest.mark.parametrize(
    ("replies", "seconds", "what"),
    [
        (lambda look: None, workers.WORKER_TIMEOUT, "no worker gave a sign of life for 30 s"),
        (lambda look: {}, workers.WORKER_TIMEOUT, "no worker gave a sign of life for 30 s"),
        (lambda look: {"a": 5.0, "b": 6.0}, workers.WORKER_TIMEOUT, "no worker gave a sign of life for 30 s"),
        (lambda look: {"a": 5.0, "b": look}, workers.STUCK, "the workers gave no result for 600 s"),
    ],
)
def test_a_cluster_that_gives_no_result_is_lost_after_a_time(
    monkeypatch: pytest.MonkeyPatch, replies: Callable[[int], dict[str, float] | None], seconds: float, what: str
) -> None:
    client = Silent(replies)

    class Condition:
        def __enter__(self) -> Condition:
            return self

        def __exit__(self, *_: object) -> None:
            """Nothing is held."""

        def wait(self, timeout: float) -> None:
            client.now += timeout

    monkeypatch.setattr(client, "thread_condition", Condition(), raising=False)
    monkeypatch.setattr("distributed.as_completed", client)
    monkeypatch.setattr(workers, "time", SimpleNamespace(monotonic=lambda: client.now))
    with Interruption() as interruption:
        work = work_of(client, TrialJob("", "", "", "", "", (), ()), "tcp://h:1", interruption)
        with pytest.raises(TransportLost, match=f"^tcp://h:1: {what}$"):
            list(work.results([[(1, ())], [(2, ())]]))
    assert seconds <= client.now < seconds + 3 * workers.CHECK_PERIOD and client.cancelled == 2


def result_of(work: Any, future: Any, cases: list[Case]) -> list[TrialResult]:
    """What a reply of the cluster is taken for."""
    return work._result(future, cases)  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    "found",
    [
        None,
        [],
        [1],
        {},
        "x",
        [TrialResult(2)],
        [TrialResult(1), TrialResult(3)],
        [TrialResult(1), TrialResult(2), TrialResult(3)],
        (TrialResult(1),),
    ],
)
def test_a_reply_that_is_no_result_ends_the_sweep(found: object) -> None:
    future = SimpleNamespace(status="finished", result=lambda timeout: found)
    with Interruption() as interruption:
        job = TrialJob("", "", "", "", "", (), ())
        work = work_of(SimpleNamespace(), job, "tcp://h:1", interruption)
        with pytest.raises(TransportLost, match="^tcp://h:1: a worker replied with something else than results$"):
            result_of(work, future, [(1, ()), (2, ())])


def test_an_exception_of_a_worker_is_one_line() -> None:
    future = SimpleNamespace(status="error", exception=lambda timeout: ImportError("no module x"))
    with Interruption() as interruption:
        job = TrialJob("", "", "", "", "", (), ())
        work = work_of(SimpleNamespace(), job, "tcp://h:1", interruption)
        with pytest.raises(TransportLost, match="^tcp://h:1: a worker failed: ImportError: no module x$"):
            result_of(work, future, [(1, ())])
