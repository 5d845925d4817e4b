"""A drive at a place: what it is and how it is set.

Theory of operation. An Ethernet product refuses questions about name, party mode and checksum. A drive that replies to
a name or to a checksum is none, so one print asks it everything. Any other drive first prints its version, part number
and settings, which no product refuses, and then what its product has. It prints the settings twice: a print that
runs into another drive's may still look valid, and a stop depends on ES. A sync mark ends the print.

A ping (the name and a line feed) shows whether the drive wants a checksum, and whether it is in program mode. (MCode
reference 5.1.33, 5.1.39, 5.1.98, 5.1.105, 5.1.119, 5.1.141; facts of real units.)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from multidrop.base.errors import NoAnswer, Refused
from multidrop.dialects.codec import Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.state import who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.classify import NOTHING, LineSetting
from multidrop.families.lexium.host.mcode.codec import NOBODY, MCode
from multidrop.families.lexium.host.mcode.exchange import (
    as_printed,
    fresh_mark,
    raise_refusal,
    send_until_answered,
    take_out,
)
from multidrop.families.lexium.host.mcode.framing import NAK, sealed
from multidrop.families.lexium.host.mcode.quiet import PONG, SLOWEST_BYTES_A_SECOND, pongs
from multidrop.families.lexium.host.mcode.state import MCodeState, ReplyPlace
from multidrop.families.lexium.manual.mnemonic import ETHERNET
from multidrop.families.lexium.manual.program_file import LONGEST_PROGRAM_LINE
from multidrop.families.lexium.manual.statements import UNNAMED

# The settings of a drive that may have changed.
#
# Theory of operation. A drive that was restarted has its saved settings. A lost reply to `EM=1` leaves the setting
# unknown. So before the next request the drive prints its settings (`PR EM,ES,EF` and a mark), which the host can read
# in any EM. A line without checksum does no harm to a drive that wants one: it replies NAK. But a checksum is an error
# to a drive that wants none. So the host adds it only after a NAK, or where a silent drive may want one.


PROGRAM_PROMPT = re.compile(rb"\n\d{1,9}  $|[\x06\x15]\d{1,9}  $")
MOST_TRIES, SILENCES, NAKS, STORED = 4, 2, 2, 2
"""Limits of the attempts in one form: in all, in silence, with NAK, with nothing printed."""
REPETITION = re.compile(rb'[!-~]?PR [^\r\n]*"~\w*"(?:,DN)?[\x80-\xff]?')
BRIEF = 0.25
"""A quarter of the time (s) to wait for a reply while a program prints without a pause."""


def places_after(state: MCodeState, setting: LineSetting) -> list[ReplyPlace]:
    """List where the drive may reply after a change of settings, the likeliest place first.

    The old name goes before a new one: where the line was lost, another drive may bear the new name.
    """
    mode, name, value = state.codec, setting.name, setting.value
    same = (int(mode.checksum > 0),)
    here = ReplyPlace(mode.party, state.address, same)
    off, on = ReplyPlace(False, "", same), ReplyPlace(True, state.address or state.name or UNNAMED, same)
    if name == "CK":
        return [replace(here, checks=(0, 1))]
    if name == "DN" and value and mode.party:
        return [here, ReplyPlace(True, value, same)]
    if name == "PY":
        return [on, off] if value == "1" else [off, on]
    if name == "FD":
        return [ReplyPlace(False, "", (0,)), here]
    if name == "IP":
        return [replace(here, checks=(0, 1)), replace(off if mode.party else on, checks=(0, 1))]
    return [here]


def look_in(state: MCodeState, places: Sequence[ReplyPlace], priority: Priority = Priority.OPERATOR) -> Procedure[bool]:
    """Look for the drive in each place in turn; record the settings that it prints."""
    party = state.codec.party
    for place in places:
        if place.party and not party:
            yield from activate_party(state.codec, priority)
        identified = yield from look(state, place, settings_asked, priority)
        if identified is not None:
            form, said = identified
            take_over(state, place.address, form, said[:3], said[7:])
        if identified is not None:
            return True
        party = place.party
    if not party and any(place.party for place in places):  # the last text must not stay in other drives' buffers
        yield from activate_party(state.codec, priority)
    return False


def activate_party(codec: MCode, priority: Priority = Priority.OPERATOR) -> Procedure[None]:
    """Send two line feeds, which make party mode effective after PY=1 (5.1.105)."""
    form = replace(codec, party=True, checksum=0)
    for _ in range(2):
        yield Request("", "", Kind.QUIET, form, priority, settle=0.05, timeout=BRIEF)


def settings_asked(form: MCode) -> tuple[str, str]:
    """Return the items to print for a drive's settings, and their form; CK only with a checksum.

    Each item twice: a print that runs into another drive's may still look valid, and a stop depends on ES.
    """
    more, digit = (",CK", "[12]") if form.checksum else ("", "")
    return f'EM,ES,EF," ",EM,ES,EF{more}', rf"((?P<em>[0-3])[0-3][01]) \2{digit}"


def look(
    state: MCodeState,
    place: ReplyPlace,
    what: Callable[[MCode], tuple[str, str]],
    priority: Priority = Priority.OPERATOR,
) -> Procedure[tuple[MCode, str] | None]:
    """Have the drive at a place print something that is certainly its own; return the codec it used and the text.

    A drive in program mode is taken out of it, with a note. It shows an address as its prompt, or prints nothing twice.
    """
    checks, tried, stored, naks = list(place.checks), 0, 0, 0
    enough = 1 if state.codec.checksum else NAKS  # a NAK that is expected proves more
    while checks and tried < MOST_TRIES:
        tried += 1
        form = replace(state.codec, em=2, party=place.party, checksum=checks[0], escape=None)
        text, reply = yield from asked(state, place.address, form, *what(form), priority)
        stored, naks = (
            stored + (bool(reply.raw) and not REPETITION.sub(b"", reply.raw).strip(b"\r\n\x06")),
            naks + (NAK in reply.raw),
        )
        if text:
            return form, text
        prompt = PROGRAM_PROMPT.search(reply.raw) is not None
        if prompt or stored == STORED:
            check = max(form.checksum, int(NAK in reply.raw))
            state.found_in_program_mode(place.address, replace(form, em=0 if prompt else 1, checksum=check))
            stored, checks = 0, [check]
            yield from take_out(state, "was in program mode and was taken out with PG; check the program in it")
        elif naks == enough and not form.checksum:
            checks, tried = [1], 0
        elif tried == MOST_TRIES or (not reply.raw and tried >= SILENCES):
            checks, tried = checks[1:], 0
    return None


def asked(
    state: MCodeState, address: str, form: MCode, items: str, pattern: str, priority: Priority = Priority.OPERATOR
) -> Procedure[tuple[str, Reply]]:
    """Have a drive print values and a mark, readable in any EM; return an empty text where it is not received."""
    mark = fresh_mark(state, address, form.party)
    expect = f"({pattern}){re.escape(mark.shown)}"
    text = f"PR {items},{mark.item}"
    timeout = BRIEF + len(text) / SLOWEST_BYTES_A_SECOND
    rows = NOTHING if state.product else None  # at an opening, what is left of an earlier session comes, too
    reply = yield Request(
        address, text, Kind.QUIET, form, priority, timeout=timeout, expect=expect, rows=rows, signed=True
    )
    for match in re.finditer(rf"{expect}(.?)\r?\n", reply.raw.decode("latin-1")):
        if not form.checksum or match[0].rstrip("\r\n").encode("latin-1") == sealed(
            (match[1] + mark.shown).encode("latin-1")
        ):
            return match[1], reply
    return "", reply


def take_over(state: MCodeState, address: str, form: MCode, settings: str, checksum: str | None) -> None:
    """Record the settings (EM, ES, EF) and the checksum mode that a drive printed."""
    em, escape, flag = (int(digit) for digit in settings)
    codec = replace(form, em=em, escape=escape, checksum=int(checksum or 0))
    state.settings_read(address, codec, error=flag == 1, running=form.checksum > 0)  # a program may be running


# Conversations that change communication settings (EM, PY, CK, ES, DN, FD, IP).
#
# The host does not infer the settings from what it sent: afterwards the drive prints its settings. Source: MCode
# reference 5.1.21, 5.1.33, 5.1.39, 5.1.45, 5.1.63, 5.1.105.


def set_wire(state: MCodeState, request: Request) -> Procedure[None]:
    """Send a communication setting, then read the drive's settings. Raises Refused or NoAnswer."""
    setting = classify.setting_of(request.text)
    assert setting is not None
    places, before, replied = places_after(state, setting), who(state), False
    try:
        yield from send_until_answered(state, request)
        replied = yield from look_in(state, places)
    finally:
        if not replied:  # stopped or lost before the settings were read, or an error that need not come from this line
            _lose(state, places)
    if not replied:
        raise NoAnswer(f"{before} was sent '{request.text}' and does not reply now; open it again later")
    if state.error:
        yield from raise_refusal(state, request)
    if setting.name == "FD":
        state.named(UNNAMED)
        state.remark(f"{before}: factory defaults: EM=0, PY=0, CK=0, name !")
    elif setting.name == "IP":
        state.remark(f"{before}: IP restored the saved settings: {state.codec.shown}")
    elif not _holds(state, setting):
        raise Refused(f"{before} did not adopt '{request.text}': {state.codec.shown}")


def _holds(state: MCodeState, setting: classify.LineSetting) -> bool:
    """Whether the drive has the value that the line set, where the line showed one."""
    mode, value = state.codec, setting.value
    if value is None:
        return True
    if setting.name == "DN":
        if not mode.party:
            state.named(value)
        return state.name == value
    return value == str({"EM": mode.em, "PY": int(mode.party), "CK": mode.checksum, "ES": mode.escape}[setting.name])


def _lose(state: MCodeState, places: list[ReplyPlace]) -> None:
    """Record that the settings are unknown: they are read before the next request."""
    state.settings_lost([(replace(state.codec, party=place.party), place.address) for place in places])


# Half a line in the drives' buffers, from an interrupted use of the port: it is made to overflow between stops.


def overflow(names: Sequence[str]) -> Procedure[None]:
    """Stop the drives, overflow every drive's buffer so that the half line is refused, and stop them twice more.

    A CR ends the line outside of party mode. A LF executes it in party mode, where the CR only separates.
    """
    form = MCode(party=True)
    stop = form.stop(names, sure=False)
    spoiled = (
        form.stop(names, sure=False, half_sent=True) + NOBODY.encode() * (LONGEST_PROGRAM_LINE + 1) + b"\r\n" + stop
    )
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
MDRIVE, MODULE = "MDI", "LMM"
THRICE = 3
EXPANDED_PART = re.compile(r"<?MDI[34]")
"""The part number of an MDrivePlus with expanded I/O."""
ENCODER_PART = "-E"
"""Part of the part number of an MDrivePlus with an encoder (such as -EQ)."""
TEXT = b'PR "~'
"""The first characters of a print: a drive refuses them after half a line, and executes nothing by themselves."""
END_OF_TEXT = b'"'
SETTLE = 0.03
"""Quiet time after the first line feeds, s: half a line in a drive's buffer is refused meanwhile."""
NAMED_ESCAPES = (2, 3)
"""The escape modes in which a stop bears the drive's name (5.1.41)."""


def find(state: MCodeState, place: ReplyPlace) -> Procedure[bool]:
    """Find a drive at a place, and read what it is and how it is set; False where it is silent."""
    if place.party:
        sure = yield from _answering(state, place)
        if sure is None:
            return False
        place = sure
    identified = yield from look(state, place, identity_asked)
    if identified is None:
        return False
    form, said = identified
    matched = re.fullmatch(identity_asked(form)[1], said)
    assert matched is not None
    values = matched.groupdict()
    version = values["version"]
    state.identified(product_of(version), version, values["part"])
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


def product_of(version: str) -> str:
    """Return the product that a version begins with; a Motion Module adds letters to it (5.1.141: LMMCM)."""
    head = version.split(" ")[0]
    return MODULE if head.startswith(MODULE) else head if head.startswith("LM") else MDRIVE


def find_in_text(state: MCodeState, place: ReplyPlace) -> Procedure[bool]:
    """Find a drive on a line whose drives may be in party mode or not, after `TEXT` and a line feed.

    A drive that is not in party mode collects these lines in its buffer. For it they are a text that is being printed,
    and the last line completes it. So the first questions have no quotation mark.
    """
    _, replied = yield from pinged(state, place)
    if (replied or (yield from _whispers(place))) and (yield from find(state, place)):
        return True
    yield from end_text()
    return False


def end_text() -> Procedure[Reply]:
    """Complete the text in a drive that is not in party mode; such a drive prints it, or repeats its end (EM=0)."""
    body = END_OF_TEXT + b"\r"
    return (yield Request(NOBODY, 'end of the text "', Kind.QUIET, MCode(), settle=SETTLE, timeout=BRIEF, body=body))


def _whispers(place: ReplyPlace) -> Procedure[bool]:
    """Whether a drive prints its name that does not reply to a ping (EM=2)."""
    name = re.escape(as_printed(place.address))
    for checksum in place.checks:
        form = MCode(em=2, party=True, checksum=checksum)
        expect = f"{name}[0-3]{name}"
        reply = yield Request(place.address, "PR DN,EM,DN", Kind.QUIET, form, settle=PONG, timeout=BRIEF, expect=expect)
        if re.search(expect.encode("latin-1"), reply.raw):
            return True
    return False


def _answering(state: MCodeState, place: ReplyPlace) -> Procedure[ReplyPlace | None]:
    """Make sure that a drive replies to its name, before it is asked much; None where it is silent.

    A drive that is not in party mode keeps every line in its buffer, and a full buffer is an error.
    """
    place, replied = yield from pinged(state, place)
    if replied:
        return place
    answered = yield from look(state, place, lambda form: ("ES", "[0-3]"))
    return None if answered is None else replace(place, checks=(answered[0].checksum,))


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


def pinged(state: MCodeState, place: ReplyPlace) -> Procedure[tuple[ReplyPlace, bool]]:
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
        if said and (match := re.fullmatch(pattern, said)):
            values = match.groupdict()
            _record(state, values.get("name", ""), values.get("serial", ""))
            return
        state.error_possible()  # the drive refused the question, or noise made one of it that it refuses
    if state.codec.escape in NAMED_ESCAPES:
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
