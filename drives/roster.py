"""The drives of a link: those found, those only addressed, and those being looked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from multidrop.dialects import DriveState, Family
from multidrop.dialects.families import family_of
from multidrop.drives.conversations import Conversations
from multidrop.drives.drive import Drive
from multidrop.drives.keeping import GLOBAL
from multidrop.drives.link import Link
from multidrop.drives.restarts import Restarts

PRINT_QUIET = 0.1
"""Quiet time after a print before the next poll of a party line, s."""
LONGEST_WAIT = 0.2
"""Longest time for which prints hold up a poll, s."""


class Roster:
    """Every drive that a stop of the link must reach."""

    def __init__(self, conversations: Conversations, family: Family[Any]) -> None:
        self.conversations = conversations
        self.family = family
        self.drives: dict[str, Drive] = {}
        """The drives found, by address."""
        self.unlisted: dict[str, Drive] = {}
        """Drives that were addressed and are not among those found: a stop must reach them, too."""
        self.probing: tuple[str, ...] = ()
        """Addresses of the drives that are being looked for."""
        self.restarts = Restarts(self.link)
        self.stated: tuple[str, ...] = ()
        """The addresses that the first search was given."""
        self.on_stored_stop: Callable[[Drive], None] = lambda drive: None
        """Called with a drive that has stored a stop instead of executing it."""
        self.link.on_unsolicited = self._unsolicited

    @property
    def link(self) -> Link:
        """The link that they are on."""
        return self.conversations.link

    @property
    def all_drives(self) -> list[Drive]:
        """Every drive found on the link or addressed by the user."""
        return list({**self.unlisted, **self.drives}.values())

    def probes(self, address: str) -> None:
        """Have a stop reach a drive that replied and is not listed."""
        self.probing = tuple(dict.fromkeys((*self.probing, address)))

    def found(self, state: DriveState) -> None:
        """List a drive that identification has found."""
        self.drives[state.address] = Drive(self.conversations, self, state)
        self._follow()

    def settings_may_have_changed(self, drives: Iterable[Drive]) -> None:
        """Note that these drives may be set as they were saved by now: a stop of them takes every form."""
        for drive in drives:
            drive.state.settings_may_have_changed()

    def found_again(self, states: Sequence[DriveState]) -> None:
        """Take over what was found after a loss; a drive that is there keeps its `Drive`, also a sole one renamed."""
        before, self.drives = self.drives, {}
        sole = next(iter(before.values())) if len(before) == len(states) == 1 else None
        for state in states:
            drive = before.get(state.address) or sole
            if drive is None:
                drive = Drive(self.conversations, self, state)
            else:
                _compare(drive.state, state)
                state.reference_lost(drive.state.unreferenced)
                self.restarts.replied_again(drive)
                drive.state, drive.missing = state, False
            self.drives[state.address] = drive
        self.unlisted |= {drive.address: drive for drive in before.values() if drive not in self.drives.values()}
        self.settings_may_have_changed(self.unlisted.values())
        self._follow()

    def at(self, address: str) -> Drive:
        """The drive at an address; an unknown one, or all (`*`, `^`), is taken to be set like the first."""
        listed = self.drives.get(address) or self.unlisted.get(address)
        if listed is not None:
            return listed
        like = next((drive.codec for drive in self.drives.values()), self.family.codec)
        state = family_of(like).new_state(like, address)
        if address not in GLOBAL:
            state.settings_may_have_changed()
        return Drive(self.conversations, self, state)

    def conversation_begins(self, drive: Drive) -> bool:
        """List the drive for the stop; return whether it was addressed before without being listed."""
        commanded = drive.address in self.unlisted
        if drive.address not in GLOBAL and drive.address not in self.drives:
            self.unlisted[drive.address] = drive
        return commanded

    def replied_again(self, drive: Drive) -> None:
        """Look for a restart of a drive after a missing reply."""
        if self.drives.get(drive.address) is drive:
            self.restarts.replied_again(drive)

    def homes(self, drive: Drive, axis: str) -> None:
        """Watch a homing of an axis whose position does not count."""
        self.restarts.homes(drive, axis)

    def conversation_ended(self, drive: Drive, before: str, commanded: bool) -> None:
        """Update the list. `before`: the address at the start, which DN and PY change."""
        if self.drives.get(before) is drive and drive.address != before:
            self.drives = {each.address: each for each in self.drives.values()}
        if not commanded or self.drives.get(drive.address) is drive:
            self.unlisted.pop(before, None)
        self._follow()

    def _follow(self) -> None:
        """Have unsolicited lines parsed in the language of the first drive."""
        inbox = self.link.line.inbox
        inbox.codec = next((drive.codec for drive in self.drives.values()), inbox.codec)

    def _unsolicited(self, lines: Sequence[str]) -> None:
        """Note and report a restart: the drive is set as it was saved; and a drive that stored a stop."""
        codec = self.link.line.inbox.codec
        for address in dict.fromkeys(filter(None, map(codec.stored_stop, lines))):
            drive = self.at(address)
            drive.state.found_storing()
            self.on_stored_stop(drive)
        if not any(map(codec.restarted, lines)):
            return
        for drive in self.drives.values():
            self.restarts.replied_again(drive, "sign-on" if len(self.drives) == 1 else "")
            drive.state.restarted(alone=len(self.drives) == 1)
        which = f"one of {', '.join(self.drives)}" if len(self.drives) > 1 else next(iter(self.drives), "")
        text = f"{which or 'the drive'} was restarted (sign-on); its settings are read before the next line"
        self.link.notify(text, warning=True)


def _compare(before: DriveState, now: DriveState) -> None:
    """Note in one line that another drive replies, or the same one with other settings."""
    who = now.address or "the drive"
    if not (now.product and before.product):
        return
    differences = [
        f"{word} {was} before, {read} now"
        for word, was, read in (
            ("product", before.product, now.product),
            ("version", before.version, now.version),
            ("part", before.part, now.part),
            ("serial number", before.serial, now.serial),
        )
        if was and read and was != read
    ]
    if differences:
        now.note(f"{who}: another drive replies than before the loss ({'; '.join(differences)})")
    elif now.codec != before.codec or now.address != before.address:
        now.note(f"{who}: its settings are not those of before the loss; they were read again")


class PrintWait:
    """The wait of one poller's next poll after a print. What people and stops ask for never waits for it.

    A program often prints several lines in a row, and on a party line the reply of another drive runs into the next.
    """

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._since: float | None = None

    def left(self, now: float) -> float:
        """Seconds for which the next poll still waits; 0: it may begin."""
        quiet = self._roster.link.line.printed_at + PRINT_QUIET - now
        if quiet <= 0 or len(self._roster.drives) < 2:
            self._since = None
            return 0.0
        self._since = now if self._since is None else self._since
        left = min(quiet, self._since + LONGEST_WAIT - now)
        if left <= 0:
            self._since = None
        return max(left, 0.0)
