"""A cluster whose scheduler ends in the middle of a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from multidrop.dialects import Diagnostic
from multidrop.shell.signals import Interruption
from multidrop.shell.sweeps import workers
from multidrop.shell.sweeps.trial import Case, Job, Result
from multidrop.transports import TransportLost

comm = pytest.importorskip("distributed.comm", reason="the extra cluster is not installed")


class Dying:
    """A client whose scheduler closes the connection when a task is submitted."""

    def map(self, *_: object, **__: object) -> object:
        raise comm.CommClosedError("in <TCP>: Stream is closed")


@contextmanager
def dying(*_: object) -> Iterator[Dying]:
    yield Dying()


def test_a_scheduler_that_ends_in_the_middle_of_a_question_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is done was yielded before, and is reported."""

    def run(job: Job, cases: list[Case]) -> list[Result]:
        return [Result(number) for number, _ in cases]

    monkeypatch.setattr(workers, "_client", dying)
    monkeypatch.setattr(workers, "_check_workers", lambda *_: None)
    monkeypatch.setattr(workers.trial, "chunk", run)
    cases: Iterator[Case] = iter([(number, ()) for number in (1, 2, 3)])
    found: list[Result] = []
    job = Job("", "", "", "", "", (), ())
    with Interruption() as interruption, pytest.raises(TransportLost, match=r"^tcp://h:1: the scheduler was lost$"):
        for chunk in workers.cluster_results(job, cases, "tcp://h:1", interruption, lambda: None):
            found += chunk
    assert found == [Result(1)]


def test_an_address_with_a_password_is_refused_before_it_is_shown_or_agreed_to() -> None:
    asked: list[str] = []
    with Interruption() as interruption, pytest.raises(Diagnostic) as refused:
        job = Job("", "", "", "", "", (), ())
        next(workers.cluster_results(job, iter(()), "tcp://me:pw@h:1", interruption, lambda: asked.append("asked")))
    assert "pw" not in str(refused.value) and not asked
