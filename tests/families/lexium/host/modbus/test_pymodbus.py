"""What of pymodbus must not be relied on, each fault pinned, so that an upgrade which changes one is seen; and that the
codec around it is imported late, is silent, and does nothing but turn bytes into bytes."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pymodbus
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.exceptions import ModbusIOException
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse
from pymodbus.pdu.mei_message import ReadDeviceInformationRequest
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, WriteMultipleRegistersRequest

from multidrop.dialects import End, Kind, Request
from multidrop.families.lexium.host.modbus import framing, mapping
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.framing import NotModbus
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from tests.support.paths import ROOT
from tests.support.until import PATIENCE


def h(text: str) -> bytes:
    return bytes.fromhex(text)


def cut(data: str, unit: int = 1, number: int = 7) -> tuple[int, object]:
    """What its framer makes of bytes: how many it has used, and the PDU."""
    return FramerSocket(DecodePDU(is_server=False)).handleFrame(h(data), unit, number)


def raises(data: str) -> bool:
    with pytest.raises(ModbusIOException, match="Unable to decode request"):
        cut(data)
    return True


def read(pdu: str) -> object:
    """What its decoder makes of an answer."""
    return DecodePDU(is_server=False).decode(h(pdu))


def field(pdu: str, name: str) -> object:
    return getattr(read(pdu), name)


FAULTS: dict[str, tuple[Callable[[], object], object]] = {
    # Its framer, where frames are cut: the whole connection would be lost, and how much to skip is not said.
    "an exception without its function raises": (lambda: raises("0007 0000 0003 01 80 01"), True),
    "an exception without a code raises": (lambda: raises("0007 0000 0002 01 83"), True),
    "a function that is not registered raises": (lambda: raises("0007 0000 0003 01 41 00"), True),
    "an answer that is too short raises": (lambda: raises("0007 0000 0005 01 03 04 0001"), True),
    "another protocol waits for ever": (lambda: cut("0007 0001 0007 01 03 04 0000 0001" * 3), (0, None)),
    "a length that cannot be waits for ever": (lambda: cut("0007 0000 FFFF 01 03 04" + "00" * 600), (0, None)),
    "a short frame takes a byte of the next one": (
        lambda: FramerSocket(DecodePDU(is_server=False)).decode(h("0007 0000 0002 01 83 00"))[0],
        9,
    ),
    "another unit is swallowed": (lambda: cut("0007 0000 0007 09 03 04 0000 0001"), (13, None)),
    "another number is swallowed": (lambda: cut("0006 0000 0007 01 03 04 0000 0001"), (13, None)),
    "number 0 passes for any": (lambda: cut("0000 0000 0007 01 03 04 0000 0001")[1] is not None, True),
    # Its PDU classes, where answers are read: almost any passes for right.
    "0x80 is no error": (lambda: ExceptionResponse(0).isError(), False),
    "0x80 cannot be decoded": (lambda: read("80 01"), None),
    "bytes behind the registers are left out": (lambda: field("03 04 0000 0001 FFFF", "registers"), [0, 1]),
    "half a register is left out": (lambda: field("03 03 0001 00", "registers"), [1]),
    "no registers are an answer": (lambda: field("03 00 00", "registers"), []),
    "an answer names no count": (lambda: field("03 02 0001", "count"), 0),
    "an answer names no address": (lambda: field("03 02 0001", "address"), 0),
    "bits have no count": (lambda: len(field("01 01 05 FF FF", "bits")), 24),  # type: ignore[arg-type]
    "a coil that is neither on nor off is on": (lambda: field("05 0000 1234", "bits"), [True]),
    "bytes behind an echo are left out": (lambda: field("10 0057 0002 FF", "count"), 2),
    "an object that is cut short is taken": (
        lambda: field("2B 0E 03 83 00 00 01 00 07 53454D", "information"),
        {0: b"SEM"},
    ),
    "objects are not counted": (lambda: len(field("2B 0E 03 83 00 00 01 00 00 01 00", "information")), 2),  # type: ignore[arg-type]
    "an object that comes twice is a list": (
        lambda: field("2B 0E 03 83 00 00 02 00 01 41 00 01 42", "information"),
        {0: [b"A", b"B"]},
    ),
    # Its requests.
    "a request has unit 0 unless it is given": (lambda: ReadHoldingRegistersRequest(address=1, count=1).dev_id, 0),
    "but an identification has unit 1": (lambda: ReadDeviceInformationRequest().dev_id, 1),
    "what it encodes lacks the function": (
        lambda: ReadHoldingRegistersRequest(address=1, count=2).encode(),
        h("0001 0002"),
    ),
    "an identification of category 0 is of category 1": (
        lambda: ReadDeviceInformationRequest(read_code=0).encode(),
        h("0E 01 00"),
    ),
    "a write is encoded whatever its count": (
        lambda: WriteMultipleRegistersRequest(address=1, registers=[]).encode(),
        h("0001 0000 00"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_it_gets_wrong_is_still_what_was_found(fault: str) -> None:
    found, expected = FAULTS[fault]
    assert found() == expected, f"pymodbus {pymodbus.__version__} has changed: see docs/decisions/0008-modbus-codec.md"


DRIVE = Modbus()
READ_P = mapping.read(REGISTERS["P"])


def request(pdu: bytes) -> Request:
    return Request("", "a line", Kind.PRINT, DRIVE, tag=7, body=pdu)


WRONG = {
    "an exception without a code": (READ_P, "83"),
    "a short answer": (READ_P, "03 04 0001"),
    "bytes behind the registers": (READ_P, "03 04 0000 0001 FFFF"),
    "half a register": (READ_P, "03 03 0001 00"),
    "no registers": (READ_P, "03 00"),
    "too many bits": (pdu_codec().read(framing.READ_COILS, 0, 4), "01 01 05 FF FF"),
    "a coil that is neither on nor off": (pdu_codec().write_coil(0, True), "05 0000 1234"),
    "a byte behind an echo": (mapping.write(REGISTERS["P"], 0), "10 0057 0002 FF"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_answer_that_pymodbus_would_take_is_damaged(name: str) -> None:
    asked, answer = WRONG[name]
    data = h("0007 0000") + (len(h(answer)) + 1).to_bytes(2) + b"\x01" + h(answer)
    found = DRIVE.decode(request(asked), data)
    assert found and found.reply.end is End.DAMAGED and found.used == len(data)


def test_frames_that_its_framer_loses_are_cut_whole() -> None:
    two = h("0007 0000 0002 01 83 0007 0000 0003 01 80 01")
    first = framing.first(two)
    assert first and (first.pdu, first.end) == (b"\x83", 8)
    second = framing.first(two, first.end)
    assert second and (second.pdu, second.end) == (b"\x80\x01", 17)
    for foreign in ("0007 0001 0003 01 03 00", "0007 0000 FFFF 01 03 00", "0007 0000 0001 01 03"):
        with pytest.raises(NotModbus):
            framing.first(h(foreign))


def test_objects_are_those_that_were_announced_and_whole() -> None:
    head = "2B 0E 03 83 00 00"
    assert pdu_codec().objects(h(head + "01 00 01 41 00 01 42")) == ({0: "A"}, None)
    assert pdu_codec().objects(h(head + "02 00 01 41 00 01 42")) == ({0: "B"}, None)
    assert pdu_codec().objects(h("2B 0E 03 83 FF 02 01 00 01 41")) == ({0: "A"}, 2)
    for short in ("01 00 07 53454D", "02 00 01 41", "01 00", "01"):
        with pytest.raises(NotModbus):
            pdu_codec().objects(h(head + short))


@given(st.binary(max_size=60), st.sampled_from([READ_P, pdu_codec().identify(3, 0), pdu_codec().read_specific("IS")]))
def test_an_answer_that_fits_is_read_or_refused(data: bytes, asked: bytes) -> None:
    answer = asked[:1] + data
    if not framing.fits(asked, answer):
        return
    try:
        if asked == READ_P:
            assert pdu_codec().registers(answer) == tuple(int.from_bytes(answer[at : at + 2]) for at in (2, 4))
        elif asked[0] == framing.READ_SPECIFIC:
            assert pdu_codec().specific(answer) == answer[2:].decode("latin-1").strip("\0 ")
        else:
            pdu_codec().objects(answer)
    except NotModbus:
        assert asked[0] == framing.IDENTIFY


@given(st.integers(0, 0xFFFF), st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=2))
def test_requests_are_the_bytes_of_the_standard(address: int, values: list[int]) -> None:
    count = len(values)
    expected = b"".join(value.to_bytes(2) for value in (address, count))
    assert pdu_codec().read(3, address, count) == b"\x03" + expected
    data = b"".join(value.to_bytes(2) for value in values)
    assert pdu_codec().write_registers(address, values) == b"\x10" + expected + bytes((2 * count,)) + data
    assert pdu_codec().message(address, b"\x2b", 9) == address.to_bytes(2) + h("0000 0002 09 2B")


# Imported late, silent, and without an event loop.


def python(code: str, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=ROOT,
        env={**os.environ, **more},
    )


@pytest.mark.process
@pytest.mark.parametrize(
    "work",
    [
        "import dialects.families",
        "import families.lexium.host.modbus.codec, families.lexium.host.modbus.operations",
        "import multidrop.cli, shell.session",
        "from multidrop.__main__ import main; assert main(['send', 'sim:#press', 'PR P']) == 0",
    ],
)
def test_pymodbus_is_not_imported_before_a_modbus_bus_is_opened(work: str, tmp_path: Path) -> None:
    done = python(f"{work}\nimport sys\nprint('pymodbus' in sys.modules)", XDG_STATE_HOME=str(tmp_path))
    assert done.stdout.splitlines()[-1:] == ["False"], done.stderr


@pytest.mark.process
def test_it_is_silent_even_where_the_root_logs_everything() -> None:
    done = python(
        "import logging\n"
        "logging.basicConfig(level=logging.DEBUG)\n"
        "from multidrop.families.lexium.host.modbus.codec import pdu_codec\n"
        "made = pdu_codec()\n"
        "print(made._decoder.decode(bytes.fromhex('8001')), made._decoder.decode(b'\\x03\\x09\\x00'))\n"
        "made._framer.handleFrame(bytes.fromhex('00070001000301830201'), 1, 7)\n"
    )
    assert (done.stdout, done.stderr) == ("None None\n", "")
    logger = logging.getLogger("pymodbus")
    assert not logger.propagate and any(isinstance(each, logging.NullHandler) for each in logger.handlers)


def test_the_codec_touches_no_loop_no_socket_and_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    pdu_codec()

    def never(*arguments: object, **named: object) -> None:
        raise AssertionError("the codec has reached out")

    for owner, name in (
        (asyncio, "get_running_loop"), (asyncio, "get_event_loop"), (asyncio, "new_event_loop"),
        (asyncio, "create_task"), (socket, "socket"), (threading.Thread, "start"),
    ):  # fmt: skip
        monkeypatch.setattr(owner, name, never)
    state = ModbusState(Modbus())
    data = state.codec.encode(request(READ_P))
    assert data == h("0007 0000 0006 01 03 0057 0002")
    found = state.codec.decode(request(READ_P), h("0007 0000 0007 01 03 04 0005 0000"))
    assert found and pdu_codec().registers(found.reply.body) == (5, 0)
    assert DRIVE.stop([""]) == h("FFFE 0000 0006 01 41 2020 2045 FFFF 0000 000B 01 10 0078 0002 04 0000 0000")
