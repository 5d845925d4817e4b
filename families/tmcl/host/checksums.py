"""The checksum of a TMCL request: the sum of its eight bytes. (TMCL firmware manuals, "Binary command format".)"""

from __future__ import annotations

from multidrop.base.errors import Diagnostic
from multidrop.dialects.checksums import SealedFrame, sums
from multidrop.families.tmcl.host.codec import FACTORY, Tmcl
from multidrop.families.tmcl.manual import commands


def tmcl(text: str, address: str) -> SealedFrame:
    """Seal a command: address, number, type, motor or bank, a value of four bytes, and their sum."""
    module = address or FACTORY
    if not module.isdecimal() or not 1 <= int(module) <= 255:
        raise Diagnostic(f"no address {module}", "", "valid: 1 to 255")
    call = commands.parsed(text)
    if call is None:
        raise Diagnostic("not a command of TMCL", text, "as in MVP ABS, 0, 51200")
    sent = Tmcl().request(module, text, call).body
    names = ("address", "number", "type", "motor or bank", "value")
    parts = (sent[0:1], sent[1:2], sent[2:3], sent[3:4], sent[4:8])
    fields = ", ".join(f"{name} {part.hex(' ').upper()}" for name, part in zip(names, parts, strict=True))
    steps = (fields, f"{sums(sent[:8])}; modulo 256: {sent[8]:02X} hex")
    return SealedFrame(sent, sent[8:], steps)
