"""Signals that end a process early: they wait for a place where work can be interrupted, and come once."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Iterator

import pytest

from multidrop.shell.signals import FROM_TERMINAL, SIGNALS, Interruption, early_ends, in_loop

pytestmark = pytest.mark.fork


@pytest.fixture(autouse=True)
def handlers() -> Iterator[dict[int, object]]:
    """The handlers of all signals, which a test leaves as they were."""
    before: dict[int, object] = {each: signal.getsignal(each) for each in SIGNALS}
    yield before
    assert {each: signal.getsignal(each) for each in SIGNALS} == before


def test_a_signal_waits_for_work_that_can_be_interrupted() -> None:
    with Interruption() as interruption:
        signal.raise_signal(signal.SIGTERM)
        assert interruption.came
        done: list[str] = []
        for _ in range(2):
            with pytest.raises(KeyboardInterrupt), interruption.open():
                done.append("began")
        assert done == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGUSR1])
def test_within_such_work_it_interrupts_at_once_and_a_second_one_does_not_interrupt_the_end(number: int) -> None:
    with Interruption() as interruption:
        done: list[str] = []
        with pytest.raises(KeyboardInterrupt), interruption.open():
            try:
                signal.raise_signal(number)
                done.append("went on")
            finally:
                signal.raise_signal(number)
                done.append("cleaned up")
        assert done == ["cleaned up"]


def test_between_two_works_nothing_is_interrupted() -> None:
    with Interruption() as interruption:
        with interruption.open():
            assert not interruption.came
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(ValueError):
            raise ValueError
        assert interruption.came


def test_work_that_fails_is_over_too() -> None:
    with Interruption() as interruption:
        with pytest.raises(ValueError), interruption.open():
            raise ValueError
        signal.raise_signal(signal.SIGINT)
        assert interruption.came


def test_the_handlers_are_taken_in_the_main_thread_only(handlers: dict[int, object]) -> None:
    with Interruption():
        assert all(signal.getsignal(each) != handlers[each] for each in SIGNALS)
    seen: list[bool] = []

    def elsewhere() -> None:
        with Interruption() as interruption, interruption.open():
            seen.append(all(signal.getsignal(each) == handlers[each] for each in SIGNALS))

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert seen == [True]


def test_faults_and_broken_pipes_are_not_among_them() -> None:
    assert not {signal.SIGPIPE, signal.SIGSEGV, signal.SIGABRT, signal.SIGKILL} & set(SIGNALS)
    assert {signal.SIGINT, signal.SIGHUP, signal.SIGQUIT} == set(FROM_TERMINAL) <= set(SIGNALS)


async def test_in_a_loop_each_signal_calls_back_until_that_is_ended() -> None:
    came = asyncio.Queue[int]()
    before = signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    try:
        leave = in_loop(asyncio.get_running_loop(), signal.SIGUSR1, lambda: came.put_nowait(1))
        for _ in range(2):
            signal.raise_signal(signal.SIGUSR1)
            assert await asyncio.wait_for(came.get(), 5) == 1
        leave()
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
        signal.raise_signal(signal.SIGUSR1)
        await asyncio.sleep(0)
        assert came.empty()
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_handlers_that_were_given_for_an_early_end_are_taken_back(handlers: dict[int, object]) -> None:
    with pytest.raises(ValueError), early_ends():
        for each in SIGNALS:
            signal.signal(each, lambda *_: None)
        raise ValueError
    assert {each: signal.getsignal(each) for each in SIGNALS} == handlers
    assert "signals" not in {each.name for each in threading.enumerate()}


@pytest.mark.skipif("sys.platform != 'linux'")
def test_a_broken_pipe_of_the_process_counts_as_an_end() -> None:
    came = threading.Event()
    with early_ends():
        signal.signal(signal.SIGTERM, lambda *_: came.set())
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        assert signal.SIGPIPE in mask
        taker = next(each for each in threading.enumerate() if each.name == "signals")
        assert taker.daemon and taker.ident is not None
        signal.pthread_kill(taker.ident, signal.SIGPIPE)
        assert any(came.wait(0.01) for _ in range(500)), "a handler runs between two steps of the main thread"
    assert signal.SIGPIPE not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
