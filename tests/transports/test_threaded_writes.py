"""The writing side of a pipe over a device whose calls block: its queue, stops of other threads, loss and end."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports.threaded import ThreadedPipe, closing
from tests.support.until import PATIENCE, until


def running(name: str) -> dict[str, threading.Thread]:
    """The threads of a pipe."""
    return {each.name: each for each in threading.enumerate() if each.name.startswith(f"{name} ")}


class Held:
    """A device that takes a piece each time that the test lets it, and reads what the test gives it."""

    name = "held"

    def __init__(self, piece: int = 2) -> None:
        self.piece, self.aborted = piece, 5
        self.taking, self.may = threading.Semaphore(0), threading.Semaphore(0)
        self.given = threading.Semaphore(0)
        self.coming: list[Any] = []
        self.written: list[bytes] = []
        self.ended: list[str] = []
        self.breaks: OSError | None = None
        self.tried = 0
        self.beside: list[str] = []
        """The pipe's threads that still ran as the device was closed."""

    def read(self) -> bytes | None:
        if not self.given.acquire(timeout=PATIENCE):
            return None
        found = self.coming.pop(0) if self.coming else b""
        if isinstance(found, OSError):
            raise found
        return found

    def give(self, *found: Any) -> None:
        for each in found:
            self.coming.append(each)
            self.given.release()

    def write(self, data: bytes) -> None:
        self.tried += 1
        self.taking.release()
        assert self.may.acquire(timeout=PATIENCE)
        if self.breaks is not None:
            raise self.breaks
        self.written.append(data)

    def abort(self) -> int:
        return self.aborted

    def cancel(self) -> None:
        self.ended.append("cancel")
        self.give(b"")
        for _ in range(99):
            self.may.release()

    def explain(self, error: OSError | None) -> str:
        return f"it broke: {error}"

    def close(self) -> None:
        self.beside += (each for each in running(self.name) if each != f"{self.name} close")
        self.ended.append("close")

    def begun(self) -> None:
        """Wait until a piece is being written."""
        assert self.taking.acquire(timeout=PATIENCE)

    def take(self, pieces: int = 1) -> None:
        """Let so many pieces pass; the next one is being written then."""
        for _ in range(pieces):
            self.may.release()
            self.begun()


@asynccontextmanager
async def opened(piece: int = 2) -> AsyncIterator[tuple[ThreadedPipe, Held, list[Any]]]:
    device, seen = Held(piece), list[Any]()
    pipe = ThreadedPipe(device)
    pipe.start(seen.append, seen.append)
    try:
        yield pipe, device, seen
    finally:
        for _ in range(99):
            device.may.release()
        await pipe.close()


async def test_a_write_leaves_in_pieces_and_what_has_not_begun_is_pending() -> None:
    async with opened() as (pipe, device, _):
        assert pipe.write(b"") and pipe.pending == 0
        assert pipe.write(b"abcde")
        device.begun()
        assert pipe.pending == 3
        assert pipe.write(b"fg") and pipe.pending == 5
        device.take(3)
        assert device.written == [b"ab", b"cd", b"e"] and pipe.pending == 0


async def test_a_device_without_pieces_gets_each_write_whole() -> None:
    async with opened(piece=0) as (pipe, device, _):
        pipe.write(b"abcde")
        device.begun()
        assert pipe.pending == 0
        pipe.write(b"x")
        device.take()
        assert device.written == [b"abcde"]


async def test_what_waits_is_dropped_with_what_the_machine_holds_or_up_to_what_has_begun() -> None:
    async with opened() as (pipe, device, _):
        pipe.write(b"abcde")
        device.begun()
        pipe.write(b"fg")
        assert pipe.discard(whole=True) == 2 and pipe.pending == 3
        pipe.write(b"hi")
        assert pipe.discard() == 3 + 2 + device.aborted and pipe.pending == 0
        pipe.write(b"jk")
        device.take()
        assert device.written == [b"ab"]
        pipe.write(b"lm")
        assert pipe.discard(whole=True) == 2 and pipe.pending == 0


async def test_a_stop_of_another_thread_takes_the_place_of_the_queue_until_the_loop_knows_of_each() -> None:
    async with opened() as (pipe, device, _):
        pipe.write(b"abcd")
        device.begun()
        dropped: list[int] = []
        assert pipe.preempt(False, lambda number: dropped.append(number) or b"!1")  # type: ignore[func-returns-value]
        assert pipe.preempt(True, lambda number: dropped.append(number) or b"!2")  # type: ignore[func-returns-value]
        assert dropped == [2 + device.aborted, 2] and pipe.pending == 2
        assert not pipe.write(b"x")
        notes: list[bool] = []
        assert not pipe.yielded(notes.append) and pipe.yielded(notes.append) and pipe.yielded(notes.append)
        assert notes == [False, True, True]
        assert pipe.write(b"xy")
        device.take(2)
        assert device.written == [b"ab", b"!2"]


async def test_a_stop_is_followed_by_its_pieces_and_a_key_counts_as_one_more() -> None:
    async with opened() as (pipe, device, _):
        waiting: list[int] = []

        def piece(data: bytes | None) -> Any:
            return lambda number: waiting.append(number) or data  # type: ignore[func-returns-value]

        assert not pipe.follow(piece(b"??")) and waiting == []
        assert not pipe.follow(piece(None), key=True) and pipe.write(b"ab")
        device.begun()
        assert pipe.follow(piece(b"!1"), key=True) and pipe.pending == 2
        assert pipe.follow(piece(b"")) and pipe.follow(piece(b"!2")) and not pipe.follow(piece(None))
        assert waiting == [0, 1, 3, 3, 5] and pipe.pending == 4
        assert not pipe.write(b"x") and pipe.yielded() and pipe.write(b"x")
        device.take(3)
        assert device.written == [b"ab", b"!1", b"!2"]


async def test_what_follows_a_stop_leaves_though_the_writer_waits_for_nothing_else() -> None:
    async with opened() as (pipe, device, _):
        assert pipe.preempt(False, lambda dropped: b"!1")
        device.begun()
        device.may.release()
        await until(lambda: device.written == [b"!1"] and not pipe.pending, 5.0)
        assert pipe.follow(lambda waiting: b"!2")
        assert device.taking.acquire(timeout=5.0)
        device.may.release()
        await until(lambda: device.written == [b"!1", b"!2"], 5.0)


async def test_a_piece_waits_until_the_device_has_it_and_no_longer() -> None:
    async with opened() as (pipe, device, _):

        def waiting() -> int:
            numbers: list[int] = []
            assert not pipe.follow(lambda number: numbers.append(number), key=True)
            return numbers[0]

        pipe.write(b"ab")
        device.begun()
        assert waiting() == 1
        device.may.release()
        await until(lambda: waiting() == 0, 5.0)


async def test_a_write_that_no_thread_has_taken_has_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    late: list[threading.Thread] = []
    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", lambda thread: late.append(thread))
        device = Held()
        pipe = ThreadedPipe(device)
    pipe.write(b"abcd")
    assert pipe.discard(whole=True) == 4 and pipe.pending == 0
    for each in late:
        each.start()
    await pipe.close()
    assert device.written == []


async def test_what_was_read_is_delivered_in_order() -> None:
    async with opened() as (_, device, seen):
        device.give(b"ab", b"", b"cd")
        await until(lambda: b"".join(seen) == b"abcd")
        assert b"" not in seen


@pytest.mark.parametrize("error", [OSError(5, "gone"), None])
async def test_a_break_of_the_reading_side_is_a_loss_and_nothing_is_written_after_it(error: OSError | None) -> None:
    async with opened() as (pipe, device, seen):
        device.give(b"ab", error, b"never read")
        reader = running("held")["held reader"]
        reader.join(5.0)  # the loop does nothing meanwhile
        assert not reader.is_alive() and device.coming == [b"never read"]
        await until(lambda: len(seen) == 2)
        data, loss = seen
        assert data == b"ab" and isinstance(loss, TransportLost) and f"it broke: {error}" in str(loss)
        assert not pipe.write(b"x") and pipe.discard() == 0
        assert not pipe.preempt(False, lambda dropped: b"!") and not pipe.follow(lambda waiting: b"!", key=True)


async def test_a_break_of_the_writing_side_is_a_loss() -> None:
    async with opened() as (pipe, device, seen):
        device.breaks = OSError(5, "gone")
        pipe.write(b"abcd")
        device.begun()
        device.may.release()
        await until(lambda: bool(seen))
        assert "it broke: [Errno 5] gone" in str(seen[0]) and device.written == []


async def test_nothing_is_written_behind_a_write_that_failed() -> None:
    async with opened() as (pipe, device, seen):
        device.breaks = OSError(5, "gone")
        writer = running("held")["held writer"]
        pipe.write(b"abcdef")
        for _ in range(99):
            device.may.release()
        writer.join(5.0)  # the loop does nothing meanwhile
        assert not writer.is_alive() and device.tried == 1 and seen == []
        await until(lambda: bool(seen))


async def test_the_end_cancels_what_waits_and_closes_the_device_once() -> None:
    device = Held()
    pipe = ThreadedPipe(device)
    pipe.start(lambda data: None, lambda error: None)
    closed = asyncio.ensure_future(pipe.close())
    await closed
    await pipe.close()
    await until(lambda: device.name not in closing)
    assert device.ended == ["cancel", "close"] and device.beside == []
    assert not pipe.write(b"x") and not pipe.preempt(False, lambda dropped: b"!")


async def test_a_loss_gives_the_device_back_once_with_its_threads_at_their_end() -> None:
    async with opened() as (pipe, device, seen):
        threads = running("held")
        assert set(threads) == {"held writer", "held reader"} and all(each.daemon for each in threads.values())
        assert pipe.preemptible
        pipe.write(b"abcd")
        device.begun()
        device.give(None)
        await until(lambda: "close" in device.ended)
        assert device.beside == [] and device.written == [b"ab"] and pipe.pending == 0, "what waits is dropped"
        assert [type(each) for each in seen] == [TransportLost]
    assert device.ended == ["cancel", "close"]


class Stuck(Held):
    """A device whose close the driver holds up."""

    name = "stuck"

    def __init__(self) -> None:
        super().__init__()
        self.lets = threading.Event()

    def close(self) -> None:
        assert self.lets.wait(PATIENCE)
        super().close()


@pytest.mark.virtual
async def test_a_close_that_the_driver_holds_up_is_given_up_after_1_s_and_stays_known() -> None:
    device, problems = Stuck(), list[object]()
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: problems.append(context))
    pipe = ThreadedPipe(device)
    begin = asyncio.get_running_loop().time()
    await pipe.close()
    assert asyncio.get_running_loop().time() - begin == pytest.approx(1.0, abs=0.01)
    assert "stuck" in closing
    thread = running("stuck")["stuck close"]
    assert thread.daemon, "the end of the process does not wait for it"
    device.lets.set()
    thread.join(PATIENCE)
    assert "stuck" not in closing and device.ended == ["cancel", "close"]
    await asyncio.sleep(2)
    await pipe.close()
    assert problems == []


@pytest.mark.virtual
async def test_closing_waits_1_s_for_what_is_written() -> None:
    device = Held()
    pipe = ThreadedPipe(device)
    pipe.write(b"abcd")
    device.begun()
    begin = asyncio.get_running_loop().time()
    await pipe.close()
    assert asyncio.get_running_loop().time() - begin >= 1.0 and not pipe.write(b"x") and pipe.write(b"")


async def test_what_is_being_written_as_it_is_closed_leaves_first() -> None:
    device = Held(piece=2)
    pipe = ThreadedPipe(device)
    pipe.write(b"abcd")
    device.begun()
    closed = asyncio.ensure_future(pipe.close())
    for last in (False, True):
        await asyncio.sleep(0.01)
        assert not closed.done() and device.ended == []
        device.may.release()
        if not last:
            device.begun()
    await closed
    assert device.written == [b"ab", b"cd"]


async def test_the_threads_that_a_driver_holds_up_are_waited_for_together_no_longer_than_the_close(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    device, waits = Held(), list[float | None]()
    pipe = ThreadedPipe(device)
    pipe.start(lambda data: None, lambda error: None)
    threads, join = running("held"), threading.Thread.join

    def joins(thread: threading.Thread, timeout: float | None = None) -> None:
        if thread in threads.values():
            waits.append(timeout)
        join(thread, timeout)

    monkeypatch.setattr(threading.Thread, "join", joins)
    await pipe.close()
    await until(lambda: "close" in device.ended)
    assert len(waits) == 2 and all(each is not None and 0 <= each <= 0.9 for each in waits)
    assert waits[0] is not None and waits[0] > 0.5


def test_its_threads_end_where_the_loop_has_ended() -> None:
    device, pipes = Held(), list[ThreadedPipe]()

    async def begin() -> None:
        pipes.append(ThreadedPipe(device))
        pipes[0].start(lambda data: None, lambda error: None)

    asyncio.run(begin())
    reader = running("held")["held reader"]
    device.give(b"late", b"never read")
    reader.join(5.0)
    assert not reader.is_alive() and device.coming == [b"never read"]
    assert not pipes[0].preempt(False, lambda dropped: b"!") and not pipes[0].follow(lambda waiting: b"!", key=True)
    writer = running("held")["held writer"]
    pipes[0].write(b"wakes the writer up, which ends")
    writer.join(5.0)
    assert not writer.is_alive() and device.written == []
