"""The transfers of a controller through libusb, on a library in memory: how each begins, ends and is cancelled."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from multidrop.features.usb import interface, libusb
from multidrop.features.usb.libusb import LibusbCarrier, open_libusb
from multidrop.features.usb.pipe import TransferFailed
from multidrop.transports import Unreachable
from tests.support.until import PATIENCE, until


class USBError(Exception):
    def __init__(self, value: int = 0) -> None:
        super().__init__(f"error {value}")
        self.value = value


class USBErrorInterrupted(USBError):
    pass


class Transfer:
    """A transfer that ends as the test says."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.set: tuple[Any, ...] = ()
        self.status, self.buffer, self.actual, self.cancelled = 0, b"", 0, 0

    def setControl(self, *given: Any, callback: Any, user_data: int) -> None:
        self.set, self.callback, self.number, self.endpoint = ("control", *given), callback, user_data, 0

    def setBulk(self, endpoint: int, data: Any, callback: Any, user_data: int) -> None:
        self.set, self.callback, self.number, self.endpoint = ("bulk", endpoint, data), callback, user_data, endpoint

    def submit(self) -> None:
        if self.bus.refuses is not None:
            raise USBError(self.bus.refuses)
        self.bus.submitted.append(self)
        self.bus.begun.append(self.set)
        if self.bus.ready and self.endpoint == 0:
            self.end()

    def cancel(self) -> None:
        self.cancelled += 1
        if self.bus.refuses is not None:
            raise USBError(self.bus.refuses)
        self.end(Bus.TRANSFER_CANCELLED)

    def end(self, status: int = 0, buffer: bytes = b"", actual: int | None = None) -> None:
        self.status, self.buffer, self.actual = status, buffer, len(buffer) if actual is None else actual
        self.bus.ended.append(self)

    def getUserData(self) -> int:
        return self.number

    def getStatus(self) -> int:
        return self.status

    def getEndpoint(self) -> int:
        return self.endpoint

    def getBuffer(self) -> bytes:
        return self.buffer

    def getActualLength(self) -> int:
        return self.actual


class Context:
    """The library's context."""

    def __init__(self, bus: Bus) -> None:
        self.handleEventsTimeout = bus.take_events


class Bus:
    """The library, one device and its handle."""

    USBError, USBErrorInterrupted = USBError, USBErrorInterrupted
    TRANSFER_COMPLETED, TRANSFER_CANCELLED, TRANSFER_STALL, TRANSFER_NO_DEVICE, TRANSFER_TIMED_OUT = range(5)

    def __init__(self) -> None:
        self.submitted: list[Transfer] = []
        self.begun: list[tuple[Any, ...]] = []
        """What each transfer was set to as it began."""
        self.ended: list[Transfer] = []
        self.made = 0
        self.calls: list[Any] = []
        self.refuses: int | None = None
        self.claims: int | None = None
        self.finds: int | None = None
        self.breaks: list[Exception] = []
        self.broken_end = False
        """No request is taken while it is closed."""
        self.ready = False
        """Requests end by themselves."""
        self.waits: list[float] = []
        self.context = Context(self)
        self.polls = threading.Semaphore(0)

    @contextlib.contextmanager
    def USBContext(self) -> Iterator[Context]:
        if self.finds is not None:
            raise USBError(self.finds)
        try:
            yield self.context
        finally:
            self.calls.append("context closed")

    def take_events(self, seconds: float) -> None:
        self.waits.append(seconds)
        self.polls.acquire(timeout=0.001)
        if self.breaks:
            raise self.breaks.pop(0)
        while self.ended:
            transfer = self.ended.pop(0)
            transfer.callback(transfer)

    def open(self) -> Bus:
        return self

    def claimInterface(self, number: int) -> None:
        if self.claims is not None:
            raise USBError(self.claims)
        self.calls.append(("claim", number))

    def getTransfer(self) -> Transfer:
        self.made += 1
        return Transfer(self)

    def clearHalt(self, endpoint: int) -> None:
        self.calls.append(("clear", endpoint))

    def controlWrite(self, *given: Any) -> None:
        if self.broken_end:
            raise USBError(-4)
        self.calls.append(given)

    def close(self) -> None:
        self.calls.append("closed")


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Bus:
    made = Bus()
    found = type("Found", (), {"device": made, "url": "usb:00"})()
    monkeypatch.setattr(libusb, "library", lambda: made)
    monkeypatch.setattr(libusb, "controllers", lambda *given: [found] if given == (made, made.context) else [])
    monkeypatch.setattr(libusb, "chosen", lambda found, target: found[0] if target == "00" else None)
    monkeypatch.setattr(libusb, "refusal", lambda value, found: f"refused with {value}")
    return made


class Desk:
    def __init__(self) -> None:
        self.done: list[Any] = []
        self.broken: list[OSError | None] = []
        self.carrier = LibusbCarrier("00")
        self.carrier.start(lambda *given: self.done.append(given), self.broken.append)


END = (interface.REQUEST_TYPE, interface.REQUEST, interface.UsbControl.CLOSE, 0, b"", 100)
OTHER = -5
"""The end for an error of libusb that has no number of Linux."""
ENDS = [(-4, interface.GONE), (-7, interface.TIMEOUT), (-9, interface.STALLED), (-12, OTHER)]
"""Errors of libusb, and the ends that they are reported as."""


def test_a_controller_that_is_claimed_has_its_url_as_a_name(bus: Bus) -> None:
    carrier = LibusbCarrier("00")
    assert carrier.name == "usb:00" and bus.calls == [("claim", 0)] and carrier.delay == 0.0
    carrier.close()
    assert bus.calls == [("claim", 0), END, "closed", "context closed"]


def test_a_bus_that_cannot_be_read_and_a_controller_that_cannot_be_claimed_are_named(bus: Bus) -> None:
    bus.finds = 7
    with pytest.raises(Unreachable, match=r"^usb:00: error 7$"):
        LibusbCarrier("00")
    bus.finds, bus.claims = None, 9
    with pytest.raises(Unreachable, match=r"^usb:00: refused with 9$"):
        LibusbCarrier("00")
    assert bus.calls == ["context closed"]


async def test_each_transfer_has_its_number_and_ends_with_its_status_and_what_came(bus: Bus) -> None:
    desk = Desk()
    carrier = desk.carrier
    assert [carrier.control(interface.UsbControl.OPEN), carrier.send(b"ID"), carrier.receive()] == [1, 2, 3]
    assert [each.set for each in bus.submitted] == [
        ("control", interface.REQUEST_TYPE, interface.REQUEST, interface.UsbControl.OPEN, 0, b""),
        ("bulk", interface.OUT, b"ID"),
        ("bulk", interface.IN, interface.PACKET),
    ]
    bus.submitted[0].end()
    bus.submitted[1].end(buffer=b"ID")
    bus.submitted[2].end(buffer=b"Performax", actual=4)
    await until(lambda: len(desk.done) == 3)
    assert desk.done == [(1, 0, b""), (2, 0, b""), (3, 0, b"Perf")]
    assert carrier.send(b"x") == 4 and bus.made == 3
    bus.submitted[3].end()
    await until(lambda: len(desk.done) == 4)
    carrier.close()
    assert bus.calls[1:] == [END, "closed", "context closed"]


@pytest.mark.parametrize(
    ("status", "end"),
    [
        (Bus.TRANSFER_CANCELLED, interface.CANCELLED),
        (Bus.TRANSFER_STALL, interface.STALLED),
        (Bus.TRANSFER_NO_DEVICE, interface.GONE),
        (Bus.TRANSFER_TIMED_OUT, interface.TIMEOUT),
        (99, OTHER),
    ],
)
async def test_a_transfer_that_fails_has_no_bytes_and_a_halted_endpoint_is_freed_at_the_end(
    bus: Bus, status: int, end: int
) -> None:
    desk = Desk()
    desk.carrier.receive()
    desk.carrier.control(interface.UsbControl.OPEN)
    for each in bus.submitted:
        each.end(status, b"what came")
    await until(lambda: len(desk.done) == 2)
    assert desk.done == [(1, end, b""), (2, end, b"")]
    desk.carrier.close()
    halted = [("clear", interface.IN)] if end == interface.STALLED else []
    assert bus.calls[1:] == [*halted, END, "closed", "context closed"]


@pytest.mark.parametrize(("value", "end"), ENDS)
async def test_a_transfer_that_cannot_begin_says_why_and_is_forgotten(bus: Bus, value: int, end: int) -> None:
    desk = Desk()
    bus.refuses = value
    with pytest.raises(TransferFailed) as failure:
        desk.carrier.send(b"x")
    assert failure.value.args == TransferFailed(end).args
    bus.refuses = None
    desk.carrier.cancel(1)
    desk.carrier.close()
    assert bus.submitted == [] and desk.done == []


async def test_a_transfer_is_cancelled_once_and_one_that_has_ended_or_has_just_ended_is_left(bus: Bus) -> None:
    desk = Desk()
    number = desk.carrier.receive()
    desk.carrier.cancel(number)
    await until(lambda: bool(desk.done))
    assert desk.done == [(number, interface.CANCELLED, b"")]
    desk.carrier.cancel(number)
    desk.carrier.cancel(99)
    other = desk.carrier.receive()
    bus.refuses = 5
    desk.carrier.cancel(other)
    bus.refuses = None
    bus.submitted[1].end()
    desk.carrier.close()


def watching() -> list[threading.Thread]:
    """The threads that wait for what a device sends."""
    return [each for each in threading.enumerate() if each.name.endswith(" events")]


async def test_after_the_end_nothing_begins_and_nothing_is_reported(bus: Bus) -> None:
    desk = Desk()
    desk.carrier.receive()
    desk.carrier.halt()
    with pytest.raises(TransferFailed) as failure:
        desk.carrier.send(b"x")
    assert failure.value.args == TransferFailed(interface.GONE).args
    [thread] = watching()
    desk.carrier.close()
    assert thread.daemon and not thread.is_alive()
    await asyncio.sleep(0)
    assert desk.done == desk.broken == [] and bus.submitted[0].cancelled >= 1


@pytest.mark.parametrize(("value", "end"), ENDS)
async def test_a_bus_that_breaks_is_reported_once_and_an_interruption_is_none(bus: Bus, value: int, end: int) -> None:
    desk = Desk()
    bus.breaks = [USBErrorInterrupted(4), USBError(value)]
    await until(lambda: bool(desk.broken))
    assert [each and each.args for each in desk.broken] == [TransferFailed(end).args]
    await until(lambda: not watching())
    desk.carrier.close()


async def test_an_end_of_either_endpoint_that_is_halted_is_freed_though_the_controller_takes_no_request(
    bus: Bus,
) -> None:
    desk = Desk()
    for begin in (desk.carrier.receive, lambda: desk.carrier.send(b"x"), lambda: desk.carrier.send(b"y")):
        begin()
        bus.submitted[-1].end(Bus.TRANSFER_STALL)
        await until(lambda: len(desk.done) == len(bus.submitted))
    bus.broken_end = True
    desk.carrier.close()
    assert sorted(bus.calls[1:3]) == [("clear", interface.OUT), ("clear", interface.IN)]
    assert bus.calls[3:] == ["closed", "context closed"]


async def test_the_events_are_taken_in_a_thread_of_the_controllers_name_that_no_end_waits_for(
    bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk = Desk()
    [thread] = [each for each in threading.enumerate() if each.name == "usb:00 events"]
    assert thread.daemon
    await until(lambda: bool(bus.waits))
    assert set(bus.waits) == {0.1}, "it looks in time whether it is to end"
    joined: list[float | None] = []
    join = threading.Thread.join

    def joins(thread: threading.Thread, timeout: float | None = None) -> None:
        joined.append(timeout)
        join(thread, timeout)

    monkeypatch.setattr(threading.Thread, "join", joins)
    desk.carrier.close()
    assert joined == [1.0], "libusb may hold it up"
    assert not thread.is_alive()


def test_the_thread_ends_with_the_loop(bus: Bus) -> None:
    desks: list[Desk] = []

    async def begin() -> None:
        desks.append(Desk())
        desks[0].carrier.receive()

    asyncio.run(begin())
    [thread] = [each for each in threading.enumerate() if each.name == "usb:00 events"]
    bus.submitted[0].end(buffer=b"late")
    thread.join(PATIENCE)
    assert not thread.is_alive() and desks[0].done == []
    desks[0].carrier.close()


async def test_all_that_waits_is_cancelled_at_the_end_before_the_device_is_given_back(bus: Bus) -> None:
    desk = Desk()
    desk.carrier.receive()
    desk.carrier.send(b"x")
    desk.carrier.close()
    assert [each.cancelled for each in bus.submitted] == [1, 1] and bus.ended == []
    assert bus.calls == [("claim", 0), END, "closed", "context closed"] and desk.done == []


async def test_a_transfer_is_known_until_it_has_ended(bus: Bus) -> None:
    """One that is used again belongs to its new number."""
    desk = Desk()
    first = desk.carrier.send(b"x")
    bus.submitted[0].end()
    await until(lambda: bool(desk.done))
    second = desk.carrier.receive()
    assert bus.submitted[1] is bus.submitted[0] and (first, second) == (1, 2)
    desk.carrier.cancel(first)
    assert bus.submitted[1].cancelled == 0
    desk.carrier.cancel(second)
    await until(lambda: len(desk.done) == 2)
    assert desk.done[1] == (second, interface.CANCELLED, b"")
    desk.carrier.close()


async def test_a_controller_is_opened_by_its_target_and_given_back(bus: Bus) -> None:
    bus.ready = True
    pipe = await open_libusb("00")
    assert pipe.name == "usb:00"
    assert [each[3] if each[0] == "control" else each[1] for each in bus.begun] == [
        interface.UsbControl.OPEN,
        interface.UsbControl.FLUSH,
        interface.IN,
    ]
    await pipe.close()
    assert bus.calls == [("claim", 0), END, "closed", "context closed"]


async def test_one_that_is_found_after_its_opening_was_cancelled_is_given_back(
    bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [type("Found", (), {"device": bus, "url": "usb:00"})()]
    asked, may = threading.Event(), threading.Event()

    def slow(usb1: Any, context: Any) -> Any:
        asked.set()
        assert may.wait(PATIENCE)
        return found

    monkeypatch.setattr(libusb, "controllers", slow)
    opening = asyncio.ensure_future(open_libusb("00"))
    await until(asked.is_set)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    may.set()
    await until(lambda: "context closed" in bus.calls)
    assert bus.calls == [("claim", 0), END, "closed", "context closed"]
