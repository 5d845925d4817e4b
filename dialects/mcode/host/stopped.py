"""Half a line in the drives' buffers, from an interrupted use of the port: it is made to overflow between stops."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.codec import Kind, Procedure, Request
from multidrop.dialects.mcode.host.codec import NOBODY, MCode
from multidrop.dialects.mcode.host.resync import BRIEF
from multidrop.dialects.mcode.manual.program_file import LONGEST


def overflow(names: Sequence[str]) -> Procedure[None]:
    """Stop the drives, overflow every drive's buffer so that the half line is refused, and stop them twice more.

    A CR ends the line outside of party mode. A LF executes it in party mode, where the CR only separates.
    """
    form = MCode(party=True)
    stop = form.stop(names, sure=False)
    spoiled = form.stop(names, sure=False, half_sent=True) + NOBODY.encode() * (LONGEST + 1) + b"\r\n" + stop
    yield from written(spoiled)
    yield from written(stop)  # a subroutine of OE may have started late


def written(data: bytes) -> Procedure[None]:
    """Write a stop past the codec."""
    yield Request(NOBODY, "stop", Kind.QUIET, MCode(party=True), settle=0.2, timeout=BRIEF, body=data)
