"""Clients that write faster than the wire carries: what is held is bounded, and the bus answers everybody again."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import select
import socket
import struct
import tracemalloc
from collections.abc import Awaitable, Callable

import pytest

from multidrop.families.lexium.manual.errors import text as error_text
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving import running
from multidrop.simulator.serving.endpoints import BACKLOG
from multidrop.simulator.serving.running import RunningFloor
from multidrop.simulator.wire import Wire
from tests.support.posix import termios
from tests.support.until import PATIENCE

pytestmark = pytest.mark.slow

CELL = """
[[bus]]
name = "press"
serve = ["pty:press.tty", "tcp://127.0.0.1:0", "udp://127.0.0.1:0"]
baud = {baud}
[[bus.drive]]
personality = "LMDCM"
name = "a"
set = {{ EM = {em} }}
[[bus]]
name = "eth"
serve = ["tcp://127.0.0.1:0", "modbus://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCE"
[bus.faults]
delay = [0.0, {delay}]
"""
FLOOD = b"PR P\r" * 60_000
MOST = 512
"""Bytes of a client that may wait in the simulator."""

Serve = Callable[..., Awaitable[tuple[RunningFloor, dict[str, str], list[str]]]]


def waiting(floor: RunningFloor, bus: str = "press") -> int:
    return sum(len(data) for _, data, _ in floor.floor.wires[bus]._coming)


def backlog(line: Wire) -> int:
    """The bytes that the drives of a wire have still to say."""
    return int(line._merger.backlog)


def clients(floor: RunningFloor, bus: str = "press") -> list[object]:
    return [each for each in floor._listeners[bus] if isinstance(each, asyncio.BufferedProtocol | asyncio.Protocol)]


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A client that has gone has no ten seconds for what it left."""
    monkeypatch.setattr(running, "GRACE", 0.3)


@pytest.fixture
def serve(serve_text) -> Serve:
    """Serves a cell for the time of a test; gives the endpoints by bus and scheme, and what is told."""

    async def start(baud: int = 9600, em: int = 1, delay: float = 0.0, speed: float = 1.0):
        floor, served = await serve_text(CELL.format(baud=baud, em=em, delay=delay), speed)
        told: list[str] = []
        floor.notify = told.append
        return floor, {f"{each.bus} {each.endpoint.partition(':')[0]}": each.endpoint for each in served}, told

    return start


def port(endpoint: str) -> tuple[str, int]:
    return "127.0.0.1", int(endpoint.rpartition(":")[2])


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await asyncio.sleep(0.005)


async def answers(endpoint: str, question: bytes = b'PR "well"\r', answer: bytes = b"well") -> None:
    """A bus answers a client of its own."""
    reader, writer = await asyncio.open_connection(*port(endpoint), limit=1 << 24)
    async with asyncio.timeout(PATIENCE):
        while True:
            writer.write(question)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(1.0):
                    await reader.readuntil(answer)
                    break
    writer.close()
    await writer.wait_closed()


def flood(client: socket.socket, data: bytes = FLOOD) -> None:
    """Write until nothing more is taken, at most the flood."""
    client.setblocking(False)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while sent < len(data):
            sent += client.send(data[sent : sent + 65536])


@pytest.mark.pty
@pytest.mark.usefixtures("impatient")
async def test_a_client_that_floods_a_paced_bus_over_tcp_is_read_no_faster_than_the_wire(serve: Serve) -> None:
    floor, served, told = await serve()
    client = socket.create_connection(port(served["press tcp"]))
    tracemalloc.start()
    try:
        for _ in range(40):
            flood(client)
            await asyncio.sleep(0.01)
            assert waiting(floor) <= MOST
        await answers(served["eth tcp"])
        assert waiting(floor) <= MOST and tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()
    assert len(clients(floor)) == 1
    client.close()  # with answers unread, so the system resets the connection
    await until(lambda: not clients(floor))
    assert told in ([], ["press: a client has left; what it wrote faster than the wire is dropped"])
    await answers(served["press tcp"])
    assert waiting(floor) <= MOST


@pytest.mark.pty
@pytest.mark.usefixtures("impatient")
async def test_after_short_commands_with_long_answers_the_bus_answers_others_once_the_client_has_gone(
    serve: Serve,
) -> None:
    floor, served, _ = await serve(baud=115200)
    client = socket.create_connection(port(served["press tcp"]))
    for _ in range(40):
        flood(client, b"PR AL\r" * 10_000)
        await asyncio.sleep(0.01)
        assert waiting(floor) <= MOST and backlog(floor.floor.wires["press"]) < 8192
    client.close()
    await until(lambda: not clients(floor))
    await answers(served["press tcp"])


@pytest.mark.pty
async def test_everything_of_a_client_that_waits_for_its_answers_is_carried(serve: Serve) -> None:
    """More than is held, written at once."""
    floor, served, _ = await serve(baud=115200, speed=100.0)
    reader, writer = await asyncio.open_connection(*port(served["press tcp"]), limit=1 << 24)
    writer.write(b"PR P\r" * 4000 + b'PR "end"\r')
    async with asyncio.timeout(PATIENCE):
        heard = await reader.readuntil(b"end")
    assert heard.count(b"0\r\n") == 4000
    writer.close()
    await writer.wait_closed()


@pytest.mark.pty
@pytest.mark.usefixtures("impatient")
async def test_a_client_that_floods_a_paced_bus_through_a_pty_waits_in_the_pty(serve: Serve) -> None:
    floor, served, told = await serve()
    path = served["press pty"].removeprefix("pty:")
    client = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    for _ in range(40):
        with contextlib.suppress(BlockingIOError):
            while os.write(client, FLOOD[:4096]):
                pass
        await asyncio.sleep(0.01)
        assert waiting(floor) <= MOST
    await answers(served["eth tcp"])
    os.close(client)
    await until(lambda: bool(told))
    assert told == ["press: a client has left; what it wrote faster than the wire is dropped"]
    await answers(served["press tcp"])


@pytest.mark.pty
async def test_what_was_written_too_fast_can_be_taken_back_all_the_same(serve: Serve) -> None:
    floor, served, _ = await serve()
    client = os.open(served["press pty"].removeprefix("pty:"), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    with contextlib.suppress(BlockingIOError):
        while os.write(client, FLOOD[:4096]):
            await asyncio.sleep(0)
    await until(lambda: waiting(floor) >= 200)
    termios.tcflush(client, termios.TCOFLUSH)
    await until(lambda: waiting(floor) == 0)
    os.write(client, b'\rPR "well"\r')
    heard = b""
    async with asyncio.timeout(PATIENCE):
        while b"well" not in heard:
            await asyncio.sleep(0.01)
            with contextlib.suppress(BlockingIOError):
                heard += os.read(client, 4096)
    os.close(client)


@pytest.mark.pty
async def test_what_a_short_lived_client_wrote_is_carried_whole(serve: Serve) -> None:
    floor, served, told = await serve(baud=115200)
    path = served["press pty"].removeprefix("pty:")
    for way in ("pty", "tcp"):
        line = f"R1={1 + len(way)}\r".encode()
        if way == "pty":
            client = os.open(path, os.O_RDWR | os.O_NOCTTY)
            os.write(client, b"R1=R1+1\r" * 400 + line)
            os.close(client)
        else:
            connection = socket.create_connection(port(served["press tcp"]))
            connection.sendall(b"R1=R1+1\r" * 400 + line)
            connection.close()
        await answers(served["press tcp"], b"PR R1\r", b"4\r\n")
    assert told == []


@pytest.mark.pty
async def test_datagrams_that_come_faster_than_the_wire_are_dropped_and_counted(serve: Serve) -> None:
    floor, served, told = await serve()
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.connect(port(served["press udp"]))
    for _ in range(100):
        for _ in range(20):
            client.send(FLOOD[:1400])
        await asyncio.sleep(0)
        assert waiting(floor) <= 1024 + 1400
    client.close()
    await until(lambda: bool(told))
    assert told == ["press: datagrams come faster than the wire carries them; some are dropped"]
    await answers(served["press tcp"])


@pytest.mark.pty
async def test_an_unpaced_bus_is_flooded_in_pieces_and_the_others_are_served_between_them(serve: Serve) -> None:
    floor, served, _ = await serve(baud=0)
    turns: list[int] = []
    wire = floor.floor.wires["press"]
    receive = wire.receive

    def counted(data, *more):
        turns.append(len(data))
        receive(data, *more)

    wire.receive = counted
    client = socket.create_connection(port(served["press tcp"]))
    flood(client)
    await answers(served["eth tcp"])
    client.close()
    assert turns and max(turns) <= 256
    await answers(served["press tcp"])


@pytest.mark.pty
async def test_a_client_that_never_reads_is_let_go(serve: Serve) -> None:
    floor, served, _ = await serve(baud=0)
    client = socket.create_connection(port(served["press tcp"]))
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    held = 0
    async with asyncio.timeout(6 * PATIENCE):
        while True:
            try:
                flood(client, b"PR AL\r" * 500)
            except OSError as gone:
                assert gone.errno in (errno.ECONNRESET, errno.EPIPE)
                break
            await asyncio.sleep(0)
            ways = [each._transport for each in clients(floor)]  # type: ignore[attr-defined]
            sizes = [way.get_write_buffer_size() for way in ways if way]
            held = max([held, *sizes])
    assert held < 2 * BACKLOG
    client.close()


@pytest.mark.pty
async def test_modbus_answers_that_are_held_back_are_bounded(serve: Serve) -> None:
    floor, served, _ = await serve(delay=3600.0)
    client = socket.create_connection(port(served["eth modbus"]))
    client.setblocking(False)
    request = struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0, 2)
    await until(lambda: bool(clients(floor, "eth")))
    [made] = clients(floor, "eth")
    for _ in range(500):
        with contextlib.suppress(BlockingIOError):
            client.send(request)
        await asyncio.sleep(0.0005)
    assert len(made._late) == 64
    client.close()


# The wire itself, in virtual time.


def wire(baud: int, em: int, more: str = "", **faults: object) -> tuple[Wire, object]:
    floor = Floor(
        read(
            f'[[bus]]\nname = "w"\nbaud = {baud}\n[[bus.drive]]\npersonality = "LMDCM"\nname = "a"\n'
            f"set = {{ EM = {em} }}\n{more}",
            "cell",
        )
    )
    made = floor.wires["w"]
    if faults:
        made.disturb(Faults(**faults))  # type: ignore[arg-type]
    return made, floor.drives[0].device


@pytest.mark.parametrize(("baud", "delay"), [(9600, 0.0), (115200, 0.0), (0, 3600.0)])
def test_short_commands_with_long_answers_fill_no_memory_and_all_are_answered(baud: int, delay: float) -> None:
    line, _ = wire(baud, 1, delay=(delay, delay))
    now, heard, most = 0.0, b"", 0
    for _ in range(200):
        line.receive(b"PR AL\r", now)
        now += 0.01
        heard += line.advance(now)
        most = max(most, backlog(line))
    assert most <= 4096 + 4096
    line.receive(b'PR "end"\r', now)
    while b"end\r\n" not in heard:
        now += 20.0
        heard += line.advance(now)
        most = max(most, backlog(line))
    assert heard.count(b"\nA = 1000000\r") == 200 and most <= 4096 + 4096


@pytest.mark.parametrize("taken_back", [True, False])
def test_the_key_of_a_stop_is_heard_at_once_while_a_drive_has_much_to_say(taken_back: bool) -> None:
    line, device = wire(9600, 1)
    line.receive(b"SL 5000\r" + b"PR AL\r" * 6, 0.0)
    line.advance(0.5)
    assert backlog(line) > 4096 and line.queued() and device.moving(0.5)
    if taken_back:
        line.retract(0.5)
    line.receive(b"\x1b", 0.5)
    line.advance(0.502)
    assert not device.moving(0.502)


def test_commands_that_wait_for_the_line_feed_of_a_party_line_are_bounded() -> None:
    line, device = wire(0, 1, "party = true\n")
    line.receive(b"\n\n", 0.0)
    line.receive(b"aR1=R1+1\r" * 10_000, 0.1)
    line.advance(0.1)
    line.receive(b"\n", 0.2)
    line.advance(0.2)
    answer = device.execute("PR ER", 0.3)
    assert answer.lines == ("20",) and error_text(20)
    assert device.execute("PR R1", 0.3).lines == ("64",)


def test_select_knows_packet_mode() -> None:
    """That a flush is seen while a pseudo-terminal is not read depends on it."""
    master, slave = os.openpty()
    from tests.support.posix import fcntl

    fcntl.ioctl(master, termios.TIOCPKT, struct.pack("i", 1))
    os.write(slave, b"x" * 100)
    assert not select.select((), (), (master,), 0)[2]
    termios.tcflush(slave, termios.TCOFLUSH)
    assert select.select((), (), (master,), 0)[2]
    os.close(master)
    os.close(slave)
