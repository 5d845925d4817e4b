"""The search for the drives of a link: at first, and again after a loss. It moves nothing."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects import DriveState, Hints, NoAnswer
from multidrop.dialects.families import FAMILIES
from multidrop.drives.conversations import Conversations
from multidrop.drives.keeping import Keeper
from multidrop.drives.roster import Roster


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
