"""The near side of a relay over time: signs of life, and what a far side that says nothing costs."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from multidrop.transports import TransportLost
from multidrop.transports.relay import BEAT, MISSED, Frames, Kind, frame
from multidrop.transports.relay_pipe import RelayPipe
from tests.support.lent_port import SocketConnection

pytestmark = pytest.mark.virtual


@asynccontextmanager
async def pipe(early: bytes = b"") -> AsyncIterator[tuple[RelayPipe, socket.socket, bytearray, list[TransportLost]]]:
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    data, losses = bytearray(), []
    with theirs:
        transport = RelayPipe(SocketConnection(ours), 9600, early)
        try:
            yield transport, theirs, data, losses
        finally:
            await transport.close()


async def test_a_far_side_that_does_not_reply_is_lost_after_three_signs_of_life() -> None:
    async with pipe() as (transport, _, data, losses):
        transport.start(data.extend, losses.append)
        began = asyncio.get_running_loop().time()
        while not losses:
            await asyncio.sleep(0.1)
        assert asyncio.get_running_loop().time() - began == pytest.approx(MISSED * BEAT, abs=0.2)
        assert "has not replied for 4.5 s" in str(losses[0])
        assert not transport.write(b"MR 51200\r")


async def test_a_far_side_that_replies_is_kept_and_one_that_is_not_read_yet_is_not_missed() -> None:
    async with pipe() as (transport, far, data, losses):
        await asyncio.sleep(10 * BEAT)
        transport.start(data.extend, losses.append)
        asked = Frames()
        for _ in range(100):
            await asyncio.sleep(BEAT)
            replies = sum(kind is Kind.BEAT for kind, _ in asked.take(far.recv(1000)))
            far.send(frame(Kind.BEAT) * replies)
        assert losses == []


async def test_what_came_with_the_greeting_is_delivered_first() -> None:
    async with pipe(frame(Kind.DATA, b"512") + frame(Kind.DATA)[:1]) as (transport, far, data, losses):
        transport.start(data.extend, losses.append)
        far.send(frame(Kind.DATA, b"00\r\n")[1:])
        while len(data) < 7:
            await asyncio.sleep(0.1)
        assert data == b"51200\r\n" and losses == []


@pytest.mark.parametrize(
    ("last", "reason"),
    [
        (frame(Kind.LOST, b"the port is gone (unplugged)"), "the port is gone (unplugged)"),
        (frame(Kind.DATA, b"half of a frame")[:9], "the connection has ended; check the network"),
        (b"Connection to pc closed.", "not of a relay"),
    ],
)
async def test_every_end_is_one_loss_with_a_reason(last: bytes, reason: str) -> None:
    async with pipe() as (transport, far, data, losses):
        transport.start(data.extend, losses.append)
        far.send(frame(Kind.DATA, b"51200\r\n") + last)
        far.shutdown(socket.SHUT_RDWR)
        while not losses:
            await asyncio.sleep(0.1)
        await asyncio.sleep(20.0)
        assert bytes(data) == b"51200\r\n" or "not of a relay" in reason
        assert len(losses) == 1 and reason in str(losses[0])
