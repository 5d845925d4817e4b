"""One body of tests over every kind of pipe, opened through its public function against a real far end."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import select
import threading
import time

import pytest

from multidrop.transports.rfc2217 import PIECE
from tests.support.pipes import KINDS, PATIENCE, STREAMS, rig
from tests.support.posix import termios

pytestmark = [
    pytest.mark.slow,
    pytest.mark.pty,
    pytest.mark.filterwarnings(r"ignore:set(Daemon|Name)\(\):DeprecationWarning"),
]

every_kind = pytest.mark.parametrize("kind", KINDS)
every_stream = pytest.mark.parametrize("kind", STREAMS)


@every_kind
async def test_every_byte_goes_through_both_ways_one_by_one(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        for value in range(256):
            each.transport.write(bytes([value]))
        assert await each.far.receive(256) == bytes(range(256))
        for value in range(256):
            await each.far.send(bytes([value]))
        await each.until(lambda: len(each.data) == 256)
        assert each.data == bytes(range(256))
        assert each.losses == []


@every_stream
async def test_a_large_write_goes_through_whole(kind: str) -> None:
    large = bytes(range(251)) * (80 if kind == "rfc2217" else 1000)
    async with rig(kind) as each:
        each.start()
        each.transport.write(large)
        assert await each.far.receive(len(large)) == large
        await each.far.send(large)
        await each.until(lambda: len(each.data) == len(large))
        assert each.data == large


@every_kind
async def test_what_comes_before_the_start_is_kept(kind: str) -> None:
    async with rig(kind) as each:
        await each.far.send(b"early")
        each.start()
        await each.until(lambda: each.data == b"early")


@every_kind
async def test_a_lost_pipe_is_told_once_and_takes_nothing_more(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        each.far.hang_up()
        await each.until(lambda: each.losses)
        each.transport.write(b"more")
        assert each.transport.discard() == 0
        await asyncio.sleep(0.05)
        (loss,) = each.losses
        assert str(loss).startswith(f"{each.transport.name} was lost: ")
        assert re.search("check its power|nothing listens|plug it in", str(loss))
        assert "\n" not in str(loss)


@pytest.mark.parametrize("kind", ["tcp", "tcp by threads"])
async def test_the_last_words_of_the_other_end_are_delivered_before_the_loss(kind: str) -> None:
    async with rig(kind) as each:
        await each.far.send(b"bye" * 100)
        each.far.hang_up()
        each.start()
        await each.until(lambda: each.losses)
        assert each.data == b"bye" * 100


async def test_the_last_words_over_rfc2217_are_delivered_before_the_loss() -> None:
    async with rig("rfc2217") as each:
        await each.far.send(b"bye" * 100)
        await asyncio.sleep(0.2)  # the server passes them on; nobody tells when it has
        each.far.hang_up()
        await asyncio.sleep(0.2)  # pyserial's own reader has ended by now, with all of them in its queue
        each.start()
        await each.until(lambda: each.losses)
        assert each.data == b"bye" * 100


@every_stream
async def test_discard_drops_what_has_not_gone(kind: str) -> None:
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        await asyncio.sleep(0.1)  # the pipe fills, as nobody reads
        dropped = each.transport.discard()
        assert dropped > large / 2
        each.transport.write(b"!")
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert len(arrived) <= large - dropped + 1
        assert arrived.endswith(b"!")


@pytest.mark.parametrize("kind", [kind for kind in STREAMS if kind != "rfc2217"])
async def test_discard_with_whole_sends_what_has_begun_to_its_end_and_nothing_of_the_rest(kind: str) -> None:
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        each.transport.write(b"y" * large)
        await asyncio.sleep(0.1)  # the pipe fills, as nobody reads
        assert each.transport.discard(whole=True) == large
        each.transport.write(b"!")
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert arrived == b"x" * large + b"!"


@every_kind
async def test_discard_drops_nothing_that_is_written_after_it(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        assert each.transport.discard() == 0
        each.transport.write(b"after")
        assert await each.far.receive(5) == b"after"


async def test_a_large_write_over_rfc2217_counts_as_several() -> None:
    async with rig("rfc2217") as each:
        each.start()
        each.transport.write(b"x" * 1_000_000)
        await asyncio.sleep(0.1)  # the pipe fills, as nobody reads
        dropped = each.transport.discard(whole=True)
        each.transport.write(b"!")
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert dropped > 500_000 and dropped % PIECE in (0, 1_000_000 % PIECE)
        assert arrived == b"x" * (1_000_000 - dropped) + b"!"


@pytest.mark.parametrize("kind", KINDS)
async def test_a_thread_writes_its_stop_while_the_loop_is_held_up_and_nothing_follows_until_the_loop_knows(kind: str):
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"MR 5")
        assert await each.far.receive(4) == b"MR 5"
        arrived: list[bytes] = []

        def stop() -> None:
            for word in (b"stop", b"again"):
                assert each.transport.preempt(False, lambda dropped, word=word: word)
                select.select([each.far.descriptor], [], [], PATIENCE)
                arrived.append(os.read(each.far.descriptor, 100))

        thread = threading.Thread(target=stop)
        thread.start()
        thread.join(PATIENCE)  # the loop does nothing meanwhile
        assert arrived == [b"stop", b"again"]
        assert not each.transport.write(b"1200\r")
        assert not each.transport.yielded()
        assert not each.transport.write(b"1200\r")
        assert each.transport.yielded()
        assert each.transport.write(b"after")
        assert await each.far.receive(5) == b"after"


@pytest.mark.parametrize("kind", ["serial", "tcp", "tcp by threads", "relay"])
@pytest.mark.parametrize("whole", [False, True])
async def test_what_preempts_the_loop_drops_what_is_unsent_and_follows_what_has_begun(kind: str, whole: bool):
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        each.transport.write(b"y" * large)
        arrived = await each.far.receive_some()  # a write has begun
        dropped: list[int] = []

        def stop(unsent: int) -> bytes:
            dropped.append(unsent)
            return b"!"

        thread = threading.Thread(target=each.transport.preempt, args=(whole, stop))
        thread.start()
        thread.join(PATIENCE)
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert arrived.strip(b"x") == b"!"
        assert dropped[0] == large if whole else dropped[0] > large
        assert not whole or len(arrived) == large + 1


@pytest.mark.parametrize("kind", KINDS)
async def test_what_follows_a_stop_leaves_behind_it_until_the_loop_has_followed_the_key(kind: str):
    async with rig(kind) as each:
        each.start()
        pipe, noted = each.transport, list[bool]()
        assert pipe.preemptible
        assert not pipe.follow(lambda waiting: b"piece"), "no key came"
        assert pipe.preempt(False, lambda dropped: b"stop")
        assert await each.far.receive(4) == b"stop"
        assert pipe.follow(lambda waiting: b"piece")
        assert await each.far.receive(5) == b"piece"
        assert pipe.follow(lambda waiting: b""), "nothing is due"
        assert not pipe.follow(lambda waiting: None), "nothing is left"
        assert pipe.follow(lambda waiting: b"key", key=True)
        assert await each.far.receive(3) == b"key"
        assert not pipe.yielded(noted.append)
        assert not pipe.write(b"MR 5\r")
        assert pipe.yielded(noted.append)
        assert noted == [False, True]
        assert not pipe.follow(lambda waiting: b"piece"), "the loop writes again"
        assert pipe.write(b"after")
        assert await each.far.receive(5) == b"after"


@pytest.mark.parametrize("kind", ["serial", "tcp", "relay"])
async def test_a_line_that_waits_is_not_pushed_by_a_stop_that_asks_whether_another_is_on_its_way(kind: str):
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        arrived = await each.far.receive_some()  # there is room again
        waits = each.transport.pending
        asked: list[int] = []
        assert not each.transport.follow(lambda waiting: asked.append(waiting), key=True)
        assert asked == [waits] and each.transport.pending == waits
        assert each.transport.preempt(False, lambda dropped: b"!")
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert len(arrived) < large


async def test_a_broken_pipe_is_not_preempted():
    async with rig("tcp") as each:
        each.start()
        each.far.hang_up()
        await each.until(lambda: each.losses)
        assert not each.transport.preempt(False, lambda dropped: b"stop")
        assert not each.transport.follow(lambda waiting: b"stop", key=True)
        assert not each.transport.write(b"MR 5\r")


@every_kind
async def test_close_may_be_repeated_and_is_no_loss(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        await asyncio.gather(each.transport.close(), each.transport.close())
        await each.transport.close()
        each.transport.write(b"nothing")
        assert each.transport.discard() == 0
        each.far.hang_up()
        await asyncio.sleep(0.02)
        assert each.losses == []


@every_kind
async def test_what_was_written_before_the_close_arrives(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"\x1b*SL 0\n")
        await each.transport.close()
        assert await each.far.receive(7) == b"\x1b*SL 0\n"


@every_kind
async def test_a_pipe_that_was_never_started_closes(kind: str) -> None:
    async with rig(kind) as each:
        await each.far.send(b"unread")


@every_stream
async def test_a_stuck_pipe_blocks_neither_writing_nor_closing(kind: str) -> None:
    gaps = [0.0]

    async def beat() -> None:
        while True:
            began = time.monotonic()
            await asyncio.sleep(0.005)
            gaps.append(time.monotonic() - began)

    async with rig(kind) as each:
        each.start()
        heart = asyncio.create_task(beat())
        for _ in range(20):
            each.transport.write(b"x" * 50_000)
            await asyncio.sleep(0)
        await each.transport.close()
        heart.cancel()
        assert max(gaps) < 5.0  # nobody reads: a call that waited would wait for good
        assert each.losses == []


@every_kind
async def test_a_cancelled_close_closes_all_the_same(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        closing = asyncio.create_task(each.transport.close())
        await asyncio.sleep(0)
        closing.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await closing
        await each.transport.close()


async def test_discard_on_rfc2217_has_the_server_drop_its_part() -> None:
    async with rig("rfc2217") as each:
        assert each.far.purged is not None
        each.far.purged.clear()  # opening purges too
        each.transport.discard()
        assert await asyncio.to_thread(each.far.purged.wait, PATIENCE)


async def test_rfc2217_sets_the_rate_of_the_far_port() -> None:
    async with rig("rfc2217") as each:
        assert termios.tcgetattr(each.far.descriptor)[4:6] == [termios.B19200] * 2
        assert each.transport.control is not None
        await asyncio.to_thread(each.transport.control.set_baud, 38400)  # in a thread: the server confirms it
        assert termios.tcgetattr(each.far.descriptor)[4:6] == [termios.B38400] * 2
        await asyncio.to_thread(each.transport.control.set_break, True)
        await asyncio.to_thread(each.transport.control.set_break, False)


async def test_a_relay_sets_the_rate_of_the_far_port_and_names_a_refusal() -> None:
    async with rig("relay") as each:
        each.start()
        assert (control := each.transport.control) is not None
        await asyncio.to_thread(control.set_baud, 38400)
        assert termios.tcgetattr(each.far.descriptor)[4:6] == [termios.B38400] * 2
        assert control.baud == 38400
        with pytest.raises(OSError):
            await asyncio.to_thread(control.set_baud, 2**32 - 1)
        assert control.baud == 38400
        await asyncio.to_thread(control.set_break, True)
        await asyncio.to_thread(control.set_break, False)


async def test_a_socket_has_no_settings_of_a_serial_port() -> None:
    async with rig("tcp") as each:
        assert each.transport.control is None
