"""What a stop does to bytes that the system has not taken: no command that was not begun is sent any more."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import AsyncIterator

import pytest

from multidrop.transports.pipe import DescriptorPipe
from multidrop.transports.threaded import ThreadedPipe
from tests.support.until import PATIENCE

pytestmark = pytest.mark.fork

ROR, MVP, GAP = bytes([1, 1] + [7] * 7), bytes([1, 4] + [8] * 7), bytes([1, 6] + [9] * 7)
"""Three frames of nine bytes."""
STOP = bytes([1, 3] + [0] * 7)


class Narrow:
    """An endpoint that takes as many bytes as it has room for. It holds `held` of them, which it can take back."""

    name = "narrow"

    def __init__(self) -> None:
        self.room, self.held, self.taken = 0, 0, b""
        self._near, self._far = socket.socketpair()

    def fileno(self) -> int:
        return self._near.fileno()

    def read(self) -> bytes | None:
        raise BlockingIOError

    def write(self, data: bytes | memoryview) -> int:
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
        return str(error)

    def close(self) -> None:
        self._near.close()
        self._far.close()


@pytest.fixture
async def wire() -> AsyncIterator[tuple[Narrow, DescriptorPipe]]:
    end = Narrow()
    pipe = DescriptorPipe(end)
    yield end, pipe
    pipe.discard()
    await pipe.close()


async def goes_on(end: Narrow, pipe: DescriptorPipe) -> bytes:
    """Let the system take everything, and a further frame; return all that it has taken."""
    end.room = 1000
    pipe.write(GAP)
    for _ in range(100):
        await asyncio.sleep(0)
    assert pipe.pending == 0
    return end.taken


async def stop(pipe: DescriptorPipe | ThreadedPipe, whole: bool, by: str) -> int:
    """Write a stop in the loop, or from another thread; return the number of bytes that were dropped for it."""
    if by == "loop":
        dropped = pipe.discard(whole)
        pipe.write(STOP)
        return dropped
    counts: list[int] = []

    def make(dropped: int) -> bytes:
        counts.append(dropped)
        return STOP

    assert await asyncio.to_thread(pipe.preempt, whole, make)
    assert not pipe.write(GAP), "before the loop has followed the key"
    assert pipe.yielded()
    (dropped,) = counts
    return dropped


@pytest.mark.parametrize("by", ["loop", "thread"])
@pytest.mark.parametrize("begun", range(10))
async def test_of_unsent_frames_only_one_that_has_begun_precedes_the_stop(
    wire: tuple[Narrow, DescriptorPipe], begun: int, by: str
) -> None:
    end, pipe = wire
    end.room, end.held = begun, 5
    for frame in (ROR, MVP, GAP):
        pipe.write(frame)
    first = ROR if begun else b""
    assert await stop(pipe, True, by) == len(ROR + MVP + GAP) - len(first)
    assert end.held == 5, "the system may hold half a frame"
    assert await goes_on(end, pipe) == first + STOP + GAP


@pytest.mark.parametrize("by", ["loop", "thread"])
@pytest.mark.parametrize("begun", [0, 3, 12])
async def test_of_unsent_text_nothing_precedes_the_stop(
    wire: tuple[Narrow, DescriptorPipe], begun: int, by: str
) -> None:
    end, pipe = wire
    lines = b"MR 5\r\n", b"SL 7\r\n", b"PR P\r\n"
    end.room, end.held = begun, 4
    for line in lines:
        pipe.write(line)
    assert await stop(pipe, False, by) == len(b"".join(lines)) - begun + 4
    assert await goes_on(end, pipe) == b"".join(lines)[:begun] + STOP + GAP


async def test_a_frame_that_was_cut_off_by_several_stops_leaves_once(wire: tuple[Narrow, DescriptorPipe]) -> None:
    end, pipe = wire
    end.room = 4
    for frame in (ROR, MVP):
        pipe.write(frame)
    dropped = [await stop(pipe, True, by) for by in ("thread", "loop", "thread")]
    assert await goes_on(end, pipe) == ROR + STOP + GAP
    assert dropped == [len(MVP), len(STOP), len(STOP)]


class Gated:
    """A blocking device that takes four bytes at a time. Each write waits until the gate is open."""

    name, piece = "gated", 4

    def __init__(self) -> None:
        self.entered, self.open, self.taken = threading.Event(), threading.Event(), b""

    def write(self, data: bytes) -> None:
        self.entered.set()
        assert self.open.wait(PATIENCE)
        self.taken += data

    def read(self) -> bytes | None:
        return b""

    def abort(self) -> int:
        return 0

    def cancel(self) -> None:
        self.open.set()

    def explain(self, error: OSError | None) -> str:
        return str(error)

    def close(self) -> None:
        """Nothing is held."""


@pytest.mark.parametrize("by", ["loop", "thread"])
@pytest.mark.parametrize("first", [ROR, ROR[:4]])
async def test_the_same_holds_where_a_thread_writes(first: bytes, by: str) -> None:
    device = Gated()
    pipe = ThreadedPipe(device)
    for frame in (first, MVP, GAP):
        pipe.write(frame)
    assert await asyncio.to_thread(device.entered.wait, PATIENCE)
    assert await stop(pipe, True, by) == len(MVP + GAP)
    device.open.set()
    pipe.write(GAP)
    await pipe.close()
    assert device.taken == first + STOP + GAP
