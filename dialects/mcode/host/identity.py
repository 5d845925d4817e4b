"""A drive at a place, and what it is: a ping, then one print of identity and settings.

Theory of operation. An Ethernet product refuses questions about name, party mode and checksum. A drive that replies to
a name or to a checksum is none, so one print asks it everything. Any other drive first prints its version, part number
and settings, which no product refuses, and then what its product has. It prints the settings twice: a print that
runs into another drive's may still look valid, and a stop depends on ES. A sync mark ends the print.

A ping (the name and a line feed) shows whether the drive wants a checksum, and whether it is in program mode. (MCode
reference 5.1.33, 5.1.39, 5.1.98, 5.1.105, 5.1.119, 5.1.141; facts of real units.)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.codec import Kind, Procedure, Request
from multidrop.dialects.mcode.host.codec import NOBODY, MCode
from multidrop.dialects.mcode.host.exchange import as_printed, take_out
from multidrop.dialects.mcode.host.framing import NAK
from multidrop.dialects.mcode.host.quiet_end import PONG, pongs
from multidrop.dialects.mcode.host.resync import BRIEF, PROGRAM_PROMPT, asked, look, take_over
from multidrop.dialects.mcode.host.state import MCodeState, Place, who
from multidrop.dialects.mcode.manual.program_file import LONGEST

# Half a line in the drives' buffers, from an interrupted use of the port: it is made to overflow between stops.


def overflow(names: Sequence[str]) -> Procedure[None]:
    """Stop the drives, overflow every drive's buffer so that the half line is refused, and stop them twice more.

    A CR ends the line outside of party mode. A LF executes it in party mode, where the CR only separates.
    """
    form = MCode(party=True)
    stop = form.stop(names, sure=False)
    spoiled = form.stop(names, sure=False, half_sent=True) + NOBODY.encode() * (LONGEST + 1) + b"\r\n" + stop
    yield from write_stop(spoiled)
    yield from write_stop(stop)  # a subroutine of OE may have started late


def write_stop(data: bytes) -> Procedure[None]:
    yield Request(NOBODY, "stop", Kind.QUIET, MCode(party=True), settle=0.2, timeout=BRIEF, body=data)


LEXIUM = r"LM[DM][A-Z0-9]* [ !#-=?-~]*"
OLDER = r"\d+\.\d+[ !#-=?-~]*"
AT_HEAD = rf"(?m:^){OLDER}"
"""Without a check byte a number is an older product's version only at the head of a line."""
NAME, PART, SERIAL = r'(?P<name>"?[!-~]"?)', r'(?P<part>[^">\r\n]*)', r'(?P<serial>[^">\r\n]*)'
"""Part and serial number are for a person and for comparison: odd characters in them hide no drive."""
SETTINGS, TWICE = r"(?P<settings>(?P<em>[0-3])[0-3][01])", r"(?P=settings)"
ETHERNET = re.compile(r"LMD.E")
MDRIVE = "MDI"
THRICE = 3
EXPANDED_PART = re.compile(r"<?MDI[34]")
"""The part number of an MDrivePlus with expanded I/O."""
ENCODER_PART = "-E"
"""Part of the part number of an MDrivePlus with an encoder (such as -EQ)."""
TEXT = b'PR "~'
"""The first characters of a print: a drive refuses them after half a line, and executes nothing by themselves."""
SETTLE = 0.03
"""Quiet time after the first line feeds, s: half a line in a drive's buffer is refused meanwhile."""
NAMED = (2, 3)
"""The escape modes in which a stop bears the drive's name (5.1.41)."""


def find(state: MCodeState, place: Place) -> Procedure[bool]:
    """Find a drive at a place, and read what it is and how it is set; False where it is silent."""
    if place.party:
        sure = yield from _answering(state, place)
        if sure is None:
            return False
        place = sure
    found = yield from look(state, place, identity_asked)
    if found is None:
        return False
    form, said = found
    matched = re.fullmatch(identity_asked(form)[1], said)
    assert matched is not None
    values = matched.groupdict()
    version = values["version"]
    state.identified(version.split(" ")[0] if version.startswith("LM") else MDRIVE, version, values["part"])
    take_over(state, place.address, form, values["settings"], values.get("checksum"))
    if "name" in values:
        _record(state, values["name"], values["serial"])
    else:
        yield from _name_and_serial(state)
    if state.product == MDRIVE:
        state.identified(mdrive(state.part), version)
    if state.error:
        state.note(f"{who(state)}: its error flag is set (EF=1); PR ER shows and clears the error")
    if state.codec.em == 2:
        state.note(f"{who(state)}: EM=2 cannot distinguish a lost command from an executed one; EM=1 can")
    return True


def find_in_text(state: MCodeState, place: Place) -> Procedure[bool]:
    """Find a drive on a line whose drives may be in party mode or not, after `TEXT` and a line feed.

    A drive that is not in party mode collects these lines in its buffer. For it they are a text that is being printed,
    and the last line completes it. So the first questions have no quotation mark.
    """
    _, replied = yield from pinged(state, place)
    if (replied or (yield from _whispers(place))) and (yield from find(state, place)):
        return True
    yield from end_text()
    return False


def end_text() -> Procedure[None]:
    """Complete the text in a drive that is not in party mode."""
    yield Request(NOBODY, 'end of the text "', Kind.QUIET, MCode(), settle=SETTLE, timeout=BRIEF, body=b'"\r')


def _whispers(place: Place) -> Procedure[bool]:
    """Whether a drive prints its name that does not reply to a ping (EM=2)."""
    name = re.escape(as_printed(place.address))
    for checksum in place.checks:
        form = MCode(em=2, party=True, checksum=checksum)
        expect = f"{name}[0-3]{name}"
        reply = yield Request(place.address, "PR DN,EM,DN", Kind.QUIET, form, settle=PONG, timeout=BRIEF, expect=expect)
        if re.search(expect.encode("latin-1"), reply.raw):
            return True
    return False


def _answering(state: MCodeState, place: Place) -> Procedure[Place | None]:
    """Make sure that a drive replies to its name, before it is asked much; None where it is silent.

    A drive that is not in party mode keeps every line in its buffer, and a full buffer is an error.
    """
    place, replied = yield from pinged(state, place)
    if replied:
        return place
    found = yield from look(state, place, lambda form: ("ES", "[0-3]"))
    return None if found is None else replace(place, checks=(found[0].checksum,))


def identity_asked(form: MCode) -> tuple[str, str]:
    """Return the items to print for identity and settings, and their form."""
    version = rf"(?P<version>{LEXIUM}|{OLDER if form.checksum else AT_HEAD})"
    if not (form.party or form.checksum):
        return 'VR,">",PN,">",EM,ES,EF,">",EM,ES,EF', f"{version}>{PART}>{SETTINGS}>{TWICE}"
    items, pattern = (
        'VR,DN,">",PN,">",SN,">",EM,ES,EF,">",EM,ES,EF',
        f"{version}{NAME}>{PART}>{SERIAL}>{SETTINGS}>{TWICE}",
    )
    return (f"{items},CK", f"{pattern}(?P<checksum>[12])") if form.checksum else (items, pattern)


def pinged(state: MCodeState, place: Place) -> Procedure[tuple[Place, bool]]:
    """Ping a drive: its reply shows whether it wants a checksum, and whether it is in program mode.

    Return the place with what is certain of its checksum, and whether a drive replied. With EM=2 none would.
    """
    if state.codec.em == 2:
        return place, False
    ping = yield Request(place.address, "", Kind.QUIET, MCode(party=True))
    if PROGRAM_PROMPT.search(ping.raw):
        state.found_in_program_mode(place.address, replace(state.codec, checksum=int(NAK in ping.raw)))
        yield from take_out(state, "was in program mode and was taken out with PG; check the program in it")
        return place, True
    for checksum in (0, 1):
        if ping.raw in pongs(place.address, checksum > 0):  # it counts more than what the user states
            return replace(place, checks=(checksum,)), True
    return place, b"\r" in ping.raw or NAK in ping.raw  # a drive that is not in party mode only echoes


def _name_and_serial(state: MCodeState) -> Procedure[None]:
    """Read the name, which Ethernet products refuse to print, and the serial number, which older ones may refuse."""
    items, pattern = '"<",DN,">",SN', f"<{NAME}>{SERIAL}"
    if ETHERNET.match(state.product):
        items, pattern = '"<>",SN', f"<>{SERIAL}"
    elif state.product == MDRIVE:
        items, pattern = '"<",DN,">"', f"<{NAME}>"
    for _ in range(THRICE):
        said, _reply = yield from asked(state, state.address, state.codec, items, pattern)
        if said and (found := re.fullmatch(pattern, said)):
            values = found.groupdict()
            _record(state, values.get("name", ""), values.get("serial", ""))
            return
    if state.codec.escape in NAMED:
        state.note(
            f"{who(state)}: its name could not be read, and a stop with ES={state.codec.escape} needs it; open it again"
        )


def _record(state: MCodeState, name: str, serial: str) -> None:
    state.named(state.address or name.strip('"'))
    state.signature_seen(name == as_printed(name.strip('"')))
    state.serial_read(serial)


def mdrive(part: str) -> str:
    """Return the MDrivePlus with this part number: MDI, MDIE with an encoder, MDIX with expanded I/O."""
    if EXPANDED_PART.match(part):
        return "MDIX"
    return "MDIE" if ENCODER_PART in part else MDRIVE
