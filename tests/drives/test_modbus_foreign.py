"""A bus against a Modbus server that other people wrote: pymodbus' own, which takes only the first of two requests."""

from __future__ import annotations

import asyncio
import logging
from contextlib import asynccontextmanager

import pytest
from pymodbus import ModbusDeviceIdentification
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from multidrop.base.errors import NoAnswer, Refused, TransportLost
from multidrop.dialects import Hints, Priority
from multidrop.drives import stopping
from multidrop.drives.bus import Bus
from multidrop.drives.drive import still
from multidrop.drives.events import Notice, Traffic, Unsolicited
from multidrop.drives.stopping import Fate
from multidrop.families.lexium.host.modbus import framing
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.transports.sockets import open_tcp
from tests.support.until import PATIENCE

LAST = 0xB8
logging.getLogger("pymodbus").addHandler(logging.NullHandler())


@asynccontextmanager
async def opened(timeout: float = 1.0, **registers: int):
    """A bus that is open on pymodbus' server, what it heard as PDUs, and the register values as they were set."""
    heard: list[tuple[int, int | None]] = []

    def trace(sending, pdu):
        if not sending:
            heard.append((pdu.function_code, getattr(pdu, "address", None)))
        return pdu

    values = [0] * LAST
    for name, value in ({"P": -51200, "V": 0, "VM": 768000, "HC": 5} | registers).items():
        row = REGISTERS[name]
        values[row.address : row.address + row.count] = framing.words_of(value, row.count)
    block = [SimData(0, values=values, datatype=DataType.REGISTERS)]
    bits = [SimData(0, values=[True, False, True, False] * 4, datatype=DataType.BITS)]
    identity = ModbusDeviceIdentification(info={0: "SEM USA", 1: "LMDCE571", 2: "4.0.0.0", 6: "LMDCE 6.002, Hw: 3.2"})
    device = SimDevice(0, simdata=(bits, bits, block, block))
    server = ModbusTcpServer(device, identity=identity, address=("127.0.0.1", 0), trace_pdu=trace)
    await server.serve_forever(background=True)
    port = server.transport.sockets[0].getsockname()[1]
    bus = Bus("eth", await open_tcp("127.0.0.1", port, "modbus"), family="modbus", timeout=timeout)
    bus.told = []
    bus.watch(bus.told.append)
    bus.start()
    try:
        yield bus, heard
    finally:
        await bus.close()
        await server.shutdown()


async def test_it_is_opened_and_read_and_written():
    async with opened() as (bus, heard):
        (drive,) = await bus.identify(Hints())
        assert (drive.product, drive.version, drive.address) == ("LMDCE", "LMDCE 6.002, Hw: 3.2", "")
        assert await drive.send('PR P," ",VM') == ("-51200 768000",)
        assert await drive.send("VM=600000") == ()
        assert await drive.send("PR VM,HC") == ("6000005",)
        (motion,) = await drive.motion()
        assert (motion.position, motion.velocity) == (-51200, 0)
        assert await still(drive) and not await drive.busy()
        assert (16, 0x8B) in heard


@pytest.mark.parametrize(("busy", "fate"), [(0, Fate.STANDING), (1, Fate.RUNNING)])
async def test_a_stop_is_confirmed_by_the_register_of_the_program(busy, fate, monkeypatch):
    monkeypatch.setattr(stopping, "LONGEST_SLOWING", 2.0)
    async with opened(BY=busy) as (bus, heard):
        (drive,) = await bus.identify(Hints())
        heard.clear()
        halt = bus.stop()
        await bus.stopped()
        assert halt.fate(drive) is fate and halt.vain is bool(busy)
        assert (3, 0x0004) in heard and heard.count((16, 0x78)) == (
            3 if busy else 1
        )  # it takes the first of two requests


async def test_exceptions_of_a_foreign_server_are_refusals():
    async with opened() as (bus, _):
        (drive,) = await bus.identify(Hints())
        with pytest.raises(Refused, match="exception 01 illegal function at function 66"):
            await drive.send("EX A3")
        with pytest.raises(Refused, match="exception 0[23] illegal data (address|value) at register 0x2000"):
            await drive.run(drive.family.registers.read(0x2000, 2))


async def test_a_stop_arrives_although_the_server_takes_only_the_first_of_two_requests():
    async with opened(0.3) as (bus, heard):
        await bus.identify(Hints())
        heard.clear()
        bus.stop()
        async with asyncio.timeout(PATIENCE):
            await bus.stopped()
        assert (16, REGISTERS["SL"].address) in heard
        assert [e.text for e in bus.told if isinstance(e, Notice) and "stopped, velocity 0" in e.text]
        assert not [e for e in bus.told if isinstance(e, Unsolicited)]


async def test_a_hundred_conversations_at_once_are_told_apart():
    async with opened() as (bus, _):
        (drive,) = await bus.identify(Hints())
        lines = [("PR P", "-51200"), ("PR VM", "768000"), ("PR HC", "5"), ("PR V", "0")] * 25
        found = await asyncio.gather(*(drive.send(line) for line, _ in lines))
        assert [text for (text,) in found] == [text for _, text in lines]


async def serve_late(reader, writer):
    """Answers each request only when the next one has come, first the late one's answer."""
    late = b""
    while len(head := await reader.read(12)) == 12:
        number, value = head[:2], head[8:10]
        answer = number + bytes.fromhex("0000 0007 01 03 04 0000") + value
        writer.write(late)
        if late:
            writer.write(answer)
            late = b""
        else:
            late = answer
    writer.close()


async def test_a_late_answer_is_never_credited_to_the_next_request():
    server = await asyncio.start_server(serve_late, "127.0.0.1", 0)
    bus = Bus("eth", await open_tcp(*server.sockets[0].getsockname()), family="modbus", timeout=0.2)
    told = []
    bus.watch(told.append)
    bus.start()
    drive = bus.at("")
    try:
        for _ in range(3):
            with pytest.raises(NoAnswer, match="not known whether 'PR P' was executed"):
                await drive.send("PR P")
            assert await drive.send("PR V") == (str(REGISTERS["V"].address << 16),)
        assert not [event for event in told if isinstance(event, Unsolicited)]
    finally:
        await bus.close()
        server.close()
        await server.wait_closed()


async def test_a_write_is_in_doubt_until_the_error_is_read_although_the_server_has_answered_it():
    async def writes_only(reader, writer):
        while len(head := await reader.read(260)) > 7 and head[7] == framing.WRITE_REGISTERS:
            writer.write(head[:5] + bytes([6]) + head[6:12])
        writer.close()

    server = await asyncio.start_server(writes_only, "127.0.0.1", 0)
    bus = Bus("eth", await open_tcp(*server.sockets[0].getsockname()), family="modbus")
    bus.start()
    try:
        drive = bus.at("")
        drive.state.identified("LMDCE", "")
        with pytest.raises(TransportLost, match="; it is not known whether 'MA 700' was executed") as lost:
            await drive.send("MA 700")
        assert (lost.value.unproven, lost.value.executed) == ("MA 700", "")
    finally:
        await bus.close()
        server.close()
        await server.wait_closed()


async def test_answers_that_come_byte_by_byte():
    async def dribble(reader, writer):
        while len(head := await reader.read(12)) == 12:
            for byte in head[:2] + bytes.fromhex("0000 0007 01 03 04 1234 0000"):
                writer.write(bytes((byte,)))
                await writer.drain()
                await asyncio.sleep(0)
        writer.close()

    server = await asyncio.start_server(dribble, "127.0.0.1", 0)
    bus = Bus("eth", await open_tcp(*server.sockets[0].getsockname()), family="modbus")
    bus.start()
    try:
        drive = bus.at("")
        drive.state.identified("LMDCE", "")
        (motion,) = await drive.motion(Priority.POLL)
        assert (motion.position, motion.velocity) == (0x1234, 0x1234)
    finally:
        await bus.close()
        server.close()
        await server.wait_closed()


async def test_a_server_of_another_kind_is_shown_for_what_it_is():
    async def web(reader, writer):
        await reader.read(12)
        writer.write(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(web, "127.0.0.1", 0)
    bus = Bus("eth", await open_tcp(*server.sockets[0].getsockname()), family="modbus")
    told = []
    bus.watch(told.append)
    bus.start()
    try:
        with pytest.raises(NoAnswer, match="not Modbus"):
            await bus.at("").send("PR P")
        assert [event for event in told if isinstance(event, Traffic) and not event.outgoing]
    finally:
        await bus.close()
        server.close()
        await server.wait_closed()
