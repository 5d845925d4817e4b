"""The commands of a PMX, which have no checksum. (PMX-2ED-SA manual 6.2.)"""

from __future__ import annotations

import re

from multidrop.base.errors import Diagnostic
from multidrop.dialects.checksums import SealedFrame


def pmx(text: str, address: str) -> SealedFrame:
    """Return a command as it is sent: `@` and the device number, the text, CR."""
    if not text or not text.isascii() or not text.isprintable():
        raise Diagnostic("not a command", text, "printable ASCII, as in PX")
    if address and not re.fullmatch(r"\d\d", address, re.ASCII):
        raise Diagnostic(f"no device number {address}", "", "valid: 00 to 99")
    head = f"@{address}" if address else ""
    how = (
        "@ and the device number first"
        if address
        else "no device number: as to the one controller of a gateway or on USB"
    )
    return SealedFrame(f"{head}{text}\r".encode("ascii"), b"", ("the language has no checksum", how, "CR ends it"))
