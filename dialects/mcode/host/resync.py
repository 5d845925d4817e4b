"""Finding a drive whose settings may have changed, and clearing what earlier requests left.

Theory of operation. A drive that was restarted has its saved settings. A lost reply to `EM=1` leaves the setting
unknown. So before the next request the drive prints its settings (`PR EM,ES,EF` and a mark), which the host can read in
any EM. A line without checksum does no harm to a drive that wants one: it replies NAK. But a checksum is an error to a
drive that wants none. So the host adds it only after a NAK, or where a silent drive may want one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from multidrop.dialects.codec import Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.errors import DriveError, NoAnswer, Refused
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.classify import NOTHING, Setting
from multidrop.dialects.mcode.host.codec import MCode
from multidrop.dialects.mcode.host.exchange import answered, fresh, refused, take_out
from multidrop.dialects.mcode.host.framing import NAK, sealed
from multidrop.dialects.mcode.host.quiet_end import SLOWEST
from multidrop.dialects.mcode.host.state import MCodeState, Place, who
from multidrop.dialects.mcode.manual.statements import UNNAMED

PROGRAM_PROMPT = re.compile(rb"\n\d{1,9}  $|[\x06\x15]\d{1,9}  $")
TRIES, SILENCES, NAKS, STORED = 4, 2, 2, 2
"""Limits of the attempts in one form: in all, in silence, with NAK, with nothing printed."""
REPETITION = re.compile(rb'[!-~]?PR [^\r\n]*"~\w*"(?:,DN)?[\x80-\xff]?')
BRIEF = 0.25
"""A quarter of the time (s) to wait for a reply while a program prints without a pause."""


def places_after(state: MCodeState, setting: Setting) -> list[Place]:
    """List where the drive may reply after a change of settings, the likeliest place first.

    The old name goes before a new one: where the line was lost, another drive may bear the new name.
    """
    mode, name, value = state.codec, setting.name, setting.value
    same = (int(mode.checksum > 0),)
    here = Place(mode.party, state.address, same)
    off, on = Place(False, "", same), Place(True, state.address or state.name or UNNAMED, same)
    if name == "CK":
        return [replace(here, checks=(0, 1))]
    if name == "DN" and value and mode.party:
        return [here, Place(True, value, same)]
    if name == "PY":
        return [on, off] if value == "1" else [off, on]
    if name == "FD":
        return [Place(False, "", (0,)), here]
    if name == "IP":
        return [replace(here, checks=(0, 1)), replace(off if mode.party else on, checks=(0, 1))]
    return [here]


def look_in(state: MCodeState, places: Sequence[Place], priority: Priority = Priority.OPERATOR) -> Procedure[bool]:
    """Look for the drive in each place in turn; record the settings that it prints."""
    party = state.codec.party
    for place in places:
        if place.party and not party:
            yield from activate_party(state.codec, priority)
        found = yield from look(state, place, settings_asked, priority)
        if found is not None:
            form, said = found
            take_over(state, place.address, form, said[:3], said[7:])
        if found is not None:
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
    state: MCodeState, place: Place, what: Callable[[MCode], tuple[str, str]], priority: Priority = Priority.OPERATOR
) -> Procedure[tuple[MCode, str] | None]:
    """Have the drive at a place print something that is certainly its own; return the codec it used and the text.

    A drive in program mode is taken out of it, with a note. It shows an address as its prompt, or prints nothing twice.
    """
    checks, tried, stored, naks = list(place.checks), 0, 0, 0
    enough = 1 if state.codec.checksum else NAKS  # a NAK that is expected proves more
    while checks and tried < TRIES:
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
        elif tried == TRIES or (not reply.raw and tried >= SILENCES):
            checks, tried = checks[1:], 0
    return None


def asked(
    state: MCodeState, address: str, form: MCode, items: str, pattern: str, priority: Priority = Priority.OPERATOR
) -> Procedure[tuple[str, Reply]]:
    """Have a drive print values and a mark, readable in any EM; return an empty text where it is not received."""
    mark = fresh(state, address, form.party)
    expect = f"({pattern}){re.escape(mark.shown)}"
    text = f"PR {items},{mark.item}"
    timeout = BRIEF + len(text) / SLOWEST
    rows = NOTHING if state.product else None  # at an opening, what is left of an earlier session comes, too
    reply = yield Request(
        address, text, Kind.QUIET, form, priority, timeout=timeout, expect=expect, rows=rows, signed=True
    )
    for found in re.finditer(rf"{expect}(.?)\r?\n", reply.raw.decode("latin-1")):
        if not form.checksum or found[0].rstrip("\r\n").encode("latin-1") == sealed(
            (found[1] + mark.shown).encode("latin-1")
        ):
            return found[1], reply
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
    places, before = places_after(state, setting), who(state)
    try:
        yield from answered(state, request)
        found = yield from look_in(state, places)
    except DriveError:  # stopped before the settings were read, or an error that need not come from this line
        _lose(state, places)
        raise
    if not found:
        _lose(state, places)
        raise NoAnswer(f"{before} was sent '{request.text}' and does not reply now; open it again later")
    if state.error:
        yield from refused(state, request)
    if setting.name == "FD":
        state.named(UNNAMED)
        state.remark(f"{before}: factory defaults: EM=0, PY=0, CK=0, name !")
    elif setting.name == "IP":
        state.remark(f"{before}: IP restored the saved settings: {state.codec.shown}")
    elif not _holds(state, setting):
        raise Refused(f"{before} did not adopt '{request.text}': {state.codec.shown}")


def _holds(state: MCodeState, setting: classify.Setting) -> bool:
    """Whether the drive has the value that the line set, where the line showed one."""
    mode, value = state.codec, setting.value
    if value is None:
        return True
    if setting.name == "DN":
        if not mode.party:
            state.named(value)
        return state.name == value
    return value == str({"EM": mode.em, "PY": int(mode.party), "CK": mode.checksum, "ES": mode.escape}[setting.name])


def _lose(state: MCodeState, places: list[Place]) -> None:
    """Record that the settings are unknown: they are read before the next request."""
    state.settings_lost([(replace(state.codec, party=each.party), each.address) for each in places])
