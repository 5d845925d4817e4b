"""The client of USB/IP byte by byte, over a socket in memory: what it sends, what it takes, and how each wait ends."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct
from collections.abc import Iterable
from typing import Any

import pytest

from multidrop.features.usb import usbip
from multidrop.features.usb.interface import CANCELLED, UsbControl
from multidrop.features.usb.pipe import explain_usb
from multidrop.features.usb.usbip import (
    OPERATION,
    RET_SUBMIT,
    RET_UNLINK,
    SUBMIT,
    UNLINK,
    Exported,
    Malformed,
    Transfer,
    Transfers,
    UsbipCarrier,
    imported,
    operation,
)
from multidrop.transports import Unreachable
from tests.support.cases import for_each
from tests.support.until import until

NAME = "usbip://10.0.0.5:3240/1-1"


def only(messages: Iterable[Transfer]) -> Transfer:
    [one] = messages
    return one


# Messages


def test_numbers_of_the_protocol_are_those_of_the_kernel() -> None:
    assert (usbip.PORT, usbip.VERSION, usbip.BUS_ID, usbip.FULL_SPEED) == (3240, 0x0111, 32, 2)
    assert (usbip.REQ_LIST, usbip.REP_LIST, usbip.REQ_IMPORT, usbip.REP_IMPORT) == (0x8005, 5, 0x8003, 3)
    assert (SUBMIT, UNLINK, RET_SUBMIT, RET_UNLINK) == (1, 2, 3, 4)
    assert usbip.INTERFACE == b"\xff\0\0\0", "a class of the vendor's own"
    assert operation(5, 2, b"rest") == bytes.fromhex("0111000500000002") + b"rest"


def test_an_exported_device_is_described_with_its_numbers_and_one_configuration() -> None:
    made = Exported("3-1.4", 3, 9)
    numbers = struct.pack(">IIIHHHBBBBBB", 3, 9, 2, 0x1589, 0xA101, 0x0100, 0, 0, 0, 1, 1, 1)
    path = b"/sys/devices/multidrop/3-1.4".ljust(256, b"\0")
    assert made.pack() == path + b"3-1.4".ljust(32, b"\0") + numbers
    assert Exported.read(made.pack()) == made and made.interfaces == 1
    other = (
        path + b"1-1\0\xffrest".ljust(32, b"\0") + struct.pack(">IIIHHHBBBBBB", 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)
    )
    assert Exported.read(other) == Exported("1-1", 1, 2, 4, 5, 6, 12)
    assert Exported.read(bytes(256) + b"\xff".ljust(32, b"\0") + bytes(24)).bus_id == "\N{REPLACEMENT CHARACTER}"


def test_an_answer_has_its_status_and_its_length() -> None:
    answer = Transfer(RET_SUBMIT, 7, 0x82, status=-32, length=3, data=b"PX\0").pack(0x00010002)
    assert (
        answer
        == bytes.fromhex(
            "00000003 00000007 00010002 00000001 00000002 ffffffe0 00000003 00000000 00000000 00000000 0000000000000000"
        )
        + b"PX\0"
    )


def header(kind: int, number: int, direction: int, endpoint: int, *rest: int) -> bytes:
    return struct.pack(">IIIII", kind, number, 0, direction, endpoint) + struct.pack(f">{len(rest)}i", *rest).ljust(
        28, b"\0"
    )


@for_each(
    ("data", "endpoint", "length"),
    [
        (header(SUBMIT, 1, 1, 15, 0, 64), 0x8F, 64),
        (header(SUBMIT, 1, 1, 2, 0, 1 << 20, 0, -1), 0x82, 1 << 20),
        (header(SUBMIT, 1, 0, 0, 0, 0), 0, 0),
        (header(UNLINK, 1, 0, 0, 5), 0, 0),
    ],
)
def test_the_extremes_of_a_request_are_taken(data: bytes, endpoint: int, length: int) -> None:
    found = only(Transfers(answers=False).feed(data))
    assert (found.number, found.endpoint, found.length, found.data) == (1, endpoint, length, b"")
    assert found.unlinked == (5 if found.kind == UNLINK else 0)


@for_each(
    ("answers", "data", "why"),
    [
        (False, header(SUBMIT, 1, 1, 16, 0, 64), "no message of USB/IP: kind 1, endpoint 16"),
        (False, header(UNLINK, 1, 2, 3, 5), "no message of USB/IP: kind 2, endpoint 3"),
        (False, header(3, 1, 0, 2), "no message of USB/IP: kind 3, endpoint 2"),
        (False, header(4, 1, 0, 2), "no message of USB/IP: kind 4, endpoint 2"),
        (True, header(1, 1, 0, 2), "no message of USB/IP: kind 1, endpoint 2"),
        (True, header(2, 1, 0, 2), "no message of USB/IP: kind 2, endpoint 2"),
        (True, header(3, 1, 2, 0), "no message of USB/IP: kind 3, endpoint 0"),
        (False, header(SUBMIT, 1, 1, 2, 0, (1 << 20) + 1), "a transfer of 1048577 bytes in 0 packets"),
        (False, header(SUBMIT, 1, 1, 2, 0, 64, 0, 1), "a transfer of 64 bytes in 1 packets"),
        (False, header(SUBMIT, 1, 1, 2, 0, -1), "a transfer of -1 bytes in 0 packets"),
        (True, header(RET_SUBMIT, 2, 1, 2, 0, 1), "the server answers transfer 2, which was not asked for"),
        (True, header(RET_SUBMIT, 1, 1, 2, 0, 65), "the server answers 65 bytes where 64 were asked for"),
        (True, header(RET_SUBMIT, 1, 1, 2, 0, -1), "the server answers -1 bytes where 64 were asked for"),
    ],
)
def test_what_cannot_be_is_refused_with_its_reason(answers: bool, data: bytes, why: str) -> None:
    messages = Transfers(answers)
    messages.asked = {1: 64}
    with pytest.raises(Malformed) as refused:
        list(messages.feed(data))
    assert str(refused.value) == why


def test_a_message_is_given_when_its_last_byte_has_come() -> None:
    messages = Transfers(answers=True)
    messages.asked = {1: 64, 2: 0, 3: 64}
    full = header(RET_SUBMIT, 1, 1, 2, 0, 64) + bytes(range(64))
    assert [list(messages.feed(full[:47])), list(messages.feed(full[47:-1]))] == [[], []]
    rest = full[-1:] + header(RET_SUBMIT, 2, 0, 2, 0, 3) + header(RET_UNLINK, 3, 0, 0, -104, 7) + b"\0"
    first, second, third = messages.feed(rest)
    assert (first.endpoint, first.length, first.data) == (0x82, 64, bytes(range(64)))
    assert (second.number, second.length, second.data) == (2, 3, b""), "what was taken brings nothing back"
    assert (third.number, third.status, third.data) == (3, -104, b"") and messages.asked == {}


# The import


class Side:
    """The server's side of a connection."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair()
        self.near.setblocking(False)
        self.far.setblocking(False)
        self.messages = Transfers(answers=False)

    def raw(self) -> bytes:
        try:
            return self.far.recv(1 << 20)
        except BlockingIOError:
            return b"nothing"

    def requests(self) -> list[Transfer]:
        """What has arrived since the last call."""
        data = self.raw()
        return [] if data == b"nothing" else list(self.messages.feed(data))

    def answer(self, *answers: Transfer) -> None:
        data = b"".join(each.pack() for each in answers)
        assert self.far.send(data) == len(data)


@pytest.fixture
def side() -> Iterable[Side]:
    made = Side()
    yield made
    made.near.close()
    made.far.close()


@pytest.fixture
def found(side: Side, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What is asked for a connection; the far side is given each time."""
    asked: list[Any] = []

    async def connected(*place: Any, **given: Any) -> socket.socket:
        asked.append((place, given))
        return side.near

    monkeypatch.setattr(usbip, "connected", connected)
    return asked


def importing(side: Side, *said: tuple[float, bytes]) -> asyncio.Task[UsbipCarrier]:
    """Begin an import; what the server says is said so many seconds later."""
    for after, data in said:
        asyncio.get_running_loop().call_later(after, side.far.send, data)
    return asyncio.ensure_future(imported("10.0.0.5", 3240, "1-1", 7.5))


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_an_import_asks_for_the_device_and_takes_the_time_of_the_way(side: Side, found: list[Any]) -> None:
    reply = operation(0x0003) + Exported("1-1", 3, 5).pack()
    carrier = await importing(side, (0.2, reply[:5]), (0.3, reply[5:100]), (0.7, reply[100:]))
    assert found == [((NAME, "10.0.0.5", 3240), {"given": 7.5})]
    assert side.raw() == bytes.fromhex("0111800300000000") + b"1-1".ljust(32, b"\0")
    assert carrier.name == NAME and carrier.delay == pytest.approx(0.7, abs=0.001)
    assert carrier.send(b"PX\0") == 1
    assert (
        side.raw()
        == bytes.fromhex(
            "00000001 00000001 00030005 00000000 00000002 00000000 00000003 00000000 00000000 00000000 0000000000000000"
        )
        + b"PX\0"
    )
    carrier.close()


@pytest.mark.virtual
@pytest.mark.AF_UNIX
@pytest.mark.parametrize(
    ("reply", "why"),
    [
        (operation(3, 1), "it is not exported"),
        (operation(3, 2), "another program has it"),
        (operation(3, 3), "it has an error"),
        (operation(3, 4), "no such device"),
        (operation(3, 5), "refused with status 5"),
        (operation(4, 1), "the server does not speak USB/IP"),
        (b"", "the server did not answer within 3 s"),
        (operation(3) + bytes(311), "the server did not answer within 3 s"),
        (
            operation(3) + Exported("1-1", 1, 2, product=0xA102).pack(),
            "1589:a102 is no Performax controller (1589:a101)",
        ),
        (
            operation(3) + Exported("1-1", 1, 2, vendor=0x000A).pack(),
            "000a:a101 is no Performax controller (1589:a101)",
        ),
    ],
)
async def test_a_refused_import_is_said_and_the_connection_given_back(
    side: Side, found: list[Any], reply: bytes, why: str
) -> None:
    begin = asyncio.get_running_loop().time()
    with pytest.raises(Unreachable) as refused:
        await importing(side, (0.0, reply))
    assert str(refused.value) == f"{NAME}: {why}" and side.near.fileno() == -1
    took = asyncio.get_running_loop().time() - begin
    assert took == pytest.approx(3.0 if "answer within" in why else 0.0, abs=0.01)


@pytest.mark.virtual
@pytest.mark.AF_UNIX
@pytest.mark.parametrize("how", ["closed", "cut", "cancelled"])
async def test_an_import_that_is_broken_off_gives_the_connection_back(side: Side, found: list[Any], how: str) -> None:
    loop = asyncio.get_running_loop()
    task = importing(side)
    if how == "closed":
        loop.call_later(0.1, side.far.shutdown, socket.SHUT_WR)
    elif how == "cut":
        loop.call_later(0.1, side.far.close)  # with the request unread
    else:
        loop.call_later(0.1, task.cancel)
    with pytest.raises(asyncio.CancelledError if how == "cancelled" else Unreachable) as ended:
        await task
    assert side.near.fileno() == -1
    if how == "closed":
        assert str(ended.value) == f"{NAME}: the server closed the connection; is it a server of USB/IP?"
    elif how == "cut":
        assert str(ended.value) == f"{NAME}: the other end cut the connection; check its power and the network"


# Transfers


class Desk:
    """A carrier that has begun to report, and what it reported."""

    def __init__(self, side: Side) -> None:
        self.done: list[Any] = []
        self.broken: list[OSError | None] = []
        self.carrier = UsbipCarrier(NAME, side.near, 0x00010002, 0.5)
        self.carrier.start(lambda *end: self.done.append(end), self.broken.append)


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_each_transfer_is_numbered_and_asks_for_what_it_can_take(side: Side) -> None:
    desk = Desk(side)
    carrier = desk.carrier
    assert [carrier.control(UsbControl.OPEN), carrier.receive(), carrier.send(b"ID\0")] == [1, 2, 3]
    opened, waiting, command = side.requests()
    assert (opened.endpoint, opened.length, opened.setup) == (0, 0, bytes.fromhex("4002020000000000"))
    assert (waiting.endpoint, waiting.length, waiting.setup) == (0x82, 64, bytes(8))
    assert (command.endpoint, command.length, command.data) == (0x02, 3, b"ID\0")
    side.answer(
        Transfer(RET_SUBMIT, 3, length=3),
        Transfer(RET_SUBMIT, 1, status=-32),
        Transfer(RET_SUBMIT, 2, length=64, data=b"7".ljust(64, b"\0")),
    )
    await until(lambda: len(desk.done) == 3)
    assert desk.done == [(3, 0, b""), (1, -32, b""), (2, 0, b"7".ljust(64, b"\0"))] and desk.broken == []
    carrier.close()


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_what_is_cancelled_ends_so_and_is_not_answered_any_more(side: Side) -> None:
    desk = Desk(side)
    waiting, other = desk.carrier.receive(), desk.carrier.receive()
    desk.carrier.cancel(waiting)
    *_, unlink = side.requests()
    assert (unlink.kind, unlink.number, unlink.unlinked) == (UNLINK, 3, waiting)
    side.answer(Transfer(RET_UNLINK, 3, status=CANCELLED))
    await until(lambda: bool(desk.done))
    assert desk.done == [(waiting, CANCELLED, b"")] and desk.carrier.receive() == 4
    desk.carrier.cancel(other)
    side.answer(Transfer(RET_SUBMIT, other, length=1, data=b"7"), Transfer(RET_UNLINK, 5, status=0))
    await until(lambda: len(desk.done) == 2)
    await asyncio.sleep(1)
    assert desk.done[1:] == [(other, 0, b"7")] and desk.broken == [], "it had ended before"
    side.answer(Transfer(RET_SUBMIT, waiting, length=1, data=b"7"))
    await until(lambda: bool(desk.broken))
    [error] = desk.broken
    assert error is not None and error.errno == errno.EPROTO
    assert explain_usb(error) == f"the server answers transfer {waiting}, which was not asked for"
    desk.carrier.close()


@pytest.mark.virtual
@pytest.mark.AF_UNIX
@pytest.mark.parametrize("how", ["closed", "cut"])
async def test_the_end_of_the_connection_is_reported_once_and_nothing_can_leave_then(side: Side, how: str) -> None:
    desk = Desk(side)
    waiting = desk.carrier.receive()
    if how == "closed":
        side.requests()
    side.far.close()
    await until(lambda: bool(desk.broken))
    [error] = desk.broken
    assert (error is None) if how == "closed" else (error is not None and error.errno == errno.ECONNRESET)
    with pytest.raises(OSError):
        desk.carrier.send(b"PX\0")
    desk.carrier.cancel(waiting)
    desk.carrier.close()
    await asyncio.sleep(1)
    assert len(desk.broken) == 1 and desk.done == [] and side.near.fileno() == -1


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_a_carrier_that_never_began_to_report_is_closed(side: Side) -> None:
    carrier = UsbipCarrier(NAME, side.near, 1, 0.0)
    carrier.halt()
    carrier.close()
    assert only(side.requests()).setup == bytes.fromhex("4002040000000000") and side.raw() == b""


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_after_a_halt_nothing_is_reported(side: Side) -> None:
    desk = Desk(side)
    waiting = desk.carrier.receive()
    await asyncio.sleep(0.1)
    desk.carrier.halt()
    side.answer(Transfer(RET_SUBMIT, waiting, length=1, data=b"7"))
    await asyncio.sleep(1)
    assert desk.done == [] and desk.broken == []
    desk.carrier.close()


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_a_server_that_sends_without_a_pause_does_not_hold_up_the_loop(side: Side) -> None:
    """No more than 4096 bytes are taken at a turn."""
    desk = Desk(side)
    numbers = [desk.carrier.receive() for _ in range(300)]
    side.requests()
    sizes = [17] + [16] * 299
    side.answer(
        *(Transfer(RET_SUBMIT, n, length=size, data=bytes(size)) for n, size in zip(numbers, sizes, strict=True))
    )
    turns = [0]
    while turns[-1] < 300:
        await asyncio.sleep(0)
        turns.append(len(desk.done))
    assert turns[1:3] == [63, 127], turns
    await until(lambda: len(desk.done) == 300)
    desk.carrier.close()


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_what_the_system_does_not_take_at_once_follows_within_some_milliseconds(side: Side) -> None:
    desk = Desk(side)
    loop, packet = asyncio.get_running_loop(), b"#" * 63 + b"\0"
    numbers = [desk.carrier.send(packet) for _ in range(5000)]
    arrived: list[Transfer] = []
    await asyncio.sleep(1)
    begin = loop.time()
    while len(arrived) < 5000:
        arrived += side.requests()
        assert loop.time() - begin < 0.5
        await asyncio.sleep(0.001)
    assert [each.number for each in arrived] == numbers and {each.data for each in arrived} == {packet}
    assert 0.001 < loop.time() - begin < 0.1
    assert desk.carrier.send(b"PX\0") == 5001 and only(side.requests()).data == b"PX\0", "at once again"
    [desk.carrier.send(packet) for _ in range(5000)]
    side.far.close()
    await until(lambda: bool(desk.broken))
    await asyncio.sleep(1)
    assert len(desk.broken) == 1, "the reader alone reports it"
    desk.carrier.close()


# The device number


@pytest.mark.virtual
@pytest.mark.AF_UNIX
@pytest.mark.parametrize(
    ("device", "text", "number"),
    [
        (bytes([18, 1]) + bytes(14) + bytes([3, 1]), bytes([12, 3]) + "2ED07".encode("utf-16-le"), "2ED07"),
        (bytes([17, 1]) + bytes(14) + bytes([9]), bytes([4, 3]) + b"7\0\xff", "7\N{REPLACEMENT CHARACTER}"),
        (bytes([18, 1]) + bytes(14) + bytes([3, 1]), None, ""),
        (bytes([18, 1]) + bytes(14) + bytes([0, 1]), None, ""),
        (bytes([16, 1]) + b"x" * 14, None, ""),
        (None, None, ""),
    ],
)
async def test_the_device_number_is_the_serial_number_of_the_descriptor(
    side: Side, device: bytes | None, text: bytes | None, number: str
) -> None:
    desk = Desk(side)
    asking = asyncio.ensure_future(desk.carrier.number())
    asked = bytearray()
    for answer in (device, text):
        await asyncio.sleep(0.01)
        for request in side.requests():
            assert (request.endpoint, request.length) == (0x80, 64)
            asked += request.setup
            said = answer or b""
            status = -32 if answer is None else 0
            side.answer(Transfer(RET_SUBMIT, request.number, status=status, length=len(said), data=said))
    assert await asking == number
    index = device[16:17] if device else b""
    second = bytes([0x80, 6, *index, 3, 9, 4, 64, 0]) if index.strip(b"\0") else b""
    assert bytes(asked) == bytes.fromhex("8006000100004000") + second
    assert desk.done == desk.broken == []
    desk.carrier.close()


@pytest.mark.virtual
@pytest.mark.AF_UNIX
async def test_a_device_that_tells_no_number_within_3_s_has_none_and_what_it_tells_later_means_nothing(
    side: Side,
) -> None:
    desk = Desk(side)
    begin = asyncio.get_running_loop().time()
    assert await desk.carrier.number() == ""
    assert asyncio.get_running_loop().time() - begin == pytest.approx(3.0, abs=0.001)
    late = only(side.requests())
    side.answer(Transfer(RET_SUBMIT, late.number, length=18, data=bytes(18)))
    await asyncio.sleep(1)
    assert desk.done == desk.broken == []
    desk.carrier.close()
    assert await desk.carrier.number() == "", "where nothing can be asked"


def test_the_sizes_of_the_protocol_are_those_of_the_kernel() -> None:
    assert (OPERATION.size, usbip.RECORD) == (8, 312)
