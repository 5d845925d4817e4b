"""The connections of an Ethernet drive die with its power, and none is accepted before it has booted."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest

from multidrop.families.lexium.simulator.power import ETHERNET_BOOT
from multidrop.simulator.cells import load, read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.in_process import connect
from multidrop.simulator.serving.running import RunningFloor
from tests.support.until import PATIENCE

CELL = """
[[bus]]
name = "eth"
serve = ["tcp://127.0.0.1:0", "udp://127.0.0.1:0", "modbus://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCE"
name = "e"
set = { EM = 1 }
[[bus]]
name = "line"
serve = ["tcp://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCM"
name = "s"
set = { EM = 1 }
"""
POSITION = bytes.fromhex("0001 0000 0006 01 03 0057 0002")
STANDING = bytes.fromhex("0001 0000 0007 01 03 04 0000 0000")

Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]
Dial = Callable[[int], Awaitable[Streams]]
Serve = Callable[..., Awaitable[tuple[RunningFloor, dict[str, int]]]]


@pytest.fixture
def serve(serve_text) -> Serve:
    """Serves the cell so many times as fast as the clock; gives the ports by bus and scheme."""

    async def start(speed: float = 1.0) -> tuple[RunningFloor, dict[str, int]]:
        floor, served = await serve_text(CELL, speed)
        ports = {f"{each.bus} {each.endpoint.partition(':')[0]}": each.endpoint for each in served}
        return floor, {key: int(endpoint.rpartition(":")[2]) for key, endpoint in ports.items()}

    return start


async def in_time(coming: Coroutine[Any, Any, Any]) -> Any:
    async with asyncio.timeout(PATIENCE):
        return await coming


async def ended(reader: asyncio.StreamReader) -> bool:
    """Whether the connection is over; a reset is an end too."""
    try:
        return bool(await in_time(reader.read()) == b"")
    except ConnectionResetError:
        return True


async def refused(port: int) -> bool:
    try:
        _, writer = await in_time(asyncio.open_connection("127.0.0.1", port))
    except ConnectionRefusedError:
        return True
    writer.close()
    return False


async def asked(port: int, data: bytes, count: int) -> bytes:
    """What is answered on a connection of its own, once there is somebody."""
    async with asyncio.timeout(PATIENCE):
        while True:
            try:
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                break
            except ConnectionRefusedError:
                await asyncio.sleep(0.01)
        writer.write(data)
        answer = await reader.readexactly(count)
    writer.close()
    return answer


@pytest.mark.parametrize("scheme", ["tcp", "modbus"])
async def test_connections_are_closed_with_the_power_and_none_is_accepted(
    serve: Serve, dial: Dial, scheme: str
) -> None:
    floor, ports = await serve()
    reader, _ = await dial(ports[f"eth {scheme}"])
    other, writer = await dial(ports["line tcp"])
    await asyncio.sleep(0)
    floor.command("/sim power e off")
    assert await ended(reader)
    assert await refused(ports[f"eth {scheme}"])
    writer.write(b"PR P\r")
    assert await in_time(other.readexactly(5)) == b"\r\n0\r\n", "nothing has happened to the other bus"
    floor.command("/sim power e on")
    assert await refused(ports[f"eth {scheme}"]), "it boots"
    writer.close()


async def test_udp_is_silent_and_a_drive_that_has_booted_knows_nobody(serve: Serve) -> None:
    floor, ports = await serve(speed=200.0)
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.setblocking(False)
    client.connect(("127.0.0.1", ports["eth udp"]))
    loop = asyncio.get_running_loop()
    await loop.sock_sendall(client, b"PR P\r")
    assert await in_time(loop.sock_recv(client, 99)) == b"\r\n0\r\n"
    floor.command("/sim power e off")
    await loop.sock_sendall(client, b"PR P\r")
    floor.command("/sim power e on")
    assert await asked(ports["eth tcp"], b"PR P\r", 5) == b"\r\n0\r\n", "it is up"
    with pytest.raises(BlockingIOError):
        client.recv(99)
    await loop.sock_sendall(client, b"PR EM\r")
    assert await in_time(loop.sock_recv(client, 99)) == b"\r\n1\r\n"
    client.close()


async def test_it_comes_back_at_the_same_ports_when_it_has_booted(serve: Serve) -> None:
    floor, ports = await serve(speed=200.0)
    for _ in range(3):
        floor.command("/sim power e off")
        floor.command("/sim power e on")
        assert await asked(ports["eth modbus"], POSITION, len(STANDING)) == STANDING
        assert await asked(ports["eth tcp"], b"PR EM\r", 5) == b"\r\n1\r\n"


@pytest.mark.parametrize("line", [b"\x03", b"FD\r"])
async def test_a_reset_is_a_new_beginning_for_its_connections_too(serve: Serve, dial: Dial, line: bytes) -> None:
    _, ports = await serve()
    reader, writer = await dial(ports["eth tcp"])
    other, _ = await dial(ports["eth modbus"])
    writer.write(line)
    async with asyncio.timeout(PATIENCE):
        assert await reader.read() == (b"\r\n" if line == b"FD\r" else b"")
    assert await ended(other)
    assert await refused(ports["eth tcp"]) and await refused(ports["eth modbus"])


async def test_a_serial_drive_behind_a_device_server_keeps_its_connection(serve: Serve, dial: Dial) -> None:
    floor, ports = await serve()
    reader, writer = await dial(ports["line tcp"])
    floor.command("/sim power s off")
    writer.write(b"PR P\r")
    with pytest.raises(asyncio.TimeoutError):
        await asyncio.wait_for(reader.read(1), 0.05)
    floor.command("/sim power s on")
    assert (await in_time(reader.readline())).startswith(b"Copyright")
    writer.write(b"PR P\r")
    assert await in_time(reader.readexactly(5)) == b"\r\n0\r\n"
    writer.close()


async def test_the_end_of_service_does_not_wait_for_a_drive_that_boots(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL, encoding="utf-8")
    async with asyncio.timeout(PATIENCE), AsyncExitStack() as stack:
        floor = RunningFloor(Floor(load(path)), 100.0)
        stack.callback(floor.close)
        served = await serve_bus(floor, floor.floor.cell.buses[0], stack)
        port = int(served[0].endpoint.rpartition(":")[2])
        floor.command("/sim power e off")
        with socket.create_server(("127.0.0.1", port)):  # somebody else takes the port
            floor.command("/sim power e on")
            while not floor.floor.connectable("eth"):
                await asyncio.sleep(0.01)
            await asyncio.sleep(0.05)
    assert await refused(port)


async def test_a_pipe_breaks_with_the_power_and_a_new_one_does_before_the_drive_has_booted(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL, encoding="utf-8")
    lost: list[str] = []
    eth, line = await connect(f"sim:{path}")
    eth.transport.start(lambda data: None, lambda error: lost.append(str(error)))
    line.transport.start(lambda data: None, lambda error: lost.append(f"line: {error}"))
    eth.floor.command("/sim power e off")
    await asyncio.sleep(0)
    (again,) = await connect(f"sim:{path}#eth")
    again.transport.start(lambda data: None, lambda error: lost.append(str(error)))
    await asyncio.sleep(0)
    assert lost == [f"sim:{path}#eth was lost: no power"] * 2
    for each in (eth, line, again):
        await each.transport.close()


def test_it_boots_as_long_as_a_real_one_and_a_serial_drive_is_there_at_once() -> None:
    floor = Floor(read(CELL))
    for drive in "es":
        floor.command(f"/sim power {drive} off", 1.0)
        assert not floor.place(drive, "")[0].device.powered
        floor.command(f"/sim power {drive} on", 2.0)
    assert [floor.connectable(bus) for bus in ("eth", "line")] == [False, True]
    assert floor.wires["eth"].deadline == 2.0 + ETHERNET_BOOT
    floor.advance(2.0 + ETHERNET_BOOT - 0.001)
    assert not floor.connectable("eth")
    floor.advance(2.0 + ETHERNET_BOOT)
    assert floor.connectable("eth") and floor.place("e", "")[0].device.powered
