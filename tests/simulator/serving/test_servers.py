"""The ways in to a running floor, with real descriptors, sockets and signals."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import re
import signal
import socket
import sys
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.command import reachable
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.in_process import connect
from multidrop.simulator.serving.running import RunningFloor
from tests.support.paths import ROOT
from tests.support.posix import fcntl, termios, tty
from tests.support.until import PATIENCE

CELL = """
[[bus]]
name = "press"
serve = ["pty:press.tty", "tcp://127.0.0.1:0", "udp://127.0.0.1:0"]
baud = {baud}
[[bus.drive]]
personality = "LMDCM"
name = "a"
set = {{ EM = 1 }}
"""

Serve = Callable[..., Awaitable[tuple[RunningFloor, dict[str, str]]]]


def write_cell(folder: Path, baud: int = 0, more: str = "") -> Path:
    path = folder / "cell.toml"
    path.write_text(CELL.format(baud=baud) + more, encoding="utf-8")
    return path


@pytest.fixture
def serve(serve_text) -> Serve:
    """Serves a cell for the time of a test; gives the endpoints by scheme."""

    async def start(baud: int = 0, more: str = "") -> tuple[RunningFloor, dict[str, str]]:
        floor, served = await serve_text(CELL.format(baud=baud) + more)
        return floor, {each.endpoint.partition(":")[0]: each.endpoint for each in served}

    return start


class Client:
    """A program that has a pseudo-terminal open."""

    def __init__(self, endpoint: str, baud: int | None = None) -> None:
        self.fd = os.open(endpoint.removeprefix("pty:"), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        if baud is not None:
            attributes = termios.tcgetattr(self.fd)
            attributes[4] = attributes[5] = baud
            termios.tcsetattr(self.fd, termios.TCSANOW, attributes)

    async def until(self, wanted: bytes) -> bytes:
        """Read until all of it has come; a hang-up ends it."""
        heard = bytearray()
        async with asyncio.timeout(PATIENCE):
            while wanted not in heard:
                if not (data := await self.read()):
                    break
                heard += data
        return bytes(heard)

    async def read(self) -> bytes:
        loop = asyncio.get_running_loop()
        ready = asyncio.Event()
        loop.add_reader(self.fd, ready.set)
        try:
            await ready.wait()
        finally:
            loop.remove_reader(self.fd)
        try:
            return os.read(self.fd, 4096)
        except OSError as error:
            assert error.errno == errno.EIO
            return b""

    async def ask(self, data: bytes, wanted: bytes) -> bytes:
        os.write(self.fd, data)
        return await self.until(wanted)

    def close(self) -> None:
        os.close(self.fd)


async def tcp_client(endpoint: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    host, port = endpoint.removeprefix("tcp://").rsplit(":", 1)
    return await asyncio.open_connection(host, int(port))


async def heard(reader: asyncio.StreamReader, count: int) -> bytes:
    async with asyncio.timeout(PATIENCE):
        return await reader.readexactly(count)


async def test_a_pty_answers_whoever_opens_the_link(serve: Serve, tmp_path: Path) -> None:
    _, served = await serve()
    assert served["pty"] == f"pty:{tmp_path / 'press.tty'}"
    client = Client(served["pty"])
    assert await client.ask(b"PR P\r", b"0\r\n") == b"\r\n0\r\n"
    client.close()


async def test_pty_clients_come_and_go_and_leave_nothing_behind(serve: Serve) -> None:
    _, served = await serve(9600)
    for _ in range(3):
        client = Client(served["pty"], termios.B9600)
        fcntl.ioctl(client.fd, termios.TIOCEXCL)
        assert await client.ask(b"PR P\r", b"0\r\n") == b"\r\n0\r\n"
        attributes = termios.tcgetattr(client.fd)
        attributes[4] = attributes[5] = termios.B115200
        termios.tcsetattr(client.fd, termios.TCSANOW, attributes)
        client.close()
        # What a client leaves is cleared in the loop's next turns, as soon as the kernel tells of its going.
        async with asyncio.timeout(PATIENCE):
            while True:
                await asyncio.sleep(0)
                try:
                    client = Client(served["pty"])
                except OSError as busy:  # as an ordinary user, until its exclusive use is cleared
                    assert busy.errno == errno.EBUSY
                    continue
                speed = termios.tcgetattr(client.fd)[5]
                used = fcntl.ioctl(client.fd, 0x80045440, b"\0\0\0\0")
                client.close()
                if speed == termios.B9600:
                    break
        assert used == b"\0\0\0\0"


async def test_what_was_heard_before_a_client_came_is_not_kept_for_it(serve: Serve) -> None:
    floor, served = await serve()
    floor.write("press", b"PR 6\r")
    client = Client(served["pty"])
    floor.write("press", b"PR 7\r")
    client.close()
    for _ in range(3):
        await asyncio.sleep(0)  # The kernel's word of its going comes with a turn of the loop.
    client = Client(served["pty"])
    assert await client.ask(b"PR 8\r", b"8\r\n") == b"\r\n8\r\n"
    client.close()


async def test_a_pty_is_raw_and_every_byte_passes(serve: Serve) -> None:
    _, served = await serve()
    client = Client(served["pty"])
    assert await client.ask(b"EM=0\r", b"\r\n") == b"\r\n"
    assert await client.ask(b"\x04\x11\x13\x7f\xff", b"\xff") == b"\x04\x11\x13\x7f\xff"
    assert await client.ask(b"\x1b", b">") == b"#\r\n>"
    client.close()


async def test_a_client_at_the_wrong_baud_rate_is_not_understood(serve: Serve) -> None:
    floor, served = await serve(9600)
    wire, came = floor.floor.wires["press"], asyncio.Event()
    receive = wire.receive
    wire.receive = lambda *args: (receive(*args), came.set())[0]  # type: ignore[method-assign]
    device, executed = floor.floor.drives[0].device, list[str]()
    execute = device.execute
    device.execute = lambda text, now: (executed.append(text), execute(text, now))[1]  # type: ignore[method-assign]
    client = Client(served["pty"], termios.B19200)
    os.write(client.fd, b"PR P\r")
    async with asyncio.timeout(PATIENCE):
        await came.wait()
    client.close()
    client = Client(served["pty"], termios.B9600)
    assert (await client.ask(b"\x1b", b"\r\n")).endswith(b"\r\n")
    assert (await client.ask(b"PR P\r", b"0\r\n")).endswith(b"0\r\n")
    assert executed.count("PR P") == 1
    client.close()


async def test_an_answer_at_9600_baud_takes_its_time(serve: Serve) -> None:
    _, served = await serve(9600)
    client = Client(served["pty"], termios.B9600)
    loop = asyncio.get_running_loop()
    start = loop.time()
    assert await client.ask(b'PR "' + b"x" * 50 + b'"\r', b"x\r\n") == b"\r\n" + b"x" * 50 + b"\r\n"
    assert loop.time() - start >= (56 + 54) * 10 / 9600
    client.close()


async def test_a_client_takes_back_what_has_not_gone_out_yet(serve: Serve) -> None:
    floor, served = await serve(1200)
    client = Client(served["pty"], termios.B1200)
    assert await client.ask(b"EM=0\r", b"\r\n") == b"\r\n"
    await client.ask(b"MR 512000" + b"0" * 100 + b"\r", b"MR 5")
    termios.tcflush(client.fd, termios.TCOFLUSH)
    assert re.fullmatch(rb"[120]{0,6}0*#\r\n>", await client.ask(b"\x1b", b">"))
    assert (await client.ask(b"PR P\r", b"0\r\n>")).endswith(b"PR P\r\n0\r\n>")
    assert floor.floor.drives[0].device.position(floor.now()) == 0
    client.close()


async def test_unplugging_hangs_up_every_client_and_plugging_brings_all_back(serve: Serve, tmp_path: Path) -> None:
    floor, served = await serve()
    client = Client(served["pty"])
    reader, writer = await tcp_client(served["tcp"])
    assert await client.ask(b"PR P\r", b"0\r\n") == await heard(reader, 5)
    floor.command("/sim unplug press")
    assert await client.until(b"never") == b""
    async with asyncio.timeout(PATIENCE):
        assert await reader.read() == b""
    assert not (tmp_path / "press.tty").is_symlink()
    again, its_writer = await tcp_client(served["tcp"])
    async with asyncio.timeout(PATIENCE):
        assert await again.read() == b""
    floor.command("/sim plug press")
    client.close()
    client = Client(served["pty"])
    assert await client.ask(b"PR P\r", b"0\r\n") == b"\r\n0\r\n"
    client.close()
    for each in (writer, its_writer):
        each.close()


async def test_a_link_that_is_served_is_not_taken(serve: Serve) -> None:
    _, served = await serve()
    with pytest.raises(Diagnostic, match="press.tty is served already"):
        await serve()
    client = Client(served["pty"])
    assert await client.ask(b"PR P\r", b"0\r\n") == b"\r\n0\r\n"
    client.close()


async def test_a_link_that_is_stale_is_replaced(serve: Serve, tmp_path: Path) -> None:
    link = tmp_path / "press.tty"
    link.symlink_to("/dev/pts/gone")
    _, served = await serve()
    client = Client(served["pty"])
    assert await client.ask(b"PR P\r", b"0\r\n") == b"\r\n0\r\n"
    client.close()


async def test_a_file_in_the_place_of_a_link_is_left_alone(serve: Serve, tmp_path: Path) -> None:
    link = tmp_path / "press.tty"
    link.write_text("mine")
    with pytest.raises(Diagnostic, match="is not a link"):
        await serve()
    assert [link.read_text(), *tmp_path.glob(".*")] == ["mine"]


async def test_every_tcp_client_hears_the_whole_wire(serve: Serve) -> None:
    _, served = await serve()
    one, its_writer = await tcp_client(served["tcp"])
    other, other_writer = await tcp_client(served["tcp"])
    other_writer.write(b"\r")
    assert await heard(other, 2) == await heard(one, 2) == b"\r\n"
    its_writer.write(b"PR P\r")
    assert await heard(one, 5) == await heard(other, 5) == b"\r\n0\r\n"
    for each in (its_writer, other_writer):
        each.close()


class Datagrams(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.came: asyncio.Queue[bytes] = asyncio.Queue()

    def datagram_received(self, data: bytes, addr: object) -> None:
        self.came.put_nowait(data)


async def test_udp_answers_its_sender_in_one_datagram(serve: Serve) -> None:
    _, served = await serve()
    host, port = served["udp"].removeprefix("udp://").split(":")
    transport, datagrams = await asyncio.get_running_loop().create_datagram_endpoint(
        Datagrams, remote_addr=(host, int(port))
    )
    transport.sendto(b"PR P\r")
    async with asyncio.timeout(PATIENCE):
        assert await datagrams.came.get() == b"\r\n0\r\n"
    transport.close()


async def test_what_cannot_be_served_is_one_line_that_names_it(serve: Serve) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        more = f'[[bus]]\nname = "two"\nserve = ["tcp://127.0.0.1:{port}"]\n'
        with pytest.raises(Diagnostic, match=f'bus "two": cannot serve tcp://127.0.0.1:{port}'):
            await serve(0, more)


CURRENT_FALLS = 0.5
"""HT after power-up, the one thing that a drive left alone still does."""


async def test_nothing_runs_while_nothing_happens(serve: Serve) -> None:
    floor, served = await serve()
    reader, writer = await tcp_client(served["tcp"])
    writer.write(b"PR P\r")
    await heard(reader, 5)
    turns = 0
    advance = floor.floor.advance

    def counted(now: float) -> dict[str, bytes]:
        nonlocal turns
        turns += 1
        return advance(now)

    floor.floor.advance = counted  # type: ignore[method-assign]
    for _ in range(100):
        await asyncio.sleep(0)
    assert turns == 0 and floor.floor.deadline in (None, CURRENT_FALLS)
    writer.close()


# -- in-process pipes


class Owner:
    """What a bus does with a transport."""

    def __init__(self) -> None:
        self.heard = bytearray()
        self.changed = asyncio.Event()
        self.lost: TransportLost | None = None

    def received(self, data: bytes) -> None:
        self.heard += data
        self.changed.set()

    def on_lost(self, error: TransportLost) -> None:
        self.lost = error
        self.changed.set()

    async def until(self, wanted: bytes) -> bytes:
        async with asyncio.timeout(PATIENCE):
            while wanted not in self.heard and self.lost is None:
                await self.changed.wait()
                self.changed.clear()
        return bytes(self.heard)


async def test_a_pipe_is_a_transport_to_a_bus(tmp_path: Path) -> None:
    cell = write_cell(tmp_path)
    (bus,) = await connect(f"{cell}#press")
    assert (bus.name, bus.names, bus.dialect, bus.party) == ("press", ("a",), "mcode", False)
    owner = Owner()
    bus.transport.start(owner.received, owner.on_lost)
    bus.transport.write(b"PR P\r")
    assert owner.heard == b"", "delivered from within a write"
    assert await owner.until(b"0\r\n") == b"\r\n0\r\n"
    bus.floor.command("/sim unplug press")
    await owner.until(b"never")
    assert "unplugged" in str(owner.lost)
    await bus.transport.close()


async def test_a_cell_runs_once_until_its_last_pipe_is_closed(tmp_path: Path) -> None:
    cell = write_cell(tmp_path)
    (one,) = await connect(f"sim:{cell}")
    (other,) = await connect(str(cell))
    assert one.floor is other.floor
    await one.transport.close()
    await one.transport.close()
    (third,) = await connect(str(cell))
    assert third.floor is other.floor
    await other.transport.close()
    await third.transport.close()
    (fresh,) = await connect(str(cell))
    assert fresh.floor is not one.floor
    await fresh.transport.close()


@pytest.mark.virtual
async def test_a_pipe_can_take_back_what_has_not_gone_out(tmp_path: Path) -> None:
    (bus,) = await connect(str(write_cell(tmp_path, 9600)))
    owner = Owner()
    bus.transport.start(owner.received, owner.on_lost)
    bus.transport.write(b"PR " + b"P" * 40)
    await asyncio.sleep(5.5 / 960)
    assert bus.transport.discard() == 37, "five characters have gone out, the sixth is going"
    bus.transport.write(b"\x1bPR 3\r")
    assert await owner.until(b"3\r\n") == b"\r\n\r\n3\r\n"
    await bus.transport.close()


async def test_a_bus_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match='no bus "mill"; valid: press'):
        await connect(f"{write_cell(tmp_path)}#mill")
    with pytest.raises(Diagnostic, match=r"missing\.toml"):
        await connect(str(tmp_path / "missing.toml"))


# -- the whole of `multidrop sim`

PROGRAM = """
import asyncio, sys
from multidrop.simulator.serving.command import serve
asyncio.run(serve(sys.argv[1], json=True, speed=float(sys.argv[2]), stdin=sys.stdin, stdout=sys.stdout))
"""


async def start_sim(cell: Path, speed: float = 1.0) -> tuple[asyncio.subprocess.Process, dict[str, str]]:
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", PROGRAM, str(cell), str(speed), cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe
    )
    assert process.stdout is not None
    served = {}
    async with asyncio.timeout(PATIENCE):
        while "ready" not in (fact := json.loads(await process.stdout.readline())):
            served[fact["endpoint"].partition(":")[0]] = fact["endpoint"]
            assert fact["bus"] == "press"
    return process, served


@pytest.mark.process
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
async def test_sim_serves_obeys_and_ends_clean(tmp_path: Path, end: signal.Signals) -> None:
    process, served = await start_sim(write_cell(tmp_path), speed=20)
    assert process.stdin is not None and process.stderr is not None
    client = Client(served["pty"])
    tty.setraw(client.fd)
    assert await client.ask(b"PR P\r", b"0\r\n") == b"\r\n0\r\n"
    process.stdin.write(b"/sim input a 1 nonsense\n# a remark\n\nhello\n/sim power a off")
    process.stdin.write_eof()
    async with asyncio.timeout(PATIENCE):
        first, second = [(await process.stderr.readline()).decode() for _ in range(2)]
    assert first.startswith('multidrop: /sim input: no level "nonsense"')
    assert second.startswith('multidrop: standard input: not understood: "hello"')
    reader, writer = await tcp_client(served["tcp"])
    process.send_signal(end)
    async with asyncio.timeout(PATIENCE):
        assert await process.wait() == 0
        assert await process.stderr.read() == b""
        assert await reader.read() == b""
    assert not (tmp_path / "press.tty").is_symlink()
    client.close()
    writer.close()


@pytest.mark.process
@pytest.mark.parametrize(
    ("hosts", "warned"),
    [
        (["127.0.0.1", "localhost"], []),
        (["0.0.0.0", "127.0.0.1"], ["0.0.0.0"]),
        (["0.0.0.0", "0.0.0.0"], ["0.0.0.0"]),
    ],
)
async def test_sim_warns_in_one_line_of_what_other_computers_can_reach(
    tmp_path: Path, hosts: list[str], warned: list[str]
) -> None:
    path = tmp_path / "cell.toml"
    entries = ", ".join(f'"tcp://{host}:0"' for host in hosts)
    path.write_text(f'[[bus]]\nname = "press"\nserve = [{entries}]\n[[bus.drive]]\npersonality = "LMDCM"\n')
    process, _ = await start_sim(path)
    process.send_signal(signal.SIGTERM)
    async with asyncio.timeout(PATIENCE):
        assert await process.wait() == 0
        assert process.stderr is not None
        said = (await process.stderr.read()).decode()
    assert said.count("\n") == len(warned[:1])
    for host in warned:
        assert f"press tcp://{host}:" in said
    assert said.count("tcp://") == hosts.count("0.0.0.0") and ("open to the network" in said) is bool(warned)


def test_an_address_of_this_computer_only_is_no_open_door() -> None:
    inside = ("pty:/tmp/x", "tcp://127.0.0.1:1", "udp://127.0.1.1:1", "modbus://[::1]:1", "tcp://localhost:1")
    outside = ("tcp://0.0.0.0:1", "udp://192.168.0.5:1", "modbus://[::]:1", "tcp://press-pc:1")
    assert [each for each in (*inside, *outside) if reachable(each)] == list(outside)


async def test_windows_passes_over_a_pseudo_terminal_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.simulator.serving.endpoints.sys", SimpleNamespace(platform="win32"))
    cell = read(
        '[[bus]]\nname = "press"\nserve = ["pty:", "tcp://127.0.0.1:0"]\n[[bus.drive]]\npersonality = "LMDCM"\n'
        '[[bus]]\nname = "other"\nserve = ["pty:other.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\n',
        "cell",
    )
    told: list[str] = []
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(cell))
        stack.callback(floor.close)
        floor.notify = told.append
        assert [each.endpoint[:6] for each in await serve_bus(floor, cell.buses[0], stack)] == ["tcp://"]
        assert told == ['bus "press": pty: is not served: Windows has no pseudo-terminals; its other endpoints are']
        with pytest.raises(Diagnostic, match=r"Windows has no pseudo-terminals.*tcp://127.0.0.1:0"):
            await serve_bus(floor, cell.buses[1], stack)
