"""One stop of a link, and what is known of its drives since."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from multidrop.dialects import Started
from multidrop.drives.drive import Drive
from multidrop.drives.link import Link
from multidrop.transports import Undelivered


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
    """A stop of one link. What is known of a drive follows from the stop, and from what was read and sent since.

    `drives` are those that it is for, `others` those that its bytes stop as well.
    """

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
    """The bytes that begin it; empty if none were written."""
    written: tuple[bytes, ...] = ()
    """What was written of it: nothing, where it goes on with one that was on its way."""
    missed: set[Drive] = field(default_factory=set)
    """Drives whose part of the stop could not be made."""
    trouble: list[str] = field(default_factory=list)
    """Why it was not written, or not for all."""
    doubts: dict[Drive, str] = field(default_factory=dict)
    """Why a drive could not be read."""
    stored: list[Drive] = field(default_factory=list)
    """The drives that had stored it, once for each time that it was written again for them."""
    started: Mapping[Drive, Started] = field(default_factory=dict)
    """What it stops, by drive; empty: everything."""
    single: bool = False
    """Its bytes stop what was `started`, and nothing else of the link."""
    rests: dict[Drive, int] = field(default_factory=dict)
    """How often in a row the axes that were started were read at rest, where other axes may go on."""
    programs: dict[Drive, bool | None] = field(default_factory=dict)
    """The drives whose programs it ends, and whether one ran; None: not known."""
    vain: bool = False
    """A drive moves on, or its program runs on, after the last attempt to stop it."""

    @property
    def delivered(self) -> bool:
        """Whether its bytes have left, with a part for every drive."""
        return bool(self.data) and not self.missed and not isinstance(self.link.lost, Undelivered)

    @property
    def affected(self) -> tuple[Drive, ...]:
        return self.drives + self.others

    @property
    def not_started(self) -> tuple[Drive, ...]:
        """The drives that it stops and that no command has started since."""
        return tuple(drive for drive in self.affected if not self.started_since(drive))

    def started_since(self, drive: Drive) -> bool:
        """Whether a command that can start the drive was sent after the stop and not refused."""
        return drive.commanded_at > self.at

    @property
    def reaches_unknown(self) -> bool:
        """Whether it stops any other drive of the line, known or not."""
        return any(drive.codec.stops_unknown(self.data) for drive in self.affected)

    def spares_programs(self, drive: Drive) -> bool:
        """Whether the programs of a drive go on, as none of them was started."""
        return self.single and drive.codec.spares and not self.started[drive].program

    def part_of(self, drive: Drive) -> str:
        """The axes of a drive that it stops, in words behind its name, ` X` or ` motor 1`; empty: all of them."""
        axes = self.started[drive].axes if self.spares_programs(drive) else None
        known = () if axes is None else drive.family.units.axes()
        if axes is None or axes.issuperset(known) or known == [""]:
            return ""
        return "".join(f" {'motor ' * axis.isdigit()}{axis.upper()}" for axis in known if axis in axes)

    def fate(self, drive: Drive) -> Fate:
        """What is known of one of its drives now."""
        if self.started_since(drive):
            return Fate.STARTED
        since = max(self.at, drive.started_at)  # a refused line may have run an error routine in the drive
        if self.spares_programs(drive) and drive in self.rests:
            return (Fate.MOVING, Fate.SENT, Fate.STANDING)[min(self.rests[drive], 2)]
        seen = drive.seen if drive.seen is not None and drive.seen.at > since else None
        runs = drive.running.runs if drive.running is not None and drive.running.at > since else None
        if seen is not None and seen.at_rest(since) and runs is False:
            return Fate.STANDING
        if not self.data or drive in self.missed or isinstance(self.link.lost, Undelivered):
            return Fate.NOT_REACHED
        if (seen is not None and seen.velocity) or runs:
            return Fate.MOVING if seen is not None and seen.velocity else Fate.RUNNING
        return Fate.NOT_KNOWN if self.link.lost or drive in self.doubts else Fate.SENT
