"""The content of a message: requests and replies as PDU classes of pymodbus. Pure functions of bytes.

Theory of operation. pymodbus packs and unpacks PDUs, and its framer adds the header. Nothing else of it is used: its
framer loses frames that it cuts (`framing.first` cuts them), and its classes accept almost any reply (`framing.fits`
decides). So this module reads only replies that fit. Functions 65 and 66 belong to this drive and have classes here.
Importing this module imports pymodbus, asyncio and logging, which is slow; `codec.pdu_codec` does that for the first
message. pymodbus logs what it cannot decode, and would print to the screen: its logger is silenced for this process.
(Modbus/TCP manual 4.1 to 4.3; docs/decisions/0008-modbus-codec.md.)
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.mei_message import ReadDeviceInformationRequest, ReadDeviceInformationResponse
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, WriteMultipleRegistersRequest

from multidrop.families.lexium.host.modbus.framing import (
    READ_COILS,
    READ_INPUTS,
    READ_REGISTERS,
    READ_SPECIFIC,
    WRITE_SPECIFIC,
    NotModbus,
)

_READ: dict[int, type[ModbusPDU]] = {
    READ_COILS: ReadCoilsRequest,
    READ_INPUTS: ReadDiscreteInputsRequest,
    READ_REGISTERS: ReadHoldingRegistersRequest,
}
_OBJECTS = 7
"""Position of the objects in an identification; the byte before holds their number."""


class ReadSpecific(ModbusPDU):
    """Function 65: encodes the request, decodes the reply (4.3.2)."""

    function_code = READ_SPECIFIC

    def __init__(self, mnemonic: str = "") -> None:
        super().__init__()
        self.mnemonic, self.text = mnemonic, b""

    def encode(self) -> bytes:
        return backwards(self.mnemonic)

    def decode(self, data: bytes) -> None:
        self.text = data[1:]


class WriteSpecific(ModbusPDU):
    """Function 66: encodes the request, decodes the reply (4.3.3)."""

    function_code = WRITE_SPECIFIC

    def __init__(self, mnemonic: str = "", text: str = "") -> None:
        super().__init__()
        self.mnemonic, self.text = mnemonic, text

    def encode(self) -> bytes:
        text = self.text.encode("ascii")
        return backwards(self.mnemonic) + bytes((len(text),)) + text

    def decode(self, data: bytes) -> None:
        self.mnemonic = data[1:].decode("latin-1").lstrip(" ")[::-1]


def backwards(mnemonic: str) -> bytes:
    return mnemonic[::-1].rjust(4).encode("ascii")


class PduCodec:
    """The codec of PDUs: requests, messages around them, and the content of replies that fit."""

    def __init__(self) -> None:
        # Keep pymodbus' log off the screen and out of our logs.
        logger = logging.getLogger("pymodbus")
        logger.addHandler(logging.NullHandler())
        logger.propagate = False
        self._decoder = DecodePDU(is_server=False)
        self._decoder.register(ReadSpecific)
        self._decoder.register(WriteSpecific)
        self._framer = FramerSocket(self._decoder)

    def message(self, transaction: int, pdu: bytes, unit: int) -> bytes:
        return self._framer.encode(pdu, unit, transaction)

    # Requests.

    def read(self, function: int, address: int, count: int) -> bytes:
        return _bytes(_READ[function](address=address, count=count))

    def write_coil(self, address: int, on: bool) -> bytes:
        return _bytes(WriteSingleCoilRequest(address=address, bits=[on]))

    def write_registers(self, address: int, words: Sequence[int]) -> bytes:
        """Write registers, each word 0 to 65535."""
        return _bytes(WriteMultipleRegistersRequest(address=address, registers=words))

    def identify(self, code: int, thing: int) -> bytes:
        """Read the device identification: codes 1 to 3 a category from an object on, 4 one object."""
        return _bytes(ReadDeviceInformationRequest(read_code=code, object_id=thing))

    def read_specific(self, mnemonic: str) -> bytes:
        """Read a word that has no register, by its mnemonic (4.3.2)."""
        return _bytes(ReadSpecific(mnemonic))

    def write_specific(self, mnemonic: str, text: str) -> bytes:
        """Write or execute a word that has no register, by its mnemonic (4.3.3)."""
        return _bytes(WriteSpecific(mnemonic, text))

    # Replies that fit.

    def registers(self, answer: bytes) -> tuple[int, ...]:
        return tuple(self._decoded(answer).registers)

    def bits(self, answer: bytes, count: int) -> tuple[int, ...]:
        """The bits of a READ_COILS or READ_INPUTS reply, in the order of the request."""
        return tuple(int(bit) for bit in self._decoded(answer).bits[:count])

    def specific(self, answer: bytes) -> str:
        pdu = self._decoded(answer)
        assert isinstance(pdu, ReadSpecific)
        return pdu.text.decode("latin-1").strip("\0 ")

    def objects(self, answer: bytes) -> tuple[dict[int, str], int | None]:
        """The objects of an identification, and the first object of the rest if more follow. Raises NotModbus."""
        # Find the end of the last announced object: pymodbus also reads truncated and surplus objects.
        at = _OBJECTS
        for _ in range(answer[at - 1]):
            if len(answer) < at + 2 or len(answer) < at + 2 + answer[at + 1]:
                raise NotModbus
            at += 2 + answer[at + 1]
        pdu = self._decoded(answer[:at])
        assert isinstance(pdu, ReadDeviceInformationResponse)
        objects = {}
        for number, value in pdu.information.items():
            last = value[-1] if isinstance(value, list) else value  # an object that comes twice
            objects[number] = last.decode("latin-1").strip("\0 ")
        return objects, pdu.next_object_id if pdu.more_follows else None

    def _decoded(self, answer: bytes) -> ModbusPDU:
        pdu = self._decoder.decode(answer)
        if pdu is None:
            raise NotModbus
        return pdu


def _bytes(pdu: ModbusPDU) -> bytes:
    return bytes((pdu.function_code,)) + pdu.encode()


def crc(frame: bytes) -> bytes:
    """Return the CRC-16 of an RTU frame, as it is sent: low byte first."""
    return FramerRTU.compute_CRC(frame).to_bytes(2)
