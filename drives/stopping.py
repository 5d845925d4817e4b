"""Stops of a link, in two phases: write the bytes, then tell of it and confirm that it works.

The bytes go first, past the queue and past every watcher; then the line fails what waits. A session writes the stops of
all links before it does anything else, so that no link delays the stop of another.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from multidrop.drives.apart import apart
from multidrop.drives.confirm import confirm_stop
from multidrop.drives.drive import Drive
from multidrop.drives.events import Traffic
from multidrop.drives.halt import Halt
from multidrop.drives.keeping import GLOBAL
from multidrop.drives.link import WrittenStop
from multidrop.drives.roster import Roster
from multidrop.drives.stop_forms import StopForms, stop_forms

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
