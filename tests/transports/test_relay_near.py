"""The near side of a relay: what it sends when, its signs of life, changes of settings, and the words for its end."""

from __future__ import annotations

import asyncio
import errno
import gc
import os
import socket
import threading
import weakref
from collections.abc import Callable
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import relay_pipe
from multidrop.transports.relay import CREDIT, FrameSplitter, Kind, frame
from multidrop.transports.relay_pipe import RelayControl, RelayEndpoint, RelayPipe, SocketStream
from tests.support.cases import for_each
from tests.support.until import until

pytestmark = pytest.mark.fork
ESC = b"\x1b"


class Way:
    """A connection in memory; `there` is what it took."""

    name = "ssh://pc/dev/ttyS0"

    def __init__(self) -> None:
        self.there, self.back = bytearray(), bytearray()
        self.takes = 10**6
        self.asked: list[int] = []
        self.words = ""
        self.ended: list[bool] = []

    def fileno(self) -> int:
        return 7

    def read(self, most: int) -> bytes:
        self.asked.append(most)
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
        return self.words

    def close(self, lost: bool) -> None:
        self.ended.append(lost)

    def sent(self) -> list[tuple[Kind, bytes]]:
        """The frames that it took, since the last call."""
        data = bytes(self.there)
        self.there.clear()
        return list(FrameSplitter().take(data))


@pytest.fixture
def way() -> Way:
    return Way()


def near(way: Way, early: bytes = b"") -> RelayEndpoint:
    connection: Any = way
    return RelayEndpoint(connection, early)


# Frames and credit


def test_a_write_is_cut_to_the_credit_and_into_frames(way: Way) -> None:
    end = near(way)
    assert end.name == way.name and end.fileno() == 7 and end.room == CREDIT == 256
    assert end.write(b"") == 0 and way.sent() == []
    assert end.write(b"x" * 300) == 256 and (end.room, end.unsent(), end.blocked) == (0, 256, False)
    assert way.sent() == [(Kind.DATA, b"x" * 256)]
    with pytest.raises(BlockingIOError):
        end.write(b"y")
    end.hurry()
    assert end.write(b"s" * 5000) == 5000 and end.room < 0
    assert [(kind, len(data)) for kind, data in way.sent()] == [(Kind.DATA, 4096), (Kind.DATA, 904)]
    with pytest.raises(BlockingIOError):
        end.write(b"y")  # one hurry is for one write
    way.back += frame(Kind.DONE, (5000 + 256 - 10).to_bytes(8))
    assert end.read() == b"" and (end.unsent(), end.room) == (10, 246)
    assert end.write(b"z") == 1 and end.unsent() == 11


def test_a_drop_frees_the_credit_and_counts_what_the_port_had_not_sent(way: Way) -> None:
    end = near(way)
    end.write(b"x" * 100)
    way.back += frame(Kind.DONE, (40).to_bytes(8))
    end.read()
    way.takes = 0
    end.write(b"y" * 7)
    assert end.blocked and end.drop() == 67 and end.room == 256 and end.unsent() == 60
    way.takes, way.there = 10**6, bytearray()
    assert end.write(ESC * 300) == 300, "what follows a drop needs no credit"
    assert way.sent() == [(Kind.DROP, b""), (Kind.DATA, ESC * 300)]
    assert end.unsent() == 360 and not end.blocked


def test_what_the_way_does_not_take_follows_from_where_it_was_cut(way: Way) -> None:
    end = near(way)
    way.takes = 5
    assert end.write(b"MR 51200\r") == 9 and end.blocked
    with pytest.raises(BlockingIOError):
        end.write(b"PR P\r")
    end.flush()
    way.takes = 10**6
    assert end.write(b"PR P\r") == 5 and not end.blocked
    assert way.sent() == [(Kind.DATA, b"MR 51200\r"), (Kind.DATA, b"PR P\r")]


def test_no_more_than_4096_bytes_are_read_at_once_and_the_early_ones_first(way: Way) -> None:
    end = near(way, frame(Kind.DATA, b"early"))
    way.back += frame(Kind.DATA, bytes(4096))
    assert end.read() == b"early" and way.asked == []
    assert end.read() == b"" and end.read() == bytes(4096) and end.read() is None and way.asked == [4096] * 3


def test_news_of_the_far_side_are_no_bytes_of_the_port(way: Way) -> None:
    end = near(way)
    way.back += frame(Kind.BEAT) + frame(Kind.OUTCOME) + frame(Kind.OUTCOME, b"\x03no\xff") + frame(Kind.BEAT)
    way.back += frame(Kind.DATA, b"51200") + frame(Kind.DROP) + frame(Kind.DATA, b"\r\n")
    assert end.read() == b"51200\r\n" and end.answered == 2 and not end.over
    assert end.outcomes == {3: "no\N{REPLACEMENT CHARACTER}"}
    way.back += frame(Kind.LOST, b"gone \xff")
    assert end.read() == b"" and end.over and end.explain(None) == "gone \N{REPLACEMENT CHARACTER}"


# The words for its end


@for_each(
    ("words", "error", "why"),
    [
        ("", None, "the connection has ended; check the network and the other machine"),
        ("", OSError(104, "reset"), "reset; check the network and the other machine"),
        ("", OSError("too late"), "too late"),
        ("Connection closed.", None, "Connection closed."),
        ("Connection closed.", OSError(104, "reset"), "Connection closed."),
        ("Connection closed.", OSError("too late"), "too late"),
    ],
)
def test_the_end_is_explained_by_whoever_knows_most(words: str, error: OSError | None, why: str) -> None:
    way = Way()
    way.words = words
    end = near(way)
    assert end.explain(error) == why
    end.close()
    assert way.ended == [True]
    untroubled = near(way)
    untroubled.close()
    assert way.ended == [True, False], "a close of ours is no loss"


def test_bytes_of_no_relay_are_told_before_the_words_of_ssh(way: Way) -> None:
    end = near(way, b"bash: warning\n")
    way.words = "Connection closed."
    with pytest.raises(OSError, match=r"^the other end sends what is not of a relay \(.+\)$") as told:
        end.read()
    assert end.over and end.explain(told.value) == str(told.value)


# Settings


class Far:
    """Replies to each change at once."""

    def __init__(self, way: Way, refuses: str = "") -> None:
        self.way, self.refuses = way, refuses
        self.end = near(way)
        self.changes: list[bytes] = []
        self.control = RelayControl(self.end, self.change, 9600)

    def change(self, made: bytes) -> None:
        [(kind, payload)] = FrameSplitter().take(made)
        assert kind is Kind.SET
        self.changes.append(payload)
        self.way.back += frame(Kind.OUTCOME, payload[:1] + self.refuses.encode())
        self.end.read()


def test_each_change_has_a_number_and_is_done_when_the_far_side_says_so(way: Way) -> None:
    far = Far(way)
    calls: list[Callable[[], None]] = [
        lambda: far.control.set_baud(115200),
        lambda: far.control.set_dtr(True),
        lambda: far.control.set_rts(False),
        lambda: far.control.set_break(True),
    ]
    for call in calls:
        call()
    assert far.changes == [
        bytes.fromhex(each) for each in ("01010001c200", "020200000001", "030300000000", "040400000001")
    ]
    assert far.control.baud == 115200 and far.end.outcomes == {}
    for _ in range(252):
        far.control.set_dtr(True)
    assert [each[0] for each in far.changes][-3:] == [254, 255, 0]


def test_a_refusal_is_an_error_with_its_text_and_an_outcome_that_came_late_is_no_other_changes(way: Way) -> None:
    far = Far(way, refuses="Invalid argument")
    with pytest.raises(OSError, match=r"^Invalid argument$"):
        far.control.set_baud(7)
    assert far.control.baud == 9600
    far.refuses = ""
    way.back += frame(Kind.OUTCOME, b"\x02late")
    far.end.read()
    far.control.set_baud(19200)
    assert far.control.baud == 19200


def test_an_outcome_is_waited_for_5_s_and_not_beyond_the_end(way: Way) -> None:
    waits: list[float | None] = []

    class Clock(threading.Condition):
        def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
            waits.append(timeout)
            return predicate()

    end = near(way)
    end.news = Clock()
    with pytest.raises(OSError, match=r"^the far side does not reply$"):
        end.outcome(1)
    assert waits == [5.0]
    end.end()
    with pytest.raises(OSError, match=r"^the connection has ended$"):
        end.outcome(1)


def test_whoever_waits_for_an_outcome_is_woken_by_it_and_by_the_end(way: Way) -> None:
    end, heard = near(way), list[object]()
    waiting = threading.Event()

    class Noted(threading.Condition):
        def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
            waiting.set()
            return super().wait_for(predicate, None if timeout else timeout)

    def wait(number: int) -> None:
        try:
            heard.append(end.outcome(number))
        except OSError as error:
            heard.append(str(error))

    end.news = Noted()
    for number, wake in ((3, end.read), (4, end.end)):
        way.back += frame(Kind.OUTCOME, b"\x03done")
        waiting.clear()
        thread = threading.Thread(target=wait, args=(number,), daemon=True)
        thread.start()
        assert waiting.wait(5.0)
        wake()
        thread.join(5.0)
        assert not thread.is_alive()
    assert heard == ["done", "the connection has ended"]


# A stream over a socket


async def test_a_stream_over_a_socket_never_blocks_and_its_end_is_empty() -> None:
    ours, theirs = socket.socketpair()
    with theirs:
        stream = SocketStream("ssh://pc/dev/ttyS0", ours)
        assert stream.name == "ssh://pc/dev/ttyS0" and stream.fileno() == ours.fileno() and stream.last_words() == ""
        with pytest.raises(BlockingIOError):
            stream.read(10)
        theirs.send(b"x" * 70000)
        assert stream.read(10) == b"x" * 10 and len(await stream.read_some()) == 65536
        assert stream.write(b"abc") == 3 and theirs.recv(10) == b"abc"
        theirs.shutdown(socket.SHUT_WR)
        assert len(await stream.read_some()) == 70000 - 10 - 65536 and await stream.read_some() == b""
        assert stream.read(10) == b""
        stream.close(False)
        assert ours.fileno() == -1 and await stream.read_some() == b""


# The pipe


class Open:
    """A pipe over a socket, its far end, and what it told."""

    def __init__(self, early: bytes = b"", **more: Any) -> None:
        ours, self.far = socket.socketpair()
        self.far.setblocking(False)
        self.frames = FrameSplitter()
        self.pipe = RelayPipe(SocketStream("ssh://pc/dev/ttyS0", ours), 9600, early, **more)
        self.data, self.losses = bytearray(), list[TransportLost]()

    def start(self) -> None:
        self.pipe.start(self.data.extend, self.losses.append)

    def sent(self, *but: Kind) -> list[tuple[Kind, bytes]]:
        """The frames that have arrived, but those of some kinds."""
        try:
            data = self.far.recv(1 << 20)
        except BlockingIOError:
            return []
        return [each for each in self.frames.take(data) if each[0] not in but]

    async def close(self) -> None:
        await self.pipe.close()
        self.far.close()


@pytest.mark.virtual
async def test_a_sign_of_life_goes_out_at_once_and_each_1500_ms_and_three_in_turn_without_a_reply_are_a_loss() -> None:
    each = Open(round_trip=0.25)
    assert each.pipe.round_trip == 0.25 and each.pipe.control is not None and each.pipe.control.baud == 9600
    each.start()
    loop = asyncio.get_running_loop()
    begin, beats = loop.time(), list[float]()
    for replies in (True, False, False, True, False, False, False):
        await until(lambda: each.sent() == [(Kind.BEAT, b"")])
        beats.append(loop.time() - begin)
        if replies:
            each.far.send(frame(Kind.BEAT))
    assert beats == pytest.approx([1.5 * number for number in range(7)], abs=0.01) and each.losses == []
    await until(lambda: bool(each.losses))
    assert loop.time() - begin == pytest.approx(10.5, abs=0.01)
    assert str(each.losses[0]) == (
        "ssh://pc/dev/ttyS0 was lost: the far side has not replied for 4.5 s; check the network"
    )
    await asyncio.sleep(60)
    assert each.sent() == [] and len(each.losses) == 1
    await each.close()


@pytest.mark.virtual
async def test_a_closed_pipe_gives_no_sign_of_life_and_takes_no_change() -> None:
    each = Open()
    assert each.pipe.round_trip == 0.0
    each.start()
    await each.pipe.close()
    control = each.pipe.control
    assert control is not None
    with pytest.raises(OSError, match=r"^the connection has ended$"):
        control.set_baud(19200)
    await asyncio.sleep(60)
    assert each.sent() == [(Kind.BEAT, b"")] and each.losses == [] and each.far.recv(10) == b""
    await each.close()


@pytest.mark.virtual
@pytest.mark.parametrize("whole", [False, True])
async def test_a_discard_has_the_far_side_drop_unless_what_has_begun_is_to_leave(whole: bool) -> None:
    each = Open()
    each.start()
    assert each.pipe.write(b"x" * 300) and each.pipe.pending == 44
    dropped = each.pipe.discard(whole=True) if whole else each.pipe.discard()
    assert dropped == (0 if whole else 300) and each.pipe.pending == (44 if whole else 0)
    told = [] if whole else [(Kind.DROP, b"")]
    assert each.sent(Kind.BEAT) == [(Kind.DATA, b"x" * 256), *told]
    await each.close()
    assert each.pipe.discard() == 0


@pytest.mark.virtual
async def test_what_waits_leaves_with_the_report_of_the_far_side() -> None:
    each = Open()
    each.start()
    each.pipe.write(b"x" * 300)
    await asyncio.sleep(0.1)
    assert each.sent(Kind.BEAT) == [(Kind.DATA, b"x" * 256)] and each.pipe.pending == 44
    each.far.send(frame(Kind.DONE, (20).to_bytes(8)))
    await until(lambda: each.pipe.pending == 24)
    assert each.sent(Kind.BEAT) == [(Kind.DATA, b"x" * 20)]
    each.far.send(frame(Kind.DONE, (300).to_bytes(8)))
    await until(lambda: each.pipe.pending == 0)
    await each.close()


@pytest.mark.virtual
async def test_what_follows_a_stop_needs_no_credit_and_nothing_to_send_asks_for_none() -> None:
    each = Open()
    each.start()
    each.pipe.write(b"x" * 256)
    assert not each.pipe.follow(lambda waiting: b"y"), "no stop came"
    assert each.pipe.preempt(False, lambda dropped: ESC) and each.pipe.follow(lambda waiting: b"y" * 300)
    assert each.pipe.follow(lambda waiting: b"") and not each.pipe.follow(lambda waiting: None)
    assert each.pipe.follow(lambda waiting: b"K", key=True) and not each.pipe.yielded() and each.pipe.yielded()
    assert each.pipe.write(b"z" * 9) and each.pipe.pending == 9, "a command waits for its credit"
    assert each.sent(Kind.BEAT) == [
        (Kind.DATA, b"x" * 256), (Kind.DROP, b""), (Kind.DATA, ESC), (Kind.DATA, b"y" * 300), (Kind.DATA, b"K"),
    ]  # fmt: skip
    await each.close()


@pytest.mark.virtual
async def test_early_bytes_of_a_pipe_that_is_closed_first_are_not_delivered() -> None:
    each = Open(frame(Kind.DATA, b"early"))
    each.start()
    await each.pipe.close()
    assert each.data == b"" and each.losses == []
    other = Open(frame(Kind.DATA, b"early") + frame(Kind.LOST, b"the port is gone"))
    other.start()
    assert other.data == b"", "in a later turn"
    assert await until(lambda: bool(other.losses)) < 0.1, "it does not wait for the end of the connection"
    assert other.data == b"early" and str(other.losses[0]) == "ssh://pc/dev/ttyS0 was lost: the port is gone"
    await each.close()
    await other.close()


@pytest.mark.virtual
@pytest.mark.parametrize("what", ["write", "setting", "stop"])
async def test_a_connection_that_cannot_be_written_to_is_a_loss(what: str) -> None:
    each = Open()
    each.start()
    await asyncio.sleep(0.1)
    each.sent()
    each.far.close()
    control = each.pipe.control
    assert control is not None
    if what == "write":
        assert each.pipe.write(b"x")
    elif what == "stop":
        assert each.pipe.preempt(False, lambda dropped: ESC)
    else:
        changing = threading.Thread(target=lambda: pytest.raises(OSError, control.set_baud, 19200), daemon=True)
        changing.start()
    await until(lambda: bool(each.losses))
    why = str(each.losses[0]).removeprefix("ssh://pc/dev/ttyS0 was lost: ")
    assert why == f"{os.strerror(errno.EPIPE)}; check the network and the other machine" or what == "setting", why
    assert not each.pipe.write(b"x")
    await each.close()


@pytest.mark.virtual
async def test_closing_waits_until_the_frames_that_wait_have_left() -> None:
    each = Open()
    each.start()
    taken = 0
    for _ in range(300):  # more than a socket holds
        each.pipe.preempt(False, lambda dropped: bytes(4096))
    loop = asyncio.get_running_loop()
    begin = loop.time()

    def free() -> None:
        nonlocal taken
        with pytest.raises(BlockingIOError):
            while True:
                taken += len(each.far.recv(1 << 20))

    loop.call_later(0.3, free)
    await each.pipe.close()
    assert taken > 4096 and 0.3 <= loop.time() - begin <= 1.01
    await each.close()


@pytest.mark.virtual
@pytest.mark.parametrize(("reported", "closed"), [(0.3, 0.3), (5.0, 1.0)])
async def test_closing_waits_for_the_port_to_send_but_no_longer_than_1_s(reported: float, closed: float) -> None:
    each = Open()
    each.start()
    each.pipe.write(ESC)
    loop = asyncio.get_running_loop()
    begin = loop.time()
    later = loop.call_later(reported, each.far.send, frame(Kind.DONE, (1).to_bytes(8)))
    await each.pipe.close()
    assert loop.time() - begin == pytest.approx(closed, abs=0.006)
    later.cancel()
    await each.close()


@pytest.mark.virtual
async def test_all_that_arrived_before_a_break_is_delivered() -> None:
    each = Open()
    each.start()
    each.sent()
    each.far.send(frame(Kind.DATA, bytes(4000)) * 3)
    each.far.close()
    each.pipe.write(b"x")
    await until(lambda: bool(each.losses))
    assert len(each.data) == 12000
    await each.close()


@pytest.mark.virtual
async def test_what_waits_for_its_credit_as_it_is_closed_leaves_with_the_report() -> None:
    each = Open()
    each.start()
    each.pipe.write(b"x" * 300)
    loop = asyncio.get_running_loop()
    begin = loop.time()
    for after, sent in ((0.3, 256), (0.5, 300)):
        loop.call_later(after, each.far.send, frame(Kind.DONE, sent.to_bytes(8)))
    await each.pipe.close()
    assert loop.time() - begin == pytest.approx(0.5, abs=0.006)
    assert each.sent(Kind.BEAT) == [(Kind.DATA, b"x" * 256), (Kind.DATA, b"x" * 44)]
    await each.close()


@pytest.mark.virtual
async def test_no_setting_is_changed_while_it_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(relay_pipe, "SETTING_TIMEOUT", 0.0)
    each = Open()
    each.start()
    each.pipe.write(ESC)
    closing = asyncio.create_task(each.pipe.close())
    await asyncio.sleep(0.1)
    control = each.pipe.control
    assert control is not None and not closing.done()
    with pytest.raises(OSError, match="the far side does not reply"):
        control.set_dtr(True)
    await closing
    assert each.sent() == [(Kind.BEAT, b""), (Kind.DATA, ESC)]
    await each.close()


@pytest.mark.virtual
async def test_the_loop_lets_go_of_a_closed_pipe() -> None:
    each = Open()
    each.start()
    await each.close()
    kept = weakref.ref(each.pipe)
    del each
    await asyncio.sleep(60)
    gc.collect()
    assert kept() is None
