"""Modbus/TCP as served to the outside: sockets, other people's clients, and MCode/TCP beside it on the same drive."""

from __future__ import annotations

import asyncio
import json
import re
import socket
import struct
import subprocess
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager

import pytest
from pymodbus.client import AsyncModbusTcpClient
from pyModbusTCP.client import ModbusClient

from multidrop.simulator.cells import demo
from multidrop.simulator.serving.running import RunningFloor
from tests.support.processes import Running
from tests.support.until import PATIENCE

CELL = """
[[bus]]
name = "eth"
serve = ["tcp://127.0.0.1:0", "modbus://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCE"
set = { EM = 1 }
[bus.faults]
"""
POSITION = bytes.fromhex("0001 0000 0006 01 03 0057 0002")
STANDING = bytes.fromhex("0001 0000 0007 01 03 04 0000 0000")

Serve = Callable[..., Awaitable[tuple[RunningFloor, dict[str, int]]]]
Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@pytest.fixture
def serve(serve_text) -> Serve:
    """Serves a cell for the time of a test; gives the ports by scheme."""

    async def start(more: str = "") -> tuple[RunningFloor, dict[str, int]]:
        floor, served = await serve_text(CELL + more)
        return floor, {each.endpoint.partition(":")[0]: int(each.endpoint.rpartition(":")[2]) for each in served}

    return start


async def heard(reader: asyncio.StreamReader, count: int) -> bytes:
    async with asyncio.timeout(PATIENCE):
        return await reader.readexactly(count)


async def test_one_drive_answers_mcode_and_modbus_on_one_state(serve, dial):
    _, ports = await serve()
    mcode_reader, mcode = await dial(ports["tcp"])
    reader, writer = await dial(ports["modbus"])
    writer.write(bytes.fromhex("0001 0000 000B 01 10 005F 0002 04 0007 0000"))  # R1=7
    assert await heard(reader, 12) == bytes.fromhex("0001 0000 0006 01 10 005F 0002")
    mcode.write(b"PR R1\r")
    assert await heard(mcode_reader, 5) == b"\r\n7\r\n"
    mcode.write(b"R1=-2\r")
    assert await heard(mcode_reader, 2) == b"\r\n"
    writer.write(bytes.fromhex("0002 0000 0006 01 03 005F 0002"))
    assert await heard(reader, 13) == bytes.fromhex("0002 0000 0007 01 03 04 FFFE FFFF")


async def test_what_a_program_prints_goes_to_mcode_and_never_to_modbus(serve, dial):
    floor, ports = await serve()
    mcode_reader, mcode = await dial(ports["tcp"])
    reader, writer = await dial(ports["modbus"])
    mcode.write(b"PG 100\rLB A3\rPR 1234\rE\rPG\r")
    await heard(mcode_reader, 10)
    writer.write(bytes.fromhex("0001 0000 0009 01 42 2020 5845 02 4133") + POSITION)  # EX A3
    assert await heard(reader, 13) == bytes.fromhex("0001 0000 0007 01 42 02 2020 5845")
    assert await heard(mcode_reader, 6) == b"1234\r\n"
    assert await heard(reader, len(STANDING)) == STANDING


async def test_clients_are_served_at_once_each_with_its_own_answers(serve, dial):
    _, ports = await serve()
    clients = [await dial(ports["modbus"]) for _ in range(8)]
    for number, (_, writer) in enumerate(clients):
        for turn in range(20):
            writer.write(struct.pack(">HHHBBHH", turn, 0, 6, number, 3, 0x57, 2))
    for number, (reader, _) in enumerate(clients):
        for turn in range(20):
            assert await heard(reader, 13) == struct.pack(">HHHBBBHH", turn, 0, 7, number, 3, 4, 0, 0)


async def test_who_speaks_something_else_is_let_go_and_the_others_are_not(serve, dial):
    _, ports = await serve()
    reader, writer = await dial(ports["modbus"])
    other_reader, other = await dial(ports["modbus"])
    other.write(POSITION + b"GET / HTTP/1.1\r\n\r\n")
    assert await heard(other_reader, len(STANDING)) == STANDING
    async with asyncio.timeout(PATIENCE):
        assert await other_reader.read() == b""
    writer.write(POSITION)
    assert await heard(reader, len(STANDING)) == STANDING


async def test_an_unplugged_bus_hangs_up_and_comes_back(serve, dial):
    floor, ports = await serve()
    reader, _ = await dial(ports["modbus"])
    floor.command("/sim unplug eth")
    async with asyncio.timeout(PATIENCE):
        assert await reader.read() == b""
    reader, _ = await dial(ports["modbus"])
    async with asyncio.timeout(PATIENCE):
        assert await reader.read() == b"", "there is nobody"
    floor.command("/sim plug eth")
    reader, writer = await dial(ports["modbus"])
    writer.write(POSITION)
    assert await heard(reader, len(STANDING)) == STANDING


async def test_a_bus_that_hangs_up_by_itself_does_so_over_modbus(serve, dial):
    _, ports = await serve("hangup_after = 0.2\n")
    reader, writer = await dial(ports["modbus"])
    writer.write(POSITION)
    async with asyncio.timeout(PATIENCE):
        assert await reader.read() == STANDING


async def test_late_answers_come_in_their_order_and_before_the_end(serve, dial):
    _, ports = await serve("delay = [0.01, 0.05]\n")
    reader, writer = await dial(ports["modbus"])
    began = asyncio.get_running_loop().time()
    for turn in range(5):
        writer.write(struct.pack(">HHHBBHH", turn, 0, 6, 1, 3, 0x57, 2))
        await writer.drain()
        await asyncio.sleep(0)
    for turn in range(5):
        assert await heard(reader, 13) == turn.to_bytes(2) + STANDING[2:]
    assert asyncio.get_running_loop().time() - began >= 0.01
    writer.write(POSITION + b"no Modbus at all")
    async with asyncio.timeout(PATIENCE):
        assert await reader.read() == STANDING


def test_the_demo_cell_serves_modbus():
    assert [each.scheme for bus in demo().buses if bus.name == "eth" for each in bus.serve] == ["tcp", "udp", "modbus"]


# Other people's clients, against a process.


@pytest.fixture(scope="module")
def sim(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, int]]:
    """`multidrop sim` on the demo cell; the ports of its Ethernet drive by scheme."""
    process = Running("sim", "--json", folder=tmp_path_factory.mktemp("sim"))
    try:
        facts = [json.loads(line) for line in process.until('{"ready": true}')]
        endpoints = [each["endpoint"] for each in facts if each.get("bus") == "eth"]
        yield {each.partition(":")[0]: int(each.rpartition(":")[2]) for each in endpoints}
    finally:
        process.process.terminate()
        process.end()


@contextmanager
def mcode(port: int) -> Iterator[Callable[[str, str], str]]:
    """MCode/TCP over a bare socket: `say(line, end)` gives what comes up to `end`."""
    with socket.create_connection(("127.0.0.1", port), PATIENCE) as wire:

        def say(line: str, end: str) -> str:
            wire.sendall(line.encode() + b"\r")
            got = b""
            while not got.endswith(end.encode()):
                got += wire.recv(4096)
            return got.decode("latin-1")

        yield say


@pytest.mark.process
def test_pymodbustcp(sim):
    client = ModbusClient("127.0.0.1", sim["modbus"], unit_id=7, timeout=PATIENCE, auto_close=False)
    try:
        assert client.read_holding_registers(0x8B, 2) == [0xB800, 0x000B]
        assert client.write_multiple_registers(0x5F, [0xFFFE, 0xFFFF])
        with mcode(sim["tcp"]) as say:
            assert say("PR R1", ">").endswith("\r\n-2\r\n>")
        assert client.write_single_coil(1, True)
        assert client.read_coils(0, 4) == [False, True, False, False]
        assert client.write_single_coil(1, False)
        assert client.read_discrete_inputs(0x2D, 4) == [False] * 4
        seen = client.read_device_identification(read_code=3, object_id=0)
        assert seen.vendor_name == b"SEM USA" and seen.product_code == b"LMDCE571"
        assert seen.conformity_level == 0x83 and len(seen.objects_by_id) == 7
        assert client.read_device_identification(read_code=4, object_id=6).objects_by_id[6].startswith(b"LMDCE")
        assert client.custom_request(bytes.fromhex("41 2020 5254")) == bytes.fromhex("41 07 302C20302C2030")
        for request, exception in (
            (lambda: client.write_single_register(0x29, 5), 1),  # function 6
            (lambda: client.read_holding_registers(0x02, 1), 2),
            (lambda: client.read_holding_registers(0x57, 3), 3),
            (lambda: client.write_multiple_registers(0x7D, [16]), 4),  # TE of a trip that is not set up
        ):
            assert not request()
            assert client.last_except == exception
        assert client.read_holding_registers(0x21, 1) == [27]
    finally:
        client.close()


@pytest.mark.process
async def test_pymodbus(sim):
    client = AsyncModbusTcpClient("127.0.0.1", port=sim["modbus"], timeout=PATIENCE, retries=0)
    assert await client.connect()
    try:
        answer = await client.read_holding_registers(0x8B, count=2, device_id=3)
        assert client.convert_from_registers(answer.registers, client.DATATYPE.INT32, word_order="little") == 768_000
        words = client.convert_to_registers(-123_456, client.DATATYPE.INT32, word_order="little")
        assert not (await client.write_registers(0x63, words)).isError()
        assert (await client.read_holding_registers(0x63, count=2)).registers == words
        assert (await client.read_coils(0, count=4)).bits[:4] == [False] * 4
        assert (await client.read_discrete_inputs(0, count=4)).bits[:4] == [False] * 4
        seen = await client.read_device_information(read_code=3)
        assert seen.information[0] == b"SEM USA" and sorted(seen.information) == list(range(7))
        assert (await client.write_register(0x29, 5)).exception_code == 1
        assert (await client.read_holding_registers(0x23, count=1)).exception_code == 2
        assert (await client.read_holding_registers(0x57, count=3)).exception_code == 3
    finally:
        client.close()


@pytest.mark.process
@pytest.mark.needs("mbpoll")
def test_mbpoll(sim):
    def mbpoll(*arguments: str, fails: bool = False) -> str:
        host, *values = arguments[-1].split()
        command = ["mbpoll", "-1", "-0", "-a", "1", "-p", str(sim["modbus"]), "-o", "5", *arguments[:-1], host, *values]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE * 3)
        assert (ended.returncode != 0) == fails, ended
        return ended.stdout + ended.stderr

    host = "127.0.0.1"
    assert re.search(r"\[139\]:\s+768000", mbpoll("-t", "4:int", "-r", "139", host)), "VM, low word first"
    mbpoll("-t", "4:int", "-r", "97", f"{host} 123456")  # R2
    assert re.search(r"\[97\]:\s+123456", mbpoll("-t", "4:int", "-r", "97", host))
    assert re.search(r"\[41\]:\s+5", mbpoll("-r", "41", host)), "HC"
    mbpoll("-t", "0", "-r", "0", f"{host} 1")
    assert re.findall(r"\[\d\]:\s+(\d)", mbpoll("-t", "0", "-r", "0", "-c", "4", host)) == ["1", "0", "0", "0"]
    mbpoll("-t", "0", "-r", "0", f"{host} 0")
    assert re.findall(r"\[\d+\]:\s+(\d)", mbpoll("-t", "1", "-r", "45", "-c", "4", host)) == ["0"] * 4
    assert "Illegal function" in mbpoll("-r", "41", f"{host} 6", fails=True), "it writes one register with function 6"
    assert "Illegal data address" in mbpoll("-r", "2", host, fails=True)
    assert "Illegal data value" in mbpoll("-r", "15", "-c", "3", host, fails=True)


@pytest.mark.process
def test_motion_begun_by_modbus_is_seen_and_ended_by_mcode(sim):
    client = ModbusClient("127.0.0.1", sim["modbus"], timeout=PATIENCE, auto_close=False)
    try:
        with mcode(sim["tcp"]) as say:
            assert client.write_multiple_registers(0x78, [10_000, 0])  # SL 10000
            assert client.read_holding_registers(0x4A, 1) == [1]
            assert say("PR MV", ">").endswith("\r\n1\r\n>")
            say("\x1b", ">")
            assert client.read_holding_registers(0x4A, 1) == [0]
    finally:
        client.close()
