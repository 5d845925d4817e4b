"""What frees an MCode drive that does not reply, whatever it is set to; nothing here knows the drive.

Theory of operation. A drive is silent because a program floods the line or waits for a key (single step), because its
buffer holds half a line, or because it is in program mode with EM=2. The stop in every form ends programs. A full
buffer of tildes makes half a line overflow. PG ends program mode; outside of it PG is an error, so a stop follows.
Outside of party mode the line is `PG` and a CR, and a line feed after each letter keeps drives named P and G from harm
(see `scan`). In party mode `*` reaches every name. Each goes out without a checksum and with one.

FD erases. It is the last resort, in the order that works on real units: outside of party mode, with a checksum, then to
every name. (MCode reference 5.1.21, 5.1.41, 5.1.45, 5.1.98, 5.1.105; facts of real units.)
"""

from __future__ import annotations

from multidrop.dialects.codec import Kind, Procedure, Request
from multidrop.dialects.mcode.host.checksum import sealed
from multidrop.dialects.mcode.host.codec import NOBODY, MCode
from multidrop.dialects.mcode.host.resync import BRIEF
from multidrop.dialects.mcode.host.stopped import overflow, written
from multidrop.dialects.mcode.manual.statements import NAMES

CLEARS = (
    "stops every drive and its program, makes half a line in a drive overflow (error 20) and sends PG, an error "
    "outside of program mode; an OE subroutine that an error starts is stopped. It erases nothing"
)
APART = 0.02
"""Quiet time after each part, s: a drive may reply to it."""
RESTARTING = 1.0
"""The time that a drive takes for FD, s."""
PG, EVERYONE = b"PG", b"*PG"
RESETS = (b"\rFD\r", sealed(b"FD") + b"\r", sealed(b"CK=0") + b"\r", b"\n*FD\n", b"\n" + sealed(b"*FD") + b"\n")


def clear() -> Procedure[None]:
    """Stop all programs, overflow half lines, leave program mode, and stop what errors started."""
    yield from overflow(NAMES)
    for line in (PG, sealed(PG)):
        for part in (line[:1] + b"\n", line[1:2] + b"\n", line[2:] + b"\r"):
            yield from _sent(part, APART)
    for line in (EVERYONE, sealed(EVERYONE)):
        yield from _sent(line + b"\n", APART)
    yield from written(MCode(party=True).stop(NAMES, sure=False))


def erase() -> Procedure[None]:
    """Set every drive on the line to factory defaults: program, variables and parameters are lost."""
    for line in RESETS:
        yield from _sent(line, RESTARTING)


def _sent(line: bytes, quiet: float) -> Procedure[None]:
    yield Request(NOBODY, "rescue", Kind.QUIET, MCode(party=True), settle=quiet, timeout=max(quiet, BRIEF), body=line)
