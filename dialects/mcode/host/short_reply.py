"""The commonest reply, read at once: one printed line without checksum, as the host's own questions and polls get it.

`reply_parser` reads the same bytes to the same result, and takes four times as long. A test holds the two together.
"""

from __future__ import annotations

import re
from functools import lru_cache

from multidrop.dialects.codec import Decoded, Kind, Reply, Request

ONE_LINE = re.compile(rb"(?:\r\n)?([ -~]+)\r\n")
"""The print of a drive with EM=1 or 2; EM=1 sends a CRLF before it while no program runs."""


def short_reply(request: Request, buffer: bytes) -> Decoded | None:
    """Return the reply of a drive with EM=1 or 2 and CK=0, if it is one line and can only be the requested print."""
    if request.kind is not Kind.PRINT or request.expect is None:
        return None
    found = ONE_LINE.fullmatch(buffer)
    if found is None:
        return None
    line = found[1].decode("ascii")
    if "opyright" in line or re.fullmatch(request.expect, line) is None:  # a sign-on may match, too
        return None
    return Decoded(Reply((line,)), len(buffer))


def only_strays(request: Request, buffer: bytes) -> bool:
    """Whether a drive with EM=1 or 2 and CK=0 has certainly not replied: no line looks like the requested print.

    A program may print a thousand lines meanwhile. A line with a CR inside is left to the parser.
    """
    if request.kind is not Kind.PRINT or not request.expect or buffer.count(b"\r") != buffer.count(b"\r\n"):
        return False
    return _line_of(request.expect).search(buffer) is None


@lru_cache
def _line_of(expect: str) -> re.Pattern[bytes]:
    """A whole line that matches, between others."""
    return re.compile(rb"(?:\A|\n)(?:" + expect.encode("latin-1") + rb")\r?\n")
