"""One stop of a link, and what is known of each drive since.

Nothing known of a drive is stored twice: it follows from the stop, from what was read since, and from what was sent
since.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from multidrop.drives.drive import Drive
from multidrop.drives.link import Link


class Fate(Enum):
    """What is known of a drive since a stop."""

    SENT = "sent, not read yet, or at velocity 0 once"
    STANDING = "read at rest since, and no program runs"
    MOVING = "velocity read as not 0 since"
    RUNNING = "a program runs, read since"
    NOT_KNOWN = "sent, and the velocity, or whether a program runs, cannot be read"
    NOT_REACHED = "not sent: the line is lost, or writing failed"
    STARTED = "started again since, by a command"


@dataclass(eq=False)
class Halt:
    """A stop of one link. `drives` are those that it is for, `others` those that its bytes stop as well."""

    link: Link
    at: float
    """When it was written, s of the link's clock."""
    number: int
    """Later stops of the same link have higher numbers."""
    whole: bool
    """It is for everything on the link, known or not."""
    drives: tuple[Drive, ...]
    others: tuple[Drive, ...] = ()
    data: bytes = b""
    """The bytes written; empty if none were."""
    missed: set[Drive] = field(default_factory=set)
    """Drives whose part of the stop could not be made."""
    trouble: list[str] = field(default_factory=list)
    """Why it was not written, or not for all."""
    doubts: dict[Drive, str] = field(default_factory=dict)
    """Why a drive could not be read."""
    stored: list[Drive] = field(default_factory=list)
    """The drives that had stored it, once for each time that it was written again for them."""
    vain: bool = False
    """A drive moves on, or its program runs on, after the last attempt to stop it."""

    @property
    def affected(self) -> tuple[Drive, ...]:
        """All drives that it stops."""
        return self.drives + self.others

    @property
    def not_started(self) -> tuple[Drive, ...]:
        """The drives that it stops and that no command has started since."""
        return tuple(drive for drive in self.affected if not self.started_since(drive))

    def started_since(self, drive: Drive) -> bool:
        """Whether a command that can start the drive was sent after the stop and not refused."""
        return drive.commanded_at > self.at

    def fate(self, drive: Drive) -> Fate:
        """What is known of one of its drives now."""
        if self.started_since(drive):
            return Fate.STARTED
        since = max(self.at, drive.started_at)  # a refused line may have run an error routine in the drive
        seen = drive.seen if drive.seen is not None and drive.seen.at > since else None
        runs = drive.running.runs if drive.running is not None and drive.running.at > since else None
        if seen is not None and seen.at_rest(since) and runs is False:
            return Fate.STANDING
        if not self.data or drive in self.missed:
            return Fate.NOT_REACHED
        if (seen is not None and seen.velocity) or runs:
            return Fate.MOVING if seen is not None and seen.velocity else Fate.RUNNING
        return Fate.NOT_KNOWN if self.link.lost or drive in self.doubts else Fate.SENT
