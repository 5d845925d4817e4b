"""The host's knowledge of one MCode drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from multidrop.base.errors import Refused
from multidrop.dialects.exchange import Looking
from multidrop.dialects.state import DriveState, Remembered, who
from multidrop.families.lexium.host.mcode.codec import MCode

Candidate = tuple[MCode, str]
"""A codec and an address at which a drive may answer."""


@dataclass(frozen=True)
class ReplyPlace:
    """A place at which a drive may reply: party mode, name, and checksums (the likelier first)."""

    party: bool
    address: str
    checks: tuple[int, ...] = (0, 1)


@dataclass(frozen=True)
class Unconfirmed:
    """The place of a drive that has not shown in this session what it is and how it is set."""

    place: ReplyPlace
    last: Remembered | None = None
    """The memory of it from last time."""
    stated: bool = False
    """The user states party mode or none; otherwise last time is the only reason to look there."""
    replied: bool = False
    """The drive has replied in this session. The place is certain; its identity and its settings are not."""


@dataclass(eq=False)
class MCodeState(DriveState):
    """One MCode drive: what its conversations learn beside the common state."""

    codec: MCode
    signs: bool = False
    """The drive prints its own name, which distinguishes its replies from another drive's."""
    candidates: Sequence[Candidate] = field(default_factory=tuple)
    """Other settings and addresses at which it may answer now, after a reply that did not come."""
    next_address: int = 0
    """In program mode: the address of the next line."""
    unconfirmed: Unconfirmed | None = None
    """The drive is only expected; its settings are unknown then."""
    looking: Looking = field(default_factory=Looking)
    """The search for the drive that the present line has begun."""
    stepping: bool = False
    """The drive was seen to wait for a key before each line of its program, and nothing was sent that ends that."""

    rest: int | None = None
    """The position that was read at rest, while nothing was sent that may change it."""
    heading: int | None = None
    """The end of the last move that the host sent, until the drive rests."""

    # Settings

    def codec_assumed(self, codec: MCode) -> None:
        self.codec = codec

    def settings_read(self, address: str, codec: MCode, *, error: bool, running: bool) -> None:
        """Record the address at which the drive replied, and the settings and error flag that it printed."""
        self.address, self.codec = address, codec
        self.name = address or self.name
        self.program_read(error=error, running=running)
        self.settings_unknown, self.candidates = False, ()

    def settings_lost(self, candidates: Sequence[Candidate]) -> None:
        """Record an unconfirmed change of settings: the drive may answer with any of these."""
        self.settings_unknown, self.candidates = True, tuple(candidates)
        self.stepping = False

    def settings_may_have_changed(self) -> None:
        """Record a restart, a loss or a broadcast: it is not known either whether the drive steps."""
        super().settings_may_have_changed()
        self.stepping = False

    def expected(self, unconfirmed: Unconfirmed) -> None:
        """Record where the drive is expected to reply, and what it was last time."""
        self.unconfirmed, self.settings_unknown = unconfirmed, True

    def sought(self) -> None:
        """Record that the host looks for the drive now: no expectation counts any more."""
        self.unconfirmed = None

    def restarted(self, alone: bool) -> None:
        """Record a sign-on. Only a drive outside of party mode sends one, and then it has no address."""
        plain = (replace(self.codec, party=False), "")
        self.settings_lost([plain] if alone and self.codec.party else [])

    # Identity

    def signature_seen(self, signs: bool) -> None:
        self.signs = signs

    # Replies, errors, programs

    def reply_lost(self) -> None:
        """Record a missing reply: it may be late, and the command may have arrived damaged and set the error flag."""
        self.reply_pending = self.error = True

    def error_possible(self) -> None:
        """Record that the error flag may be set, by a line whose outcome was not read: no later line is to blame."""
        self.error = True

    def line_invalidated(self) -> None:
        """Record an overflow, which is error 20."""
        self.error_possible()

    def program_started(self) -> None:
        self.running, self.stepping = True, False

    def program_read(self, *, error: bool, running: bool) -> None:
        self.error_flag_read(error)
        self.running = running

    # Motion

    def seen_at_rest(self, position: int | None) -> None:
        """Record the position at rest; None: it moves, or a program may move it."""
        self.rest = position
        if position is not None:
            self.heading = None

    def heads_for(self, target: int | None) -> None:
        """Record the end of the move that was sent; None: a line was sent after which it is not known."""
        self.rest, self.heading = None, target

    def counts_may_have_changed(self, restarted: bool = False) -> None:
        """Record it; a drive that was restarted neither moves to a target nor steps."""
        super().counts_may_have_changed(restarted)
        if restarted:
            self.rest, self.heading, self.stepping = None, None, False

    # Single step

    def steps(self, on: bool = True) -> None:
        """Record that it runs its program step by step, or that it may not do that any more."""
        self.running, self.stepping = on or self.running, on

    # Program mode

    def may_be_in_program_mode(self) -> None:
        """Record that PG n is on its way: until its reply shows otherwise, the drive stores every line."""
        self.programming = True

    def found_in_program_mode(self, address: str, codec: MCode) -> None:
        """Record a drive that showed a program prompt, or stored what it received."""
        self.address, self.codec, self.programming = address, codec, True

    def entered_program_mode(self, at: int) -> None:
        self.programming, self.next_address = True, at

    def left_program_mode(self) -> None:
        self.programming, self.next_address = False, 0


# Phrases that several messages about an MCode drive share.


def refuse_in_program(state: MCodeState, then: str = "") -> None:
    """Raise Refused where the drive would store a request."""
    if state.programming:
        more = f", then {then}" if then else ""
        raise Refused(f"{who(state)} is in program mode and would store it: PG ends that{more}")
