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
import math
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from multidrop.base.errors import DriveError, NoAnswer, TransportLost
from multidrop.base.isolation import isolated
from multidrop.dialects import DriveState, Family, Hints, Motion, StopPiece
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.values import Value
from multidrop.drives.conversations import Conversations
from multidrop.drives.drive import Drive, still
from multidrop.drives.events import Restarted
from multidrop.drives.link import Link
from multidrop.drives.port_journal import GLOBAL, Keeper
from multidrop.drives.protected_units import protection, silent
from multidrop.drives.silence import explained

SLOW = 1.0
"""The time that a slow drive gets to reply before its silence is given a cause, s."""
OPENING, OPENING_PLACE, REPAIRS, SLOW_BAUD = 8.0, 4.0, 60.0, 4800
"""The time limit of a search, s: for itself, for each address, for what is owed to drives; at this baud rate and above
with a timeout of 1 s."""
RETRY_PAUSE = 0.25
"""Seconds between two looks at a line that is away, or at a drive that homes."""
BOOT = 1.0
"""Seconds after a sign-on before the drive is asked."""
TOGETHER = 3.0
"""Seconds after a restart in which those of other drives of the line are found, if the same cause restarted them."""
SAME_CAUSE = 60.0
"""Seconds within which a drive that was silent may have been restarted by what has restarted another one."""
MOST_SIGNS = 4
"""Most settings that a message names."""


class Restarts:
    """Looks for restarts of the drives of one link, and for the homings after them."""

    def __init__(self, link: Link, all_drives: Callable[[], Iterable[Drive]]) -> None:
        self._link, self._all_drives = link, all_drives
        self._found: dict[Drive, tuple[float, bool]] = {}
        """When a restart of each drive was last found, and whether it is certain."""
        self._counts: dict[Drive, int] = {}
        self._together: asyncio.Task[None] | None = None
        self._tasks: dict[Drive, asyncio.Task[None]] = {}
        self._homings: dict[tuple[Drive, str], asyncio.Task[None]] = {}

    def replied_again(self, drive: Drive, sign: str = "") -> None:
        """Compare a drive with what was known of it; `sign`: it has shown already that it restarted."""
        # What was known of it, unless a program ran, or something was sent since that can change it.
        rested = drive.rested
        known = [facts for facts, read_at in drive.settings.values() if drive.calm and read_at == drive.commands]
        before = {name: value for facts in known for name, value in facts.items()}
        running = self._tasks.get(drive)
        if (sign or rested or before) and (running is None or running.done()):
            work = partial(self._look, drive, sign, rested, before)
            self._tasks[drive] = self._begin(f"looking for a restart of {drive.shown}", work)

    def homes(self, drive: Drive, axis: str) -> None:
        if (before := self._homings.pop((drive, axis), None)) is not None:
            before.cancel()
        work = partial(self._to_its_end, drive, axis)
        self._homings[drive, axis] = self._begin(f"watching the homing of {drive.shown}", work)

    def close(self) -> None:
        others = [self._together] if self._together is not None else []
        for task in (*self._tasks.values(), *self._homings.values(), *others):
            task.cancel()

    def _begin(self, what: str, work: Callable[[], Coroutine[Any, Any, None]]) -> asyncio.Task[None]:
        async def guarded() -> None:
            trouble: list[str] = []
            with isolated(f"{what} on {self._link.name}", trouble):
                await work()
            if trouble:
                self._link.notify(trouble[0], warning=True)

        return asyncio.get_running_loop().create_task(guarded())

    async def _look(self, drive: Drive, sign: str, rested: Mapping[str, int], before: Mapping[str, Value]) -> None:
        """Read the drive once; say a restart that shows, once.

        `sign`: one that is there already; `rested`: its positions at rest; `before`: its settings as last read.
        """
        await asyncio.sleep(BOOT if sign else 0)
        while self._link.away is not None or drive.programming or drive.transferring:
            await asyncio.sleep(RETRY_PAUSE)
        try:
            axes = await drive.motion()
            settings: dict[str, Value] = {}
            for part in drive.family.values.parts({}) if before else ():
                if part.slow and part.name in drive.settings:
                    settings |= await drive.run(part.read())
        except (DriveError, TransportLost) as failure:
            drive.missing = isinstance(failure, NoAnswer)
            return
        at_rest = all(axis.velocity == 0 for axis in axes)
        jumped = [axis for axis in axes if at_rest and axis.position == 0 != rested.get(axis.axis, 0)]
        changed = [name for name, value in settings.items() if name in before and value != before[name]]
        if not (sign or jumped or changed):
            return self._maybe(drive, rested, axes)
        if drive.hold and drive.state.unreferenced:  # that was said
            return
        if not sign:  # with one, that was recorded as it came
            drive.motions.restarted()
        signs = [sign] if sign else []
        for axis in axes:
            name = f"{axis.axis} " if axis.axis else ""
            was = f"{rested[axis.axis]} before, " if axis.axis in rested else ""
            signs.append(f"{name}position {was}{axis.position} now")
        for name in changed:
            signs.append(f"{_shown(name)} {_text(before[name])} before, {_text(settings[name])} now")
        more = f"; {len(signs) - MOST_SIGNS} more differ" if len(signs) > MOST_SIGNS else ""
        drive.state.reference_lost(axis.axis for axis in axes)
        self.restarted(drive)
        drive.hold = f"it was restarted ({signs[0]})" if drive.strict else ""
        verb = f"/referenced {drive.address}".rstrip()
        self._link.notify(
            f"{drive.shown} was restarted ({'; '.join(signs[:MOST_SIGNS])}{more}): its position is not referenced; "
            f"home it, set its position, or {verb} if it is right",
            drive.address,
            warning=True,
        )

    def count(self, drive: Drive) -> int:
        """How often this drive was restarted so far, or may have been."""
        return self._counts.get(drive, 0)

    def restarted(self, drive: Drive, certain: bool = True) -> None:
        """Record and publish that a drive was restarted, or may have been; then look at the others of its line."""
        now = self._link.now()
        self._found[drive] = now, certain
        self._counts[drive] = self.count(drive) + 1
        drive.state.counts_may_have_changed(restarted=True)
        self._link.publish(Restarted(now, drive.address, certain))
        if certain and (self._together is None or self._together.done()):
            before = {other: other.rested for other in self._all_drives()}
            work = partial(self._look_at_others, before, now)
            self._together = self._begin("looking for restarts of other drives", work)

    async def _look_at_others(self, before: Mapping[Drive, Mapping[str, int]], since: float) -> None:
        """Name the drives that nothing shows to have run on, where another drive of their line was restarted.

        A restart sets positions to 0: a drive that rests where it rested before, and elsewhere, has run on.
        """
        await asyncio.sleep(TOGETHER)
        unsure = []
        for drive, rested in before.items():
            if drive.programming or drive.transferring:
                continue
            try:
                axes = await drive.motion()
            except (DriveError, TransportLost):
                continue  # once it replies again, it is looked at by itself
            if (looking := self._tasks.get(drive)) is not None and not looking.done():
                await asyncio.wait([looking])
            if self._found.get(drive, NEVER)[0] < since - TOGETHER and not _ran_on(rested, axes):
                unsure.append(drive)
        self._unsure(unsure)

    def _maybe(self, drive: Drive, rested: Mapping[str, int], axes: Sequence[Motion]) -> None:
        """Take it that a drive that was silent may have been restarted, if another one of the line was."""
        since = self._link.now() - SAME_CAUSE
        others = any(certain and at >= since for other, (at, certain) in self._found.items() if other is not drive)
        if others and self._found.get(drive, NEVER)[0] < since and not _ran_on(rested, axes):
            self._unsure([drive])

    def _unsure(self, drives: Sequence[Drive]) -> None:
        for drive in drives:
            self.restarted(drive, certain=False)
        if drives:
            names = ", ".join(each.shown for each in drives)
            self._link.notify(
                f"{names} may have been restarted, too, and nothing that can be read shows whether: the program, the "
                f"settings and the position may be other ones than before",
                drives[0].address if len(drives) == 1 else "",
                warning=True,
            )

    async def _to_its_end(self, drive: Drive, axis: str) -> None:
        """Wait until the drive rests; the axis is referenced if nothing was sent in between and no error is set."""
        try:
            while not await still(drive):
                await asyncio.sleep(RETRY_PAUSE)
            ended_well = await drive.homing_ended(axis)
        except (DriveError, TransportLost):
            return
        if ended_well:
            drive.state.referenced(axis)
            name = f" {axis}" if axis else ""
            check = "; check its place, as a homing may leave the position" if axis in drive.anchored else ""
            self._link.notify(f"{drive.shown}{name} is referenced: the homing has ended{check}", drive.address)


NEVER = (-math.inf, False)


def _ran_on(rested: Mapping[str, int], axes: Sequence[Motion]) -> bool:
    """Whether positions show that a drive was not restarted, which sets them to 0: it rests elsewhere, as before."""
    return any(rested.get(axis.axis) == axis.position != 0 for axis in axes)


def _shown(name: str) -> str:
    """A setting as a person knows it: `VM`, `run current 0`."""
    return name.replace("_", " ").lower() if "_" in name else name


def _text(value: Value) -> str:
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


class Roster:
    """Every drive that a stop of the link must reach; their search, after which the keeper remembers them."""

    def __init__(self, conversations: Conversations, family: type[Family], keeper: Keeper) -> None:
        self.conversations = conversations
        self.link = conversations.link
        self.family = family
        self._keeper = keeper
        self.drives: dict[str, Drive] = {}
        """The drives found, by address."""
        self.unlisted: dict[str, Drive] = {}
        """Drives that were addressed and are not among those found: a stop must reach them, too."""
        self.probing: tuple[str, ...] = ()
        """Addresses of the drives that are being looked for."""
        self.sweep: tuple[StopPiece, ...] = ()
        """A stop of the whole link ends with it: of addresses that a search has asked, and that have not replied."""
        self.restarts = Restarts(self.link, lambda: self.drives.values())
        self.stated: tuple[str, ...] = ()
        """The addresses that the first search was given."""
        self.on_stored_stop: Callable[[Drive], None] = lambda drive: None
        """Called with a drive that has stored a stop instead of executing it."""
        self.link.on_unsolicited = self._unsolicited
        self.link.on_unasked = self._came_unasked

    @property
    def all_drives(self) -> list[Drive]:
        return list({**self.unlisted, **self.drives}.values())

    @property
    def strange(self) -> bool:
        """No drive is known here, only a device that did not identify itself, or has not been asked yet."""
        states = [drive.state for drive in self.all_drives] or [self.family.new_state(self.family.codec, "")]
        return all(state.stranger for state in states)

    def probes(self, address: str) -> None:
        """Have a stop reach a drive that replied and is not listed."""
        self.probing = tuple(dict.fromkeys((*self.probing, address)))

    def found(self, state: DriveState) -> None:
        self.drives[state.address] = Drive(self.conversations, self, state)
        if state.product and not state.settings_unknown:
            self.link.heard.replied(state.address)
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
                state.follows(drive.state)
                self.restarts.replied_again(drive)
                state.label = drive.label
                drive.state, drive.missing = state, False
            self.drives[state.address] = drive
        self.unlisted |= {drive.address: drive for drive in before.values() if drive not in self.drives.values()}
        self.settings_may_have_changed(self.unlisted.values())
        self._follow()

    def homes(self, drive: Drive, axis: str) -> None:
        """Watch the homing of a drive to its end."""
        self.restarts.homes(drive, axis)

    def at(self, address: str) -> Drive:
        """The drive at an address; an unknown one, or all (`*`, `^`), is taken to be set like the first."""
        listed = self.drives.get(address) or self.unlisted.get(address)
        if listed is not None:
            return listed
        like = next((drive.codec for drive in self.drives.values()), self.family.codec)
        state = FAMILIES[like.family].new_state(like, address)
        if not self.strange:
            state.identified("", "")  # another name of what is known here
        if address not in GLOBAL:
            state.settings_may_have_changed()
        return Drive(self.conversations, self, state)

    def conversation_begins(self, drive: Drive) -> bool:
        address = drive.state.address
        commanded = address in self.unlisted
        if address not in GLOBAL and address not in self.drives:
            self.unlisted[address] = drive
        return commanded

    def replied_again(self, drive: Drive) -> None:
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

    def _came_unasked(self) -> None:
        for drive in self.drives.values():
            drive.state.came_unasked()

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
            if len(self.drives) == 1:
                drive.motions.restarted()
            self.restarts.restarted(drive, certain=len(self.drives) == 1)
        which = f"one of {', '.join(self.drives)}" if len(self.drives) > 1 else next(iter(self.drives), "")
        text = f"{which or 'the drive'} was restarted (sign-on); its settings are read before the next line"
        self.link.notify(text, warning=True)

    # The search

    async def search(self, hints: Hints) -> list[DriveState]:
        """Find the drives on the line and how they are set. Raises NoAnswer if none answers."""
        self.family = family = FAMILIES[hints.family or self.family.name]
        self.probing = hints.drives or (*hints.tried, *(remembered.address for remembered in hints.remembered))
        unknown = family.new_state(family.codec, "")
        try:
            async with asyncio.timeout(limit := self._limit(hints)):
                return await self.conversations.run(family.identify(hints), unknown, searching=True)
        except TimeoutError:
            failure = NoAnswer(f"no drive could be identified within {limit:.0f} s")
            raise explained(failure, self.link, family.name) from None
        except NoAnswer as error:
            if hints.drives or hints.party or not self.link.unheard or protection(self.link, family) is None:
                raise
            await asyncio.sleep(SLOW)
            raise silent(error, self.link, family) from None

    def _limit(self, hints: Hints) -> float:
        """The longest time of a search, s: a device that sends all the time is asked no longer. Repairs take theirs."""
        line, places = self.link.line, max(1, len(self.probing))
        slow = max(1.0, line.timeout, SLOW_BAUD / line.baud if line.baud else 1.0)
        return slow * (OPENING + OPENING_PLACE * places) + (REPAIRS if hints.cut or hints.owed else 0.0)

    async def search_again(self, hints: Hints) -> list[DriveState]:
        """Search where the drives were before the loss, then where they were at first. Raises as `search`."""
        if not self.drives:
            self.stated = hints.drives
            return await self.search(hints)
        states = [drive.state for drive in self.drives.values()]
        own = (state.restore for state in states if state.restore is not None)
        owed = tuple(dict.fromkeys((*own, *self._keeper.owed)))  # a drive may have been silent at the opening
        mark = max((state.sync_marks for state in states), default=0)
        first = replace(hints, checksum=None, em=None, cut="", owed=owed, remembered=(), first_mark=mark)
        names = tuple(filter(None, self.drives))
        last = replace(first, drives=names, party=bool(names), addressed=bool(names) or hints.addressed)
        try:
            return await self.search(last)
        except NoAnswer:
            if last == first:
                raise
            return await self.search(first)

    async def search_over(self) -> None:
        """Publish and keep what was found, and note that no drive holds a part of a command."""
        for drive in self.drives.values():
            self.conversations.publish_notes(drive.state)
            await self.conversations.keep(drive.state)
        self.probing = ()
        self.link.departure.cleared()
        self.link.leftovers.drives_found()
        self.remember()

    def remember(self) -> None:
        """Have the keeper remember the drives, where their family can be found faster by it."""
        offering = [drive for drive in self.drives.values() if drive.family.offers("remember")]
        known = {drive.address: drive.family.remember() for drive in offering}
        if known:
            self._keeper.remember(known)


def _compare(before: DriveState, now: DriveState) -> None:
    """Note in one line that another drive replies, or the same one with other settings."""
    who = now.label or now.address or "the drive"
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
