"""A shared pseudo-terminal over real sockets, with plain clients, pyserial's and our own."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import threading
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest
import serial

from multidrop.base.errors import TransportLost
from multidrop.drives import pacing
from multidrop.features.sharing import key_stop, server
from multidrop.features.sharing.client import ClientRequest, ClientStream, Input
from multidrop.features.sharing.server import SharedPort
from multidrop.features.sharing.stop_bytes import stop_bytes
from multidrop.features.sharing.writer_turns import NOT_REACHED, WRITES_A_TURN, ClientWrite, Say
from multidrop.shell.connect.opening import open_port
from multidrop.shell.connect.urls import parse
from multidrop.transports import Unreachable, telnet
from multidrop.transports.pipe import DescriptorPipe
from multidrop.transports.rfc2217 import open_rfc2217
from multidrop.transports.telnet import OPTION, Setting, message
from tests.support.posix import termios, tty
from tests.support.until import PATIENCE, until

pytestmark = [
    pytest.mark.pty,
    pytest.mark.filterwarnings(r"ignore:set(Daemon|Name)\(\):DeprecationWarning"),
]


class Line:
    """A pseudo-terminal at a link, whose far end a test reads and writes."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.arrived = bytearray()
        self.open()

    def open(self) -> None:
        self.far, near = os.openpty()
        tty.setraw(near)
        os.set_blocking(self.far, False)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(near))
        self.near = near

    def close(self) -> None:
        os.close(self.far)
        os.close(self.near)

    async def got(self, data: bytes) -> bytes:
        """Wait for bytes at the far end; return all that came."""

        def read() -> bool:
            with contextlib.suppress(BlockingIOError):
                self.arrived += os.read(self.far, 4096)
            return data in self.arrived

        await until(read, 10)
        came = bytes(self.arrived)
        self.arrived.clear()
        return came

    @property
    def baud(self) -> int:
        return int(termios.tcgetattr(self.far)[4])


class Shared:
    """A shared port, what it has said, and its clients."""

    def __init__(self, port: SharedPort, line: Line, said: list[Say], number: int) -> None:
        self.port, self.line, self.said, self.number = port, line, said, number
        self._writers: list[asyncio.StreamWriter] = []

    def events(self) -> list[str]:
        return [each.event for each in self.said]

    async def client(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.number)
        self._writers.append(writer)
        return reader, writer

    async def close(self) -> None:
        await self.port.close()
        for each in self._writers:
            each.close()
            with contextlib.suppress(OSError):
                await each.wait_closed()
        self.line.close()


@pytest.fixture
async def shared(tmp_path: Path) -> AsyncIterator[Shared]:
    line, said = Line(tmp_path / "tty"), list[Say]()
    port = SharedPort(await open_port(parse(str(line.link))), stop_bytes(""), said.append)
    url = await port.open("127.0.0.1", 0)
    made = Shared(port, line, said, int(url.rpartition(":")[2]))
    yield made
    await made.close()


async def test_one_writes_all_hear_and_another_is_refused_but_for_its_stop(shared: Shared) -> None:
    (hears, ada), (listens, bob) = await shared.client(), await shared.client()
    ada.write(b"PR P\r")
    await shared.line.got(b"PR P\r")
    os.write(shared.line.far, b"51200\r\n")
    assert await hears.readexactly(7) == await listens.readexactly(7) == b"51200\r\n"
    bob.write(b"\x1b")
    await shared.line.got(b"\x1b")
    bob.write(b"MR 1\r")
    assert await listens.read() == b""
    assert shared.events()[-1] == "refused"
    bob.write(b"\x1b")
    await shared.line.got(b"\x1b")
    ada.close()
    await until(lambda: shared.events().count("left") == 1)
    _, eve = await shared.client()
    eve.write(b"PR V\r")
    await shared.line.got(b"PR V\r")


async def test_pyserial_reads_writes_and_changes_the_baud_rate(shared: Shared) -> None:
    def work() -> bytes:
        with serial.serial_for_url(f"rfc2217://127.0.0.1:{shared.number}", baudrate=9600, timeout=5) as port:
            port.write(bytes(range(256)))
            port.baudrate = 19200
            port.send_break(0.001)
            port.reset_output_buffer()
            os.write(shared.line.far, bytes(range(256)))
            assert port.cts is False
            return bytes(port.read(256))

    assert await asyncio.to_thread(work) == bytes(range(256))
    await shared.line.got(bytes(range(256)))
    assert shared.line.baud == termios.B19200


async def test_our_own_client_is_told_why_it_is_refused(shared: Shared) -> None:
    first = await open_rfc2217("127.0.0.1", shared.number)
    second = await open_rfc2217("127.0.0.1", shared.number)
    losses, got = list[TransportLost](), bytearray()
    first.start(got.extend, losses.append)
    second.start(got.extend, losses.append)
    assert first.limits == ""
    await asyncio.to_thread(first.control.set_baud, 38400)
    assert shared.line.baud == termios.B38400
    first.write(b"PR P\r")
    await shared.line.got(b"PR P\r")
    with pytest.raises(OSError, match=r"does not accept 19200 baud \(it has 38400\)"):
        await asyncio.to_thread(second.control.set_baud, 19200)
    second.discard()
    second.write(b"\x1b")
    await shared.line.got(b"\x1b")
    second.write(b"PR V\r")
    await until(lambda: losses)
    assert str(losses[0]).startswith(f"{second.name} was lost: refused: 127.0.0.1:")
    await first.close()
    await second.close()


async def test_a_client_that_does_not_read_is_dropped_and_the_others_are_served(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MOST_UNREAD_BYTES", 4096)
    with socket.create_connection(("127.0.0.1", shared.number)) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        hears, ada = await shared.client()
        await until(lambda: shared.events().count("connected") == 2)
        while "dropped" not in shared.events():
            with contextlib.suppress(BlockingIOError):
                os.write(shared.line.far, b"x" * 4096)
            await hears.read(65536)
        ada.write(b"PR P\r")
        await shared.line.got(b"PR P\r")


async def test_a_client_that_never_reads_its_last_bytes_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "LINGER", 0.01)
    stuck = Mock(spec=asyncio.Transport)
    stuck.get_extra_info.return_value, stuck.is_closing.return_value = None, False
    connection = server.ClientConnection(Mock())
    connection.connection_made(stuck)
    connection.say_goodbye(b"refused")
    await until(lambda: stuck.abort.called)
    assert stuck.close.called


async def test_a_writer_that_is_too_far_ahead_of_the_line_is_dropped_and_a_stop_still_passes(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MOST_BYTES_AHEAD", 4096)
    (_, ada), (_, bob) = await shared.client(), await shared.client()
    ada.write(b"x" * 100_000)
    await until(lambda: "writes" in shared.events())
    ada.write(b"x" * 100_000)
    await until(lambda: "dropped" in shared.events())
    bob.write(b"\x1b")
    await shared.line.got(b"\x1b")


async def test_a_lost_port_closes_its_clients_and_comes_back(shared: Shared) -> None:
    hears, _ = await shared.client()
    shared.line.close()
    assert await hears.read() == b""
    with pytest.raises(Unreachable, match=": lost: .*tty was lost: the port is gone"):
        await open_rfc2217("127.0.0.1", shared.number)
    shared.line.open()
    await until(lambda: "back" in shared.events())
    _, ada = await shared.client()
    ada.write(b"PR P\r")
    await shared.line.got(b"PR P\r")


async def test_a_port_that_cannot_be_found_again_ends_it(tmp_path: Path) -> None:
    line = Line(tmp_path / "tty")
    port = SharedPort(await open_port(parse(os.ttyname(line.near))), stop_bytes(""), lambda said: None)
    await port.open("127.0.0.1", 0)
    line.close()
    loss = await asyncio.wait_for(port.lost_for_good, PATIENCE)
    assert "was lost" in str(loss)
    await port.close()


async def test_our_stop_from_another_thread_passes_while_the_loop_is_held_up(shared: Shared) -> None:
    client = await open_rfc2217("127.0.0.1", shared.number)
    client.start(lambda data: None, lambda loss: None)
    assert await asyncio.to_thread(partial(client.preempt, False, lambda dropped: b"\x1b"))
    assert not client.write(b"MR 1\r")
    client.yielded()
    await shared.line.got(b"\x1b")
    await client.close()


async def test_a_stop_takes_back_what_is_unsent_but_no_stop_that_is_still_leaving(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken_back = list[bool]()

    def discard(pipe: object, whole: bool = False) -> int:
        taken_back.append(whole)
        return 0

    monkeypatch.setattr(DescriptorPipe, "discard", discard)
    _, ada = await shared.client()
    _, bob = await shared.client()
    ada.write(b"PR P\r")
    await shared.line.got(b"PR P\r")
    ada.write(b"\x1b")
    await shared.line.got(b"\x1b")
    assert len(taken_back) == 1
    bob.write(b"\x1b")
    await shared.line.got(b"\x1b")
    assert len(taken_back) == 1, "the next one follows it"
    ada.write(b"PR V\r")
    await shared.line.got(b"PR V\r")
    bob.write(b"\x1b")
    await shared.line.got(b"\x1b")
    assert len(taken_back) == 2


async def test_ctrl_x_at_the_shared_port_stops_the_drives_and_sharing_goes_on(shared: Shared) -> None:
    _, ada = await shared.client()
    ada.write(b"PR P\r")
    await shared.line.got(b"PR P\r")
    shared.port.stop()
    stop = b"\x1b\x05!\x05!\x1b\n\x1b\x05"
    await shared.line.got(stop * 2)
    ada.write(b"PR V\r")
    await shared.line.got(b"PR V\r")


def pressed(shared: Shared) -> bytes:
    """Press the stop key in its thread while the loop does nothing; return what that wrote."""
    thread = threading.Thread(target=shared.port.stop_ahead)
    thread.start()
    thread.join()
    return os.read(shared.line.far, 4096)


async def test_the_key_s_thread_writes_the_stop_while_the_loop_is_held_up_and_the_loop_does_not_again(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pacing.PACER, "after", lambda owner, seconds, work: None)
    first, *others = stop_bytes("").own
    assert pressed(shared) == first.data
    shared.port.stop()
    assert await shared.line.got(others[-1].data) == b"".join(each.data for each in others)
    assert shared.events() == ["stop"] * (1 + len(others))


async def test_its_thread_makes_a_line_that_a_client_has_begun_harmless(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pacing.PACER, "after", lambda owner, seconds, work: None)
    _, ada = await shared.client()
    ada.write(b"MR 5")
    await shared.line.got(b"MR 5")
    assert pressed(shared) == stop_bytes("").mended(stop_bytes("").own[0].data)
    shared.port._do([ClientWrite(1, b"PR P\r")])  # the loop has not heard of the key yet
    shared.port.stop()
    assert shared.events()[-2:] == ["unsent", "stop"] and shared.said[-2].detail.startswith("5 bytes")


async def test_the_whole_stop_of_several_modules_is_written_by_the_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, due = [100.0], list[tuple[float, Callable[[], None]]]()
    monkeypatch.setattr(key_stop.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(pacing.PACER, "after", lambda owner, seconds, work: due.append((now[0] + seconds, work)))
    line, stops = Line(tmp_path / "tty"), stop_bytes("tmcl", ("1", "2"))
    port = SharedPort(await open_port(parse(f"{line.link}?dialect=tmcl")), stops, lambda said: None)
    shared = Shared(port, line, [], 0)
    await port.open("127.0.0.1", 0)
    came = [pressed(shared)]
    while due:
        at, work = due.pop()
        assert at > now[0], "the pieces have gaps"
        now[0] = at + 0.001
        work()
        with contextlib.suppress(BlockingIOError):
            came.append(os.read(line.far, 4096))
    assert came == [each.data for each in stops.own]
    port.stop()
    await asyncio.sleep(0)
    with pytest.raises(BlockingIOError):
        os.read(line.far, 4096)
    await shared.close()


async def test_a_stop_while_the_port_is_lost_is_its_first_bytes_after_the_return(shared: Shared) -> None:
    _, ada = await shared.client()
    await until(lambda: "connected" in shared.events())
    shared.line.close()
    await until(lambda: "lost" in shared.events())
    shared.port.stop()
    assert shared.events()[-1] == NOT_REACHED
    ada.write(b"\x1b")
    await until(lambda: shared.events().count(NOT_REACHED) == 2)
    shared.line.open()
    await until(lambda: "back" in shared.events())
    _, eve = await shared.client()
    eve.write(b"PR P\r")
    own, _ = stop_bytes("").own
    mended = stop_bytes("").mended
    await until(lambda: shared.events().count("stop") == 3)
    assert (await shared.line.got(b"PR P\r")).startswith(mended(own.data))
    assert "owed since the loss of the port" in next(each.detail for each in shared.said if each.event == "stop")


async def test_four_clients_that_flood_it_with_requests_do_not_come_before_anothers_stop(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    worked, answers = list[ClientRequest](), ClientStream.answers

    def count(client: ClientStream, request: ClientRequest) -> bool:
        worked.append(request)
        return answers(client, request)

    at_stop, receive = list[int](), ClientStream.receive

    def note(client: ClientStream, data: bytes) -> list[Input]:
        if data == b"\x1b":
            at_stop.append(len(worked))
        return receive(client, data)

    monkeypatch.setattr(ClientStream, "answers", count)
    monkeypatch.setattr(ClientStream, "receive", note)
    flooding = [await shared.client() for _ in range(4)]
    _, bob = await shared.client()
    await until(lambda: shared.events().count("connected") == 5)
    for _, each in flooding:
        each.write(telnet.option(telnet.WILL, OPTION) + message(Setting.LINE_MASK, 7) * 900)
    await until(lambda: worked)
    bob.write(b"\x1b")
    before = len(worked)
    await shared.line.got(b"\x1b")
    assert at_stop[0] - before <= 4 * 2 * WRITES_A_TURN * 3 < 4 * 900 - before  # three looks at the sockets, at most
    await until(lambda: len(worked) == 4 * 900)


async def test_sharing_ends_at_once_while_the_port_is_lost_and_tried_again(shared: Shared) -> None:
    shared.line.link.unlink()
    os.close(shared.line.far)
    shared.line.far = os.open(os.devnull, os.O_RDWR)
    await until(lambda: "lost" in shared.events())
    await asyncio.wait_for(shared.port.close(), 5)
    assert asyncio.all_tasks() == {asyncio.current_task()}
