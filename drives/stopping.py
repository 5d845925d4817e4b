"""Stops of a link, in two phases: write the bytes, then tell of it and confirm that it works.

The bytes go first, past the queue and past every watcher; then the line fails what waits. A session writes the stops of
all links before it does anything else, so that no link delays the stop of another.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from multidrop.dialects import Codec, DriveError, Motion, Priority, Stopped, StopPiece
from multidrop.drives.drive import Drive
from multidrop.drives.events import Sample, Traffic, Transaction, apart
from multidrop.drives.keeping import GLOBAL
from multidrop.drives.link import Link, WrittenStop
from multidrop.drives.roster import Roster
from multidrop.transports import TransportLost

# Confirmation of a stop: read velocities and programs, and stop again what moves or runs on.
#
# A stop is believed only when two readings show the drive at rest and no program runs that can move it: screen and log
# must not lie. So each drive is read once the wire is quiet and the stop was repeated. A drive that still moves and
# does not slow down is stopped again, and so is one whose program runs, unless a command has started it since.


TRIES = 3
BETWEEN = 0.1
"""Time between two readings of a drive that may be slowing down, s."""
RAMP = 30.0
"""How long a drive is read that slows down, or was stopped in vain, s."""


class Activity(NamedTuple):
    """What a drive did when it was read; nothing, where that is not known."""

    speed: int = 0
    """Unsigned, of its fastest axis."""
    runs: bool = False
    """A program runs."""
    places: str = ""
    """The positions of its axes; empty: not read."""

    @property
    def none(self) -> bool:
        """Whether it neither moves nor runs a program, or nothing is known."""
        return not self.speed and not self.runs

    def lessens(self, before: Activity | None) -> bool:
        """Whether it slows down, as far as two readings show, and no program runs that can move it again."""
        return not self.runs and (before is None or self.speed < before.speed)


NOTHING = Activity()
ENDLESS = Activity(1 << 40)
"""Of a drive that another stop kept from being read: faster than any."""


async def confirm_stop(halt: Halt, repeat: Callable[[Halt], None], superseded: Callable[[Halt], bool]) -> None:
    """Read the drives of a stop and publish what was found; `repeat` it for what goes on and does not slow down."""
    link = halt.link
    unconfirmed = list(halt.affected)
    if not unconfirmed:
        link.notify("stop sent; no drive is known here, so no velocity could be read", warning=True)
    before: dict[Drive, Activity] = {}
    active: dict[Drive, Activity] = {}
    tries, until = 0, link.now() + RAMP
    while unconfirmed and link.now() < until:
        found = {drive: await _read(drive, halt) for drive in unconfirmed if not halt.started_since(drive)}
        _announce(halt, found)
        if superseded(halt) and not link.lost:
            return
        active = {drive: each for drive, each in found.items() if not each.none and not halt.started_since(drive)}
        slow_down = all(each.lessens(before.get(drive)) for drive, each in active.items())
        before = found
        if active and not slow_down and tries < TRIES:
            tries += 1
            _once_more(halt, active, tries, repeat)
        # The line of an operator that may start a drive may also be refused, and then nothing has started it.
        undecided = [drive for drive in unconfirmed if halt.started_since(drive) and drive.starting]
        once = [drive for drive, each in found.items() if each.none and halt.fate(drive) is Fate.SENT]
        unconfirmed = [*active, *undecided, *once]
        if unconfirmed:
            await asyncio.sleep(BETWEEN)
    if active and tries < TRIES:
        names = ", ".join(drive.shown for drive in active)
        link.notify(f"{names}: slows down for more than {RAMP:g} s", warning=True)


def _announce(halt: Halt, found: Mapping[Drive, Activity]) -> None:
    """Say which drives stand, whether this reading or a poll after it has confirmed that."""
    for drive, each in found.items():
        if each.places and each.none and halt.fate(drive) is Fate.STANDING:
            halt.link.notify(f"{drive.shown}: stopped, velocity 0 at {each.places}")


def _once_more(halt: Halt, active: Mapping[Drive, Activity], tries: int, repeat: Callable[[Halt], None]) -> None:
    """Stop again what goes on, or give up and say so."""
    link = halt.link
    if tries == TRIES:
        halt.vain = True
        for goes_on, moves in (("MOVING", True), ("RUNNING", False)):
            if names := ", ".join(drive.shown for drive, each in active.items() if bool(each.speed) is moves):
                link.notify(f"STILL {goes_on} after {TRIES} stops: {names}; cut the power", warning=True)
        return
    for drive, each in active.items():
        does = f"still moves at {each.speed} a second" if each.speed else "its program still runs"
        link.notify(f"{drive.shown}: {does}; stop sent again", warning=True)
    repeat(halt)


async def _read(drive: Drive, halt: Halt) -> Activity:
    """Read and publish what a drive does; NOTHING also where that cannot be read, which is a doubt of the stop."""
    if drive.programming and not drive.engaged:
        return _not_known(drive, halt, "its velocity cannot be read in program mode")
    ended: list[Transaction] = []
    try:
        axes = await drive.motion(Priority.OPERATOR, ended.append)
        runs, why = await _program(drive, axes)
    except Stopped:
        return ENDLESS
    except (TimeoutError, DriveError, TransportLost) as error:
        return _not_known(drive, halt, f"its velocity could not be read: {error}")
    at = ended[-1].transmitted_at
    for each in axes:
        drive.link.publish(Sample(at, drive.address, each.position, each.velocity, each.axis, each.trouble, runs))
    if why:
        return _not_known(drive, halt, why)
    halt.doubts.pop(drive, None)
    speed = abs(drive.seen.velocity) if drive.seen is not None else 0
    return Activity(speed, bool(runs), ", ".join(str(each.position) for each in axes))


async def _program(drive: Drive, axes: Sequence[Motion]) -> tuple[bool | None, str]:
    """Whether a program runs, None where that is not asked: a drive that moves is stopped again; or why not known."""
    runs = axes[0].program
    if runs is not None or any(axis.velocity for axis in axes):
        return runs, ""
    try:
        return await drive.busy(), ""
    except Stopped:
        raise
    except (TimeoutError, DriveError, TransportLost) as error:
        return None, f"velocity 0 was read, and whether a program runs was not: {error}"


def _not_known(drive: Drive, halt: Halt, why: str) -> Activity:
    halt.doubts[drive] = why
    drive.link.notify(f"{drive.shown}: stop sent, but {why}", warning=True)
    return NOTHING


# One stop of a link, and what is known of each drive since.
#
# Nothing known of a drive is stored twice: it follows from the stop, from what was read since, and from what was sent
# since.


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


# The bytes of a stop: for every language and setting on a link, each form once.


@dataclass(frozen=True)
class StopForms:
    """The forms of a stop, of which the state of the wire selects one."""

    immediate: bytes
    unterminated: bytes
    """The same stop without any byte that ends a half-sent line."""
    repeats: tuple[StopPiece, ...]
    """The same stop, to be written piece by piece once it is quiet."""
    invalidate: bytes
    """Makes a half-sent line harmless; empty if none is needed."""
    framed: bool
    """Messages carry their length: one that has begun to leave must leave whole."""
    missed: tuple[Drive, ...] = ()
    """Drives whose dialect failed to make a stop."""

    def written(self, cut: bool) -> WrittenStop:
        """The stop to write. `cut`: a line may have been cut in two."""
        if cut and self.invalidate:
            return WrittenStop(self.unterminated + self.invalidate + self.immediate, True, self.repeats)
        return WrittenStop(self.immediate, False, self.repeats)


@dataclass(frozen=True)
class _Target:
    """A name to stop, and its drive if one is known."""

    name: str
    drive: Drive | None = None


_Groups = dict[tuple[Codec, bool], list[_Target]]
"""Targets by language, and whether that is certain."""


class _Collected:
    """The forms of several groups, each once."""

    def __init__(self) -> None:
        self.immediate: list[bytes] = []
        self.unterminated: list[bytes] = []
        self.repeats: list[StopPiece] = []
        self.invalidate: list[bytes] = []

    def add(self, codec: Codec, names: list[str], sure: bool) -> None:
        stop, unfinished = codec.stop(names, sure), codec.stop(names, sure, half_sent=True)
        pieces, invalidate = codec.stop_again(names, sure), codec.invalidate()
        if stop not in self.immediate:
            # Written at once, the reply to a second answered stop would collide with the reply to the first.
            collides = bool(self.immediate) and codec.stop_replies
            if collides:
                self.repeats.append(StopPiece(stop, pieces[0].quiet))
            else:
                self.immediate.append(stop)
                self.unterminated.append(unfinished)
            self.repeats += pieces
        if invalidate not in self.invalidate:
            self.invalidate.append(invalidate)


def stop_forms(roster: Roster, only: Iterable[Drive] | None = None) -> StopForms:
    """Make the bytes that stop these drives; by default all of the link, unlisted and probed ones included."""
    groups, forms = _groups(roster, only), _Collected()
    missed: list[Drive] = []
    for (codec, sure), members in groups.items():
        names, failed = [each.name for each in members], list[str]()
        with apart(f"the stop of {', '.join(names)} on {roster.link.name}", failed):
            forms.add(codec, names, sure)
        missed += [each.drive for each in members if each.drive is not None and failed]
    return StopForms(
        b"".join(forms.immediate),
        b"".join(forms.unterminated),
        tuple(forms.repeats),
        b"".join(forms.invalidate),
        any(codec.framed for codec, _ in groups),
        tuple(missed),
    )


def _groups(roster: Roster, only: Iterable[Drive] | None) -> _Groups:
    groups: _Groups = {}
    for drive in roster.all_drives if only is None else only:
        members = groups.setdefault((drive.codec, not drive.state.settings_unknown), [])
        members.append(_Target(drive.address or drive.state.name, drive))
    if only is None and (roster.probing or not groups):
        groups.setdefault((roster.family.codec, False), []).extend(_Target(name) for name in roster.probing)
    return groups


AGAIN = 3
"""How often a stop is written again for a drive that stored it."""


class Stopping:
    """Stops the drives of one link."""

    def __init__(self, roster: Roster) -> None:
        self.last: Halt | None = None
        """The last stop of the whole link."""
        self._roster = roster
        self._link = roster.link
        self._ahead: tuple[WrittenStop, StopForms] | None = None
        """The stop that another thread has written and the loop has not yet taken over."""
        self._unconfirmed: list[Halt] = []
        """Stops that are not confirmed yet, or that a loss kept from the drives or from being confirmed."""
        self._tasks: set[asyncio.Task[None]] = set()
        roster.on_stored_stop = self._stored

    @property
    def tasks(self) -> set[asyncio.Task[None]]:
        """The stops that are being confirmed."""
        return set(self._tasks)

    def ahead(self) -> None:
        """Write the stop of the whole link from any thread, whatever the loop is doing; `halt` must follow in the loop.

        From then until that `halt` the loop writes nothing. Does nothing on a transport that cannot be preempted.
        """
        forms = stop_forms(self._roster)

        def stop(cut: bool) -> bytes:
            written = forms.written(cut)
            self._ahead = written, forms
            return written.data

        self._link.preempt(forms.framed, stop)

    def halt(self, only: Iterable[Drive] | None) -> Halt:
        """Write a stop, and nothing else: no watcher hears of it before `halted`. Failures go to `Halt.trouble`."""
        drives = tuple(self._roster.all_drives if only is None else only)
        halt = Halt(self._link, self._link.now(), self._link.stops, only is None, drives)
        if halt.whole:
            self.last = halt
            self._unconfirmed.clear()
        self._unconfirmed.append(halt)
        self._write(halt)
        return halt

    def halted(self, halt: Halt, confirm: bool = True) -> None:
        """Publish a stop that was written, fail what waited, and confirm that it works."""
        if self._link.lost:
            return
        self._publish(halt)
        if not self._link.away and confirm:
            self._begin_to_confirm(halt)
        elif self._link.reserved:
            self.unasked()

    def unasked(self) -> None:
        """Count the stops as done, on a line where no drive can be asked: a later loss writes none of them again."""
        self._unconfirmed.clear()

    # After a loss

    def resume(self) -> Halt | None:
        """Write the stop that a loss kept from the drives or from being confirmed; None where there is none.

        Call it as soon as the link has another transport, before anything else is written.
        """
        self._ahead = None
        open_, self._unconfirmed = self._unconfirmed, []
        drives = {drive: None for halt in open_ for drive in halt.not_started}
        whole = any(halt.whole and len(halt.not_started) == len(halt.affected) for halt in open_)
        if not (drives or whole or self._link.cut):
            return None
        whole = whole or bool(self._link.cut)
        self._roster.settings_may_have_changed(self._roster.all_drives if whole else drives)
        halt = self.halt(None if whole else drives)
        self._publish(halt)
        return halt

    def resumed(self) -> None:
        """Confirm the stops of the loss, now that the drives are found again."""
        for halt in self._unconfirmed:
            self._begin_to_confirm(halt)

    def _begin_to_confirm(self, halt: Halt) -> None:
        task = asyncio.get_running_loop().create_task(self._confirm(halt))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _confirm(self, halt: Halt) -> None:
        await confirm_stop(halt, self._repeat, self._superseded)
        if not self._link.away and halt in self._unconfirmed:
            self._unconfirmed.remove(halt)

    # Writing

    def _repeat(self, halt: Halt) -> None:
        """Write a stop once more."""
        self._write(halt)
        self._publish(halt)

    def _stored(self, drive: Drive) -> None:
        """Write the whole stop again for a drive that stored it; its form now ends that first.

        Only its own: the frames for the others go on, and each of several such drives has the end of its download.
        """
        halt = next((each for each in reversed(self._unconfirmed) if drive in each.affected), None)
        if halt is None:
            halt = self.halt([drive])
            self.halted(halt)
        elif drive.programming and halt.stored.count(drive) < AGAIN:
            halt.stored.append(drive)
            text = f"{drive.shown}: it stored the stop; its download is ended and the whole stop sent again"
            self._link.notify(text, warning=True)
            self._repeat(Halt(halt.link, halt.at, halt.number, False, (drive,), trouble=halt.trouble))

    def _superseded(self, halt: Halt) -> bool:
        """Whether a later stop of the whole link confirms it."""
        return self.last is not None and self.last.number > halt.number

    def _write(self, halt: Halt) -> None:
        self._link.stops += 1
        if halt.whole:
            self._roster.conversations.stop(None)
        if self._link.lost:
            self._ahead = None
            halt.trouble.append("lost")
            return
        with apart(f"the stop of {halt.link.name}", halt.trouble):
            self._cut(halt)
        if not halt.whole:
            self._roster.conversations.stop(drive.state for drive in halt.affected)

    def _cut(self, halt: Halt) -> None:
        """Write the bytes first; then tell the line."""
        at = self._link.now()
        stop, forms = self._take_over(halt) or self._write_now(halt)
        halt.data = stop.data
        halt.missed.update(forms.missed)
        if not halt.whole:
            halt.others = self._also_stopped(halt)
        self._link.stopped(stop, at, None if halt.whole else {*GLOBAL, *(drive.address for drive in halt.affected)})
        for drive in halt.affected:
            drive.state.stopped()

    def _take_over(self, halt: Halt) -> tuple[WrittenStop, StopForms] | None:
        """Return what another thread has written already; only a stop of the whole link takes it over."""
        ahead = self._ahead
        if halt.whole:
            self._ahead = None
            self._link.take_over()
        return ahead

    def _write_now(self, halt: Halt) -> tuple[WrittenStop, StopForms]:
        forms = stop_forms(self._roster, None if halt.whole else halt.drives)
        written: list[WrittenStop] = []

        def stop(cut: bool) -> bytes:
            written.append(forms.written(cut))
            return written[-1].data

        self._link.write_stop(forms.framed, stop, halt.trouble)
        return written[-1], forms

    def _also_stopped(self, halt: Halt) -> tuple[Drive, ...]:
        others = [drive for drive in self._roster.all_drives if drive not in halt.drives]
        return tuple(drive for drive in others if _hears(drive, halt.data))

    def _publish(self, halt: Halt) -> None:
        if halt.data:
            self._link.publish(Traffic(self._link.now(), True, halt.data))
        self._link.advance()


def _hears(drive: Drive, data: bytes) -> bool:
    """Whether the bytes of a stop of other drives stop this one, too."""
    state = drive.state
    return drive.codec.hears_stop(data, drive.address or state.name, not state.settings_unknown)
