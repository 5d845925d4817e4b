"""What an automation has started, and what it has claimed. `automation.Automations` has those that run."""

from __future__ import annotations

from dataclasses import dataclass, field

from multidrop.dialects import Started
from multidrop.drives.drive import Drive
from multidrop.drives.link import Link
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.stopping import Halt

Claim = tuple[Link, str]
"""A link and an address on it; a global address is all of the link."""


@dataclass(frozen=True)
class SentMotion:
    """What an automation has sent to a drive that can have started it."""

    at: float
    """When the last of it was about to be sent, s of the link's clock."""
    what: Started
    why: str = ""
    """Why it may move, where none of that has started it."""


@dataclass(eq=False)
class Automation:
    """One automation: the drives it started, and their stops. The address `*` is all of a bus."""

    stops: int
    """The number of stops of everything before its first start."""
    name: str = ""
    """Its name in messages, such as `macro shuttle`."""
    claims: frozenset[Claim] = frozenset()
    """The drives that it will start."""
    still: str = ""
    """The reason why it may start nothing now; empty: it may."""
    started: dict[Drive, SentMotion] = field(default_factory=dict)
    stopped: dict[Drive, SentMotion] = field(default_factory=dict)
    """Those of `started` whose stops are written."""
    halts: list[Halt] = field(default_factory=list)
    """The stops of its drives, once they are written."""

    def has(self, claim: Claim) -> bool:
        """True if a drive is one of those that it claimed or started."""
        own = [*self.claims, *((drive.link, drive.address) for drive in self.started)]
        return any(
            each[0] is claim[0] and (each[1] == claim[1] or each[1] in GLOBAL or claim[1] in GLOBAL) for each in own
        )
