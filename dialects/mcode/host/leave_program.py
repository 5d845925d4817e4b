"""Leaving program mode, whatever the state of the drive and of the wire (MCode reference 5.1.98)."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import End, Kind, Procedure
from multidrop.dialects.errors import NoAnswer
from multidrop.dialects.mcode.host.exchange import REPEATS, ends_in_program_mode, print_mark, read_error
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import described, who
from multidrop.dialects.mcode.manual.errors import ErrorNumber

NOT_PROGRAMMING = ErrorNumber.NOT_IN_PROGRAM_MODE
"""The error of PG alone outside of program mode (section 10)."""


def leave_program(state: MCodeState) -> Procedure[int]:
    """Send PG until a prompt, an error or a printed mark shows the end of program mode; one PG too many does no harm.

    Returns the error that this found and cleared, 0 for none.
    """
    for _ in range(2 * REPEATS):
        request = replace(state.codec.request(state.address, "PG"), kind=Kind.PROGRAM)
        reply = yield request
        code: int | None = 0
        if ends_in_program_mode(reply):
            continue
        if reply.end in (End.DONE, End.SILENT):
            state.left_program_mode()
        elif reply.end in (End.REFUSED, End.NAK):
            code = yield from read_error(state)  # None: stored, so still in program mode; 0: damaged frame
            if code:
                state.left_program_mode()
        else:
            if (yield from print_mark(state, request.priority)) is not None:
                state.left_program_mode()
        if not state.programming:
            return code if code and code != NOT_PROGRAMMING else 0
    raise NoAnswer(f"{who(state)} could not be taken out of program mode: type PG, then open it again")


def take_out(state: MCodeState, remark: str) -> Procedure[None]:
    """Leave program mode and report it, with the error that was set."""
    code = yield from leave_program(state)
    error = f"; {described(code, state)}, now cleared" if code else ""
    state.note(f"{who(state)}: {remark}{error}")
