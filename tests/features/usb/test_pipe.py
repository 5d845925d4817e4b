"""The pipe of a controller on USB: one command at a time, flushes where a reply is missing, stops ahead of all."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from collections.abc import Callable

import pytest

from multidrop.base.errors import TransportLost
from multidrop.features.usb.interface import CANCELLED, GONE, STALLED, UsbControl
from multidrop.features.usb.pipe import REPLY, TAKEN, WRITE_TIMEOUT, Broken, Done, TransferFailed, UsbPipe, open_usb
from multidrop.transports import Undelivered, Unreachable
from tests.support.cases import for_each
from tests.support.until import until

pytestmark = pytest.mark.virtual


class Played:
    """A carrier whose transfers end when the test says so; `log` is what began, in order."""

    name, delay = "usb:2ED00@1-1", 0.0

    def __init__(self) -> None:
        self.log: list[str] = []
        self.open: dict[int, str] = {}
        """Transfers that have not ended."""
        self.gone = False
        self.closed = 0
        self.halted = False
        self.helpful = True
        """Requests are confirmed by themselves."""

    def start(self, done: Done, broken: Broken) -> None:
        self.done, self.broken, self.loop = done, broken, asyncio.get_running_loop()

    def _begin(self, what: str) -> int:
        if self.gone:
            raise TransferFailed(GONE)
        self.log.append(what)
        number = len(self.log)
        self.open[number] = what
        return number

    def control(self, value: UsbControl) -> int:
        number = self._begin(value.name)
        if self.helpful:
            self.loop.call_soon_threadsafe(self.end, value.name)
        return number

    def send(self, data: bytes) -> int:
        assert data.endswith(b"\0") and data.count(b"\0") == 1
        return self._begin(data[:-1].decode())

    def receive(self) -> int:
        return self._begin("IN")

    def cancel(self, number: int) -> None:
        if number in self.open:
            self.loop.call_soon_threadsafe(self.end, self.open[number], CANCELLED)

    def halt(self) -> None:
        self.halted = True

    def close(self) -> None:
        self.closed += 1

    def end(self, what: str, status: int = 0, data: bytes = b"") -> None:
        """End the first open transfer of this text."""
        number = next((number for number, each in self.open.items() if each == what), 0)
        if number:
            del self.open[number]
            self.done(number, status, data)

    def reply(self, text: str) -> None:
        """The controller takes the command on its way, and replies in a block."""
        for each in [each for each in self.open.values() if each not in ("IN", "FLUSH")][:1]:
            self.end(each)
        self.end("IN", 0, text.encode().ljust(64, b"\0"))

    @property
    def sent(self) -> list[str]:
        """What began, without the waits for replies and the opening."""
        return [each for each in self.log if each != "IN"][2:]


class Host:
    """An open pipe, and what it told."""

    def __init__(self, carrier: Played, pipe: UsbPipe) -> None:
        self.carrier, self.pipe = carrier, pipe
        self.heard = b""
        self.losses: list[TransportLost] = []
        pipe.start(self.hear, self.losses.append)

    def hear(self, data: bytes) -> None:
        self.heard += data


@pytest.fixture
def carrier() -> Played:
    return Played()


async def opened(carrier: Played) -> Host:
    return Host(carrier, await open_usb(carrier))


async def test_opening_flushes_and_drops_what_an_earlier_session_left(carrier: Played) -> None:
    opening = asyncio.create_task(open_usb(carrier))
    await asyncio.sleep(0.01)
    assert carrier.log == ["OPEN", "FLUSH", "IN"]
    carrier.reply("stale")
    host = Host(carrier, await opening)
    carrier.reply("fresh")
    assert host.heard == b"fresh\r"
    await host.pipe.close()
    assert carrier.closed == 1


@pytest.mark.parametrize("size", [1, 3, 100])
async def test_commands_leave_whole_and_one_at_a_time(carrier: Played, size: int) -> None:
    host = await opened(carrier)
    data = b"PX\rV1=5\r"
    for at in range(0, len(data), size):
        assert host.pipe.write(data[at : at + size])
    assert carrier.sent == ["PX"] and host.pipe.pending == 5
    carrier.end("PX")
    assert carrier.sent == ["PX"]  # its reply has not come yet
    carrier.end("IN", 0, b"3\0")
    assert carrier.sent == ["PX", "V1=5"]
    carrier.end("V1=5")
    carrier.end("IN", 0, b"")  # a packet of no bytes is no reply
    host.pipe.write(b"PY\r")
    assert carrier.sent == ["PX", "V1=5"]
    carrier.end("IN", 0, b"OK\0 and what was in the block before")
    assert host.heard == b"3\rOK\r" and host.pipe.pending == 0 and carrier.sent == ["PX", "V1=5", "PY"]


async def test_with_its_reply_no_command_is_preceded_by_a_flush(carrier: Played) -> None:
    host = await opened(carrier)
    for number in range(3):
        host.pipe.write(f"V{number}\r".encode())
        carrier.reply(str(number))
    assert carrier.sent == ["V0", "V1", "V2"] and host.heard == b"0\r1\r2\r"


async def test_a_missing_reply_is_flushed_away_before_the_next_command(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.write(b"PX\rPY\r")
    carrier.end("PX")
    carrier.helpful = False
    await asyncio.sleep(0.9 * REPLY)
    assert carrier.sent == ["PX"]
    await asyncio.sleep(0.2 * REPLY)
    assert carrier.sent == ["PX", "FLUSH"]
    carrier.end("IN", 0, b"too late\0")
    assert host.heard == b""
    carrier.end("FLUSH")
    assert carrier.sent == ["PX", "FLUSH", "PY"]
    carrier.reply("7")
    assert host.heard == b"7\r"


async def test_a_stop_leaves_its_own_thread_ahead_of_a_waiting_transfer(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.write(b"X1000\rX2000\r")
    thread = threading.Thread(target=host.pipe.preempt, args=(False, lambda dropped: b"ABORT\r"))
    thread.start()
    thread.join()
    assert carrier.sent == ["X1000", "ABORT"]  # before the loop has turned
    assert not host.pipe.write(b"X3000\r")
    host.pipe.yielded()
    await asyncio.sleep(0)
    assert "X1000" not in carrier.open.values() and host.pipe.pending == 0
    carrier.reply("OK")
    await asyncio.sleep(2 * WRITE_TIMEOUT)
    assert carrier.sent == ["X1000", "ABORT"] and host.losses == []


async def test_a_stop_of_the_loop_waits_for_no_transfer_either(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.write(b"X1000\rX2000\r")
    assert host.pipe.discard() == 0
    host.pipe.write(b"ABORT\r")
    assert carrier.sent == ["X1000", "ABORT"]
    await asyncio.sleep(0)
    carrier.reply("OK")
    host.pipe.write(b"PX\r")
    await asyncio.sleep(0)
    assert carrier.sent == ["X1000", "ABORT", "FLUSH", "PX"]  # X1000 may have a reply


def by_the_loop(pipe: UsbPipe) -> None:
    pipe.discard()
    pipe.write(b"ABO")
    pipe.write(b"RT\r")


WAYS: dict[str, Callable[[UsbPipe], object]] = {
    "loop": by_the_loop,
    "thread": lambda pipe: pipe.preempt(False, lambda dropped: b"ABORT\r"),
    "another": lambda pipe: pipe.follow(lambda waiting: b"ABORT\r", key=True),
}


@pytest.mark.parametrize("way", WAYS)
async def test_a_stop_that_is_not_taken_follows_a_flush_once_more_and_then_the_pipe_is_lost(
    carrier: Played, way: str
) -> None:
    host = await opened(carrier)
    WAYS[way](host.pipe)
    await asyncio.sleep(0.9 * TAKEN)
    assert carrier.sent == ["ABORT"]
    await asyncio.sleep(0.2 * TAKEN)
    assert carrier.sent == ["ABORT", "FLUSH", "ABORT"] and host.losses == []
    await asyncio.sleep(TAKEN)
    assert carrier.sent == ["ABORT", "FLUSH", "ABORT"]
    assert [type(each) for each in host.losses] == [Undelivered]
    assert str(host.losses[0]) == "usb:2ED00@1-1 was lost: the controller does not take the stop"


async def test_of_a_stop_of_several_commands_all_are_sent_again_where_one_is_not_taken(carrier: Played) -> None:
    host = await opened(carrier)
    assert host.pipe.preempt(False, lambda dropped: f"ABORTX\r\rV{dropped}=1\r".encode())
    assert carrier.sent == ["ABORTX", "V0=1"]
    carrier.end("ABORTX")
    await asyncio.sleep(1.5 * TAKEN)
    assert carrier.sent[2:] == ["FLUSH", "ABORTX", "V0=1"]
    carrier.end("ABORTX")
    carrier.end("V0=1")
    carrier.end("IN", 0, b"OK\0")
    carrier.end("IN", 0, b"OK\0")
    await asyncio.sleep(2 * WRITE_TIMEOUT)
    host.pipe.yielded()
    host.pipe.write(b"PX\r")
    assert carrier.sent[5:] == ["PX"] and host.losses == [] and host.heard == b"OK\rOK\r"


async def test_each_reply_of_a_stop_is_waited_for_and_one_too_many_is_not_counted(carrier: Played) -> None:
    host = await opened(carrier)
    carrier.end("IN", 0, b"nobody asked\0")
    host.pipe.preempt(False, lambda dropped: b"ABORTX\rABORTY\r")
    host.pipe.yielded()
    carrier.end("ABORTX")
    carrier.end("ABORTY")
    carrier.end("IN", 0, b"OK\0")
    host.pipe.write(b"PX\r")
    assert carrier.sent == ["ABORTX", "ABORTY", "FLUSH"], "a stop waits for no reply, and what it owes is flushed"
    await asyncio.sleep(0)
    carrier.reply("7")
    assert carrier.sent[3:] == ["PX"] and host.heard == b"nobody asked\rOK\r7\r"


async def test_a_key_that_is_the_first_of_all_waits_for_nothing_and_its_reply_is_flushed(carrier: Played) -> None:
    host = await opened(carrier)
    assert host.pipe.follow(lambda waiting: b"ABORT\r", key=True) and host.pipe.yielded()
    carrier.end("ABORT")
    host.pipe.write(b"PX\r")
    assert carrier.sent == ["ABORT", "FLUSH"]
    await asyncio.sleep(0)
    assert carrier.sent == ["ABORT", "FLUSH", "PX"]


@pytest.mark.parametrize("way", ["loop", "thread"])
async def test_a_stop_drops_what_waits_and_the_begin_of_a_command(carrier: Played, way: str) -> None:
    host = await opened(carrier)
    assert host.pipe.write(b"X1\rX2\rV1=") and host.pipe.pending == 6
    if way == "loop":
        assert host.pipe.discard() == 0
    else:
        assert host.pipe.preempt(False, lambda dropped: b"") and host.pipe.yielded()
    assert host.pipe.pending == 0
    await asyncio.sleep(0)
    host.pipe.write(b"PX\r")
    await asyncio.sleep(0)
    assert carrier.sent == ["X1", "FLUSH", "PX"] and "X1" not in carrier.open.values()
    await asyncio.sleep(0.9 * WRITE_TIMEOUT)
    carrier.reply("7")
    await asyncio.sleep(WRITE_TIMEOUT)
    assert host.losses == []


async def test_only_what_is_written_in_the_same_turn_as_a_discard_is_a_stop(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.discard()
    await asyncio.sleep(0)
    host.pipe.write(b"PX\rPY\r")
    assert carrier.sent == ["PX"] and host.pipe.pending == 3


async def test_what_follows_a_stop_leaves_at_once_and_a_key_counts_as_one_more(carrier: Played) -> None:
    host = await opened(carrier)
    pipe, noted, asked = host.pipe, list[bool](), list[int]()

    def nothing(waiting: int) -> None:
        asked.append(waiting)

    assert not pipe.follow(lambda waiting: b"PX\r"), "no stop came"
    assert pipe.preempt(False, lambda dropped: b"ABORT\r")
    assert pipe.follow(lambda waiting: b"V1=1\rV2=2\r") and pipe.follow(lambda waiting: b"")
    assert not pipe.follow(nothing) and not pipe.follow(nothing, key=True) and asked == [0, 0]
    assert pipe.follow(lambda waiting: b"ABORT\r", key=True)
    assert carrier.sent == ["ABORT", "V1=1", "V2=2", "ABORT"]
    assert not pipe.yielded(noted.append) and not pipe.write(b"PX\r")
    assert pipe.yielded(noted.append) and pipe.yielded(noted.append) and noted == [False, True, True]
    assert not pipe.follow(lambda waiting: b"PX\r"), "the loop writes again"
    assert pipe.preempt(False, lambda dropped: b"ABORT\r") and not pipe.write(b"PX\r") and pipe.yielded()
    assert pipe.write(b"PX\r") and pipe.preemptible
    carrier.gone = True
    assert pipe.follow(lambda waiting: b"ABORT\r", key=True)
    await until(lambda: bool(host.losses))
    assert not pipe.follow(nothing, key=True) and asked == [0, 0]
    assert [type(each) for each in host.losses] == [Undelivered]


@pytest.mark.parametrize("delay", [0.0, 0.5])
async def test_a_slow_way_gets_its_time_on_top(carrier: Played, delay: float) -> None:
    """A reply has 250 ms, a stop 100 ms, a command and a request 1 s; what comes within 20 ms of a flush is old."""
    carrier.delay = delay
    opening = asyncio.create_task(open_usb(carrier))
    assert await until(opening.done) == pytest.approx(0.02 + delay, abs=0.006)
    host = Host(carrier, await opening)
    host.pipe.write(b"PX\rPY\r")
    carrier.end("PX")
    assert await until(lambda: "FLUSH" in carrier.sent) == pytest.approx(0.25 + delay, abs=0.006)
    carrier.reply("7")
    host.pipe.preempt(False, lambda dropped: b"ABORT\r")
    assert await until(lambda: carrier.sent.count("ABORT") == 2) == pytest.approx(0.1 + delay, abs=0.006)
    assert await until(lambda: bool(host.losses)) == pytest.approx(0.1 + delay, abs=0.006)
    assert [type(each) for each in host.losses] == [Undelivered]

    slow = Played()
    slow.delay = delay
    host = Host(slow, await open_usb(slow))
    host.pipe.write(b"PX\r")
    assert await until(lambda: bool(host.losses)) == pytest.approx(1.0 + delay, abs=0.006)
    deaf = Played()
    deaf.delay, deaf.helpful = delay, False
    opening = asyncio.create_task(open_usb(deaf))
    assert await until(opening.done) == pytest.approx(1.0 + delay, abs=0.006)
    assert isinstance(opening.exception(), Unreachable)
    deaf.end("OPEN")  # too late: no one waits for it


async def test_a_stop_that_is_taken_at_the_second_time_is_no_loss(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.preempt(False, lambda dropped: b"ABORT\r")
    await asyncio.sleep(1.5 * TAKEN)
    carrier.reply("OK")
    host.pipe.yielded()
    await asyncio.sleep(2 * WRITE_TIMEOUT)
    assert host.losses == []
    host.pipe.write(b"PX\r")
    assert carrier.sent[-2:] == ["ABORT", "PX"]


@pytest.mark.parametrize("what", ["PX", "FLUSH"])
async def test_a_controller_that_takes_nothing_is_lost(carrier: Played, what: str) -> None:
    host = await opened(carrier)
    carrier.helpful = False
    host.pipe.write(b"PX\rPY\r")
    if what == "FLUSH":
        carrier.end("PX")
    await asyncio.sleep(1.1 * WRITE_TIMEOUT + REPLY)
    assert [str(each) for each in host.losses] == ["usb:2ED00@1-1 was lost: the controller takes nothing"]
    assert type(host.losses[0]) is TransportLost and carrier.closed == 1
    assert carrier.halted and host.pipe.pending == 0


@pytest.mark.parametrize(
    ("status", "why"), [(GONE, "unplugged, or without power"), (STALLED, "the controller refused a transfer")]
)
@pytest.mark.parametrize("what", ["PX", "IN"])
async def test_a_transfer_that_fails_is_a_loss_told_once(carrier: Played, what: str, status: int, why: str) -> None:
    host = await opened(carrier)
    host.pipe.write(b"PX\r")
    carrier.end(what, status)
    carrier.gone = True
    assert not host.pipe.write(b"PY\r")
    assert not host.pipe.preempt(False, lambda dropped: b"ABORT\r")
    await asyncio.sleep(1)
    assert [str(each) for each in host.losses] == [f"usb:2ED00@1-1 was lost: {why}"]


async def test_a_stop_to_a_device_that_is_gone_is_undelivered(carrier: Played) -> None:
    host = await opened(carrier)
    carrier.gone = True
    host.pipe.preempt(False, lambda dropped: b"ABORT\r")
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert [type(each) for each in host.losses] == [Undelivered]


async def test_closing_gives_the_last_stop_its_time(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.write(b"ABORT\r")
    closing = asyncio.create_task(host.pipe.close())
    await asyncio.sleep(0.05)
    assert carrier.closed == 0 and not carrier.halted
    carrier.reply("OK")
    await closing
    assert carrier.closed == 1 and carrier.halted


@pytest.mark.parametrize(
    ("status", "why"), [(None, "the controller does not take requests"), (STALLED, "the controller refused a transfer")]
)
async def test_a_device_that_takes_no_request_is_given_back(carrier: Played, status: int | None, why: str) -> None:
    carrier.helpful = False
    opening = asyncio.create_task(open_usb(carrier))
    await asyncio.sleep(0)
    if status is not None:
        carrier.end("OPEN", status)
    with pytest.raises(Unreachable, match=f"^usb:2ED00@1-1: {why}"):
        await opening
    assert carrier.closed == 1


@pytest.mark.parametrize("at", ["request", "wait"])
async def test_a_device_that_vanishes_while_it_is_opened_is_given_back(carrier: Played, at: str) -> None:
    carrier.helpful = at == "wait"
    opening = asyncio.create_task(open_usb(carrier))
    await asyncio.sleep(0.01)
    carrier.helpful = True
    carrier.broken(OSError(errno.ECONNRESET, "reset"))
    with pytest.raises(Unreachable, match=r"^usb:2ED00@1-1 was lost: the other end cut the connection; check"):
        await opening
    assert carrier.closed == 1


async def test_an_opening_that_is_cancelled_gives_the_device_back(carrier: Played) -> None:
    opening = asyncio.create_task(open_usb(carrier))
    await asyncio.sleep(0.01)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert carrier.closed == 1


@for_each(
    ("status", "why"),
    [
        (GONE, "unplugged, or without power"),
        (-108, "unplugged"),
        (STALLED, "the controller refused a transfer"),
        (-errno.EPROTO, f"a transfer failed ({os.strerror(errno.EPROTO)})"),
    ],
)
def test_each_end_of_a_transfer_has_its_words_and_its_number(status: int, why: str) -> None:
    failure = TransferFailed(status)
    assert (failure.errno, failure.strerror) == (-status, why)
    assert TransferFailed(status, "otherwise").strerror == "otherwise"


@pytest.mark.parametrize("what", ["command", "wait for a reply", "flush"])
async def test_a_transfer_that_cannot_begin_is_a_loss_of_the_device(carrier: Played, what: str) -> None:
    host = await opened(carrier)
    if what != "command":
        host.pipe.write(b"PX\rPY\r")
        carrier.end("PX")
    carrier.gone = True
    if what == "command":
        host.pipe.write(b"PX\r")
    elif what == "wait for a reply":
        carrier.end("IN", 0, b"7\0")
        assert host.heard == b"7\r"
    await until(lambda: bool(host.losses))
    assert type(host.losses[0]) is TransportLost
    assert str(host.losses[0]) == "usb:2ED00@1-1 was lost: unplugged, or without power"


async def test_closing_waits_for_the_commands_that_wait_and_is_no_loss(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.write(b"PX\rPY\r")
    carrier.end("PX")
    closing = asyncio.create_task(host.pipe.close())
    await until(lambda: carrier.sent == ["PX", "FLUSH", "PY"])
    assert not closing.done()
    assert host.pipe.write(b"") and not host.pipe.write(b"PZ\r")
    assert not host.pipe.preempt(False, lambda dropped: b"ABORT\r")
    carrier.end("PY")
    await closing
    await asyncio.sleep(2 * WRITE_TIMEOUT)
    assert carrier.closed == 1 and carrier.sent == ["PX", "FLUSH", "PY"] and host.losses == []


async def test_what_ends_that_the_pipe_has_not_begun_means_nothing(carrier: Played) -> None:
    host = await opened(carrier)
    host.pipe.write(b"PX\rPY\r")
    carrier.done(99, 0, b"12\0")
    carrier.done(99, CANCELLED, b"")
    assert host.heard == b"" and carrier.sent == ["PX"]
    await host.pipe.close()
    assert host.losses == []
