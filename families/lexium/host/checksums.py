"""The checksums of MCode (CK=1, CK=2) and of Modbus frames.

(MCode reference 5.1.21, 7.1.2; MODBUS over serial line V1.02, 2.5.)
"""

from __future__ import annotations

import re

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted
from multidrop.dialects.checksums import SealedFrame, sums
from multidrop.families.lexium.host.mcode import framing

_HEX = re.compile(r"(?:[0-9A-Fa-f]{2}[\s,:]*)+")
LONGEST_FRAME = 254
"""Most bytes of a frame on a serial line without its checksum: the unit and a PDU of 253."""


def mcode(text: str, address: str) -> SealedFrame:
    """Seal a command: the name of a drive in party mode, the text, the check byte, CR or in party mode LF."""
    if not text.isascii() or not text.isprintable() or not text:
        raise Diagnostic("not a command", text, "printable ASCII, as in MR 51200")
    if not address.isascii() or not (address.isprintable() and len(address) <= 1):
        raise Diagnostic(f"no name {address}", "", "one printable ASCII character, as in a")
    body = f"{address}{text}".encode("ascii")
    check = framing.checksum(body)
    end, name = (b"\n", "LF") if address else (b"\r", "CR")
    total = sum(body)
    steps = (
        f"{sums(body)}; it covers {'name and command' if address else 'the command'}, not the {name}",
        f"modulo 128 (80 hex): {total % 128:X} hex; subtracted from 80 hex: {-total % 128:X} hex",
        f"bit 7 set: {check:02X} hex. It is one raw byte before the {name} (CK=1 and CK=2)",
    )
    return SealedFrame(framing.sealed(body) + end, bytes([check]), steps)


def rtu(text: str, address: str) -> SealedFrame:
    """Seal a Modbus RTU frame: unit, PDU, CRC-16, low byte first."""
    from multidrop.families.lexium.host.modbus.pdu import crc as crc_of

    body = _frame(text, address)
    crc = crc_of(body)
    steps = (
        f"CRC-16 of {counted(len(body), 'byte')}: begin with FFFF hex; for each byte: exclusive or with the low byte,",
        "then 8 times: shift right by one bit, and if a 1 fell out, exclusive or with A001 hex",
        f"the result {crc[1]:02X}{crc[0]:02X} hex is sent with its low byte first: {crc.hex(' ').upper()}",
    )
    return SealedFrame(body + crc, crc, steps)


def ascii_frame(text: str, address: str) -> SealedFrame:
    """Seal a Modbus ASCII frame: a colon, the bytes in hex, LRC, CR LF."""
    body = _frame(text, address)
    lrc = -sum(body) & 0xFF
    check = f"{lrc:02X}".encode()
    steps = (
        sums(body),
        f"modulo 256: {sum(body) % 256:02X} hex; subtracted from 100 hex: {lrc:02X} hex (LRC)",
        "it is sent as two hex digits, as every byte of the frame is; the sum is of the bytes, not of the digits",
    )
    return SealedFrame(b":" + body.hex().upper().encode() + check + b"\r\n", check, steps)


def _frame(text: str, address: str) -> bytes:
    """The bytes of a frame: unit and PDU in hex; with an address, only the PDU is typed. Raises Diagnostic."""
    if not _HEX.fullmatch(text.strip()):
        raise Diagnostic("not bytes in hex", text, "two digits each, as in 01 03 00 57 00 02")
    data = bytes.fromhex(re.sub(r"[\s,:]", "", text))
    if address:
        if not address.isdecimal() or not int(address) <= 255:
            raise Diagnostic(f"no unit {address}", "", "valid: 0 to 255")
        data = bytes([int(address)]) + data
    if not 2 <= len(data) <= LONGEST_FRAME:
        raise Diagnostic(f"a frame of {len(data)} bytes", text, f"valid: 2 to {LONGEST_FRAME}: the unit, then the PDU")
    return data
