"""USB/IP: the messages as the kernel's documentation has them, and the client against servers of every kind."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.features.usb import usbip
from multidrop.features.usb.interface import CANCELLED, PRODUCT, VENDOR, UsbControl
from multidrop.features.usb.pipe import Broken, Done
from multidrop.features.usb.usbip import (
    OPERATION,
    RECORD,
    REP_IMPORT,
    RET_SUBMIT,
    RET_UNLINK,
    SUBMIT,
    UNLINK,
    Exported,
    Malformed,
    Transfer,
    Transfers,
    imported,
    operation,
    setup,
)
from multidrop.transports import Unreachable
from tests.support.cases import for_each
from tests.support.until import PATIENCE

DEVICE = Exported("1-1", 1, 2)


def read(messages: Transfers, data: bytes, size: int = 0) -> list[Transfer]:
    """The messages in bytes, which come in pieces of this size."""
    pieces = [data[at : at + size] for at in range(0, len(data), size)] if size else [data]
    return [each for piece in pieces for each in messages.feed(piece)]


# Messages


def test_messages_are_those_of_the_kernels_documentation() -> None:
    out = Transfer(SUBMIT, 7, 0x02, length=3, data=b"PX\0").pack(0x00010002)
    assert out == bytes.fromhex("00000001 00000007 00010002 00000000 00000002 00000000 00000003"
                                "00000000 00000000 00000000 0000000000000000") + b"PX\0"  # fmt: skip
    flush = Transfer(SUBMIT, 8, setup=setup(UsbControl.FLUSH)).pack(0x00010002)
    assert flush[40:] == bytes.fromhex("40 02 0100 0000 0000")
    unlink = Transfer(UNLINK, 9, unlinked=7).pack(0x00010002)
    assert unlink[:24] == bytes.fromhex("00000002 00000009 00010002 00000000 00000000 00000007") and len(unlink) == 48
    assert operation(0x8003, rest=b"1-1".ljust(32, b"\0"))[:11] == bytes.fromhex("0111 8003 00000000") + b"1-1"
    assert len(DEVICE.pack()) == 312 and Exported.read(DEVICE.pack()) == DEVICE


transfers = st.builds(
    lambda kind, number, endpoint, status, data, wanted: (
        Transfer(kind, number, endpoint, length=wanted if endpoint & 0x80 else len(data), setup=b"12345678",
                 data=b"" if endpoint & 0x80 else data)
        if kind == SUBMIT
        else Transfer(UNLINK, number, unlinked=status)
    ),
    st.sampled_from([SUBMIT, UNLINK]), st.integers(1, 2**32 - 1), st.sampled_from([0, 0x80, 0x02, 0x82]),
    st.integers(0, 2**32 - 1), st.binary(max_size=70), st.integers(0, 70),
)  # fmt: skip


@given(st.lists(transfers, max_size=5), st.integers(0, 60))
def test_what_a_host_sends_is_read_in_any_pieces(sent: list[Transfer], size: int) -> None:
    expected = [each if each.kind == SUBMIT else Transfer(UNLINK, each.number, unlinked=each.unlinked) for each in sent]
    assert read(Transfers(answers=False), b"".join(each.pack(5) for each in sent), size) == expected


@given(st.lists(st.tuples(st.booleans(), st.binary(max_size=64)), max_size=5), st.integers(0, 60))
def test_answers_are_read_in_any_pieces(answers: list[tuple[bool, bytes]], size: int) -> None:
    """Only those to transfers that bring data have any after the header; the header does not say which these are."""
    messages = Transfers(answers=True)
    messages.asked = {number: 64 * wanted for number, (wanted, _) in enumerate(answers, 1)}
    sent = [
        Transfer(RET_SUBMIT, number, length=len(data), data=data if wanted else b"")
        for number, (wanted, data) in enumerate(answers, 1)
    ]
    assert read(messages, b"".join(each.pack() for each in sent), size) == sent
    assert messages.asked == {}


@given(st.binary(max_size=200), st.booleans())
def test_garbage_is_refused_or_waits_for_more(data: bytes, answers: bool) -> None:
    try:
        read(Transfers(answers), data)
    except Malformed as error:
        assert "\n" not in str(error)


@for_each(
    "data",
    [
        Transfer(RET_SUBMIT, 1).pack(),
        struct.pack(">IIIII28x", SUBMIT, 1, 0, 0, 16),
        struct.pack(">IIIIIIiiii8x", SUBMIT, 1, 0, 0, 2, 0, 1 << 21, 0, 0, 0),
        struct.pack(">IIIIIIiiii8x", SUBMIT, 1, 0, 0, 2, 0, -1, 0, 0, 0),
        struct.pack(">IIIIIIiiii8x", SUBMIT, 1, 0, 1, 2, 0, 64, 0, 8, 0),
    ],
)
def test_a_message_that_cannot_be_is_refused(data: bytes) -> None:
    with pytest.raises(Malformed):
        read(Transfers(answers=False), data)


@for_each(
    "answer, why",
    [
        (Transfer(RET_SUBMIT, 2), "transfer 2, which was not asked for"),
        (Transfer(RET_UNLINK, 9), "transfer 9, which was not asked for"),
        (Transfer(RET_SUBMIT, 1, length=65, data=b"x" * 65), "65 bytes where 64 were asked for"),
        (Transfer(RET_SUBMIT, 1, length=1 << 20), "1048576 bytes where 64 were asked for"),
        (Transfer(RET_SUBMIT, 1, length=-1), "-1 bytes where 64"),
    ],
)
def test_an_answer_of_more_than_was_asked_is_refused_before_its_data(answer: Transfer, why: str) -> None:
    messages = Transfers(answers=True)
    messages.asked = {1: 64}
    with pytest.raises(Malformed, match=why):
        read(messages, answer.pack()[:48])


def test_an_answer_counts_once() -> None:
    messages = Transfers(answers=True)
    messages.asked = {1: 64}
    answer = Transfer(RET_SUBMIT, 1, length=2, data=b"7\0").pack()
    with pytest.raises(Malformed, match="transfer 1, which was not asked for"):
        read(messages, answer * 2)


# The client

Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]
Serve = Callable[[Callable[..., Awaitable[None]]], Awaitable[int]]


@pytest.fixture
async def serve() -> AsyncIterator[Serve]:
    """Serves one script of a server; gives its port."""
    async with AsyncExitStack() as stack:

        async def start(script: Callable[..., Awaitable[None]]) -> int:
            async def met(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
                stack.callback(writer.close)
                await script(reader, writer)

            server = await asyncio.start_server(met, "127.0.0.1", 0)
            stack.callback(server.close)
            return int(server.sockets[0].getsockname()[1])

        yield start


def replying(reply: bytes) -> Callable[..., Awaitable[None]]:
    async def script(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        assert await reader.readexactly(40) == bytes.fromhex("0111800300000000") + b"1-1".ljust(32, b"\0")
        writer.write(reply)
        writer.close()

    return script


@pytest.mark.parametrize(
    ("reply", "why"),
    [
        (b"", "the server closed the connection"),
        (operation(REP_IMPORT)[:5], "the server closed the connection"),
        (operation(REP_IMPORT) + DEVICE.pack()[:-1], "the server closed the connection"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "the server does not speak USB/IP"),
        (operation(REP_IMPORT, 1), "it is not exported"),
        (operation(REP_IMPORT, 2), "another program has it"),
        (operation(REP_IMPORT, 77), "refused with status 77"),
        (
            operation(REP_IMPORT) + Exported("1-1", 1, 2, 0x046D, 0xC52B).pack(),
            "046d:c52b is no Performax controller",
        ),
    ],
)
async def test_a_refused_import_says_why(serve: Serve, reply: bytes, why: str) -> None:
    port = await serve(replying(reply))
    with pytest.raises(Unreachable, match=f"^usbip://127.0.0.1:{port}/1-1: {why}"):
        await imported("127.0.0.1", port, "1-1")


async def test_a_server_that_says_nothing_is_given_up(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usbip, "ANSWER", 0.05)

    async def silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read()

    port = await serve(silent)
    with pytest.raises(Unreachable, match="did not answer within 0.05 s"):
        await imported("127.0.0.1", port, "1-1")


class Ear:
    """What a carrier reports."""

    def __init__(self) -> None:
        self.ends: asyncio.Queue[object] = asyncio.Queue()
        self.done: Done = lambda *end: self.ends.put_nowait(end)
        self.broken: Broken = self.ends.put_nowait

    async def next(self) -> object:
        return await asyncio.wait_for(self.ends.get(), PATIENCE)


async def attached(serve: Serve) -> tuple[usbip.UsbipCarrier, Ear, Streams]:
    """A client, what it reports, and the server's side of its connection after the import."""
    met: asyncio.Future[Streams] = asyncio.get_running_loop().create_future()

    async def script(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readexactly(OPERATION.size + 32)
        writer.write(operation(REP_IMPORT) + DEVICE.pack())
        met.set_result((reader, writer))

    carrier = await imported("127.0.0.1", await serve(script), "1-1")
    ear = Ear()
    carrier.start(ear.done, ear.broken)
    return carrier, ear, await asyncio.wait_for(met, PATIENCE)


async def test_several_transfers_are_on_their_way_and_end_in_any_order(serve: Serve) -> None:
    carrier, ear, (reader, writer) = await attached(serve)
    waiting, asked, flushed = carrier.receive(), carrier.send(b"PX\0"), carrier.control(UsbControl.FLUSH)
    received = read(Transfers(answers=False), await reader.readexactly(3 * 48 + 3), 1)
    assert [(each.endpoint, each.length, each.data) for each in received] == [
        (0x82, 64, b""), (0x02, 3, b"PX\0"), (0, 0, b"")]  # fmt: skip
    for number, data in ((flushed, b""), (asked, b""), (waiting, b"12\0")):
        writer.write(Transfer(RET_SUBMIT, number, length=len(data) or 3, data=data).pack())
    assert [await ear.next() for _ in range(3)] == [(flushed, 0, b""), (asked, 0, b""), (waiting, 0, b"12\0")]
    carrier.halt()
    carrier.close()
    [closing] = read(Transfers(answers=False), await reader.readexactly(48))
    assert closing.setup == setup(UsbControl.CLOSE) and not await reader.read()


@pytest.mark.parametrize("in_time", [True, False])
async def test_a_cancelled_transfer_ends_once(serve: Serve, in_time: bool) -> None:
    carrier, ear, (reader, writer) = await attached(serve)
    number = carrier.receive()
    carrier.cancel(number)
    submitted, unlink = read(Transfers(answers=False), await reader.readexactly(96))
    assert (unlink.kind, unlink.unlinked) == (UNLINK, submitted.number)
    if in_time:
        writer.write(Transfer(RET_UNLINK, unlink.number, status=CANCELLED).pack())
    else:
        writer.write(
            Transfer(RET_SUBMIT, number, length=2, data=b"7\0").pack() + Transfer(RET_UNLINK, unlink.number).pack()
        )
    assert await ear.next() == ((number, CANCELLED, b"") if in_time else (number, 0, b"7\0"))
    writer.close()
    assert await ear.next() is None
    carrier.close()


async def test_a_flood_of_answers_is_a_break_and_is_not_kept(serve: Serve) -> None:
    carrier, ear, (_, writer) = await attached(serve)
    number = carrier.receive()
    writer.write(Transfer(RET_SUBMIT, number, length=2, data=b"7\0").pack() * 20000)
    assert await ear.next() == (number, 0, b"7\0")
    assert f"transfer {number}, which was not asked for" in str(await ear.next())
    carrier.close()


async def test_garbage_from_the_server_is_a_break_with_a_reason(serve: Serve) -> None:
    carrier, ear, (_, writer) = await attached(serve)
    writer.write(b"\xff" * 48)
    assert "no message of USB/IP" in str(await ear.next())
    carrier.close()


async def test_what_the_system_does_not_take_at_once_follows(serve: Serve) -> None:
    carrier, ear, (reader, _) = await attached(serve)
    numbers = [carrier.send(b"#" * 63 + b"\0") for _ in range(2000)]
    received: list[Transfer] = []
    messages = Transfers(answers=False)
    while len(received) < len(numbers):
        received += messages.feed(await asyncio.wait_for(reader.read(65536), PATIENCE))
    assert [each.number for each in received] == numbers
    carrier.halt()
    carrier.close()


def test_a_device_of_a_controller_is_a_controllers() -> None:
    assert (DEVICE.vendor, DEVICE.product) == (VENDOR, PRODUCT) == (0x1589, 0xA101)
    assert len(DEVICE.pack()) == RECORD
