"""A pipe is open, then broken or closed: what it delivers, tells and takes in each state, on an endpoint in memory."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
import time
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import Lost, Undelivered
from multidrop.transports import pipe as here
from multidrop.transports.pipe import DescriptorPipe, Pipe, begun, in_thread, running_loop
from tests.support.until import PATIENCE, until

pytestmark = pytest.mark.fork

SYSTEM = 4
"""Bytes that one read takes."""


class End:
    """An endpoint that takes as many bytes as it has room for, and gives what the far side of a socket has sent."""

    name = "end"

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair()
        self.near.setblocking(False)
        self.far.setblocking(False)
        self.room, self.held, self.taken = 10**6, 0, b""
        self.before: list[bytes | OSError | None] = []
        """What the next reads find ahead of what the far side has sent."""
        self.breaks: OSError | None = None
        """The error of the next write."""
        self.reads = 0
        self.closed_in: list[threading.Thread] = []

    def full(self) -> None:
        """Let the system take nothing more until `free`."""
        self.room = 0
        with contextlib.suppress(BlockingIOError):
            while self.near.send(bytes(65536)):
                pass

    def free(self) -> None:
        self.room = 10**6
        with contextlib.suppress(BlockingIOError):
            while self.far.fileno() >= 0 and self.far.recv(1 << 20):
                pass

    def fileno(self) -> int:
        return self.near.fileno()

    def read(self) -> bytes | None:
        self.reads += 1
        if self.before:
            found = self.before.pop(0)
            if isinstance(found, OSError):
                raise found
            return found
        return self.near.recv(SYSTEM) or None

    def write(self, data: bytes | memoryview) -> int:
        if self.breaks is not None:
            raise self.breaks
        if not self.room:
            raise BlockingIOError
        part = bytes(data[: self.room])
        self.room -= len(part)
        self.taken += part
        return len(part)

    def unsent(self) -> int:
        return self.held

    def drop(self) -> int:
        dropped, self.held = self.held, 0
        return dropped

    def explain(self, error: OSError | None) -> str:
        return f"because of {error}"

    def close(self) -> None:
        self.closed_in.append(threading.current_thread())
        self.near.close()
        self.far.close()


class Owner:
    """Whoever has the pipe: `seen` is what it was given and told, in order."""

    def __init__(self) -> None:
        self.end = End()
        self.pipe = DescriptorPipe(self.end)
        self.seen: list[Any] = []

    def start(self) -> None:
        self.pipe.start(self.seen.append, self.seen.append)

    @property
    def told(self) -> list[str]:
        """The losses."""
        return [str(each) for each in self.seen if isinstance(each, TransportLost)]

    @property
    def data(self) -> bytes:
        return b"".join(each for each in self.seen if isinstance(each, bytes))


@pytest.fixture
async def owner() -> AsyncIterator[Owner]:
    made = Owner()
    yield made
    made.end.held = 0
    await made.pipe.close()


# What is read


@pytest.mark.virtual
async def test_only_what_arrived_is_delivered_and_a_read_in_vain_is_no_loss() -> None:
    owner = Owner()
    owner.end.before = [BlockingIOError(), InterruptedError(), b"", b"early"]
    owner.start()
    owner.end.far.send(b"abcdef")
    await until(lambda: len(owner.data) == 11)
    assert owner.seen == [b"early", b"abcd", b"ef"]
    reads = owner.end.reads
    await asyncio.sleep(60)
    assert owner.end.reads == reads, "it is read when there is something"
    await owner.pipe.close()


@pytest.mark.virtual
@pytest.mark.parametrize("error", [OSError(5, "gone"), None])
async def test_a_read_that_fails_or_ends_is_one_loss_with_its_reason(error: OSError | None) -> None:
    owner = Owner()
    owner.end.before = [b"last", error, b"arrived before", error, b"never read"]
    owner.start()
    owner.end.far.send(b"!")
    await until(lambda: bool(owner.told))
    assert (
        owner.seen[:2] == [b"last", b"arrived before"]
        and len(owner.seen) == 3
        and owner.told == [f"end was lost: because of {error}"]
    )
    assert not owner.pipe.write(b"x") and owner.pipe.write(b"") and owner.pipe.discard() == 0
    await asyncio.sleep(1)
    assert len(owner.end.closed_in) == 1, "it is given back at once"
    await owner.pipe.close()
    assert len(owner.end.closed_in) == 1 and len(owner.told) == 1


# What is written


@pytest.mark.virtual
async def test_what_the_system_does_not_take_waits_and_follows_in_order() -> None:
    owner = Owner()
    owner.start()
    owner.end.full()
    owner.end.room = 3
    assert owner.pipe.write(b"") and owner.pipe.write(b"abcde") and owner.pipe.write(b"fg")
    assert owner.end.taken == b"abc" and owner.pipe.pending == 4
    await asyncio.sleep(1)
    owner.end.free()
    owner.end.room = 1
    assert owner.pipe.write(b"h") and owner.end.taken == b"abc", "it overtakes nothing"
    owner.end.room = 10**6
    await until(lambda: owner.end.taken == b"abcdefgh")
    assert owner.pipe.pending == 0
    await asyncio.sleep(60)  # nothing is left to watch for
    assert owner.pipe.write(b"i") and owner.end.taken == b"abcdefghi"
    await owner.pipe.close()


@pytest.mark.virtual
@pytest.mark.parametrize("whole", [False, True])
async def test_what_waits_is_dropped_and_no_room_is_watched_for_after_that(whole: bool) -> None:
    owner = Owner()
    owner.start()
    owner.end.full()
    owner.end.held = 5
    owner.pipe.write(b"abcde")
    dropped = owner.pipe.discard(whole=True) if whole else owner.pipe.discard()
    assert dropped == (5 if whole else 10) and owner.pipe.pending == 0
    owner.end.room = 10
    assert owner.pipe.write(b"ESC") and owner.end.taken == b"ESC", "a stop waits for no turn of the loop"
    owner.end.free()
    await asyncio.sleep(60)
    assert owner.end.taken == b"ESC" and owner.end.held == (5 if whole else 0)
    owner.end.held = 0
    await owner.pipe.close()


@pytest.mark.virtual
async def test_a_write_that_breaks_the_pipe_tells_it_later_and_what_arrived_comes_first() -> None:
    owner = Owner()
    owner.start()
    owner.end.far.send(b"the end")
    owner.end.breaks = BrokenPipeError(32, "closed")
    assert owner.pipe.write(b"x")
    assert owner.seen == [] and not owner.pipe.write(b"y") and owner.pipe.pending == 0
    await until(lambda: bool(owner.told))
    assert owner.end.reads == 3, "the third finds nothing more"
    assert owner.data == b"the end" and owner.told == ["end was lost: because of [Errno 32] closed"]
    assert owner.seen[-1] is not None and isinstance(owner.seen[-1], TransportLost)
    await owner.pipe.close()


@pytest.mark.virtual
async def test_of_a_flood_that_goes_on_in_spite_of_a_break_only_some_is_read() -> None:
    owner = Owner()
    owner.start()
    owner.end.far.send(bytes(100 * SYSTEM))
    owner.end.breaks = BrokenPipeError(32, "closed")
    owner.pipe.write(b"x")
    await until(lambda: bool(owner.told))
    assert len(owner.data) == 64 * SYSTEM
    await owner.pipe.close()


@pytest.mark.virtual
async def test_the_first_reason_counts() -> None:
    owner = Owner()
    owner.start()
    owner.end.before = [OSError(5, "the second")]
    owner.end.breaks = BrokenPipeError(32, "the first")
    owner.pipe.write(b"x")
    owner.end.far.send(b"!")
    await asyncio.sleep(1)
    assert owner.told == ["end was lost: because of [Errno 32] the first"]
    await owner.pipe.close()


# Begin and end


@pytest.mark.virtual
async def test_a_pipe_is_started_once_and_one_that_broke_before_tells_it_then() -> None:
    owner = Owner()
    owner.end.breaks = BrokenPipeError(32, "closed")
    owner.pipe.write(b"x")
    await asyncio.sleep(1)
    owner.start()
    assert owner.seen == []
    await asyncio.sleep(1)
    assert owner.told == ["end was lost: because of [Errno 32] closed"]
    with pytest.raises(RuntimeError, match=r"^end was started before$"):
        owner.start()
    await owner.pipe.close()


@pytest.mark.virtual
async def test_a_closed_pipe_delivers_and_tells_nothing() -> None:
    owner = Owner()
    await owner.pipe.close()
    owner.start()
    assert not owner.pipe.write(b"x") and owner.pipe.write(b"") and owner.pipe.discard() == 0
    assert not owner.pipe.preempt(False, lambda dropped: b"!") and not owner.pipe.follow(lambda w: b"!", key=True)
    await asyncio.sleep(1)
    assert owner.seen == [] and owner.end.taken == b""


@pytest.mark.virtual
@pytest.mark.parametrize(("leaves_after", "closed_after"), [(0.0, 0.0), (0.3, 0.3), (0.95, 0.95), (5.0, 1.0)])
async def test_closing_waits_for_what_has_not_left_but_no_longer_than_1_s(
    leaves_after: float, closed_after: float
) -> None:
    loop = asyncio.get_running_loop()
    for where in ("here", "system"):
        owner = Owner()
        owner.start()
        if where == "system":
            owner.end.held = 5
            loop.call_later(leaves_after, owner.end.drop)
        else:
            owner.end.full()
            owner.pipe.write(b"ESC")
            loop.call_later(leaves_after, owner.end.free)
        if not leaves_after:
            await asyncio.sleep(0.01)
        begin, descriptor = loop.time(), owner.end.fileno()
        closing = asyncio.create_task(owner.pipe.close())
        await asyncio.sleep(0)
        owner.end.far.send(b"too late")
        await closing
        assert not loop.remove_reader(descriptor) and not loop.remove_writer(descriptor), "it watches nothing"
        assert loop.time() - begin == pytest.approx(closed_after, abs=0.006)
        assert owner.seen == [] and len(owner.end.closed_in) == 1
        assert where == "system" or owner.end.taken == (b"ESC" if leaves_after < 1 else b"")


@pytest.mark.virtual
async def test_a_break_while_it_is_closed_ends_the_wait_and_is_not_told() -> None:
    owner = Owner()
    owner.start()
    owner.end.full()
    owner.pipe.write(b"ESC")
    begin = asyncio.get_running_loop().time()
    closing = asyncio.create_task(owner.pipe.close())
    await asyncio.sleep(0.1)
    owner.end.breaks = BrokenPipeError(32, "closed")
    owner.end.free()
    await closing
    assert asyncio.get_running_loop().time() - begin == pytest.approx(0.1, abs=0.006)
    await asyncio.sleep(1)
    assert owner.seen == [] and len(owner.end.closed_in) == 1


async def test_every_caller_waits_for_the_close_which_a_cancelled_one_does_not_end(owner: Owner) -> None:
    owner.start()
    owner.end.held = 5
    first, second = (asyncio.create_task(owner.pipe.close()) for _ in range(2))
    await asyncio.sleep(0)
    first.cancel()
    await asyncio.sleep(0.02)
    assert first.cancelled() and not second.done() and owner.end.closed_in == []
    owner.end.held = 0
    await second
    [thread] = owner.end.closed_in
    assert thread is not threading.current_thread(), "closing may block"


# Other threads


@pytest.mark.virtual
async def test_a_stop_that_breaks_the_pipe_is_a_loss_and_a_broken_pipe_takes_none() -> None:
    owner = Owner()
    owner.start()
    asked: list[int] = []

    def piece(waiting: int) -> bytes:
        asked.append(waiting)
        return b"!"

    owner.end.full()
    assert owner.pipe.preempt(False, lambda dropped: b"ESC") and owner.pipe.pending == 3
    assert owner.pipe.follow(piece) and asked == [3] and owner.pipe.pending == 4
    owner.end.breaks = BrokenPipeError(32, "closed")
    assert not owner.pipe.follow(piece) and asked == [3], "the stop did not leave"
    await until(lambda: bool(owner.told))
    assert not owner.pipe.preempt(False, piece) and not owner.pipe.follow(piece, key=True) and asked == [3]
    await owner.pipe.close()


@pytest.mark.virtual
@pytest.mark.parametrize("way", ["preempt", "follow"])
async def test_the_loop_is_told_of_a_stop_that_cannot_be_written(way: str) -> None:
    owner = Owner()
    owner.start()
    owner.end.breaks = BrokenPipeError(32, "closed")
    if way == "preempt":
        assert owner.pipe.preempt(False, lambda dropped: b"ESC")
    else:
        assert owner.pipe.follow(lambda waiting: b"ESC", key=True)
    assert owner.seen == []
    await until(lambda: bool(owner.told))
    assert owner.told == ["end was lost: because of [Errno 32] closed"]
    await owner.pipe.close()


@pytest.mark.virtual
@pytest.mark.parametrize("way", ["preempt", "follow"])
async def test_a_stop_that_waits_leaves_when_there_is_room(way: str) -> None:
    owner = Owner()
    owner.start()
    owner.end.full()
    owner.end.room = 1
    if way == "preempt":
        assert owner.pipe.preempt(False, lambda dropped: b"ESC")
    else:
        assert owner.pipe.follow(lambda waiting: b"ESC", key=True)
    assert owner.end.taken == b"E" and owner.pipe.pending == 2
    await asyncio.sleep(0.1)
    owner.end.free()
    await until(lambda: owner.end.taken == b"ESC")
    assert not owner.pipe.write(b"x")
    await asyncio.sleep(60)
    await owner.pipe.close()


@pytest.mark.virtual
async def test_the_loop_writes_again_when_it_has_followed_every_stop_and_key() -> None:
    owner = Owner()
    pipe, noted = owner.pipe, list[bool]()
    owner.end.held = 5
    dropped: list[int] = []

    def stop(number: int) -> bytes:
        dropped.append(number)
        return b"S"

    assert pipe.yielded(noted.append) and pipe.yielded() and noted == [True]
    assert not pipe.follow(stop) and pipe.preempt(False, stop) and pipe.preempt(False, stop) and dropped == [5, 0]
    assert not pipe.follow(lambda waiting: None, key=True) and not pipe.follow(lambda waiting: None)
    assert pipe.follow(lambda waiting: b"") and pipe.follow(lambda waiting: b"p")
    assert pipe.follow(lambda waiting: b"K", key=True)
    for last in (False, False, True):
        assert not pipe.write(b"x")
        assert pipe.yielded(noted.append) is last
    assert noted == [True, False, False, True]
    assert pipe.write(b"x") and owner.end.taken == b"SSpKx" and not pipe.follow(lambda waiting: b"p")
    await pipe.close()


def test_a_write_has_begun_once_the_system_has_some_of_it() -> None:
    chunk = memoryview(b"abc")
    assert not begun(chunk) and begun(chunk[1:]) and begun(chunk[3:])


# A pipe of another kind


class Bare(Pipe):
    """A pipe that the test breaks."""

    def break_by(self, error: OSError | None, kind: type[TransportLost]) -> None:
        self._break(error, kind)

    def write(self, data: bytes) -> bool:
        return False

    def discard(self, whole: bool = False) -> int:
        return 0

    def _begin(self) -> None: ...

    def _halt(self) -> None: ...

    def _drain(self) -> None:
        self._deliver(b"rest")

    def _idle(self) -> bool:
        return True

    def _release(self) -> None: ...

    def _explain(self, error: OSError | None) -> str:
        return "why"


@pytest.mark.virtual
async def test_a_loss_is_of_its_kind_and_the_last_that_is_heard() -> None:
    pipe, seen = Bare("bare"), list[Any]()

    def lost(loss: TransportLost) -> None:
        seen.append(loss)
        pipe.break_by(None, TransportLost)

    told: Lost = lost
    pipe.start(seen.append, told)
    pipe.break_by(None, Undelivered)
    await asyncio.sleep(1)
    assert [type(each) for each in seen] == [bytes, Undelivered] and str(seen[1]) == "bare was lost: why"
    assert pipe.control is None and pipe.name == "bare"
    await pipe.close()


# Calls in a thread


async def test_a_call_in_a_thread_gives_its_result_or_its_error() -> None:
    undone: list[object] = []
    assert await in_thread(threading.current_thread, undone.append) is not threading.current_thread()
    with pytest.raises(ZeroDivisionError):
        await in_thread(lambda: 1 // 0, undone.append)
    assert undone == []


@pytest.mark.parametrize("fails", [False, True])
async def test_the_result_that_no_one_waits_for_any_more_is_undone(fails: bool) -> None:
    may, undone, problems = threading.Event(), list[int](), list[object]()
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: problems.append(context))

    def make() -> int:
        assert may.wait(PATIENCE)
        if fails:
            raise OSError
        return 7

    waiting = asyncio.ensure_future(in_thread(make, undone.append))
    await asyncio.sleep(0.01)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert undone == []
    may.set()
    await in_thread(lambda: None, lambda none: None)
    if not fails:
        await until(lambda: bool(undone))
    else:
        await asyncio.sleep(0.02)
    assert undone == ([] if fails else [7]) and problems == []


# The clock


@pytest.mark.parametrize(
    ("platform", "version", "finer"),
    [("win32", (3, 12), True), ("win32", (3, 13), False), ("linux", (3, 12), False)],
)
def test_the_clock_of_windows_loops_goes_on_with_a_finer_one_before_python_3_13(
    monkeypatch: pytest.MonkeyPatch, platform: str, version: tuple[int, int], finer: bool
) -> None:
    now = [1000.0]
    monkeypatch.setattr(here, "sys", SimpleNamespace(platform=platform, version_info=version))
    monkeypatch.setattr(here, "time", SimpleNamespace(perf_counter=lambda: now[0]))

    async def measured() -> float:
        loop = asyncio.get_running_loop()
        before = loop.time()
        assert running_loop() is loop
        now[0] += 2.5
        clock = loop.time
        assert running_loop() is loop and loop.time == clock, "asked again, it is the same"
        return loop.time() - before

    with asyncio.Runner() as runner:
        passed = runner.run(measured())
    assert (passed > 2) == finer and (not finer or passed == pytest.approx(2.5, abs=0.5))


@pytest.mark.virtual
async def test_a_loop_with_a_clock_of_its_own_keeps_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "sys", SimpleNamespace(platform="win32", version_info=(3, 12)))
    clock = asyncio.get_running_loop().time
    assert running_loop().time == clock


def test_with_the_finer_clock_no_timer_is_early(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "sys", SimpleNamespace(platform="win32", version_info=(3, 12)))

    async def measured() -> float:
        running_loop()
        begun_at = time.perf_counter()
        await asyncio.sleep(0.02)
        return time.perf_counter() - begun_at

    with asyncio.Runner() as runner:
        assert runner.run(measured()) >= 0.0199
