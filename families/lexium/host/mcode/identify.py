"""The identification of the drives on a line, which moves nothing and raises no error in any drive.

Theory of operation. An immediate error runs a resident OE subroutine, and reading ER clears it. So the host sends only
what no drive refuses: a line feed, a name and a line feed (a ping), `PR VR`, and after NAK or silence the same with a
checksum. The version shows an Ethernet product, which refuses questions about party mode and checksum. The host asks
the rest accordingly. Each reply bears a mark with the drive's name: a running program may print anything, and a slow
drive may reply while another drive is asked. A drive in program mode shows an address as its prompt, or prints nothing.
The host takes it out with PG and reports that.

Our last use of the port may have sent half a line (`hints.cut`). The host makes that line overflow, as after a stop. It
stops the drives before and after, because an overflow is an error. Otherwise the first line feed to a party line
follows a tilde, which no drive has as its name. So half a line in a drive's buffer is not executed. One case remains: a
drive named P on a line that the user does not describe as one. It takes `PR VR` for a command `R VR`, and refuses it.
Where the user states no names, the host looks for those that the command line mentions, then for those that replied
last time, before anything else.
(MCode reference 5.1.33, 5.1.39, 5.1.98, 5.1.105, 5.1.141; facts of real units.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from multidrop.base.errors import NoAnswer
from multidrop.dialects.codec import Kind, Procedure, Reply, Request
from multidrop.dialects.family import Hints
from multidrop.dialects.state import who
from multidrop.families.lexium.host.mcode.codec import NOBODY, TO_PARTY, MCode
from multidrop.families.lexium.host.mcode.identity import (
    BRIEF,
    END_OF_TEXT,
    SETTLE,
    TEXT,
    end_text,
    find,
    find_in_text,
)
from multidrop.families.lexium.host.mcode.operations import put_back_found
from multidrop.families.lexium.host.mcode.state import MCodeState, ReplyPlace, Unconfirmed
from multidrop.families.lexium.manual.statements import UNNAMED

IN_TEXT = TEXT + b"\n\n"
"""The same for a line whose drives may be outside of party mode; it leaves them in the middle of a text."""
SEARCH = "multidrop scan PORT tries every name and baud rate"


def expected_places(hints: Hints) -> list[Unconfirmed]:
    """Return where the drives are, by the user's hints or from last time; nothing where one is not known."""
    last = {remembered.address: remembered for remembered in hints.remembered}
    party, checks = _party(hints), _checks(hints)
    if party is False or (party is None and "" in last and hints.drives in ((), (last[""].name,))):
        return [Unconfirmed(ReplyPlace(False, "", checks), last.get(""), party is False)]
    tried = _tried(hints)
    names = hints.drives or (tried if all(name in last for name in tried) else ())
    if (party and hints.drives) or (names and names[0] in last):
        return [Unconfirmed(ReplyPlace(True, name, checks), last.get(name), party is True) for name in names]
    return []


def expected_state(expected: Unconfirmed, hints: Hints) -> MCodeState:
    """A drive that the host looks for before the first line for it."""
    state, last = _new_state(expected.place, hints), expected.last
    if last is not None:
        state.codec_assumed(replace(state.codec, em=last.em, checksum=last.checksum))
        state.identified(last.product, last.version, last.part)
    state.named(expected.place.address or (last.name if last is not None else ""))
    state.expected(expected)
    return state


def _party(hints: Hints) -> bool | None:
    if hints.party is None and (len(hints.drives) > 1 or hints.drives == ("P",)):
        return True
    return hints.party


def look_around(hints: Hints) -> Procedure[list[MCodeState]]:
    """Find the drives on a line that holds no half-sent command."""
    party = _party(hints)
    if party is not False and not hints.drives:
        for names in (_tried(hints), _last_names(hints)):
            if likely := (yield from _likely(names, hints)):
                return likely
    if party is None and hints.drives:
        sole = yield from _by_name_first(hints)
        if sole is not None:
            return [sole]
    if not party:
        place = ReplyPlace(False, "", _checks(hints))
        alone = _new_state(place, hints)
        if (yield from _find(alone, place, hints)):
            return [alone]
        if party is False:
            raise NoAnswer(
                "no drive replies (MCode outside of party mode was tried); party=1 and drives=NAMES open a party line; "
                f"{SEARCH}"
            )
    yield from wake(TO_PARTY)
    states = []
    for name in hints.drives or (UNNAMED,):
        states.append((yield from _named(name, hints)))
        hints = replace(
            hints, em=states[-1].codec.em if states[-1].product else hints.em
        )  # the next is likely set alike
    present = [state for state in states if state.product]
    if not present:
        raise NoAnswer(_no_reply(hints, party))
    return [state if state.product else _absent(state, present[0]) for state in states]


def _tried(hints: Hints) -> tuple[str, ...]:
    """Return the names from the command line that a drive can have."""
    return tuple(name for name in hints.tried if len(name) == 1 and "!" <= name <= "~")


def _last_names(hints: Hints) -> tuple[str, ...]:
    """Return the names of last time's party line, in order: the first is selected, whichever was used last."""
    return tuple(sorted(remembered.address for remembered in hints.remembered if remembered.party))


def _likely(names: Sequence[str], hints: Hints) -> Procedure[list[MCodeState]]:
    """Find the drives of a party line at names that are likely; nothing where none of them replies.

    Where one replies, those that are silent are listed too: a line for the first of them must not get to the next.
    """
    last = {remembered.address: remembered for remembered in hints.remembered}
    likely: list[MCodeState] = []
    for name in names:
        own = replace(hints, drives=(name,))
        state = (yield from _named(name, own)) if likely else (yield from _by_name_first(own))
        if state is not None and state.product:
            likely.append(state)
            hints = replace(hints, em=state.codec.em)
    present = {state.address: state for state in likely}
    states = []
    for name in names if likely else ():
        state = present.get(name) or _new_state(ReplyPlace(True, name, _checks(hints)), hints)
        if name not in present and name in last:
            state = expected_state(Unconfirmed(ReplyPlace(True, name, _checks(hints)), last[name]), hints)
            state.note(f"{who(state)} replied here last time, and does not reply")
        states.append(state if name in present or name in last else _absent(state, likely[0]))
    return states


def _no_reply(hints: Hints, party: bool | None) -> str:
    names = ", ".join(hints.drives)
    several = f"none of the drives {names} replies"
    tried = several if len(hints.drives) > 1 else f"{names} does not reply" if names else "no drive replies"
    forms = [] if party else ["outside of party mode"]
    guesses = ", ".join(dict.fromkeys((*_tried(hints), *_last_names(hints), UNNAMED)))
    forms += ["in party mode"] if names else [f"as {guesses} in party mode"]
    how = f" (MCode {' and '.join(forms)} was tried)" if len(forms) > 1 else ""
    advice = ", party=0 where it is alone and not in party mode" if party and hints.party is None else ""
    named = "drives=NAMES names others" if names else "drives=a,b,... names those of a party line"
    return f"{tried}{how}; {named}{advice}; {SEARCH}"


def _by_name_first(hints: Hints) -> Procedure[MCodeState | None]:
    """Look for the one named drive on a party line; None where it is silent, or not in party mode."""
    woken = yield from wake(IN_TEXT)
    if TEXT in woken.raw:  # by a drive that is not in party mode; an adapter's repetition is removed from here on
        ended = yield from end_text()
        if END_OF_TEXT in ended.raw or TEXT in (yield from wake(IN_TEXT)).raw:
            return None
    place = ReplyPlace(True, hints.drives[0], _checks(hints))
    state = _new_state(place, hints)
    if not (yield from find_in_text(state, place)):
        return None
    yield from put_back_found(state, hints.owed)
    return state


def wake(spoiler: bytes) -> Procedure[Reply]:
    """Make half a line harmless, and party mode effective (5.1.105: a line feed; facts of real units: two)."""
    form = MCode(party=True)
    return (yield Request(NOBODY, "", Kind.QUIET, form, settle=SETTLE, timeout=BRIEF, body=spoiler))


def _named(name: str, hints: Hints) -> Procedure[MCodeState]:
    """Find one of several drives; a failure with one does not prevent finding the others."""
    place = ReplyPlace(True, name, _checks(hints))
    state, silent = _new_state(place, hints), _new_state(place, hints)
    try:
        return state if (yield from _find(state, place, hints)) else silent
    except NoAnswer as error:
        silent.note(str(error))
        return silent


def _new_state(place: ReplyPlace, hints: Hints) -> MCodeState:
    return MCodeState(MCode(em=hints.em or 0, party=place.party), place.address, sync_marks=hints.first_mark)


def _checks(hints: Hints) -> tuple[int, ...]:
    return (0, 1) if hints.checksum is None else (int(hints.checksum > 0),)


def _absent(state: MCodeState, like: MCodeState) -> MCodeState:
    """A drive that the user named and that is silent: the host reads its settings before the first request."""
    state.codec_assumed(replace(like.codec, escape=None))
    state.settings_may_have_changed()
    state.note(f"{who(state)} does not reply")
    return state


def _find(state: MCodeState, place: ReplyPlace, hints: Hints) -> Procedure[bool]:
    """Find one drive and its settings, and restore what it is owed; False where it is silent."""
    replied = yield from find(state, place)
    if replied:
        yield from put_back_found(state, hints.owed)
    return replied
