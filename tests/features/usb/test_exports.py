"""Controllers of a cell over USB/IP: the same device as on RS-485, and clients that come, go and talk nonsense."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.features.usb.exports import attaching
from multidrop.features.usb.interface import CANCELLED, STALLED, UsbControl
from multidrop.features.usb.usbip import (
    INTERFACE,
    OPERATION,
    RECORD,
    REQ_IMPORT,
    REQ_LIST,
    RET_SUBMIT,
    SUBMIT,
    UNLINK,
    Exported,
    Transfer,
    Transfers,
    operation,
    setup,
)
from multidrop.simulator.cells import load, read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.command import reachable
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from tests.support.cell_session import TCP, bus, drive, pmx
from tests.support.until import PATIENCE

CELL = bus("stages", pmx("00"), pmx("07"), baud=0, serve=["usbip://127.0.0.1:0", *TCP])
BUS_ID = b"1-1".ljust(32, b"\0")
SERIAL = struct.pack("<BBHHH", 0x80, 6, 0x0303, 0x0409, 255)


class Client:
    """A host of USB/IP, byte by byte if asked."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer
        self.messages = Transfers(answers=True)
        self.last = 0
        self.slow = False

    async def say(self, data: bytes) -> None:
        for piece in [data[at : at + 1] for at in range(len(data))] if self.slow else [data]:
            self.writer.write(piece)
            await self.writer.drain()
            if self.slow:
                await asyncio.sleep(0)

    async def exactly(self, size: int) -> bytes:
        return await asyncio.wait_for(self.reader.readexactly(size), PATIENCE)

    async def ended(self) -> bool:
        """Whether the server closes the connection and says nothing before that."""
        return await asyncio.wait_for(self.reader.read(), PATIENCE) == b""

    async def attach(self, bus_id: str = "1-1") -> int:
        """Import a device; return the status."""
        await self.say(operation(REQ_IMPORT, rest=bus_id.encode().ljust(32, b"\0")))
        _, _, status = OPERATION.unpack(await self.exactly(OPERATION.size))
        if not status:
            assert Exported.read(await self.exactly(RECORD)).bus_id == bus_id
        return int(status)

    async def submit(self, endpoint: int, data: bytes = b"", request: bytes = bytes(8), length: int = 64) -> int:
        self.last += 1
        self.messages.asked[self.last] = length if endpoint & 0x80 else 0
        size = length if endpoint & 0x80 else len(data)
        await self.say(Transfer(SUBMIT, self.last, endpoint, length=size, setup=request, data=data).pack(0x10002))
        return self.last

    async def answer(self) -> Transfer:
        while True:
            data = await self.exactly(1)
            if found := list(self.messages.feed(data)):
                return found[0]

    async def ask(self, text: str) -> str:
        """A command, and the reply, whose block is waited for only now."""
        await self.submit(0x02, text.encode() + b"\0")
        assert (await self.answer()).status == 0
        await self.submit(0x82)
        answer = await self.answer()
        assert len(answer.data) == 64
        return answer.data.partition(b"\0")[0].decode()

    async def request(self, request: bytes, endpoint: int = 0x80) -> Transfer:
        await self.submit(endpoint, request=request, length=255)
        return await self.answer()


class Shop:
    """A served cell, and its clients."""

    def __init__(self, stack: AsyncExitStack, folder: Path) -> None:
        self.stack = stack
        (folder / "cell.toml").write_text(CELL)
        self.floor = RunningFloor(Floor(load(folder / "cell.toml")))
        stack.callback(self.floor.close)
        self.notices: list[str] = []
        self.floor.notify = self.notices.append

    async def open(self) -> Shop:
        self.endpoints = [
            each.endpoint for each in await serve_bus(self.floor, self.floor.floor.cell.buses[0], self.stack)
        ]
        return self

    async def client(self, endpoint: int = 0) -> Client:
        port = int(self.endpoints[endpoint].rpartition(":")[2].partition("/")[0])
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        self.stack.callback(writer.close)
        return Client(reader, writer)

    async def attached(self, bus_id: str = "1-1") -> Client:
        made = await self.client()
        assert await made.attach(bus_id) == 0
        return made

    async def on_the_line(self, text: str) -> str:
        """A reply over RS-485."""
        wire = await self.client(-1)
        await wire.say(text.encode() + b"\r")
        return (await asyncio.wait_for(wire.reader.readuntil(b"\r"), PATIENCE))[:-1].decode()


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[Shop]:
    async with AsyncExitStack() as stack:
        yield await Shop(stack, tmp_path).open()


def test_only_a_bus_of_controllers_is_served_so() -> None:
    for drives in ([], [drive("LMDCM", "a", party=True)], [pmx("00"), drive("LMDCM", "a", party=True)]):
        with pytest.raises(Diagnostic, match=r"^cell.toml:6: .*usbip://.*valid: a bus of PMX only"):
            read("seed = 1\n\n\n" + bus("w", *drives, serve=["usbip://127.0.0.1:0"]), "cell.toml")


def test_it_is_the_last_of_the_endpoints_that_are_known() -> None:
    with pytest.raises(Diagnostic) as refused:
        read(CELL.replace("usbip:", "http:"))
    assert refused.value.hint == "valid: pty:, tcp://, udp://, modbus:// or usbip:// at the beginning"


def test_the_command_that_attaches_it_is_said_and_a_network_warned_of() -> None:
    assert attaching("usbip://127.0.0.1:40123/1-2").startswith("usbip --tcp-port 40123 attach -r 127.0.0.1 -b 1-2 ")
    assert attaching("usbip://10.0.0.5:3240/1-1").startswith("usbip attach -r 10.0.0.5 -b 1-1 ")
    assert reachable("usbip://0.0.0.0:3240/1-1") and not reachable("usbip://127.0.0.1:3240/1-1")


async def test_each_controller_has_a_bus_id_and_is_listed(shop: Shop) -> None:
    assert [each.rpartition("/")[2] for each in shop.endpoints[:2]] == ["1-1", "1-2"]
    assert shop.endpoints[0].startswith("usbip://127.0.0.1:")
    client = await shop.client()
    client.slow = True
    await client.say(operation(REQ_LIST))
    assert await client.exactly(12) == operation(0x0005, 0, (2).to_bytes(4))
    records = await client.exactly(2 * (RECORD + 4))
    assert [Exported.read(records[at : at + RECORD]).bus_id for at in (0, RECORD + 4)] == ["1-1", "1-2"]
    assert records[RECORD : RECORD + 4] == INTERFACE and await client.ended()


@pytest.mark.parametrize("slow", [False, True])
async def test_it_is_one_device_with_the_one_on_the_line_and_hears_its_own_traffic_only(shop: Shop, slow: bool) -> None:
    client = await shop.attached("1-2")
    client.slow = slow
    assert await client.ask("V1=31") == "OK"
    assert await shop.on_the_line("@07V1") == "31" and await shop.on_the_line("@00V1") == "0"
    assert await client.ask("DN") == "2ED07" and await client.ask("hello") == "?hello"
    serial = await client.request(SERIAL)
    assert serial.data == bytes([12, 3]) + "2ED07".encode("utf-16-le")


async def test_requests_are_those_of_the_makers_driver_and_others_are_stalled(shop: Shop) -> None:
    client = await shop.attached()
    for value in UsbControl:
        assert (await client.request(setup(value), 0)).status == 0
    for request in ("4002030000000000", "4003020000000000", "8006000700000000", "c002010000000800"):
        assert (await client.request(bytes.fromhex(request), 0x80)).status == STALLED, request
    device = (await client.request(bytes.fromhex("8006000100001200"))).data
    assert (len(device), device[8:12]) == (18, bytes.fromhex("891501a1"))
    configuration = (await client.request(bytes.fromhex("800600020000ff00"))).data
    assert (len(configuration), configuration[2], configuration[4]) == (32, 32, 1)
    assert (await client.request(bytes.fromhex("8006000200000900"))).data == configuration[:9]
    for endpoint in (0x01, 0x81, 0x03):
        await client.submit(endpoint, b"" if endpoint & 0x80 else b"PX\0")
        assert (await client.answer()).status == STALLED
    await client.submit(0x02, bytes(65))
    assert (await client.answer()).status == STALLED


async def test_a_reply_that_was_not_read_comes_first_until_a_flush(shop: Shop) -> None:
    client = await shop.attached()
    await client.submit(0x02, b"DN\0")
    await client.answer()
    assert await client.ask("V1") == "2ED00"
    client.writer.close()
    again = await shop.attached()  # after a host that died, too
    assert await again.ask("V2=5") == "0"
    await again.request(setup(UsbControl.FLUSH), 0)
    assert await again.ask("V2") == "5"


async def test_a_command_is_executed_once_whatever_becomes_of_its_reply(shop: Shop) -> None:
    client = await shop.attached()
    await client.submit(0x02, b"V1=1\0 and anything behind the end of the block")
    client.writer.close()
    while await shop.on_the_line("@00V1") != "1":
        pass
    assert (await (await shop.attached()).ask("V1")) == "OK"


async def test_an_unlinked_transfer_takes_no_reply(shop: Shop) -> None:
    client = await shop.attached()
    waiting = await client.submit(0x82)
    client.last += 1
    client.messages.asked[client.last] = 0
    await client.say(Transfer(UNLINK, client.last, unlinked=waiting).pack())
    assert (await client.answer()).status == CANCELLED
    client.messages.asked.pop(waiting)
    assert await client.ask("DN") == "2ED00"
    client.last += 1
    client.messages.asked[client.last] = 0
    await client.say(Transfer(UNLINK, client.last, unlinked=waiting).pack())
    assert (await client.answer()).status == 0  # it had ended before


async def test_a_second_client_is_refused_and_the_first_goes_on(shop: Shop) -> None:
    first, second = await shop.attached(), await shop.client()
    assert await second.attach() == 2 and await second.ended()
    assert await (await shop.client()).attach("1-3") == 4
    assert await first.ask("DN") == "2ED00" and await (await shop.attached("1-2")).ask("DN") == "2ED07"
    first.writer.close()
    while await (third := await shop.client()).attach() == 2:
        pass
    assert await third.ask("DN") == "2ED00"


@pytest.mark.parametrize(
    "data",
    [b"GET / HTTP/1.0\r\n\r\n", b"\0" * 8, operation(0x8004), operation(REQ_IMPORT, rest=BUS_ID) + b"\xff" * 48],
)
async def test_garbage_ends_its_connection_and_no_other(shop: Shop, data: bytes) -> None:
    other, client = await shop.attached("1-2"), await shop.client()
    await client.say(data)
    assert not await asyncio.wait_for(client.reader.read(), PATIENCE) or data[2:4] == b"\x80\x03"
    assert [each for each in shop.notices if "a client of usbip:// was disconnected" in each]
    assert await other.ask("DN") == "2ED07" and await shop.on_the_line("@00DN") == "2ED00"
    assert await (await shop.attached()).ask("DN") == "2ED00"


@pytest.mark.parametrize("cut", [1, 7, 20, 39, 41, 60, 87, 90])
async def test_half_a_message_waits_and_its_end_is_the_end_of_its_client(shop: Shop, cut: int) -> None:
    client = await shop.client()
    message = operation(REQ_IMPORT, rest=BUS_ID) + Transfer(SUBMIT, 1, 2, length=5, data=b"V1=1\0").pack()
    await client.say(message[:cut])
    assert await shop.on_the_line("@00V1") == "0"
    client.writer.close()
    while await (other := await shop.client()).attach() == 2:
        pass
    assert await other.ask("V1") == "0" and shop.notices == []


@pytest.mark.parametrize("command", ["unplug stages", "power 07 off"])
async def test_an_unplugged_controller_is_gone_for_its_client_and_comes_back(shop: Shop, command: str) -> None:
    client, other = await shop.attached("1-2"), await shop.attached("1-1")
    await client.submit(0x82)
    assert (await client.request(setup(UsbControl.FLUSH), 0)).status == 0  # both have arrived
    shop.floor.command(f"/sim {command}")
    assert await client.ended()
    assert await (await shop.client()).attach("1-2") == 4
    if command.startswith("power"):
        assert await other.ask("DN") == "2ED00"
    shop.floor.command("/sim " + command.replace("unplug", "plug").replace("off", "on"))
    assert await (await shop.attached("1-2")).ask("DN") == "2ED07"


async def test_a_client_that_reads_nothing_is_disconnected(shop: Shop) -> None:
    client = await shop.attached()
    answers = b"".join(Transfer(SUBMIT, n, 0x80, length=255, setup=SERIAL).pack() for n in range(1, 2000))
    try:
        for _ in range(100):
            await asyncio.wait_for(client.say(answers), PATIENCE)
    except ConnectionError:
        pass
    else:
        pytest.fail("it goes on")
    assert await (await shop.attached("1-2")).ask("DN") == "2ED07"


def test_an_answer_has_the_number_of_its_request() -> None:
    assert Transfer(RET_SUBMIT, 3).pack()[:8] == bytes.fromhex("0000000300000003")
