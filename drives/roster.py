"""The drives of a link: those found, addressed only, or being looked for; their search and their restarts.

The search moves nothing. A restart that no drive reports is found by what is read after a silence: a drive that replies
again after a missing reply, or after a loss of its line, is read once: position, and the settings read before. A
restart leaves one of these signs: a sign-on; position 0 where the drive rested elsewhere and nothing was sent, and no
program ran, that can move it; a setting that is another one although nothing was sent that sets it. Without a sign
nothing is claimed: a drive may only have been slow. After a restart the position counts from wherever the drive was,
until a homing or a set position is seen as done. Only reads are sent.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from multidrop.dialects import DriveError, DriveState, Family, Hints, NoAnswer
from multidrop.dialects.families import FAMILIES, family_of
from multidrop.dialects.values import Value
from multidrop.drives.conversations import Conversations
from multidrop.drives.drive import Drive, still
from multidrop.drives.events import isolated
from multidrop.drives.link import Link
from multidrop.drives.port_journal import GLOBAL, Keeper
from multidrop.transports import TransportLost

PAUSE = 0.25
"""Seconds between two looks at a line that is away, or at a drive that homes."""
BOOT = 1.0
"""Seconds after a sign-on before the drive is asked."""
NAMED = 4
"""Most settings that a message names."""


@dataclass(frozen=True)
class Before:
    """What was known of a drive when it replied again."""

    rested: Mapping[str, int]
    """Positions of its axes at rest, if nothing was sent or ran since that can move them."""
    settings: Mapping[str, Value]
    """Settings as last read, if nothing was sent since that sets them."""
    sign: str
    """The sign of a restart that is there already: a sign-on."""


class Restarts:
    """Looks for restarts of the drives of one link, and for the homings after them."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._tasks: dict[Drive, asyncio.Task[None]] = {}
        self._homings: dict[tuple[Drive, str], asyncio.Task[None]] = {}

    def replied_again(self, drive: Drive, sign: str = "") -> None:
        """Compare a drive with what was known of it; `sign`: it has shown already that it restarted."""
        before = Before(_rested(drive), _unchanged(drive), sign)
        running = self._tasks.get(drive)
        if (sign or before.rested or before.settings) and (running is None or running.done()):
            self._tasks[drive] = self._begin(f"looking for a restart of {drive.shown}", self._look(drive, before))

    def homes(self, drive: Drive, axis: str) -> None:
        if (before := self._homings.pop((drive, axis), None)) is not None:
            before.cancel()
        work = self._to_its_end(drive, axis, (drive.commands, drive.started_at))
        task = self._begin(f"watching the homing of {drive.shown}", work)
        self._homings[drive, axis] = task

    def close(self) -> None:
        for task in (*self._tasks.values(), *self._homings.values()):
            task.cancel()

    def _begin(self, what: str, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        async def guarded() -> None:
            trouble: list[str] = []
            with isolated(f"{what} on {self._link.name}", trouble):
                await work
            if trouble:
                self._link.notify(trouble[0], warning=True)

        return asyncio.get_running_loop().create_task(guarded())

    async def _look(self, drive: Drive, before: Before) -> None:
        """Read the drive once; say a restart that shows, once."""
        await asyncio.sleep(BOOT if before.sign else 0)
        while self._link.away is not None or drive.programming or drive.transferring:
            await asyncio.sleep(PAUSE)
        try:
            axes = await drive.motion()
            settings = await self._settings(drive, before) if before.settings else {}
        except (DriveError, TransportLost) as failure:
            drive.missing = isinstance(failure, NoAnswer)
            return
        at_rest = all(axis.velocity == 0 for axis in axes)
        jumped = [axis for axis in axes if at_rest and axis.position == 0 != before.rested.get(axis.axis, 0)]
        changed = [name for name, value in settings.items() if value != before.settings[name]]
        if not (before.sign or jumped or changed):
            return
        signs = [before.sign] if before.sign else []
        for axis in axes:
            name = f"{axis.axis} " if axis.axis else ""
            was = f"{before.rested[axis.axis]} before, " if axis.axis in before.rested else ""
            signs.append(f"{name}position {was}{axis.position} now")
        for name in changed:
            signs.append(f"{_shown(name)} {_text(before.settings[name])} before, {_text(settings[name])} now")
        more = f"; {len(signs) - NAMED} more differ" if len(signs) > NAMED else ""
        drive.state.reference_lost(axis.axis for axis in axes)
        verb = f"/referenced {drive.address}".rstrip()
        self._link.notify(
            f"{drive.shown} was restarted ({'; '.join(signs[:NAMED])}{more}): its position is not referenced; "
            f"home it, set its position, or {verb} if it is right",
            drive.address,
            warning=True,
        )

    @staticmethod
    async def _settings(drive: Drive, before: Before) -> Mapping[str, Value]:
        """Read the known settings again."""
        found: dict[str, Value] = {}
        for part in drive.family.values.parts(drive.state, {}):
            if part.slow and part.name in drive.settings:
                found |= await drive.run(part.read(drive.state))
        return {name: value for name, value in found.items() if name in before.settings}

    async def _to_its_end(self, drive: Drive, axis: str, sent: tuple[int, float]) -> None:
        """Wait until the drive rests; the axis is referenced if nothing was `sent` in between and no error is set."""
        stops = self._link.stops
        try:
            while not await still(drive):
                await asyncio.sleep(PAUSE)
            ended_well = await drive.run(drive.family.homed(drive.state))
        except (DriveError, TransportLost):
            return
        if ended_well and (drive.commands, drive.started_at) == sent and self._link.stops == stops:
            drive.state.referenced(axis)
            name = f" {axis}" if axis else ""
            self._link.notify(f"{drive.shown}{name} is referenced: the homing has ended", drive.address)


def _rested(drive: Drive) -> Mapping[str, int]:
    """The last positions at rest, if no program ran and nothing was sent since that can change them; else none."""
    at, commands, positions = drive.resting
    return positions if drive.calm and drive.started_at <= at and commands == drive.commands else {}


def _unchanged(drive: Drive) -> Mapping[str, Value]:
    """The settings as last read, if no program ran and nothing was sent since that can set them; else none."""
    known = [facts for facts, commands in drive.settings.values() if drive.calm and commands == drive.commands]
    return {name: value for facts in known for name, value in facts.items()}


def _shown(name: str) -> str:
    """A setting as a person knows it: `VM`, `run current 0`."""
    return name.replace("_", " ").lower() if "_" in name else name


def _text(value: Value) -> str:
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


class Roster:
    """Every drive that a stop of the link must reach."""

    def __init__(self, conversations: Conversations, family: Family[Any]) -> None:
        self.conversations = conversations
        self.link = conversations.link
        self.family = family
        self.drives: dict[str, Drive] = {}
        """The drives found, by address."""
        self.unlisted: dict[str, Drive] = {}
        """Drives that were addressed and are not among those found: a stop must reach them, too."""
        self.probing: tuple[str, ...] = ()
        """Addresses of the drives that are being looked for."""
        self.restarts = Restarts(self.link)
        self.homes = self.restarts.homes
        self.stated: tuple[str, ...] = ()
        """The addresses that the first search was given."""
        self.on_stored_stop: Callable[[Drive], None] = lambda drive: None
        """Called with a drive that has stored a stop instead of executing it."""
        self.link.on_unsolicited = self._unsolicited

    @property
    def all_drives(self) -> list[Drive]:
        return list({**self.unlisted, **self.drives}.values())

    def probes(self, address: str) -> None:
        """Have a stop reach a drive that replied and is not listed."""
        self.probing = tuple(dict.fromkeys((*self.probing, address)))

    def found(self, state: DriveState) -> None:
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
        address = drive.state.address
        commanded = address in self.unlisted
        if address not in GLOBAL and address not in self.drives:
            self.unlisted[address] = drive
        return commanded

    def replied_again(self, drive: Drive) -> None:
        """Look for a restart of a drive after a missing reply."""
        if self.drives.get(drive.address) is drive:
            self.restarts.replied_again(drive)

    def conversation_ended(self, drive: Drive, before: str, commanded: bool) -> None:
        """Update the list. `before`: the address at the start, which DN and PY change."""
        address = drive.state.address
        if self.drives.get(before) is drive and address != before:
            self.drives = {each.address: each for each in self.drives.values()}
        if not commanded or self.drives.get(address) is drive:
            self.unlisted.pop(before, None)
        self._follow()

    def _follow(self) -> None:
        """Have unsolicited lines parsed in the language of the first drive."""
        for drive in self.drives.values():
            self.conversations.link.line.inbox.codec = drive.state.codec
            break

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


class Search:
    """Finds drives and their settings, and has the keeper remember them."""

    def __init__(self, roster: Roster, conversations: Conversations, keeper: Keeper) -> None:
        self._roster, self._conversations, self._keeper = roster, conversations, keeper

    async def first(self, hints: Hints) -> list[DriveState]:
        """Find the drives on the line and how they are set. Raises NoAnswer if none answers."""
        roster = self._roster
        roster.family = family = FAMILIES[hints.family or roster.family.name]
        roster.probing = hints.drives or (*hints.tried, *(each.address for each in hints.remembered))
        unknown = family.new_state(family.codec, "")
        return await self._conversations.run(family.identify(hints), unknown, searching=True)

    async def again(self, hints: Hints) -> list[DriveState]:
        """Search where the drives were before the loss, then where they were at first. Raises as `first`."""
        if not self._roster.drives:
            self._roster.stated = hints.drives
            return await self.first(hints)
        states = [drive.state for drive in self._roster.drives.values()]
        owed = tuple(state.restore for state in states if state.restore is not None)
        mark = max((state.sync_marks for state in states), default=0)
        first = replace(hints, checksum=None, em=None, cut="", owed=owed, remembered=(), first_mark=mark)
        names = tuple(filter(None, self._roster.drives))
        last = replace(first, drives=names, party=bool(names), addressed=bool(names) or hints.addressed)
        try:
            return await self.first(last)
        except NoAnswer:
            if last == first:
                raise
            return await self.first(first)

    async def over(self) -> None:
        """Publish and keep what was found, and note that no drive holds a part of a command."""
        for drive in self._roster.drives.values():
            self._conversations.publish_notes(drive.state)
            await self._conversations.keep(drive.state)
        self._roster.probing = ()
        self._conversations.link.departure.cleared()
        self._conversations.link.leftovers.drives_found()
        self.remember()

    def remember(self) -> None:
        """Have the keeper remember the drives, where their family can be found faster by it."""
        states = {drive.address: (drive.family.remember, drive.state) for drive in self._roster.drives.values()}
        known = {address: remember(state) for address, (remember, state) in states.items() if remember is not None}
        if known:
            self._keeper.remember(known)
