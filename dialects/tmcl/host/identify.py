"""Find the modules on a line. Only reading commands: nothing moves, and no error is cleared."""

from __future__ import annotations

from multidrop.dialects.codec import End, Procedure
from multidrop.dialects.errors import Inexpressible, NoAnswer
from multidrop.dialects.family import Hints
from multidrop.dialects.tmcl.host.codec import FACTORY, MOST_MOTORS, Tmcl, number_of
from multidrop.dialects.tmcl.host.exchange import END, status_of, who
from multidrop.dialects.tmcl.host.motors import motors
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.commands import Call, Command, Version
from multidrop.dialects.tmcl.manual.status import Status

TRIES = 2
"""The first request may complete an unfinished message in a module."""
IDENTITY = Call(Command.VERSION, Version.BINARY)


def identify(hints: Hints) -> Procedure[list[TmclState]]:
    """The modules at the addresses of `hints.drives`; without any, those tried, or the one at the factory's address.

    Raises NoAnswer where none replies, and Inexpressible for hints of other families.
    """
    if hints.checksum is not None or hints.em is not None or not hints.addressed:
        raise Inexpressible("checksum=, em= and address=none are for other families: a module has none of them")
    named = [name for name in hints.tried if name.isdecimal()]
    names = tuple(dict.fromkeys(hints.drives or named)) or (FACTORY,)
    for name in names:  # all, before the first is asked
        number_of(name)
    found = []
    for name in names:
        state = TmclState(Tmcl(), name)
        state.named(name)
        if any(each.name == name for each in hints.owed):
            yield from _end_download(state, "the last session left it in download mode")
        if not (yield from _found(state)):
            state.note(f"{who(state)} does not reply")
        found.append(state)
    codec = Tmcl(tuple((state.address, state.motors) for state in found if state.motors))
    for state in found:
        state.line_counted(codec)
    if not any(state.product for state in found):
        tried = ", ".join(state.address for state in found)
        raise NoAnswer(f"no module replies at {tried}; check power, baud and addresses (drives=1,2,...)")
    return found


def _found(state: TmclState) -> Procedure[bool]:
    """Ask one module for its version and count its motors; whether it replied."""
    for _ in range(TRIES):
        reply = yield state.codec.request(state.address, "136 1, 0, 0", IDENTITY)
        if status_of(reply) == Status.STORED:
            yield from _end_download(state, "found in download mode, where it stored one command more")
            reply = yield state.codec.request(state.address, "136 1, 0, 0", IDENTITY)
        damaged = reply.end is End.REFUSED and int(reply.text) == Status.WRONG_CHECKSUM
        if reply.end in (End.DONE, End.REFUSED) and not damaged:
            break
    else:
        return False
    if reply.end is End.DONE:
        number = int(reply.text) & 0xFFFFFFFF
        state.identified(f"TMCM-{number >> 16}", f"{number >> 8 & 0xFF}.{number & 0xFF:02}")
    else:
        state.identified("TMCL module", "")
    yield from _count_motors(state)
    return True


def _end_download(state: TmclState, why: str) -> Procedure[None]:
    """End the download mode of a module and say so."""
    yield state.codec.request(state.address, END, Call(Command.END_DOWNLOAD))
    state.note(f"{who(state)}: {why}; it was ended with 133: check the program in the module")


def _count_motors(state: TmclState) -> Procedure[None]:
    """Count the motors of a module, or say that it was not possible."""
    try:
        yield from motors(state)
    except NoAnswer as error:
        state.note(f"{who(state)}: its motors are not counted; a stop is for {MOST_MOTORS} ({error})")
