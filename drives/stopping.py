"""Stopping a line: what to write, seeing afterwards that it worked, and what is known of each drive.

A stop is only believed when the velocity has been read as 0 (screen and log must not lie), so once the wire is
quiet and the stop has been repeated, every drive is asked; one that still moves, and does not slow down, is stopped
again. What is known of a drive is never kept twice: it follows from the stop, from what was read since, and from
what was sent since.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from dialects import Codec, DriveError, Priority, Stopped
from dialects.families import PLAIN
from drives.apart import apart
from transports import TransportLost

if TYPE_CHECKING:
    from drives.bus import Bus
    from drives.drive import Drive

TRIES = 3
BETWEEN = 0.1
"""Seconds between two readings of a drive that may be slowing down."""
RAMP = 30.0
"""Seconds for which a drive that slows down, or was stopped in vain, is read on."""


class Fate(Enum):
    """What is known of a drive that a stop was for."""

    SENT = "sent, not read yet"
    STANDING = "velocity read as 0 since"
    MOVING = "velocity read as not 0 since"
    NOT_KNOWN = "sent, and the velocity cannot be read"
    NOT_REACHED = "not sent: the line is lost, or writing failed"
    STARTED = "started again since, by a command"


@dataclass(eq=False)
class Halt:
    """A stop of one line. `drives` are those that it is for, `others` those that its bytes stop as well."""

    bus: Bus
    at: float
    """When it was written, s of the bus's clock."""
    number: int
    """Later stops of the same bus have higher ones."""
    whole: bool
    """It is for everything on the line, known or not."""
    drives: tuple[Drive, ...]
    others: tuple[Drive, ...] = ()
    data: bytes = b""
    """What was written; empty where nothing was."""
    missed: set[Drive] = field(default_factory=set)
    """Drives whose part of the stop could not be made."""
    trouble: list[str] = field(default_factory=list)
    """Why it was not written, or not for all."""
    doubts: dict[Drive, str] = field(default_factory=dict)
    """Why a drive could not be read."""
    vain: bool = False
    """A drive moved on though it was stopped TRIES times."""

    @property
    def affected(self) -> tuple[Drive, ...]:
        """All that it stops."""
        return self.drives + self.others

    @property
    def superseded(self) -> bool:
        """Whether a later stop of the whole line sees to it."""
        last = self.bus.last_stop
        return last is not None and last.number > self.number

    def fate(self, drive: Drive) -> Fate:
        """What is known of one of its drives now."""
        if drive.started_at > self.at:
            return Fate.STARTED
        seen = drive.seen if drive.seen is not None and drive.seen.at > self.at else None
        if seen is not None and not seen.velocity:
            return Fate.STANDING
        if not self.data or drive in self.missed:
            return Fate.NOT_REACHED
        if seen is not None:
            return Fate.MOVING
        return Fate.NOT_KNOWN if self.bus.lost or drive in self.doubts else Fate.SENT


@dataclass(frozen=True)
class Forms:
    """What stops drives on a bus, each form once."""

    immediate: bytes
    unterminated: bytes
    """The same, of which no byte ends a line that was half sent."""
    repeat: tuple[bytes, ...]
    """The same, to be written piece by piece when it is quiet."""
    invalidate: bytes
    """What makes a half-sent line harmless."""
    framed: bool
    """Messages carry their length: one that has begun to leave must leave whole."""
    missed: tuple[Drive, ...] = ()
    """Those whose dialect failed to say how."""

    def written(self, cut: bool) -> WrittenStop:
        """The stop to write; `cut`: a line may have been cut in two."""
        invalidated = cut and bool(self.invalidate)
        return WrittenStop(
            self, self.unterminated + self.invalidate + self.immediate if invalidated else self.immediate, invalidated
        )


@dataclass(frozen=True)
class WrittenStop:
    """The bytes of a stop, and whether they make a half-sent line harmless."""

    forms: Forms
    data: bytes
    invalidated: bool


Group = tuple[Codec, bool]


def stop_forms(bus: Bus, only: Iterable[Drive] | None = None) -> Forms:
    """The bytes that stop these drives; all on the bus unless given, with those only spoken to or being looked for."""
    groups = _groups(bus, only)
    immediate: list[bytes] = []
    unterminated: list[bytes] = []
    repeat: list[bytes] = []
    invalidating: list[bytes] = []
    missed: list[Drive] = []
    for (codec, sure), members in groups.items():
        names, failed = [name for name, _ in members], list[str]()
        with apart(f"the stop of {', '.join(names)} on {bus.name}", failed):
            stop, unfinished = codec.stop(names, sure), codec.stop(names, sure, half_sent=True)
            pieces, invalidate = codec.stop_again(names, sure), codec.invalidate()
            if stop not in immediate and immediate and codec.stop_gap is not None:
                repeat += (stop, *pieces)  # at once, its answer and the first one's would run into each other
            elif stop not in immediate:
                immediate.append(stop)
                unterminated.append(unfinished)
                repeat += pieces
            invalidating += [invalidate] if invalidate not in invalidating else []
        missed += [drive for _, drive in members if drive is not None and failed]
    framed = any(codec.framed for codec, _ in groups)
    return Forms(
        b"".join(immediate), b"".join(unterminated), tuple(repeat), b"".join(invalidating), framed, tuple(missed)
    )


def _groups(bus: Bus, only: Iterable[Drive] | None) -> dict[Group, list[tuple[str, Drive | None]]]:
    """Names and drives by how they are spoken to, and whether that is sure."""
    groups: dict[Group, list[tuple[str, Drive | None]]] = {}
    for drive in bus.all_drives if only is None else only:
        members = groups.setdefault((drive.codec, not drive.state.settings_unknown), [])
        members.append((drive.address or drive.state.name, drive))
    if only is None and (bus.probing or not groups):
        groups.setdefault((PLAIN[bus.family], False), []).extend((name, None) for name in bus.probing)
    return groups


async def confirm_stop(bus: Bus, halt: Halt) -> None:
    """Read the velocities of a stop's drives and say what was found; stop again what moves and does not slow down."""
    moving = list(halt.affected)
    if not moving:
        bus.notify("stop sent; no drive is known here, so it is not known whether all stand", warning=True)
    before: dict[Drive, int] = {}
    tries, until = 0, bus.now() + RAMP
    while moving and bus.now() < until:
        speeds = {drive: await _speed(drive, halt) for drive in moving}
        if halt.superseded and not bus.lost:
            return
        moving = [drive for drive in moving if speeds[drive]]
        slow_down = all(speeds[drive] < before.get(drive, speeds[drive] + 1) for drive in moving)
        before = speeds
        if moving and not slow_down and tries < TRIES:
            tries += 1
            _once_more(bus, halt, {drive: speeds[drive] for drive in moving}, tries)
        if moving:
            await asyncio.sleep(BETWEEN)
    if moving and tries < TRIES:
        bus.notify(f"{', '.join(drive.shown for drive in moving)}: slows down for more than {RAMP:g} s", warning=True)


def _once_more(bus: Bus, halt: Halt, speeds: dict[Drive, int], tries: int) -> None:
    """Stop again what moves on, or give that up and say so."""
    if tries == TRIES:
        halt.vain = True
        names = ", ".join(drive.shown for drive in speeds)
        bus.notify(f"STILL MOVING after {TRIES} stops: {names}; cut the power", warning=True)
        return
    for drive, speed in speeds.items():
        bus.notify(f"{drive.shown}: still moves at {speed} a second; stop sent again", warning=True)
    bus.repeat(halt)


async def _speed(drive: Drive, halt: Halt) -> int:
    """How fast a drive moves, unsigned; 0 also where that cannot be read, which is said."""
    bus = drive.bus
    if drive.programming and not bus.engaged(drive):
        return _not_known(drive, halt, "in program mode it cannot be asked whether it stands")
    try:
        axes = await drive.motion(Priority.OPERATOR)
    except Stopped:
        return 1 << 40  # another stop came meanwhile: faster than anything
    except (TimeoutError, DriveError, TransportLost) as error:
        return _not_known(drive, halt, f"it is not known whether it stands: {error}")
    halt.doubts.pop(drive, None)
    speed = max(abs(axis.velocity) for axis in axes)
    if not speed:
        bus.notify(f"{drive.shown}: stopped, velocity 0 at {', '.join(str(a.position) for a in axes)}")
    return speed


def _not_known(drive: Drive, halt: Halt, why: str) -> int:
    halt.doubts[drive] = why
    drive.bus.notify(f"{drive.shown}: stop sent, but {why}", warning=True)
    return 0
