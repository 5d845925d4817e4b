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
from dataclasses import replace
from functools import partial

from multidrop.base.isolation import isolated
from multidrop.dialects import DriveState, Started, StopPiece
from multidrop.drives.drive import Drive
from multidrop.drives.events import Rested, Traffic
from multidrop.drives.halts import Fate as Fate
from multidrop.drives.halts import Halt as Halt
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.roster import Roster
from multidrop.drives.stop_ahead import BegunStop, StopAhead
from multidrop.drives.stop_forms import StopForms, single_forms, stop_forms
from multidrop.drives.stop_readings import ENDLESS, Activity, read_activity

STOP_TRIES = 3
READING_PAUSE = 0.1
"""Time between two readings of a drive that may be slowing down, s."""
LONGEST_SLOWING = 30.0
"""Longest time for which a drive is read after a stop while it slows down or goes on, s."""
MOST_STORED_STOPS = 3
"""How often a stop is written again for a drive that stored it."""


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

    def halt(
        self,
        only: Iterable[Drive] | None = None,
        follows: bool = True,
        *,
        started: Mapping[Drive, Started] | None = None,
    ) -> Halt:
        """Write a stop of all drives or some, and nothing else: no watcher hears of it before `halted`.

        `started`: what was started in each of `only`; only that is stopped, where the line allows it.
        `follows`: a stop of all drives takes over what `ahead` has begun, if anything; with False it leaves that to the
        next one. Failures go to `Halt.trouble`.
        """
        drives = tuple(self._roster.all_drives if only is None else only)
        halt = Halt(self._link, self._link.stamp(), self._link.stops, only is None, drives)
        halt.started = started or {}
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
            # Some drives reply to a stop. Such a reply may be late and pass for the reply to another drive's request,
            # and a mark after that request would confirm it. So the requests to all of these drives end, too.
            repliers = [drive for drive in self._roster.all_drives if drive.state.codec.stop_replies]
            only = None
            if not halt.whole:  # the bytes may stop other drives as well
                halt.others = () if halt.single else self._reached(halt.drives, halt.data)
                only = {*GLOBAL, *(drive.address for drive in (*halt.affected, *repliers))}
            since = None if ahead is None else ahead.since(link.line.transmitted_at)
            link.line.stop(at, *written.pieces, only=only, since=since)
            if written.first is not None:
                link.line.put_first(written.first)
            self._note_written(written)
            if halt.single:
                link.debris.stop_written(b"".join(piece.data for piece in written.pieces), link.line.transmitted_at)
            for drive in halt.affected:
                if not halt.spares_programs(drive):
                    halt.programs.setdefault(drive, _ran(drive, halt))
                drive.state.stopped()
            for drive in (*repliers, *(halt.drives if halt.single else ())):
                drive.state.reply_outstanding()
            # Every drive on the line has refused the rest of a line, or may have.
            if written.invalidates or written.before or link.transport.may_invalidate:
                for drive in self._roster.all_drives:
                    drive.state.line_invalidated()
            self._ahead.watch(written.forms)
        if not halt.whole:
            conversations.stop(drive.state for drive in halt.affected)

    def _note_written(self, begun: BegunStop) -> None:
        line = self._link.line
        for when, data in begun.written:
            line.note_written(data, when, whole=not begun.stops_all or (begun.invalidates and data == begun.data))
            self._link.debris.stop_written(data, line.transmitted_at)

    def _went_on(self) -> None:
        """Take over the pieces that another thread has written while the loop was held up."""
        link, begun = self._link, self._ahead.take(True)
        if begun is None or link.lost:
            return
        link.line.went_on(begun.pieces, begun.since(link.line.transmitted_at))
        self._note_written(begun)
        for drive in self._roster.all_drives:
            if drive.state.codec.stop_replies:
                drive.state.reply_outstanding()
        for _, data in begun.written:
            link.publish(Traffic(link.now(), True, data, stop=True))
        self._ahead.watch(begun.forms)
        link.advance()

    def _reached(self, drives: Iterable[Drive], data: bytes) -> tuple[Drive, ...]:
        """The other drives of the link that the bytes of a stop stop as well."""
        others = [drive for drive in self._roster.all_drives if drive not in drives]
        return tuple(drive for drive in others if _hears(drive.state, data))

    def _write_single(self, halt: Halt, usual: StopForms) -> BegunStop | None:
        """Write a stop of what was started, behind what leaves; None where the usual one stops no more, or must.

        Nothing that is on its way is dropped: a line that is cut off needs the usual stop.
        """
        data = usual.immediate
        reaches_more = self._reached(halt.drives, data) or any(drive.codec.stops_unknown(data) for drive in halt.drives)
        if not (reaches_more or any(map(halt.spares_programs, halt.drives))):
            return None
        forms, link, now = single_forms(halt.started), self._link, self._link.now()
        if forms is None or link.away or link.transport.pending:
            return None
        begun = BegunStop(forms, forms.immediate, now, [*forms.repeats], stops_all=False)
        return begun if link.transport.write(begun.note_written(begun.data, now, link.line.byte_time)) else None

    def _write_now(self, halt: Halt) -> BegunStop:
        """Drop what is unsent and write a stop.

        An earlier stop that is still being sent is not dropped, unless it is for some drives and the new one for all.
        """
        link, forms, now = self._link, stop_forms(self._roster, None if halt.whole else halt.drives), self._link.now()
        line = link.line
        under_way = BegunStop(forms, forms.immediate, line.transmitted_at, [*forms.pieces], stops_all=halt.whole)
        leaving = line.last_write_was_stop and (link.transport.pending or now < under_way.clear(line.byte_time))
        leaving = leaving and (line.stops_all or not halt.whole)  # a stop of some drives holds up none of all
        halt.single = bool(halt.started) and not leaving
        if halt.single and (single := self._write_single(halt, forms)) is not None:
            return single
        halt.single = False
        if leaving:
            if halt.whole:
                return under_way
            if forms.gap:  # wait for the gap after what is being sent, then write this stop before the rest of that
                return replace(under_way, pieces=[*forms.repeats], first=StopPiece(forms.immediate, forms.gap))
            begun, dropped = replace(under_way, pieces=[*forms.repeats]), 0
        else:
            begun, dropped = replace(under_way, data=b"", left=now, pieces=[*forms.repeats], written=[]), 1
            with isolated(f"taking back what {link.name} has not sent", halt.trouble):
                dropped = link.transport.discard(whole=forms.framed)
            begun.data, begun.invalidates = forms.written(bool(dropped or line.half_sent(now)))
        link.transport.write(begun.note_written(begun.data, now, line.byte_time))
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
            self.count_as_done()

    def count_as_done(self) -> None:
        """Count the stops as done on a line whose drives cannot be read: they are not written again after a loss."""
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
        cut = bool(self._link.cut) and not self._roster.strange  # only a person's stop is for a stranger
        whole = whole or cut or self._missed
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
        halt.started = {}
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
        elif drive.programming and halt.stored.count(drive) < MOST_STORED_STOPS:
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
        tries, until = 0, link.now() + LONGEST_SLOWING
        while unconfirmed and link.now() < until:
            activities = {
                drive: await self._read(drive, halt) for drive in unconfirmed if not halt.started_since(drive)
            }
            if self.last is not None and self.last.number > halt.number:
                return  # a later stop of the whole link confirms it, by what is read after that
            for drive, activity in activities.items():  # whether this reading or a poll after it has confirmed that
                if activity.places and activity.none and halt.fate(drive) is Fate.STANDING:
                    name, at = f"{drive.shown}{halt.part_of(drive)}", ", ".join(str(at) for _, at in activity.places)
                    rested = Rested(halt.number, len(halt.affected), name, activity.places)
                    link.notify(f"{name}: stopped, velocity 0 at {at}", drive.address, rested=rested)
            active = {
                drive: activity
                for drive, activity in activities.items()
                if not activity.none and not halt.started_since(drive)
            }
            slow_down = all(activity.lessens(before.get(drive), halt.single) for drive, activity in active.items())
            before = activities
            if halt.single and any(drive in halt.doubts for drive in activities) and not link.lost:
                self._repeat(halt)  # as the usual stop
                unconfirmed = list(halt.affected)
                continue
            if active and not slow_down and tries < STOP_TRIES and not link.lost:
                tries += 1
                self._once_more(halt, active, tries)
            # The line of an operator that may start a drive may also be refused, and then nothing has started it.
            undecided = [drive for drive in unconfirmed if halt.started_since(drive) and drive.starting]
            once = [drive for drive, activity in activities.items() if activity.none and halt.fate(drive) is Fate.SENT]
            unconfirmed = [*active, *undecided, *once]
            if unconfirmed:
                await asyncio.sleep(READING_PAUSE)
        if active and tries < STOP_TRIES:
            names = ", ".join(drive.shown for drive in active)
            link.notify(f"{names}: slows down for more than {LONGEST_SLOWING:g} s", warning=True)

    async def _read(self, drive: Drive, halt: Halt) -> Activity:
        """Read what a drive does; where that cannot be read, it is a doubt of the stop."""
        spares = halt.spares_programs(drive)
        activity, why = await read_activity(drive, halt.started[drive].axes if spares else None)
        if why:
            halt.doubts[drive] = why
            drive.link.notify(f"{drive.shown}: stop sent, but {why}", warning=True)
        elif activity is not ENDLESS:
            halt.doubts.pop(drive, None)
        if spares and halt.single and not why and activity is not ENDLESS:
            halt.rests[drive] = 0 if activity.speed else halt.rests.get(drive, 0) + 1
            return activity._replace(runs=False)
        return activity

    def _once_more(self, halt: Halt, active: Mapping[Drive, Activity], tries: int) -> None:
        """Stop again what goes on, or give up and say so."""
        if tries == STOP_TRIES:
            halt.vain = True
            for goes_on, moves in (("MOVING", True), ("RUNNING", False)):
                if names := ", ".join(
                    drive.shown for drive, activity in active.items() if bool(activity.speed) is moves
                ):
                    text = f"STILL {goes_on} after {STOP_TRIES} stops: {names}; cut the power"
                    halt.link.notify(text, warning=True)
            return
        for drive, activity in active.items():
            does = f"still moves at {activity.speed} a second" if activity.speed else "its program still runs"
            does = "a stop kept its velocity from being read" if activity is ENDLESS else does
            halt.link.notify(f"{drive.shown}: {does}; stop sent again", warning=True)
        self._repeat(halt)


def _ran(drive: Drive, halt: Halt) -> bool | None:
    """Whether a program ran in a drive right before a stop; None: not known."""
    if drive.running is not None and drive.running.at > drive.started_at:
        return drive.running.runs
    what = halt.started.get(drive)
    return True if what is not None and what.program and not what.lasts else None


def _hears(state: DriveState, data: bytes) -> bool:
    return state.codec.hears_stop(data, state.address or state.name, not state.settings_unknown)
