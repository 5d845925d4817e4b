"""Finding out how the drives on a line are set, without moving anything or raising an error in any of them.

Theory of operation. An immediate error runs a resident OE subroutine, and reading ER clears it, so only what no drive
refuses is sent: a line feed, a name and a line feed (a ping), `PR VR`, and after NAK or silence the same with a
checksum. From the version on (it tells Ethernet products, which refuse questions about party mode and checksum) the
rest is asked, each value printed behind its name (`PR "EM=",EM`): a running program may print numbers, too. A drive
that was left in program mode shows an address as its prompt, or prints nothing; it is taken out with PG, which is said.
(MCode reference 5.1.33, 5.1.39, 5.1.98, 5.1.105, 5.1.141; facts of real units.)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dialects.base import End, Hints, Kind, Known, Request, Talk
from dialects.errors import NoAnswer
from dialects.mcode.asking import INTEGER, mcode, who
from dialects.mcode.dialect import MCode
from dialects.mcode.programming import take_out
from dialects.mcode.wiring import activate_party

VERSION = re.compile(rb"(?:^|[\r\n>?\x06\x80-\xff])((?:LM[DM]\w* [ -~]*)|(?:\d+\.\d+[ -~]*?))[\x80-\xff]?\r?\n")
PROGRAM_PROMPT = re.compile(rb"\n\d+  $|[\x06\x15]\d+  $")
ETHERNET = re.compile(r"LMD.E")
BRIEF = 0.25
"""Four times this long (s) a collection may take where a program prints all the time and the wire is never quiet."""


@dataclass(frozen=True)
class Heard:
    """What an answer to `PR VR` shows."""

    raw: bytes
    version: str

    @property
    def silent(self) -> bool:
        """Nothing came."""
        return not self.raw

    @property
    def blank(self) -> bool:
        """Nothing was printed: there are signs and our own words only."""
        return not re.sub(rb"\w?PR VR[\x80-\xff]?", b"", self.raw).strip(b"\r\n\x06\x15>? ")

    @property
    def programming(self) -> bool:
        """The prompt is an address."""
        return PROGRAM_PROMPT.search(self.raw) is not None

    @property
    def not_taken(self) -> bool:
        """The drive wants a checksum."""
        return b"\x15" in self.raw

    @property
    def echoes(self) -> bool:
        """EM=0: it ends in a prompt."""
        return self.raw[-1:] in (b">", b"?") or self.programming


def identify(hints: Hints) -> Talk[list[Known]]:
    """The drives on a line, in the order of `hints.drives`. Raises NoAnswer where nobody answers."""
    party = hints.party
    if party is None and len(hints.drives) > 1:
        party = True
    yield _line_feed()
    if not party:
        alone = yield from _find(MCode(), "", hints)
        if alone is not None:
            return [alone]
        if party is False:
            raise NoAnswer("no drive answers; check power, baud and wiring, or give party=1 and drives=NAMES")
    yield from activate_party(MCode(party=True))
    found = []
    for name in hints.drives or ("!",):
        known = yield from _find(MCode(party=True), name, hints)
        found.append(known or Known(MCode(party=True), name))
    present = [known for known in found if known.product]
    if not present:
        asked = ", ".join(hints.drives)
        tried = f"none of the drives {asked}" if asked else "no drive"
        raise NoAnswer(f"{tried} answers; check power, baud and names (drives=a,b,... for a party line)")
    return [known if known.product else _absent(known, present[0]) for known in found]


def _absent(known: Known, like: Known) -> Known:
    """A drive that should be there and is silent: it is spoken to as its neighbours are."""
    known.dialect = replace(mcode(like), escape=None)
    known.notes.append(f"{who(known)} does not answer")
    return known


def _line_feed() -> Request:
    return Request("", "", Kind.QUIET, MCode(party=True), settle=0.1, timeout=BRIEF)


def _find(dialect: MCode, address: str, hints: Hints) -> Talk[Known | None]:
    """One drive and how it is set; None where it is silent."""
    known = Known(dialect, address)
    sealed_only = bool(hints.checksum)
    if dialect.party:
        ping = yield Request(address, "", Kind.QUIET, dialect, timeout=BRIEF)
        sealed_only = sealed_only or b"\x15" in ping.raw
        if PROGRAM_PROMPT.search(ping.raw):
            yield from _take_out(known, replace(dialect, em=0, checksum=int(sealed_only)))
    heard, checksum = yield from _any_version(known, dialect, [0, 1][sealed_only : 1 if hints.checksum == 0 else 2])
    if not heard.version:
        return None
    known.version = heard.version
    known.product = heard.version.split(" ")[0] if heard.version.startswith("LM") else "MDI"
    yield from _settings(known, replace(dialect, checksum=checksum), heard, hints)
    return known


def _any_version(known: Known, dialect: MCode, checksums: Sequence[int]) -> Talk[tuple[Heard, int]]:
    """`PR VR` without and with a checksum; what was heard and which of them it was.

    Only where neither gives a version although something is heard the drive may be in program mode and show nothing.
    """
    heard, checksum, noisy = Heard(b"", ""), 0, []
    for checksum in checksums:
        heard = yield from _version(known, replace(dialect, checksum=checksum), rescue=False)
        if heard.version:
            return heard, checksum
        noisy += [checksum] if not heard.silent and not (heard.not_taken and not checksum) else []
    for checksum in noisy:
        heard = yield from _version(known, replace(dialect, checksum=checksum), rescue=True)
        if heard.version:
            break
    return heard, checksum


def _version(known: Known, dialect: MCode, rescue: bool) -> Talk[Heard]:
    """`PR VR`, twice where the first fell on the rest of somebody's line or on a drive in program mode."""
    heard = Heard(b"", "")
    for attempt in range(3):
        heard = yield from _ask_version(known.address, dialect)
        if heard.version or heard.silent or (heard.not_taken and not dialect.checksum):
            break
        if heard.programming or (attempt == 1 and (rescue or heard.blank)):
            em = 0 if heard.programming else 1
            yield from _take_out(known, replace(dialect, em=em))
        elif attempt == 1:
            break
    return heard


def _ask_version(address: str, dialect: MCode) -> Talk[Heard]:
    reply = yield Request(address, "PR VR", Kind.QUIET, replace(dialect, em=2), timeout=BRIEF)
    found = VERSION.search(reply.raw)
    return Heard(reply.raw, found.group(1).decode("latin-1").strip() if found else "")


def _take_out(known: Known, dialect: MCode) -> Talk[None]:
    """Out of program mode, and say so."""
    known.dialect, known.programming = dialect, True
    yield from take_out(known, "was in program mode and was taken out with PG; check the program in it")


def _settings(known: Known, dialect: MCode, heard: Heard, hints: Hints) -> Talk[None]:
    """EM, CK, ES, DN, PN and EF, each asked in the way that is known by then."""
    if hints.em is not None:
        em = hints.em
    elif heard.echoes:
        em = 0
    else:
        em = yield from _echo_mode(known.address, dialect)
    known.dialect = replace(dialect, em=em, checksum=2 * dialect.checksum)  # which also does without an ACK
    ethernet = ETHERNET.match(known.product) is not None
    if dialect.checksum:
        mode = hints.checksum or (yield from _number(known, "CK"))
        known.dialect = replace(mcode(known), checksum=mode or 1)
    escape = yield from _number(known, "ES")
    known.dialect = replace(mcode(known), escape=escape)
    if not ethernet:
        name = yield from _text(known, "DN")
        known.name = (name or known.address).strip('"')
    known.part = yield from _text(known, "PN")
    if (yield from _number(known, "EF")) == 1:
        known.error = True
        known.notes.append(f"{who(known)}: its error flag is set (EF=1); PR ER tells the error and clears it")


def _echo_mode(address: str, dialect: MCode) -> Talk[int]:
    reply = yield Request(address, _named("EM"), Kind.QUIET, replace(dialect, em=2), timeout=BRIEF)
    found = re.findall(rb"EM=([0-3])[\x80-\xff]?\r?\n", reply.raw)
    return int(found[-1]) if found else 1


def _named(name: str) -> str:
    """A print of a value that cannot be taken for anything else's."""
    return f'PR "{name}=",{name}'


def _number(known: Known, name: str) -> Talk[int | None]:
    text = yield from _text(known, name, INTEGER)
    return int(text) if text else None


def _text(known: Known, name: str, pattern: str = ".*") -> Talk[str]:
    reply = yield replace(mcode(known).request(known.address, _named(name)), expect=f"{name}=({pattern})")
    return reply.text.partition("=")[2] if reply.end is End.DONE else ""
