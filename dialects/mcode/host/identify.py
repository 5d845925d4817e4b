"""Finding out how the drives on a line are set, without moving anything or raising an error in any of them.

Theory of operation. An immediate error runs a resident OE subroutine, and reading ER clears it, so only what no drive
refuses is sent: a line feed, a name and a line feed (a ping), `PR VR`, and after NAK or silence the same with a
checksum. From the version on (it tells Ethernet products, which refuse questions about party mode and checksum) the
rest is asked. Each answer bears a mark with the drive's name, as a running program may print whatever it likes, and a
slow drive's answer may come while another one is asked. A drive that was left in program mode shows an address as its
prompt, or prints nothing; it is taken out with PG, which is said.

A line that our own last use of the port may have sent by half (`hints.cut`) is made to overflow first, as after a stop;
the drives are stopped before and after that, as an overflow is an error. Otherwise
the first line feed to a party line stands behind a tilde, which is nobody's name: half a line that somebody left in a
drive's buffer is then no command. What cannot be helped is a drive by the name of P on a line of which nobody says
that it is one: it takes `PR VR` for a command `R VR`, and refuses it.
(MCode reference 5.1.33, 5.1.39, 5.1.98, 5.1.105, 5.1.141; facts of real units.)
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
"""Without a check byte a number is the version of an older product only where a line begins with it."""
ETHERNET = re.compile(r"LMD.E")
NOBODY = "~"
"""No drive's name."""
MDRIVE = "MDI"
THRICE = 3
NAME_AND_PART = ('"<",DN,">",PN', '<"?[!-~]"?>[ -~]*')
"""Begun by a character of its own: a print without a line end may stand in front."""
PART = ('"<>",PN', "<>[ -~]*")
EXPANDED_PART = re.compile(r"<?MDI[34]")
"""The part number of an MDrivePlus with expanded I/O."""
ENCODER_PART = "-E"
"""Stands in that of one with an encoder (such as -EQ)."""
NAMED = (2, 3)
"""The escape modes in which a stop bears the drive's name (5.1.41)."""


def identify(hints: Hints) -> Procedure[list[MCodeState]]:
    """The drives on a line, in the order of `hints.drives`. Raises NoAnswer where nobody answers.

    Raises Inexpressible, before anything is sent, for a name that no drive can have: another one would take its second
    character for the beginning of a command.
    """
    for name in hints.drives:
        if len(name) != 1:
            raise Inexpressible(f"'{name}' is no drive's name: they are single letters and digits, as in drives=a,b")
    if not hints.cut:
        return (yield from _look_around(hints))
    yield from _overflow(hints)
    found = yield from _look_around(hints)
    for state in found:  # now that it is known how each is stopped, and had an error's subroutine begun since
        yield from _stop(state.codec.stop([state.address or state.name], sure=not state.settings_unknown))
    return found


def _look_around(hints: Hints) -> Procedure[list[MCodeState]]:
    """The drives on a line that is not in the middle of a command."""
    party = hints.party
    if party is None and (len(hints.drives) > 1 or hints.drives == ("P",)):
        party = True
    if not party:
        alone = yield from _find(Place(False, "", _checks(hints)), hints)
        if alone is not None:
            return [alone]
        if party is False:
            raise NoAnswer("no drive answers; check power, baud and wiring, or give party=1 and drives=NAMES")
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
        raise NoAnswer(f"{tried} answers; check power, baud and names (drives=a,b,... for a party line){advice}")
    return [state if state.product else _absent(state, present[0]) for state in found]


def _overflow(hints: Hints) -> Procedure[None]:
    """Stop, fill every drive's buffer until the half line in it is refused, stop; then stop again.

    A CR ends the line outside of party mode, a LF executes in it, where the CR only separates.
    """
    form, names = MCode(party=True), hints.drives or (UNNAMED,)
    stop = form.stop(names, sure=False)
    spoiled = form.stop(names, sure=False, half_sent=True) + NOBODY.encode() * (LONGEST + 1) + b"\r\n" + stop
    yield from _stop(spoiled)
    yield from _stop(stop)  # should a subroutine of OE have begun late


def _stop(data: bytes) -> Procedure[None]:
    yield Request(NOBODY, "stop", Kind.QUIET, MCode(party=True), settle=0.2, timeout=BRIEF, body=data)


def _named(name: str, hints: Hints) -> Procedure[MCodeState]:
    """One of several drives: what is wrong with it does not keep the others from being found."""
    try:
        found = yield from _find(Place(True, name, _checks(hints)), hints)
    except NoAnswer as error:
        silent = MCodeState(MCode(party=True), name)
        silent.note(str(error))
        return silent
    return found or MCodeState(MCode(party=True), name)


def _checks(hints: Hints) -> tuple[int, ...]:
    """With which checksums a drive is asked, in this order."""
    return (0, 1) if hints.checksum is None else (int(hints.checksum > 0),)


def _absent(state: MCodeState, like: MCodeState) -> MCodeState:
    """A drive that should be there and is silent: how it is set is found out when it is spoken to."""
    state.codec_assumed(replace(like.codec, escape=None))
    state.settings_may_have_changed()
    state.note(f"{who(state)} does not answer")
    return state


def _find(place: Place, hints: Hints) -> Procedure[MCodeState | None]:
    """One drive and how it is set; None where it is silent."""
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
        state.note(f"{who(state)}: its error flag is set (EF=1); PR ER tells the error and clears it")
    if state.codec.em == 2:
        state.note(f"{who(state)}: EM=2 does not tell a lost command from an executed one; EM=1 does")
    yield from _names(state)
    yield from put_back_found(state, hints.owed)
    return state


def _pinged(state: MCodeState, place: Place) -> Procedure[Place]:
    """A name and a line feed: what comes back says whether a checksum is wanted, and whether a program is stored."""
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
    """EM, ES, EF, and CK where a checksum is used, in one print. What cannot be read is looked for again later."""
    for _ in range(THRICE):
        said, _reply = yield from asked(state, state.address, form, *settings_asked(form))
        if said:
            take_over(state, state.address, form, said)
            return
    state.codec_assumed(replace(form, em=hints.em or 0, checksum=hints.checksum or form.checksum))
    state.settings_may_have_changed()
    state.note(f"{who(state)}: how it is set could not be read; it is looked at again before anything is sent")


def mdrive(part: str) -> str:
    """The MDrivePlus with this part number: MDI, MDIE with an encoder, MDIX with expanded I/O."""
    if EXPANDED_PART.match(part):
        return "MDIX"
    return "MDIE" if ENCODER_PART in part else MDRIVE


def _names(state: MCodeState) -> Procedure[None]:
    """The name that it bears (Ethernet products refuse to tell it) and its part number."""
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
            f"{who(state)}: its name could not be read, which a stop bears with ES={state.codec.escape}; open it again"
        )
