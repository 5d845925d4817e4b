"""USB/IP judged by others: Debian's `usbip`, and both sides of the Python library `usbip`."""

from __future__ import annotations

import asyncio
import re
import subprocess
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.features.usb.device import UsbController, sides
from multidrop.features.usb.exports import UsbipServer
from multidrop.features.usb.pipe import UsbPipe, open_usb
from multidrop.features.usb.usbip import imported
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import Unreachable
from tests.support.cell_session import bus, pmx
from tests.support.front_door import command
from tests.support.tools import tool
from tests.support.until import until

usbip = pytest.importorskip("usbip", reason="the library usbip is not installed")
HOST = "127.0.0.1"
FLUSH, OPEN, CLOSE = 1, 2, 4


@asynccontextmanager
async def served(*numbers: str) -> AsyncIterator[tuple[RunningFloor, int]]:
    """Controllers of one bus, exported; the floor, and the port of the server."""
    floor = RunningFloor(Floor(read(bus("w", *map(pmx, numbers)), "cell")))
    server = UsbipServer(floor, "w")
    try:
        yield floor, await server.open(HOST, 0)
    finally:
        await server.close()
        floor.close()


# The server, judged by others


@pytest.mark.process
@pytest.mark.needs("usbip")
async def test_debians_usbip_lists_each_controller_that_has_power() -> None:
    async with served("00", "07") as (floor, port):
        arguments = [tool("usbip"), "--tcp-port", str(port), "list", "-r", HOST]

        async def listed() -> str:
            done = await asyncio.to_thread(subprocess.run, arguments, capture_output=True, text=True, timeout=60)
            assert done.returncode == 0, done.stderr
            return done.stdout

        both = await listed()
        assert re.findall(r"^ +(\d-\d): .* \((....:....)\)$", both, re.M) == [
            ("1-1", "1589:a101"),
            ("1-2", "1589:a101"),
        ]
        assert both.count("Vendor Specific Class") >= 2 or both.count("(ff/00/00)") == 2, both
        floor.command("/sim power w:00 off")
        assert re.findall(r"^ +(\d-\d): ", await listed(), re.M) == ["1-2"]


async def test_the_host_side_of_the_library_lists_imports_and_asks() -> None:
    async with served("00", "07") as (floor, port):
        found = await asyncio.to_thread(usbip.host.list_devices, usbip.USBIP(HOST, port))
        facts = [(each["busid"], each["idVendor"], each["idProduct"], each["interfaces"]) for each in found]
        assert facts == [(busid, 0x1589, 0xA101, [(0xFF, 0, 0)]) for busid in ("1-1", "1-2")]
        assert await asyncio.to_thread(_conversation, port) == [
            (0x1589, 0xA101, 64),
            "2ED07",
            [2, 0x82],
            b"Performax-2ED-SA\0",
            b"2ED07\0",
            b"OK\0",
            b"1234\0",
            "stalled",
        ]
        assert [each.device.programs.variables[1] for each in sides(floor.floor, "w")] == [0, 1234]


def _conversation(port: int) -> list[Any]:
    """What another host hears of the second controller: descriptors, and replies of 64 bytes up to their NUL."""
    seen: list[Any] = []
    with usbip.attach(HOST, "1-2", port=port, vid=0x1589, pid=0xA101) as handle:
        about = handle.device_descriptor
        seen.append((about.idVendor, about.idProduct, about.bMaxPacketSize0))
        seen.append(handle.control(0x80, 6, 0x0300 | about.iSerialNumber, 0x0409, 255)[2:].decode("utf-16-le"))
        configuration = handle.control(0x80, 6, 0x0200, 0, 255)
        pieces = usbip.core.iter_descriptors(configuration)
        seen.append([each[2] for each in pieces if each[1] == usbip.core.DT_ENDPOINT])
        for value in (OPEN, FLUSH):
            handle.control(0x40, 2, value, 0, b"")
        for text in (b"ID\0", b"DN\0".ljust(64, b"\0"), b"V1=1234\0", b"V1\0"):
            assert handle.bulk_out(0x02, text) == len(text)
            reply = handle.bulk_in(0x82, 64)
            assert len(reply) == 64
            seen.append(reply[: reply.index(0) + 1])
        try:
            handle.control(0x40, 2, 0x77, 0, b"")
        except usbip.Stall:
            seen.append("stalled")
        handle.control(0x40, 2, CLOSE, 0, b"")
    return seen


async def test_a_reply_that_was_not_read_comes_first_to_the_next_host_unless_it_flushes() -> None:
    async with served("00") as (floor, port):

        def ask(flush: bool, *texts: bytes) -> bytes:
            with usbip.attach(HOST, "1-1", port=port) as handle:
                if flush:
                    handle.control(0x40, 2, FLUSH, 0, b"")
                for text in texts:
                    handle.bulk_out(0x02, text)
                return bytes(handle.bulk_in(0x82, 64).partition(b"\0")[0])

        [controller] = sides(floor.floor, "w")
        for flush, expected in ((False, b"OK"), (True, b"7")):
            assert await asyncio.to_thread(ask, True, b"V1=7\0", b"V2=8\0") == b"OK"  # the second reply stays unread
            await until(lambda: len(controller.replies) == 1)
            await asyncio.sleep(0.05)  # until the server has noticed that the host has gone
            assert await asyncio.to_thread(ask, flush, b"V1\0") == expected


# The client, judged by the library's device


class Performax(usbip.Interface):  # type: ignore[misc, name-defined]
    """The vendor's interface as the library makes one, with a simulated controller behind it."""

    bulk_out = usbip.Out(0x02, "bulk", mps=64)
    bulk_in = usbip.In(0x82, "bulk", mps=64)

    def __init__(self, controller: UsbController) -> None:
        super().__init__()
        self.controller = controller
        self.requests: list[int] = []
        self.heard: list[bytes] = []
        self.silent = False

    def on_control(self, setup: Any, data: bytes = b"") -> bytes:
        if (setup.bmRequestType, setup.bRequest, setup.wIndex, setup.wLength) != (0x40, 2, 0, 0):
            raise usbip.Stall
        self.requests.append(setup.wValue)
        return b""

    def on_out(self, ep: object, data: bytes) -> None:
        self.heard.append(data)
        if not self.silent:
            self.controller.receive(data, 0.0)
        while self.controller.replies:
            self.bulk_in.write(self.controller.replies.popleft())


@contextmanager
def plugged(vendor: int = 0x1589) -> Iterator[tuple[Performax, int]]:
    """A device of the library, and the port where it is served."""
    floor = Floor(read(bus("w", pmx("07")), "cell"))
    device = usbip.USBDevice(vendor, 0xA101, product="Performax USB", serial="2ED07")
    interface = device.add(Performax(sides(floor, "w")[0]))
    transport = usbip.USBIP(HOST, 0)
    with device.plug(via=transport):
        yield interface, transport._listener.socks[0].getsockname()[1]


async def opened(port: int) -> tuple[UsbPipe, bytearray, list[TransportLost]]:
    pipe = await open_usb(await imported(HOST, port, "1-1"))
    heard, lost = bytearray(), list[TransportLost]()
    pipe.start(heard.extend, lost.append)
    return pipe, heard, lost


async def test_the_pipe_speaks_to_the_librarys_device_as_the_driver_does() -> None:
    with plugged() as (device, port):
        pipe, heard, lost = await opened(port)
        assert device.requests[:2] == [OPEN, FLUSH]
        for text, reply in ((b"DN\r", b"2ED07\r"), (b"V1=5\r", b"OK\r"), (b"V1\r", b"5\r")):
            heard.clear()
            assert pipe.write(text)
            await until(lambda reply=reply: bytes(heard) == reply)
        await pipe.close()
        await until(lambda: device.requests[-1] == CLOSE)
        assert [each.rstrip(b"\0") for each in device.heard] == [b"DN", b"V1=5", b"V1"]
        assert all(each.endswith(b"\0") and len(each) <= 64 for each in device.heard)
        assert lost == []


async def test_after_a_missing_reply_the_next_command_waits_for_a_flush() -> None:
    with plugged() as (device, port):
        pipe, heard, _ = await opened(port)
        device.silent = True
        pipe.write(b"V1\r")
        await until(lambda: len(device.heard) == 1)
        device.silent = False
        before = list(device.requests)
        pipe.write(b"DN\r")
        await until(lambda: bytes(heard) == b"2ED07\r")
        assert device.requests[len(before) :] == [FLUSH]
        await pipe.close()


async def test_the_stop_leaves_at_once_while_a_reply_is_awaited() -> None:
    with plugged() as (device, port):
        pipe, _, _ = await opened(port)
        device.silent = True
        pipe.write(b"V1\r")
        await until(lambda: len(device.heard) == 1)
        assert await asyncio.to_thread(pipe.preempt, False, lambda dropped: b"ABORT\r")
        await until(lambda: len(device.heard) == 2)
        assert device.heard[1].rstrip(b"\0") == b"ABORT"
        pipe.yielded()
        await pipe.close()


async def test_a_device_that_is_unplugged_there_is_lost_here() -> None:
    with plugged() as (device, port):
        pipe, _, lost = await opened(port)
        device.dev.unplug()
        device.bulk_in.stall()  # what waits for a reply ends with an error
        await until(lambda: lost)
        assert str(lost[0]).startswith(f"usbip://{HOST}:{port}/1-1 was lost: ")
        await pipe.close()


async def test_a_device_of_another_make_is_refused() -> None:
    with plugged(vendor=0x1209) as (_, port):
        with pytest.raises(Unreachable, match="1209:a101"):
            await imported(HOST, port, "1-1")
        with pytest.raises(Unreachable, match=f"^usbip://{HOST}:{port}/1-9: "):
            await imported(HOST, port, "1-9")


def test_a_command_line_asks_the_librarys_device(tmp_path: Path) -> None:
    with plugged() as (_, port):
        done = command(tmp_path, "send", f"usbip://{HOST}:{port}/1-1", "V1=77", "V1")
        assert (done.returncode, done.stdout) == (0, "77\n"), done.stderr
