"""The search for modules at one baud rate: a reading question at each address.

Theory of operation. A reply bears the address of its module, so one that is late, or that comes from a module which
replies to every address, is put down to that module, once. Address 1 is asked first, and twice where it is silent. A
second of silence follows each of these questions, in which modules drop what another host left of a message: the
frames after it are counted from their first byte. What cannot be read (several replies at once, or a late one that ran
into the next question) has the addresses before it asked once more, with the time that the slowest module takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.codec import Kind, Procedure, StopPiece
from multidrop.dialects.scanning import Found, Outcome, Reach, Scan, Step
from multidrop.dialects.tmcl.host.codec import FACTORY, GAP, RESYNC, Tmcl, TmclState, frame_of, replies_in
from multidrop.dialects.tmcl.host.operations import IDENTITY, count_line, find
from multidrop.dialects.tmcl.manual.commands import Call, Command

ALL = (FACTORY, *(str(number) for number in range(2, 256)))
SLOWEST = 0.3
"""The longest pause of a module before a reply (global parameter 75), and its reply, s."""
LATE = 5
"""Addresses before the present one whose reply may have run into its question."""
HAZARD = (
    "a frame may hold bytes that MCode drives on the line obey: the addresses 3, 10, 13 and 27, and other bytes of a "
    "frame, are ^C, LF, CR and ESC to them"
)


def search(reach: Reach, found: Found[TmclState], step: Step) -> Procedure[Outcome]:
    """Search for modules; report each as soon as it is identified, with the number of its motors."""
    states: dict[str, TmclState] = {}
    remarks: list[str] = []
    asked: list[str] = []
    unread: list[str] = []
    again: set[str] = set()
    for address in _addresses(reach):
        reach.asks(address)
        asked.append(address)
        quiet = RESYNC if address == FACTORY else SLOWEST if address == ALL[-1] else reach.window + GAP
        heard = yield from _heard(address, quiet)
        if address == FACTORY and not replies_in(heard):
            heard += yield from _heard(address, RESYNC)
        if frame_of(int(address), IDENTITY) in heard:
            return Outcome(echo=True)
        if heard and not replies_in(heard):
            for each in asked[-LATE:]:
                if each not in again and each not in states:
                    again.add(each)
                    heard += yield from _heard(each, SLOWEST)
            if not replies_in(heard):
                unread.append(address)
        for name in replies_in(heard):
            if name in states or name in reach.known:
                continue
            state = TmclState(Tmcl(), name)
            state.named(name)
            if not (yield from find(state)):
                unread.append(address)
                continue
            states[name] = state
            count_line([*states.values()])
            if name not in asked:
                remarks.append(
                    f"module {name} replied to address {address}: it replies to every address, or another host asks it"
                )
            found(state)
        step()
    if unread:
        where = ", ".join(dict.fromkeys(unread))
        remarks.append(
            f"what came at {where} is no module's reply: several may reply at once, or drives of another kind"
        )
    return Outcome(tuple(remarks))


def _addresses(reach: Reach) -> Sequence[str]:
    return ALL if reach.everything and not reach.alone else ALL[:1]


def _heard(address: str, quiet: float) -> Procedure[bytes]:
    """Ask for the version; return what was received until it was quiet, or until the module's own reply."""
    asked = Tmcl().request(address, str(IDENTITY), IDENTITY)
    return (yield replace(asked, kind=Kind.QUIET, settle=quiet, timeout=quiet)).raw


def stop(asked: Sequence[str]) -> Sequence[StopPiece]:
    """MST for the first motor of each, twice: a module that lost a byte takes the first one for the rest of a message.

    The whole stop of an absent module would take half a second.
    """
    frames = [frame_of(int(address), Call(Command.MST)) for address in asked]
    pieces = [StopPiece(each, GAP) for each in frames]
    return [*pieces, *(StopPiece(each, GAP if at else RESYNC) for at, each in enumerate(frames))]


SCAN = Scan(
    "TMCL",
    (9600, 19200, 38400, 57600, 115200),
    lambda reach: len(_addresses(reach)),
    search,
    asked=lambda reach: "addresses 1 to 255" if len(_addresses(reach)) > 1 else "address 1 only (--all: each address)",
    hazard=HAZARD,
    waits=2 * RESYNC,
    slow=GAP,
    stop=stop,
)
