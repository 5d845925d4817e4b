"""The relay's two sides in memory: frames, credit, the drop that goes ahead of what was sent, signs of life."""

from __future__ import annotations

import asyncio
import os
import select
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multidrop.base.errors import TransportLost
from multidrop.transports import relay
from multidrop.transports.port_users import lock_owner
from multidrop.transports.relay import (
    BEAT,
    CREDIT,
    GREETING,
    MISSED,
    MOST_FRAME_BYTES,
    FrameSplitter,
    GarbledFrame,
    Kind,
    PortSetting,
    Relay,
    frame,
)
from multidrop.transports.relay_pipe import RelayEndpoint, RelayPipe, SocketStream
from tests.support.lent_port import lent

pytestmark = pytest.mark.fork

FRAMES = st.lists(st.tuples(st.sampled_from(Kind), st.binary(max_size=40)), max_size=20)
HELD = 16
"""Bytes that the driver of the port holds."""


@pytest.fixture
def both():
    return Both()


@given(FRAMES, st.integers(1, 7))
def test_frames_come_out_as_they_went_in_whole_and_in_pieces(made: list[tuple[Kind, bytes]], size: int) -> None:
    data = b"".join(frame(*each) for each in made)
    assert list(FrameSplitter().take(data)) == made
    pieces = FrameSplitter()
    found = [each for at in range(0, len(data), size) for each in pieces.take(data[at : at + size])]
    assert found == made


@given(st.binary(min_size=3, max_size=30))
def test_what_is_no_frame_is_refused_and_never_waited_for(data: bytes) -> None:
    known = data[0] in set(Kind) and int.from_bytes(data[1:3]) <= MOST_FRAME_BYTES
    if known:
        list(FrameSplitter().take(data[:3]))
    else:
        with pytest.raises(GarbledFrame):
            list(FrameSplitter().take(data))


@dataclass
class Port:
    """A port whose driver holds a few bytes, and sends when the test says."""

    sent: bytearray = field(default_factory=bytearray)
    held: bytearray = field(default_factory=bytearray)
    arrived: list[bytes | None] = field(default_factory=list)
    settings: list[tuple[str, int]] = field(default_factory=list)
    baud = 9600
    name = "port"

    @property
    def control(self) -> Port:
        return self

    def fileno(self) -> int:
        raise NotImplementedError

    def read(self) -> bytes | None:
        if not self.arrived:
            raise BlockingIOError
        return self.arrived.pop(0)

    def write(self, data: bytes | memoryview) -> int:
        taken = data[: HELD - len(self.held)]
        if not taken:
            raise BlockingIOError
        self.held += taken
        return len(taken)

    def send(self, count: int) -> None:
        self.sent += self.held[:count]
        del self.held[:count]

    def unsent(self) -> int:
        return len(self.held)

    def drop(self) -> int:
        count = len(self.held)
        self.held.clear()
        return count

    def explain(self, error: OSError | None) -> str:
        return "the port is gone"

    def close(self) -> None: ...

    def set_baud(self, baud: int) -> None:
        if baud == 7:
            raise OSError(22, "Invalid argument")
        self.settings.append(("baud", baud))

    def set_dtr(self, on: bool) -> None:
        self.settings.append(("dtr", on))

    def set_rts(self, on: bool) -> None:
        self.settings.append(("rts", on))

    def set_break(self, on: bool) -> None:
        self.settings.append(("break", on))


class Way:
    """A connection like ssh: it takes all bytes, and delivers them at a call of the test."""

    name = "ssh://pc/dev/ttyS0"

    def __init__(self) -> None:
        self.there, self.back = bytearray(), bytearray()
        self.takes = 10**6
        """Number of bytes that it takes until it is full."""

    def fileno(self) -> int:
        raise NotImplementedError

    def read(self, most: int) -> bytes:
        if not self.back:
            raise BlockingIOError
        data = bytes(self.back[:most])
        del self.back[:most]
        return data

    def write(self, data: bytes | bytearray | memoryview) -> int:
        taken = bytes(data[: self.takes])
        if not taken:
            raise BlockingIOError
        self.there += taken
        self.takes -= len(taken)
        return len(taken)

    def last_words(self) -> str:
        return "client_loop: send disconnect: Broken pipe"

    def close(self, lost: bool) -> None: ...


class Both:
    """Two sides of a relay, a way between them, and a port."""

    def __init__(self) -> None:
        self.port, self.way = Port(), Way()
        self.far = Relay(self.port)
        assert bytes(self.far.out) == f"{GREETING}\n".encode()
        self.far.out.clear()
        self.near = RelayEndpoint(self.way, b"")

    def write(self, data: bytes) -> int:
        try:
            return self.near.write(data)
        except BlockingIOError:
            return 0

    def deliver(self, count: int = 10**6) -> None:
        """Deliver bytes to the far side."""
        data = bytes(self.way.there[:count])
        del self.way.there[:count]
        self.far.receive(data)

    def answer(self, count: int = 10**6) -> bytes:
        """Deliver bytes to the near side."""
        self.far.push()
        self.way.back += self.far.out[:count]
        del self.far.out[:count]
        arrived = b""
        while self.way.back:
            arrived += self.near.read() or b""
        return arrived

    def send_all(self) -> None:
        """Let the port send, until nothing waits."""
        while self.port.held or self.far.queue:
            self.port.send(HELD)
            self.far.push()


def test_no_more_leaves_than_the_credit_until_the_port_has_sent(both: Both) -> None:
    assert both.write(b"x" * 1000) == CREDIT
    assert both.write(b"x") == 0
    both.deliver()
    both.answer()
    assert both.write(b"x") == 0, "the driver holds 16 bytes, which are not sent"
    both.port.send(10)
    both.answer()
    assert both.write(b"x" * 1000) == 10
    both.deliver()
    both.send_all()
    both.answer()
    assert both.near.unsent() == 0
    assert bytes(both.port.sent) == b"x" * (CREDIT + 10)


def test_the_stop_is_the_next_that_a_blocked_port_sends(both: Both) -> None:
    both.write(b"MR 51200\r" * 100)
    both.deliver()
    assert len(both.port.held) == HELD and both.far.queue
    assert both.near.drop() == CREDIT
    stop = b"\x1b" * (2 * CREDIT)
    assert both.write(stop) == len(stop), "a stop needs no credit"
    both.deliver()
    both.send_all()
    assert bytes(both.port.sent) == stop


def test_a_drop_is_obeyed_ahead_of_what_came_with_it(both: Both) -> None:
    both.write(b"MR 51200\r")
    both.near.drop()
    both.write(b"\x1b")
    both.deliver()
    both.send_all()
    assert bytes(both.port.sent) == b"\x1b"


@given(st.data())
@settings(max_examples=60)
def test_whatever_is_on_its_way_a_stop_follows_only_what_was_sent_before_it(data: st.DataObject) -> None:
    both, clean = Both(), b""
    for number in range(data.draw(st.integers(1, 12))):
        step = data.draw(st.sampled_from(["write", "deliver", "answer", "send", "stop"]))
        size = data.draw(st.integers(1, 400))
        if step == "write":
            both.write(b"c" * size)
        elif step == "deliver":
            both.deliver(size)
        elif step == "answer":
            both.answer(size)
        elif step == "send":
            both.port.send(size)
        else:
            both.near.drop()
            stop = bytes([number]) * size
            assert both.write(stop) == size
            both.deliver()
            before = bytes(both.port.sent)
            both.send_all()
            assert bytes(both.port.sent) == before + stop
            clean = stop
        assert len(both.far.queue) + len(both.port.held) <= CREDIT + len(clean)
    both.deliver()
    both.send_all()
    both.answer()
    assert both.near.unsent() == 0 and both.near.room == CREDIT


def test_of_what_arrives_after_too_long_a_silence_only_a_stop_is_passed_on(both: Both) -> None:
    both.far.late(frame(Kind.DATA, b"MR 51200\r") + frame(Kind.BEAT))
    both.send_all()
    assert bytes(both.port.sent) == b""
    both.far.late(frame(Kind.DROP) + frame(Kind.DATA, b"\x1b") + frame(Kind.DATA, b"MR 5\r"))
    both.send_all()
    assert bytes(both.port.sent) == b"\x1b"


@pytest.mark.parametrize("taken", range(len(frame(Kind.DATA, b"MR 51200\r"))))
def test_on_a_way_that_is_full_a_stop_follows_only_the_rest_of_a_frame_that_has_begun(both: Both, taken: int) -> None:
    begun = frame(Kind.DATA, b"MR 51200\r") if taken else b""
    both.way.takes = taken
    assert both.write(b"MR 51200\r") == 9
    assert both.near.blocked
    assert both.near.drop() == 9
    assert both.write(b"\x1b") == 0
    both.way.takes = 10**6
    assert both.write(b"\x1b") == 1
    assert bytes(both.way.there) == begun + frame(Kind.DROP) + frame(Kind.DATA, b"\x1b")
    both.deliver()
    both.send_all()
    both.answer()
    assert bytes(both.port.sent) == b"\x1b"
    assert both.near.unsent() == 0 and both.near.room == CREDIT


def test_a_change_of_a_setting_that_waits_is_not_dropped(both: Both) -> None:
    both.way.takes = 0
    change = frame(Kind.SET, b"\x01\x01\x00\x00\x25\x80")
    both.near.send(change)
    both.near.drop()
    both.way.takes = 10**6
    both.near.flush()
    assert bytes(both.way.there) == change + frame(Kind.DROP)


def test_bytes_of_the_port_come_back_in_order_and_its_loss_is_named(both: Both) -> None:
    both.port.arrived += [bytes(range(256)) * 40, b"51200\r\n"]
    assert both.far.read() and both.far.read() and both.far.read()
    assert both.answer(1) == b""
    assert both.answer() == bytes(range(256)) * 40 + b"51200\r\n"
    both.port.arrived.append(None)
    assert not both.far.read()
    both.far.lost(None)
    both.answer()
    assert both.near.over and both.near.explain(None) == "the port is gone"


def test_an_end_without_a_word_of_the_relay_quotes_ssh() -> None:
    assert Both().near.explain(None) == "client_loop: send disconnect: Broken pipe"


@pytest.mark.parametrize(
    ("setting", "value", "done", "outcome"),
    [
        (PortSetting.BAUD, 115200, [("baud", 115200)], ""),
        (PortSetting.BREAK, 1, [("break", True)], ""),
        (PortSetting.RTS, 0, [("rts", False)], ""),
        (PortSetting.DTR, 1, [("dtr", True)], ""),
        (PortSetting.BAUD, 7, [], "Invalid argument"),
        (99, 7, [], "no setting 99"),
    ],
)
def test_settings_of_the_port_change_and_a_refusal_is_named(
    setting: int, value: int, done: list[tuple[str, int]], outcome: str, both: Both
) -> None:
    both.near.send(frame(Kind.SET, bytes([3, setting]) + value.to_bytes(4)))
    both.deliver()
    both.answer()
    assert both.port.settings == done
    assert both.near.outcome(3) == outcome


def test_a_sign_of_life_is_replied_to_and_no_outcome_is_waited_for_at_the_end(both: Both) -> None:
    both.near.send(frame(Kind.BEAT))
    both.deliver()
    both.answer()
    assert both.near.answered == 1
    both.near.end()
    with pytest.raises(OSError, match="the connection has ended"):
        both.near.outcome(1)


@pytest.mark.parametrize("data", [b"GET / HTTP/1.1\r\n", frame(Kind.LOST), frame(Kind.SET, b"\x01")])
def test_input_that_is_not_of_multidrop_ends_the_relay(data: bytes) -> None:
    with pytest.raises(GarbledFrame):
        Both().far.receive(data)


def test_output_that_is_not_of_a_relay_is_a_loss(both: Both) -> None:
    both.way.back += b"bash: warning\n"
    with pytest.raises(OSError, match="not of a relay"):
        both.near.read()


def test_a_relay_that_was_held_up_for_too_long_passes_no_command_on(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = os.openpty()
    now = [0.0]
    monkeypatch.setattr(relay, "_now", lambda: now[0])
    try:
        with lent(os.ttyname(slave)) as connection:
            now[0] = 60.0
            connection.write(frame(Kind.DATA, b"MR 51200\r"))
            assert select.select([connection.fileno()], [], [], 10.0)[0] and connection.read(10) == b""
            assert not select.select([master], [], [], 0)[0]
    finally:
        os.close(master)
        os.close(slave)


def test_a_relay_that_gets_no_sign_of_life_ends_and_frees_its_port() -> None:
    master, slave = os.openpty()
    try:
        with lent(os.ttyname(slave), silence=0.1) as connection:
            found, _, _ = select.select([connection.fileno()], [], [], 10.0)
            assert found and connection.read(10) == b""
            assert lock_owner(os.ttyname(slave)) is None
    finally:
        os.close(master)
        os.close(slave)


# The near side over time


@asynccontextmanager
async def pipe(early: bytes = b"") -> AsyncIterator[tuple[RelayPipe, socket.socket, bytearray, list[TransportLost]]]:
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    data, losses = bytearray(), []
    with theirs:
        transport = RelayPipe(SocketStream("ssh://pc/dev/ttyS0", ours), 9600, early)
        try:
            yield transport, theirs, data, losses
        finally:
            await transport.close()


@pytest.mark.virtual
async def test_a_far_side_that_does_not_reply_is_lost_after_three_signs_of_life() -> None:
    async with pipe() as (transport, _, data, losses):
        transport.start(data.extend, losses.append)
        began = asyncio.get_running_loop().time()
        while not losses:
            await asyncio.sleep(0.1)
        assert asyncio.get_running_loop().time() - began == pytest.approx(MISSED * BEAT, abs=0.2)
        assert "has not replied for 4.5 s" in str(losses[0])
        assert not transport.write(b"MR 51200\r")


@pytest.mark.virtual
async def test_a_far_side_that_replies_is_kept_and_one_that_is_not_read_yet_is_not_missed() -> None:
    async with pipe() as (transport, far, data, losses):
        await asyncio.sleep(10 * BEAT)
        transport.start(data.extend, losses.append)
        asked = FrameSplitter()
        for _ in range(100):
            await asyncio.sleep(BEAT)
            replies = sum(kind is Kind.BEAT for kind, _ in asked.take(far.recv(1000)))
            far.send(frame(Kind.BEAT) * replies)
        assert losses == []


@pytest.mark.virtual
async def test_what_came_with_the_greeting_is_delivered_first() -> None:
    async with pipe(frame(Kind.DATA, b"512") + frame(Kind.DATA)[:1]) as (transport, far, data, losses):
        transport.start(data.extend, losses.append)
        far.send(frame(Kind.DATA, b"00\r\n")[1:])
        while len(data) < 7:
            await asyncio.sleep(0.1)
        assert data == b"51200\r\n" and losses == []


@pytest.mark.virtual
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
