"""A pipe over a device whose calls block, as every port and socket of Windows is, on a device in memory."""

from __future__ import annotations

import asyncio
import threading

from multidrop.base.errors import TransportLost
from multidrop.transports.pipe import running_loop
from multidrop.transports.threaded import ThreadedPipe
from tests.support.until import PATIENCE

PIECE, MANY = 4096, 100


class Endless:
    """A device that always has bytes: many pieces, then its end."""

    name, piece = "endless", 0

    def __init__(self) -> None:
        self.reads = 0
        self.most = threading.Event()
        """Half of all was read."""

    def read(self) -> bytes | None:
        if self.reads == MANY:
            return None
        self.reads += 1
        if self.reads == MANY // 2:
            self.most.set()
        return bytes([self.reads]) * PIECE

    def write(self, data: bytes) -> None:
        """Take it."""

    def abort(self) -> int:
        return 0

    def cancel(self) -> None:
        """No read waits."""

    def explain(self, error: OSError | None) -> str:
        return "it ended"

    def close(self) -> None:
        """It needs none."""


async def test_a_flood_is_not_read_ahead_of_a_loop_that_is_held_up_and_arrives_whole() -> None:
    device, data, over = Endless(), bytearray(), asyncio.Event()
    losses: list[TransportLost] = []
    pipe = ThreadedPipe(device)

    def lost(error: TransportLost) -> None:
        losses.append(error)
        over.set()

    pipe.start(data.extend, lost)
    assert not device.most.wait(0.1), "what the loop has not taken is bounded"
    assert device.reads == 32 * 1024 // PIECE + 1, "the last one waits for room"
    await asyncio.wait_for(over.wait(), PATIENCE)
    assert data == b"".join(bytes([number]) * PIECE for number in range(1, MANY + 1))
    assert [str(each) for each in losses] == ["endless was lost: it ended"]
    await pipe.close()


async def test_a_closed_pipe_waits_for_no_reader() -> None:
    device = Endless()
    pipe = ThreadedPipe(device)
    pipe.start(lambda data: None, lambda error: None)
    assert not device.most.wait(0.1)
    await asyncio.wait_for(pipe.close(), PATIENCE)
    assert device.reads < MANY


async def test_the_clock_of_a_wire_is_finer_than_its_pauses() -> None:
    """Before Python 3.13 the clock of Windows goes in steps of 15.6 ms."""
    begun = asyncio.get_running_loop().time()
    loop, steps = running_loop(), []
    assert 0 <= loop.time() - begun < 1
    for _ in range(20):
        before = loop.time()
        while (now := loop.time()) == before:
            pass
        steps.append(now - before)
    assert min(steps) < 0.001
    assert running_loop() is loop and loop.time() >= now
