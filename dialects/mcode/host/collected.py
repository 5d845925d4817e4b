"""The end of a collected reply (`Kind.QUIET`), where its bytes show one although the drive's echo mode is not known.

The reply to a ping shows it, and a signed print after which nothing can follow.
"""

from __future__ import annotations

import re

from multidrop.dialects.codec import Request
from multidrop.dialects.mcode.host.checksum import unsealed

PROMPTS = (">", "?")
ACK = "\x06"


def is_pong(request: Request, buffer: bytes) -> bool:
    """Whether this is the whole reply to a ping, from a drive that wants a checksum or none."""
    if request.body or request.text or not request.address:
        return False
    return any(buffer in pongs(request.address, each) for each in (False, True))


def pongs(address: str, checksum: bool) -> tuple[bytes, ...]:
    """The whole replies to a ping in EM=1 and EM=0."""
    name, sign = address.encode("latin-1"), b"\x15" if checksum else b"\r\n"
    return sign, name + sign + b">", name + sign + b"?"


def ends_by_itself(request: Request, buffer: bytes, checksum: bool) -> bool:
    """Whether nothing more can follow a signed print. `checksum`: the request bears one.

    EM=0 repeats the request and ends in a prompt; EM=3 only repeats it, so this cannot distinguish the two.
    """
    if not (request.signed and request.expect) or buffer[-1:] not in (b"\n", b">", b"?"):
        return False
    text = buffer.decode("latin-1")
    found = list(re.finditer(rf"(?:{request.expect})(.?)\r?\n", text))
    if not found:
        return False
    before, after = text[: found[-1].start()], text[found[-1].end() :]
    if checksum and not (ACK in before and unsealed(found[-1][0].rstrip("\r\n").encode("latin-1")) is not None):
        return False  # an ACK may follow the print
    return after in PROMPTS if "PR " in before else not after
