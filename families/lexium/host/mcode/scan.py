"""The search for MCode drives at one baud rate, and what frees a drive that does not reply."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from multidrop.base.errors import NoAnswer
from multidrop.dialects.codec import Kind, Procedure, Request
from multidrop.dialects.scanning import Found, Reach, Scan, SearchOutcome, Step
from multidrop.families.lexium.host.mcode.codec import NOBODY, MCode
from multidrop.families.lexium.host.mcode.framing import NAK, sealed
from multidrop.families.lexium.host.mcode.identity import BRIEF, PROGRAM_PROMPT, find, overflow, write_stop
from multidrop.families.lexium.host.mcode.quiet import pongs
from multidrop.families.lexium.host.mcode.state import MCodeState, ReplyPlace
from multidrop.families.lexium.manual.statements import NAMES

# What frees an MCode drive that does not reply, whatever it is set to; nothing here knows the drive.
#
# Theory of operation. A drive is silent because a program floods the line or waits for a key (single step), because
# its buffer holds half a line, or because it is in program mode with EM=2. The stop in every form ends programs. A
# full buffer of tildes makes half a line overflow. PG ends program mode; outside of it PG is an error, so a stop
# follows. Outside of party mode the line is `PG` and a CR, and a line feed after each letter keeps drives named P and
# G from harm (see `scan`). In party mode `*` reaches every name. Each goes out without a checksum and with one.
#
# FD erases. It is the last resort, in the order that works on real units: outside of party mode, with a checksum, then
# to every name. (MCode reference 5.1.21, 5.1.41, 5.1.45, 5.1.98, 5.1.105; facts of real units.)


CLEARS = (
    "stops every drive and its program, makes half a line in a drive overflow (error 20) and sends PG, an error "
    "outside of program mode; an OE subroutine that an error starts is stopped. It erases nothing"
)
PART_PAUSE = 0.02
"""Quiet time after each part, s: a drive may reply to it."""
RESTARTING = 1.0
"""The time that a drive takes for FD, s."""
PG, EVERYONE = b"PG", b"*PG"
RESETS = (b"\rFD\r", sealed(b"FD") + b"\r", sealed(b"CK=0") + b"\r", b"\n*FD\n", b"\n" + sealed(b"*FD") + b"\n")


def _sent(line: bytes, quiet: float) -> Procedure[None]:
    yield Request(NOBODY, "rescue", Kind.QUIET, MCode(party=True), settle=quiet, timeout=max(quiet, BRIEF), body=line)


# The search for MCode drives at one baud rate: one drive without a name, then every name, whatever their settings.
#
# Theory of operation. Nothing that is sent moves a drive or is an error in one. A drive outside of party mode collects
# all that it receives until a CR, and 64 characters are an error to it. So it is looked for first, and where one
# replies no name is tried. That question is `PR VR`, which no product refuses. But drives in party mode receive it
# too, and one that is named P would take it for its own `R VR`. So the question is sent in three parts, with a line
# feed after the P and after the R. Outside of party mode a line feed is part of no line. In party mode the parts are a
# ping of P, a ping of R, and a line for the name " ", which no drive has.
#
# A ping (a name and a line feed) is not stored in program mode and shows almost every drive. With EM=2 a drive replies
# to a print only, so what is silent is asked to print its name, at last with a checksum. A checksum is an error where
# none is wanted, and a drive that wants none has replied by then. A reply may come late, while the next names are
# tried. So once anything comes, the names before are asked again, with more time. What replied is then identified as
# at an opening (`identity.find`).
#
# One case remains: half a line of another program's, such as `aMR ` without its number. The P of the question
# completes it. Half a line of our own overflows first. (MCode reference 5.1.21, 5.1.33, 5.1.39, 5.1.98, 5.1.105, 7.1;
# facts of real units.)


QUESTION = b"PR VR"
FOREIGN = b"?" + QUESTION
"""The reply of a PMX controller, which repeats an unknown word."""
CERTAIN = 5
"""Windows in which a late reply comes: for a question that is repeated because something came."""
ALONE_TRIES = 4
"""Questions to a drive outside of party mode: the first one may follow half a line, and each may want a checksum."""
REST_WINDOWS = 3
"""Windows in which the replies to earlier questions come."""
LATE_NAMES = 6
"""Names before the present one whose reply may come now: an adapter holds bytes for 16 ms, a network for longer."""
NAMED_PONGS = {name: [pong for sign in (True, False) for pong in pongs(name, sign) if len(pong) > 2] for name in NAMES}
"""The replies to a ping that bear the name."""
ROUNDS = 3
"""Pings, prints, prints with a checksum."""
PING, PRINT = 0.5, 0.6
"""The silence after a ping and after a print, in windows: twice the longest time for a command (7.1)."""
TALKS = 3
"""Questions after which something else than a reply came, until a program is known to print."""
VERSION = re.compile(rb"(?m:^|[\x06>?])(?:LM[DM][A-Z0-9]* |\d+\.\d+[ !-~]*[\x80-\xff]?\r\n)")
BUSY = 2.5
"""The longest wait, in windows, while a program prints without a pause."""


@dataclass(frozen=True)
class Apart(MCode):
    """The codec of questions outside of party mode that a drive named P, in party mode, does not take for its own."""

    def encode(self, request: Request) -> bytes:
        """Return the frame; a print without a name has a line feed after each letter of PR."""
        frame = super().encode(request)
        if self.party or request.kind is not Kind.QUIET or not frame.startswith(b"PR "):
            return frame
        return b"P\nR\n" + frame[2:]


@dataclass
class _McodeSearch:
    """One search: its manner, what it has found, and what it could not read."""

    reach: Reach
    found: Found
    step: Step
    names: list[str] = field(default_factory=list)
    remarks: dict[str, str] = field(default_factory=dict)
    """By address; other remarks by their subject."""

    talk: int = 0
    """Questions after which something came that no drive was found by: a program prints."""

    @property
    def talks(self) -> bool:
        """Whether a program prints all the time: only what a drive prints of itself counts then."""
        return self.talk >= TALKS

    def asked(self, request: bytes, what: str, quiet: float, name: str = "") -> Procedure[bytes]:
        timeout = BRIEF if self.talks else max(quiet, BUSY * self.reach.window)
        form = MCode(party=bool(name))
        reply = yield Request(name, what, Kind.QUIET, form, settle=quiet, timeout=timeout, body=request)
        return reply.raw


# A drive outside of party mode


def _unnamed(own: _McodeSearch) -> Procedure[bool]:
    """Look for a drive outside of party mode; return whether one replies."""
    checksum, tried = 0, 0
    for _ in range(ALONE_TRIES):
        # Make the question for the version in its parts; over UDP there is no party line, and it stays whole.
        frame = sealed(QUESTION) if checksum else QUESTION
        question = [frame + b"\r"] if own.reach.alone else [frame[:1] + b"\n", frame[1:2] + b"\n", frame[2:] + b"\r"]
        heard = yield from _parts_asked(own, question, own.reach.window)
        if not VERSION.search(b"".join(heard)) and heard != question and any(map(_ambiguous, heard)):
            heard = yield from _parts_asked(own, question, CERTAIN * own.reach.window)
        if _is_unnamed(question, heard):
            state = yield from _identified(own, ReplyPlace(False, ""))
            if state is not None:
                own.found(state)
            return True
        tried += 1
        if FOREIGN in heard[-1]:
            own.remarks["PMX"] = "something replies as a PMX does; --dialect pmx searches for one"
        if not any(heard) or NAK in heard[-1] or tried == ALONE_TRIES // 2:
            checksum, tried = 1 - checksum, 0
    return False


def _parts_asked(own: _McodeSearch, question: list[bytes], quiet: float) -> Procedure[list[bytes]]:
    heard = []
    for part in question:
        heard.append((yield from own.asked(part, QUESTION.decode(), quiet)))
    return heard


def _is_unnamed(question: list[bytes], heard: list[bytes]) -> bool:
    """Whether a drive outside of party mode replied: with its version, more than an echo, a prompt or a line end.

    Where the pings of P and R were replied to, only the version or the echo of everything counts.
    """
    sent, received = b"".join(question), b"".join(heard)
    if VERSION.search(received) or (received.startswith(sent) and received != sent):
        return True
    return not any(heard[:-1]) and _ambiguous(heard[-1])


def _ambiguous(heard: bytes) -> bool:
    return NAK in heard or PROGRAM_PROMPT.search(heard) is not None or heard == b"\r\n"


# Names


def _named(own: _McodeSearch) -> Procedure[None]:
    """Try every name: pings first, then prints for the drives that do not reply to a ping."""
    for number in range(ROUNDS):
        for at, name in enumerate(NAMES):
            if own.talks and own.reach.hasty:
                own.remarks["talk"] = "a program prints all the time, and the search for names ended there"
                return
            if name not in own.names and not (own.talks and number == 0):
                # Try the last of these names in one form; the names before it may reply late.
                names = NAMES[max(0, at - LATE_NAMES) : at + 1]
                name = names[-1]
                if number == 0:
                    heard = yield from _pinged(own, name, PING * own.reach.window)
                    sure = heard in NAMED_PONGS[name]
                else:
                    heard = yield from _name_asked(own, name, number - 1, PRINT * own.reach.window)
                    sure = _prints(name, heard)
                if heard and not (sure and (yield from _reported(own, name, _checks(name, heard)))) and not own.talks:
                    yield from _late(own, names)
            own.step()
        if (yield from own.asked(b"\n", "", REST_WINDOWS * own.reach.window, NAMES[-1])) and not own.talks:
            yield from _late(own, NAMES[-LATE_NAMES:])


def _late(own: _McodeSearch, names: Sequence[str]) -> Procedure[None]:
    """Look for the drives whose replies came: the last of these names, or those before it."""
    several = yield from own.asked(b"\n", "", REST_WINDOWS * own.reach.window, names[-1])
    heard = False
    for there in (_pongs_late, _prints_late):
        for name in reversed(names):
            if name not in own.names and (yield from there(own, name)) and (yield from _reported(own, name)):
                heard = True
                if not several:
                    return
        if heard:
            return
    own.talk += 1


def _pongs_late(own: _McodeSearch, name: str) -> Procedure[bool]:
    """Whether a drive replies to a ping of this name, with time for its reply."""
    heard = yield from _pinged(own, name, CERTAIN * own.reach.window)
    return heard in (*pongs(name, True), *pongs(name, False)) or PROGRAM_PROMPT.search(heard) is not None


def _prints_late(own: _McodeSearch, name: str) -> Procedure[bool]:
    """Whether a drive prints this name, with time for its reply; what a program prints is not such a reply."""
    for checksum in (0, 1):
        if _prints(name, (yield from _name_asked(own, name, checksum, CERTAIN * own.reach.window))):
            return True
    return False


def _pinged(own: _McodeSearch, name: str, quiet: float) -> Procedure[bytes]:
    return (yield from own.asked(f"{name}\n".encode(), "", quiet, name))


def _name_asked(own: _McodeSearch, name: str, checksum: int, quiet: float) -> Procedure[bytes]:
    frame = f"{name}PR DN".encode()
    line = (sealed(frame) if checksum else frame) + b"\n"
    return (yield from own.asked(line, "PR DN", quiet, name))


def _prints(name: str, heard: bytes) -> bool:
    """Whether a drive printed this name, or shows that it stores the question or wants it with a checksum."""
    if NAK in heard or PROGRAM_PROMPT.search(heard):
        return True
    return re.search(rb'(?m:^|[\x06>?])"?%s"?[\x80-\xff]?\r\n' % re.escape(name.encode()), heard) is not None


def _checks(name: str, heard: bytes) -> tuple[int, ...]:
    """The checksums to identify a drive with: with one only where its print of the name bears one."""
    sealed_name = rb'"?%s"?[\x80-\xff]\r\n' % re.escape(name.encode())
    return (1,) if re.search(sealed_name, heard) else (0, 1)


def _reported(own: _McodeSearch, name: str, checks: tuple[int, ...] = (0, 1)) -> Procedure[bool]:
    state = yield from _identified(own, ReplyPlace(True, name, checks))
    if state is not None:
        own.names.append(name)
        own.found(state)
    return state is not None


def _identified(own: _McodeSearch, place: ReplyPlace) -> Procedure[MCodeState | None]:
    """Identify the drive that replies at a place; a reply that cannot be read becomes a remark."""
    form = Apart if not (place.party or own.reach.alone) else MCode
    state = MCodeState(form(party=place.party), place.address, sync_marks=own.reach.first_mark)
    try:
        if (yield from find(state, place)):
            codec = state.codec
            state.codec_assumed(MCode(codec.em, codec.party, codec.checksum, codec.escape))
            return state
    except NoAnswer as error:
        own.remarks[place.address] = str(error)
        return None
    at = f"{place.address} replies" if place.address else "a drive without a name replies"
    own.remarks[place.address] = f"{at}, but nothing that can be read: several drives may have this address"
    return None


class MCodeScan(Scan):
    """The search for MCode drives."""

    title = "MCode"
    bauds = (4800, 9600, 19200, 38400, 115200)
    clears = CLEARS
    erases = True
    names = NAMES

    def places(self, reach: Reach) -> int:
        return 1 if reach.alone else 1 + ROUNDS * len(NAMES)

    def search(self, reach: Reach, found: Found, step: Step) -> Procedure[SearchOutcome]:
        """Search for every drive at one baud rate; report each as soon as it is identified."""
        own = _McodeSearch(reach, found, step, list(reach.known))
        if reach.cut:
            yield from overflow(NAMES)
        alone = yield from _unnamed(own)
        step()
        if not (alone or reach.alone):
            yield from _named(own)
        return SearchOutcome(tuple(text for about, text in own.remarks.items() if about not in own.names))

    def clear(self) -> Procedure[None]:
        """Stop all programs, overflow half lines, leave program mode, and stop what errors started."""
        yield from overflow(NAMES)
        for line in (PG, sealed(PG)):
            for part in (line[:1] + b"\n", line[1:2] + b"\n", line[2:] + b"\r"):
                yield from _sent(part, PART_PAUSE)
        for line in (EVERYONE, sealed(EVERYONE)):
            yield from _sent(line + b"\n", PART_PAUSE)
        yield from write_stop(MCode(party=True).stop(NAMES, sure=False))

    def erase(self) -> Procedure[None]:
        """Set every drive on the line to factory defaults: program, variables and parameters are lost."""
        for line in RESETS:
            yield from _sent(line, RESTARTING)

    def asked(self, reach: Reach) -> str:
        return "all names, with and without a checksum"


SCAN = MCodeScan()
