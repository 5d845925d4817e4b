"""Stops of a link, in two phases: write the bytes, then publish it and confirm that it works.

1. The thread that reads the keys calls `Stopping.ahead` for each link: `stop_forms` makes the bytes, and the transport
   writes them past every queue, whatever the event loop does (`StopAhead`).
2. In the loop `Stopping.halt` takes that over, or writes the stop now. Then the line fails what waits, and notes what
   the drives may hold of a line. A session does this for all links before anything else: none delays another's stop.
3. `Stopping.halted` publishes the stop. The line repeats it in pieces once it is quiet.
4. The drives are read. A stop is believed only when two readings show the drive at rest and no program runs that can
   move it: screen and log must not lie. A drive that still moves and does not slow down is stopped again, and so is one
   whose program runs, unless a command has started it since.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from typing import NamedTuple

from multidrop.dialects import DriveError, DriveState, Stopped, StopPiece
from multidrop.drives.drive import Drive
from multidrop.drives.events import Sample, Traffic, isolated
from multidrop.drives.link import Link
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.roster import Roster
from multidrop.drives.stop_ahead import Begun, StopAhead
from multidrop.drives.stop_forms import stop_forms
from multidrop.transports import TransportLost, Undelivered

TRIES = 3
BETWEEN = 0.1
"""Time between two readings of a drive that may be slowing down, s."""
RAMP = 30.0
"""How long a drive is read that slows down, or was stopped in vain, s."""
AGAIN = 3
"""How often a stop is written again for a drive that stored it."""


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

    def fate(self, drive: Drive) -> Fate:
        """What is known of one of its drives now."""
        if self.started_since(drive):
            return Fate.STARTED
        since = max(self.at, drive.started_at)  # a refused line may have run an error routine in the drive
        seen = drive.seen if drive.seen is not None and drive.seen.at > since else None
        runs = drive.running.runs if drive.running is not None and drive.running.at > since else None
        if seen is not None and seen.at_rest(since) and runs is False:
            return Fate.STANDING
        if not self.data or drive in self.missed or isinstance(self.link.lost, Undelivered):
            return Fate.NOT_REACHED
        if (seen is not None and seen.velocity) or runs:
            return Fate.MOVING if seen is not None and seen.velocity else Fate.RUNNING
        return Fate.NOT_KNOWN if self.link.lost or drive in self.doubts else Fate.SENT


class Stopping:
    """Stops the drives of one link."""

    def __init__(self, roster: Roster) -> None:
        self.last: Halt | None = None
        """The last stop of the whole link."""
        self._roster = roster
        self._link = roster.link
        self._ahead = StopAhead(roster.link, partial(stop_forms, roster), self._went_on)
        self._missed = False
        """Another thread's stop found the link lost, and the loop has not taken that over."""
        self._unconfirmed: list[Halt] = []
        """Stops that are not confirmed yet, or that a loss kept from the drives or from being confirmed."""
        self._tasks: dict[asyncio.Task[None], None] = {}
        roster.on_stored_stop = self._stored

    @property
    def tasks(self) -> list[asyncio.Task[None]]:
        """The stops that are being confirmed."""
        return list(self._tasks)

    # The bytes

    def ahead(self) -> None:
        """Write the stop of the whole link from any thread, whatever the loop is doing; `halt` must follow in the loop.

        From then until that `halt` the loop writes nothing. Does nothing on a transport that cannot be preempted.
        """
        if self._link.lost:
            self._missed = True
        else:
            self._ahead.press()

    def halt(self, only: Iterable[Drive] | None = None, follows: bool = True) -> Halt:
        """Write a stop of all drives or some, and nothing else: no watcher hears of it before `halted`.

        `follows`: it may be the one that follows a call of `ahead`. Failures go to `Halt.trouble`.
        """
        drives = tuple(self._roster.all_drives if only is None else only)
        halt = Halt(self._link, self._link.stamp(), self._link.stops, only is None, drives)
        if halt.whole:
            self.last = halt
            self._missed = self._missed and not follows
            self._unconfirmed.clear()
        self._unconfirmed.append(halt)
        self._write(halt, follows)
        return halt

    def _write(self, halt: Halt, follows: bool = False) -> None:
        """Write the bytes first; then tell the line."""
        link, conversations = self._link, self._roster.conversations
        link.stops += 1
        if halt.whole:
            conversations.stop(None)
        if link.lost:
            self._ahead.forget()
            halt.trouble.append("lost")
            return
        with isolated(f"the stop of {link.name}", halt.trouble):
            at, ahead = link.now(), self._ahead.take(halt.whole and follows)
            written = ahead or self._write_now(halt)
            halt.data, halt.written = written.data, tuple(data for _, data in written.written)
            halt.missed.update(written.forms.missed)
            # A late reply to the stop of one would pass for that to a request of another, with its mark behind it.
            repliers = [drive for drive in self._roster.all_drives if drive.state.codec.stop_replies]
            only = None
            if not halt.whole:  # the bytes may stop other drives as well
                others = [drive for drive in self._roster.all_drives if drive not in halt.drives]
                halt.others = tuple(drive for drive in others if _hears(drive.state, halt.data))
                only = {*GLOBAL, *(drive.address for drive in (*halt.affected, *repliers))}
            since = None if ahead is None else ahead.since(link.line.transmitted)
            link.line.stop(at, *written.pieces, only=only, since=since)
            if written.first is not None:
                link.line.put_first(written.first)
            self._note_written(written)
            for drive in halt.affected:
                drive.state.stopped()
            for drive in repliers:
                drive.state.reply_outstanding()
            # Every drive on the line has refused the rest of a line, or may have.
            if written.invalidates or written.before or link.transport.may_invalidate:
                for drive in self._roster.all_drives:
                    drive.state.line_invalidated()
            self._ahead.watch(written.forms)
        if not halt.whole:
            conversations.stop(drive.state for drive in halt.affected)

    def _note_written(self, begun: Begun) -> None:
        line = self._link.line
        for when, data in begun.written:
            line.wrote(data, when, whole=begun.invalidates and data == begun.data)
            self._link.debris.stop_written(data, line.transmitted)

    def _went_on(self) -> None:
        """Take over the pieces that another thread has written while the loop was held up."""
        link, begun = self._link, self._ahead.take(True)
        if begun is None or link.lost:
            return
        link.line.went_on(begun.pieces, begun.since(link.line.transmitted))
        self._note_written(begun)
        for drive in self._roster.all_drives:
            if drive.state.codec.stop_replies:
                drive.state.reply_outstanding()
        for _, data in begun.written:
            link.publish(Traffic(link.now(), True, data, stop=True))
        self._ahead.watch(begun.forms)
        link.advance()

    def _write_now(self, halt: Halt) -> Begun:
        """Drop what is unsent and write a stop, whatever fails. One that is still leaving is not dropped."""
        link, forms, now = self._link, stop_forms(self._roster, None if halt.whole else halt.drives), self._link.now()
        under_way = Begun(forms, forms.immediate, link.line.transmitted, [*forms.pieces])
        if link.line.only_stop and (link.transport.pending or now < under_way.clear(link.line.byte_time)):
            if halt.whole:
                return under_way
            if forms.gap:  # the gap behind what is leaving comes first, and before the rest of that this stop
                return replace(under_way, pieces=[*forms.repeats], first=StopPiece(forms.immediate, forms.gap))
            begun, dropped = replace(under_way, pieces=[*forms.repeats]), 0
        else:
            begun, dropped = Begun(forms, b"", now, [*forms.repeats]), 1
            with isolated(f"taking back what {link.name} has not sent", halt.trouble):
                dropped = link.transport.discard(whole=forms.framed)
            begun.data, begun.invalidates = forms.written(bool(dropped or link.line.half_sent(now)))
        link.transport.write(begun.wrote(begun.data, now, link.line.byte_time))
        return begun

    # What follows

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
        self._ahead.forget()
        open_, self._unconfirmed = self._unconfirmed, []
        drives = {drive: None for halt in open_ for drive in halt.not_started}
        whole = any(halt.whole and len(halt.not_started) == len(halt.affected) for halt in open_)
        whole = whole or bool(self._link.cut) or self._missed
        if not (drives or whole):
            return None
        self._roster.settings_may_have_changed(self._roster.all_drives if whole else drives)
        halt = self.halt(None if whole else drives, follows=False)
        self._publish(halt)
        return halt

    def resumed(self) -> None:
        """Confirm the stops of the loss, now that the drives are found again."""
        for halt in self._unconfirmed:
            self._begin_to_confirm(halt)

    def _begin_to_confirm(self, halt: Halt) -> None:
        task = asyncio.get_running_loop().create_task(self._confirm(halt))
        self._tasks[task] = None
        task.add_done_callback(self._tasks.pop)

    def _publish(self, halt: Halt) -> None:
        for data in halt.written:
            self._link.publish(Traffic(self._link.now(), True, data, stop=True))
        self._link.advance()

    def _repeat(self, halt: Halt) -> None:
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

    # Confirmation

    async def _confirm(self, halt: Halt) -> None:
        await self._read_drives(halt)
        if not self._link.away and halt in self._unconfirmed:
            self._unconfirmed.remove(halt)

    async def _read_drives(self, halt: Halt) -> None:
        """Read the drives of a stop and publish what was found; repeat it for what goes on and does not slow down."""
        link = halt.link
        unconfirmed = list(halt.affected)
        if not unconfirmed:
            link.notify("stop sent; no drive is known here, so no velocity could be read", warning=True)
        before: dict[Drive, Activity] = {}
        active: dict[Drive, Activity] = {}
        tries, until = 0, link.now() + RAMP
        while unconfirmed and link.now() < until:
            found = {drive: await _read(drive, halt) for drive in unconfirmed if not halt.started_since(drive)}
            if self.last is not None and self.last.number > halt.number:
                return  # a later stop of the whole link confirms it, by what is read after that
            for drive, each in found.items():  # whether this reading or a poll after it has confirmed that
                if each.places and each.none and halt.fate(drive) is Fate.STANDING:
                    link.notify(f"{drive.shown}: stopped, velocity 0 at {each.places}")
            active = {drive: each for drive, each in found.items() if not each.none and not halt.started_since(drive)}
            slow_down = all(each.lessens(before.get(drive)) for drive, each in active.items())
            before = found
            if active and not slow_down and tries < TRIES and not link.lost:
                tries += 1
                self._once_more(halt, active, tries)
            # The line of an operator that may start a drive may also be refused, and then nothing has started it.
            undecided = [drive for drive in unconfirmed if halt.started_since(drive) and drive.starting]
            once = [drive for drive, each in found.items() if each.none and halt.fate(drive) is Fate.SENT]
            unconfirmed = [*active, *undecided, *once]
            if unconfirmed:
                await asyncio.sleep(BETWEEN)
        if active and tries < TRIES:
            names = ", ".join(drive.shown for drive in active)
            link.notify(f"{names}: slows down for more than {RAMP:g} s", warning=True)

    def _once_more(self, halt: Halt, active: Mapping[Drive, Activity], tries: int) -> None:
        """Stop again what goes on, or give up and say so."""
        if tries == TRIES:
            halt.vain = True
            for goes_on, moves in (("MOVING", True), ("RUNNING", False)):
                if names := ", ".join(drive.shown for drive, each in active.items() if bool(each.speed) is moves):
                    text = f"STILL {goes_on} after {TRIES} stops: {names}; cut the power"
                    halt.link.notify(text, warning=True)
            return
        for drive, each in active.items():
            does = f"still moves at {each.speed} a second" if each.speed else "its program still runs"
            does = "a stop kept its velocity from being read" if each is ENDLESS else does
            halt.link.notify(f"{drive.shown}: {does}; stop sent again", warning=True)
        self._repeat(halt)


def _hears(state: DriveState, data: bytes) -> bool:
    return state.codec.hears_stop(data, state.address or state.name, not state.settings_unknown)


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


async def _read(drive: Drive, halt: Halt) -> Activity:
    """Read and publish what a drive does; NOTHING also where that cannot be read, which is a doubt of the stop."""
    if drive.programming and not drive.engaged:
        return _not_known(drive, halt, "its velocity cannot be read in program mode")
    try:
        axes = await drive.motion()
        assert drive.seen is not None
        at = drive.seen.transmitted_at
        runs, why = axes[0].program, ""
        if runs is None and not any(axis.velocity for axis in axes):  # a drive that moves is stopped again
            try:
                runs = await drive.busy()
            except Stopped:
                raise
            except (TimeoutError, DriveError, TransportLost) as error:
                why = f"velocity 0 was read, and whether a program runs was not: {error}"
    except Stopped:
        return ENDLESS
    except (TimeoutError, DriveError, TransportLost) as error:
        return _not_known(drive, halt, f"its velocity could not be read: {error}")
    for each in axes:
        drive.link.publish(Sample(at, drive.address, each.position, each.velocity, each.axis, each.trouble, runs))
    if why:
        return _not_known(drive, halt, why)
    halt.doubts.pop(drive, None)
    speed = abs(drive.seen.velocity) if drive.seen is not None else 0
    return Activity(speed, bool(runs), ", ".join(str(each.position) for each in axes))


def _not_known(drive: Drive, halt: Halt, why: str) -> Activity:
    halt.doubts[drive] = why
    drive.link.notify(f"{drive.shown}: stop sent, but {why}", warning=True)
    return NOTHING
