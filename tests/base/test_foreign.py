"""Functions of features by others, guarded: what comes back, what is raised, and what ends the caller."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.base.foreign import ForeignGuard, callback, guarded
from multidrop.base.isolation import LOG, isolated
from multidrop.drives.events import Publisher


class Unreadable(Exception):
    def __str__(self) -> str:
        raise ValueError("no text")


def raising(failure: BaseException) -> Any:
    def function() -> None:
        raise failure

    return ForeignGuard("gauge").function(function)


@pytest.mark.parametrize(
    ("failure", "words"),
    [(Unreadable(), "Unreadable"), (ValueError("two\nlines"), "ValueError: two lines")],
)
def test_whatever_is_raised_is_one_line(failure: BaseException, words: str) -> None:
    with pytest.raises(Diagnostic, match=rf"^the feature gauge failed at test_foreign.py:\d+: {words}$"):
        raising(failure)()


@pytest.mark.parametrize("end", [KeyboardInterrupt, GeneratorExit, asyncio.CancelledError])
def test_what_ends_the_caller_passes(end: type[BaseException]) -> None:
    with pytest.raises(end):
        raising(end())()


async def test_an_interrupt_of_its_own_is_a_failure_where_an_event_loop_takes_the_signals() -> None:
    with pytest.raises(Diagnostic, match="^the feature gauge failed at test_foreign.py:[0-9]+: KeyboardInterrupt"):
        raising(KeyboardInterrupt())()


async def subscriber(event: object) -> None:
    """Take an event."""


class Taker:
    async def __call__(self, event: object) -> None:
        """Take an event."""


@pytest.mark.parametrize(
    "function", [subscriber, partial(subscriber), Taker(), ForeignGuard("gauge").function(subscriber)]
)
def test_an_async_subscriber_is_refused_in_one_line(function: Any) -> None:
    wants = " is async, and nothing awaits it; give a plain function, which may start a task$"
    with pytest.raises(Diagnostic, match=wants):
        Publisher("a watcher").subscribe(function)
    with pytest.raises(Diagnostic, match=wants):
        callback(function)


async def test_work_that_a_stop_cancels_is_cancelled() -> None:
    async def work() -> None:
        await asyncio.Event().wait()

    task = asyncio.ensure_future(ForeignGuard("gauge").function(work)())
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


class Gauge:
    """An object with state, whose methods call each other."""

    def __init__(self) -> None:
        self.count = 0

    def missing(self) -> str:
        raise KeyError("no")

    def found(self) -> str:
        self.count += 1
        try:
            return self.missing()
        except KeyError:
            return "the default"


def test_the_methods_of_an_object_catch_what_they_raise_themselves() -> None:
    gauge = Gauge()
    [record] = guarded(Feature("gauge", "measures", adds=(gauge,))).adds
    assert isinstance(record, Gauge) and record.found() == "the default"
    assert gauge.count == 1, "its state is kept in the object that its module has"
    with pytest.raises(Diagnostic, match="^the feature gauge failed"):
        record.missing()


def test_a_subscriber_that_fails_is_reported_once_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(LOG, "propagate", False)
    for _ in range(3):
        with isolated("a subscriber"):
            raising(KeyError("a\x1b"))()
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("the feature gauge failed at test_foreign.py:") and line.endswith("KeyError: 'a\\x1b'")
