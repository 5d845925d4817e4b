"""The search for modules at one baud rate: a reading question at each address.

Theory of operation. A reply bears the address of its module, so one that is late, or that comes from a module which
replies to every address, is put down to that module, once. Address 1 is asked first, and twice where it is silent. A
second of silence follows each of these questions, in which modules drop what another host left of a message: the
frames after it are counted from their first byte. What cannot be read (several replies at once, or a late one that ran
into the next question) has the addresses before it asked once more, with the time that the slowest module takes.

A byte that is lost on its way has all modules count wrongly from there on, and reply to nothing. So after each block of
addresses a module that has replied is asked once more; where no module replies, the block is asked again after a
second of silence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from multidrop.dialects.codec import Kind, Procedure, StopPiece
from multidrop.dialects.scanning import Found, Reach, Scan, SearchOutcome, Step
from multidrop.families.tmcl.host.codec import FACTORY, RESYNC, STOP_PIECE_QUIET, Tmcl, TmclState, frame_of, replies_in
from multidrop.families.tmcl.host.operations import IDENTITY, count_line, find
from multidrop.families.tmcl.manual.commands import Command, TmclCall

ALL = (FACTORY, *(str(number) for number in range(2, 256)))
LONGEST_REPLY_WAIT = 0.3
"""The longest pause of a module before a reply (global parameter 75), and its reply, s."""
LATE_ADDRESSES = 5
"""Addresses before the present one whose reply may have run into its question."""
BLOCK = 32
"""Addresses after which the count is checked."""
HAZARD = (
    "a frame may hold bytes that MCode drives on the line obey: the addresses 3, 10, 13 and 27, and other bytes of a "
    "frame, are ^C, LF, CR and ESC to them"
)


@dataclass
class _TmclSearch:
    """One search of a line."""

    reach: Reach
    found: Found
    states: dict[str, TmclState] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    asked: dict[str, None] = field(default_factory=dict)
    unread: dict[str, None] = field(default_factory=dict)
    again: set[str] = field(default_factory=set)
    """Addresses that were asked with the longest time."""

    @property
    def window(self) -> float:
        return self.reach.window + STOP_PIECE_QUIET

    def ask(self, address: str) -> Procedure[None]:
        """Ask one address, and identify what replies."""
        first = address == FACTORY and address not in self.asked
        self.reach.asks(address)
        self.asked[address] = None
        heard = yield from _heard(
            address, RESYNC if first else LONGEST_REPLY_WAIT if address == ALL[-1] else self.window
        )
        if first and not replies_in(heard):
            heard += yield from _heard(address, RESYNC)
        if heard and not replies_in(heard):
            for late in [*self.asked][-LATE_ADDRESSES:]:
                if late not in self.again and late not in self.states:
                    self.again.add(late)
                    heard += yield from _heard(late, LONGEST_REPLY_WAIT)
            if not replies_in(heard):
                self.unread[address] = None
        for name in replies_in(heard):
            if name not in self.states and name not in self.reach.known:
                yield from self._identify(name, address)

    def _identify(self, name: str, address: str) -> Procedure[None]:
        """Identify a module that replied, as this address was asked."""
        state = TmclState(Tmcl(), name)
        state.named(name)
        if not (yield from find(state)):
            self.unread[address] = None
            return
        self.states[name] = state
        count_line([*self.states.values()])
        if name not in self.asked:
            why = "it replies to every address, or another host asks it"
            self.remarks.append(f"module {name} replied to address {address}: {why}")
        self.found(state)

    def counted(self) -> Procedure[bool]:
        """Whether a module that has replied does so again: no byte was lost on the way to it."""
        known = next(reversed(self.states), "")
        return bool(known and replies_in((yield from _heard(known, LONGEST_REPLY_WAIT))))


def _addresses(reach: Reach) -> Sequence[str]:
    return ALL if reach.everything and not reach.alone else ALL[:1]


def _heard(address: str, quiet: float) -> Procedure[bytes]:
    """Ask for the version; return what was received until it was quiet, or until the module's own reply."""
    asked = Tmcl().request(address, str(IDENTITY), IDENTITY)
    return (yield replace(asked, kind=Kind.QUIET, settle=quiet, timeout=quiet)).raw


class TmclScan(Scan):
    """The search for TMCL modules."""

    title = "TMCL"
    bauds = (9600, 19200, 38400, 57600, 115200)
    hazard = HAZARD
    waits = 2 * RESYNC
    slow = 0.11

    def places(self, reach: Reach) -> int:
        return len(_addresses(reach))

    def search(self, reach: Reach, found: Found, step: Step) -> Procedure[SearchOutcome]:
        """Search for modules; report each as soon as it is identified, with the number of its motors."""
        own, addresses = _TmclSearch(reach, found), _addresses(reach)
        for begin in range(0, len(addresses), BLOCK):
            block = addresses[begin : begin + BLOCK]
            for address in block:
                yield from own.ask(address)
                step()
            if len(addresses) == 1 or (yield from own.counted()):
                continue
            yield from _heard(FACTORY, RESYNC)
            for address in block:
                if address not in own.states:
                    yield from own.ask(address)
            if own.states and not (yield from own.counted()):
                own.remarks.append(f"the line loses bytes: modules at {block[0]} to {block[-1]} may have been missed")
        if own.unread:
            why = "is no module's reply: several may reply at once, or drives of another kind"
            own.remarks.append(f"what came at {', '.join(own.unread)} {why}")
        return SearchOutcome(tuple(own.remarks))

    def asked(self, reach: Reach) -> str:
        return "addresses 1 to 255" if len(_addresses(reach)) > 1 else "address 1 only (--all: each address)"

    def stop(self, asked: Sequence[str]) -> Sequence[StopPiece]:
        """MST for the first motor of each, twice: a module that lost a byte takes the first for the rest of a message.

        The whole stop of an absent module would take half a second.
        """
        frames = [frame_of(int(address), TmclCall(Command.MST)) for address in asked]
        pieces = [StopPiece(frame, STOP_PIECE_QUIET) for frame in frames]
        return [*pieces, *(StopPiece(frame, STOP_PIECE_QUIET if at else RESYNC) for at, frame in enumerate(frames))]


SCAN = TmclScan()
