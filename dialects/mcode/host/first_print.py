"""A person's print that is the first line to a drive: its own exchange confirms the drive.

Theory of operation. The user's hints, or last time, say where the drive replies. A ping shows that it still does, and
whether it wants a checksum. The print is read in a form that every echo mode shows. Its sync mark bears the drive's
name and a number that differs from last time's, so no other drive's and no earlier reply matches.

No remembered setting replaces a reading of ES: until then a stop takes every form. (Decision 0027.)
"""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import Kind, Procedure, Request
from multidrop.dialects.errors import Inexpressible, NoAnswer
from multidrop.dialects.mcode.host import printed
from multidrop.dialects.mcode.host.attend import confirm_drive
from multidrop.dialects.mcode.host.codec import MCode
from multidrop.dialects.mcode.host.exchange import refused
from multidrop.dialects.mcode.host.framing import NAK
from multidrop.dialects.mcode.host.identity import pinged
from multidrop.dialects.mcode.host.resync import asked
from multidrop.dialects.mcode.host.state import MCodeState, Place
from multidrop.dialects.mcode.host.wording import unknown

LONGEST_MARK = '"~a0000"'


def first_print(state: MCodeState, request: Request) -> Procedure[tuple[str, ...] | None]:
    """Send a print to a drive that is not confirmed yet; return its lines.

    None: the print was not executed, and takes the usual path. Raises Refused or NoAnswer.
    """
    expected, pattern = state.unconfirmed, printed.reading(request.text)
    if expected is None or request.kind is not Kind.PRINT or pattern is None or not _fits(state, request):
        return None
    if not expected.replied:
        place = yield from _present(state, expected.place)
        if place is None:
            return None
        expected = replace(expected, place=place, replied=True)
    place = expected.place
    form = _form(state, place, place.checks[0])
    said, _reply = yield from asked(state, place.address, form, request.text[2:].strip(), pattern)
    if said:
        state.expected(expected)
        return (said,)
    yield from confirm_drive(state, request.text, "was sent once, and it is not known whether it was executed")
    if not _may_have_taken(state.codec, form):
        return None
    if state.error:
        yield from refused(state, request)
    raise NoAnswer(unknown(state, request))


def _present(state: MCodeState, place: Place) -> Procedure[Place | None]:
    """Make sure that the drive replies; return the place with its checksum, None where that is not certain.

    This comes before the person's line, so that half a line in the drive's buffer does not spoil that one.
    """
    if place.party:
        place, replied = yield from pinged(state, place)
        return place if replied and len(place.checks) == 1 else None
    for checksum in place.checks:
        said, reply = yield from asked(state, "", _form(state, place, checksum), '"-"', "-")
        if said:
            return replace(place, checks=(checksum,))
        if not (NAK in reply.raw and state.codec.checksum):  # a NAK that was not expected needs more proof
            return None
    return None


def _form(state: MCodeState, place: Place, checksum: int) -> MCode:
    """The form of a print that every echo mode shows."""
    return replace(state.codec, em=2, party=place.party, checksum=checksum, escape=None)


def _fits(state: MCodeState, request: Request) -> bool:
    """Whether the line has room for a mark and a check byte."""
    try:
        replace(state.codec, checksum=1).request(state.address, f"{request.text},{LONGEST_MARK}")
    except Inexpressible:
        return False
    return True


def _may_have_taken(codec: MCode, form: MCode) -> bool:
    """Whether a drive with these settings may have executed a line in this form."""
    return codec.party == form.party and (codec.checksum > 0) == (form.checksum > 0)
