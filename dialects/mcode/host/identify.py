"""The identification of the drives on a line, which moves nothing and raises no error in any drive.

Theory of operation. An immediate error runs a resident OE subroutine, and reading ER clears it. So the host sends only
what no drive refuses: a line feed, a name and a line feed (a ping), `PR VR`, and after NAK or silence the same with a
checksum. The version shows an Ethernet product, which refuses questions about party mode and checksum. The host asks
the rest accordingly. Each reply bears a mark with the drive's name: a running program may print anything, and a slow
drive may reply while another drive is asked. A drive in program mode shows an address as its prompt, or prints nothing.
The host takes it out with PG and reports that.

Our last use of the port may have sent half a line (`hints.cut`). The host makes that line overflow, as after a stop. It
stops the drives before and after, because an overflow is an error. Otherwise the first line feed to a party line
follows a tilde, which is no drive's name. So half a line in a drive's buffer is no command. One case remains: a drive
named P on a line that the user does not describe as one. It takes `PR VR` for a command `R VR`, and refuses it. (MCode
reference 5.1.33, 5.1.39, 5.1.98, 5.1.105, 5.1.141; facts of real units.)
"""

from __future__ import annotations

import re
from dataclasses import replace

from dialects.codec import Kind, Procedure, Request
from dialects.errors import Inexpressible, NoAnswer
from dialects.family import Hints
from dialects.mcode.host.codec import MCode
from dialects.mcode.host.framing import NAK
from dialects.mcode.host.leave_program import take_out
from dialects.mcode.host.program_mode import put_back_found
from dialects.mcode.host.resync import (
    BRIEF,
    PROGRAM_PROMPT,
    Place,
    activate_party,
    asked,
    look,
    settings_asked,
    take_over,
)
from dialects.mcode.host.signatures import as_printed
from dialects.mcode.host.state import MCodeState
from dialects.mcode.host.wording import who
from dialects.mcode.manual.device_name import UNNAMED
from dialects.mcode.manual.program_file import LONGEST

PLAIN = r"LM[DM][A-Z0-9]* [ -~]*|\d+\.\d+[ -~]*"
AT_HEAD = r"LM[DM][A-Z0-9]* [ -~]*|(?m:^)\d+\.\d+[ -~]*"
"""Without a check byte a number is an older product's version only at the head of a line."""
ETHERNET = re.compile(r"LMD.E")
NOBODY = "~"
"""A character that no drive has as its name."""
MDRIVE = "MDI"
THRICE = 3
NAME_AND_PART = ('"<",DN,">",PN', '<"?[!-~]"?>[ -~]*')
"""A character of its own begins the print: a print without a line end may precede it."""
PART = ('"<>",PN', "<>[ -~]*")
EXPANDED_PART = re.compile(r"<?MDI[34]")
"""The part number of an MDrivePlus with expanded I/O."""
ENCODER_PART = "-E"
"""Part of the part number of an MDrivePlus with an encoder (such as -EQ)."""
NAMED = (2, 3)
"""The escape modes in which a stop bears the drive's name (5.1.41)."""


def identify(hints: Hints) -> Procedure[list[MCodeState]]:
    """Find the drives on a line, in the order of `hints.drives`. Raises NoAnswer where no drive replies.

    Raises Inexpressible, before anything is sent, for a name longer than one character: a drive would take the second
    character for the beginning of a command.
    """
    for name in hints.drives:
        if len(name) != 1:
            raise Inexpressible(f"no drive name '{name}'; valid: one letter or digit each, as in drives=a,b")
    if not hints.cut:
        return (yield from _look_around(hints))
    yield from _overflow(hints)
    found = yield from _look_around(hints)
    for state in found:  # their stops are known now, and an error's subroutine may have started since
        yield from _stop(state.codec.stop([state.address or state.name], sure=not state.settings_unknown))
    return found


def _look_around(hints: Hints) -> Procedure[list[MCodeState]]:
    """Find the drives on a line that holds no half-sent command."""
    party = hints.party
    if party is None and (len(hints.drives) > 1 or hints.drives == ("P",)):
        party = True
    if not party:
        alone = yield from _find(Place(False, "", _checks(hints)), hints)
        if alone is not None:
            return [alone]
        if party is False:
            raise NoAnswer("no drive replies; check power, baud and wiring, or give party=1 and drives=NAMES")
    yield Request(NOBODY, "", Kind.QUIET, MCode(party=True), settle=0.1, timeout=BRIEF)
    yield from activate_party(MCode(party=True))
    found = []
    for name in hints.drives or (UNNAMED,):
        found.append((yield from _named(name, hints)))
    present = [state for state in found if state.product]
    if not present:
        names = ", ".join(hints.drives)
        tried = f"none of the drives {names}" if names else "no drive"
        advice = " or give party=0 where it is alone and not in party mode" if party and hints.party is None else ""
        raise NoAnswer(f"{tried} replies; check power, baud and names (drives=a,b,... for a party line){advice}")
    return [state if state.product else _absent(state, present[0]) for state in found]


def _overflow(hints: Hints) -> Procedure[None]:
    """Stop the drives, overflow every drive's buffer so that the half line is refused, and stop them twice more.

    A CR ends the line outside of party mode. A LF executes it in party mode, where the CR only separates.
    """
    form, names = MCode(party=True), hints.drives or (UNNAMED,)
    stop = form.stop(names, sure=False)
    spoiled = form.stop(names, sure=False, half_sent=True) + NOBODY.encode() * (LONGEST + 1) + b"\r\n" + stop
    yield from _stop(spoiled)
    yield from _stop(stop)  # a subroutine of OE may have started late


def _stop(data: bytes) -> Procedure[None]:
    yield Request(NOBODY, "stop", Kind.QUIET, MCode(party=True), settle=0.2, timeout=BRIEF, body=data)


def _named(name: str, hints: Hints) -> Procedure[MCodeState]:
    """Find one of several drives; a failure with one does not prevent finding the others."""
    try:
        found = yield from _find(Place(True, name, _checks(hints)), hints)
    except NoAnswer as error:
        silent = MCodeState(MCode(party=True), name)
        silent.note(str(error))
        return silent
    return found or MCodeState(MCode(party=True), name)


def _checks(hints: Hints) -> tuple[int, ...]:
    """The checksums to try, in this order."""
    return (0, 1) if hints.checksum is None else (int(hints.checksum > 0),)


def _absent(state: MCodeState, like: MCodeState) -> MCodeState:
    """A drive that the user named and that is silent: the host reads its settings before the first request."""
    state.codec_assumed(replace(like.codec, escape=None))
    state.settings_may_have_changed()
    state.note(f"{who(state)} does not reply")
    return state


def _find(place: Place, hints: Hints) -> Procedure[MCodeState | None]:
    """Find one drive and its settings; None where it is silent."""
    state = MCodeState(MCode(party=place.party), place.address)
    if place.party:
        place = yield from _pinged(state, place)
    found = yield from look(state, place, lambda form: ("VR", PLAIN if form.checksum else AT_HEAD))
    if found is None:
        return None
    form, version = found
    state.identified(version.split(" ")[0] if version.startswith("LM") else MDRIVE, version)
    yield from _settings(state, form, hints)
    if state.error:
        state.note(f"{who(state)}: its error flag is set (EF=1); PR ER shows and clears the error")
    if state.codec.em == 2:
        state.note(f"{who(state)}: EM=2 cannot distinguish a lost command from an executed one; EM=1 can")
    yield from _names(state)
    yield from put_back_found(state, hints.owed)
    return state


def _pinged(state: MCodeState, place: Place) -> Procedure[Place]:
    """Ping a drive: its reply shows whether it wants a checksum, and whether it is in program mode."""
    ping = yield Request(place.address, "", Kind.QUIET, state.codec, timeout=BRIEF)
    name = place.address.encode("latin-1")
    if PROGRAM_PROMPT.search(ping.raw):
        state.found_in_program_mode(place.address, replace(state.codec, checksum=int(NAK in ping.raw)))
        yield from take_out(state, "was in program mode and was taken out with PG; check the program in it")
        return place
    if ping.raw in (b"\r\n", name + b"\r\n>", name + b"\r\n?") and 0 in place.checks:
        return replace(place, checks=(0,))
    if ping.raw in (NAK, name + NAK + b">", name + NAK + b"?") and 1 in place.checks:
        return replace(place, checks=(1,))
    return place


def _settings(state: MCodeState, form: MCode, hints: Hints) -> Procedure[None]:
    """Read EM, ES, EF, and CK with a checksum, in one print. Settings that cannot be read are read again later."""
    for _ in range(THRICE):
        said, _reply = yield from asked(state, state.address, form, *settings_asked(form))
        if said:
            take_over(state, state.address, form, said)
            return
    state.codec_assumed(replace(form, em=hints.em or 0, checksum=hints.checksum or form.checksum))
    state.settings_may_have_changed()
    state.note(f"{who(state)}: its settings could not be read; they are read again before the next line")


def mdrive(part: str) -> str:
    """Return the MDrivePlus with this part number: MDI, MDIE with an encoder, MDIX with expanded I/O."""
    if EXPANDED_PART.match(part):
        return "MDIX"
    return "MDIE" if ENCODER_PART in part else MDRIVE


def _names(state: MCodeState) -> Procedure[None]:
    """Read the drive's name (which Ethernet products refuse to print) and its part number."""
    ethernet = ETHERNET.match(state.product) is not None
    state.named(state.address)
    if state.settings_unknown:
        return
    for _ in range(THRICE):
        said, _reply = yield from asked(state, state.address, state.codec, *(PART if ethernet else NAME_AND_PART))
        if said:
            name, _, part = said.removeprefix("<").partition(">")
            state.named(state.address or name.strip('"'))
            state.signature_seen(name == as_printed(name.strip('"')))
            product = mdrive(part) if state.product == MDRIVE else state.product
            state.identified(product, state.version, part)
            return
    if not state.address and state.codec.escape in NAMED:
        state.note(
            f"{who(state)}: its name could not be read, and a stop with ES={state.codec.escape} needs it; open it again"
        )
