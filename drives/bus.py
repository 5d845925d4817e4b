"""A bus: a link with its drives, their telemetry and their stop. What a session holds."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from multidrop.base.errors import TransportLost
from multidrop.dialects import DriveState, Hints, Procedure, Started
from multidrop.dialects.families import DEFAULT, FAMILIES
from multidrop.drives.conversations import Conversations
from multidrop.drives.drive import Drive
from multidrop.drives.events import Changed
from multidrop.drives.line import DEFAULT_TIMEOUT, Line
from multidrop.drives.link import Link, Reserved
from multidrop.drives.port_journal import Keeper
from multidrop.drives.roster import Roster
from multidrop.drives.stopping import Halt, Stopping
from multidrop.drives.telemetry import Telemetry
from multidrop.transports import Transport

T = TypeVar("T")


class Bus:
    """An open line with its drives. All methods but `stop_ahead` are called from the event loop's thread."""

    def __init__(
        self,
        name: str,
        transport: Transport,
        *,
        baud: int = 0,
        local_echo: bool = False,
        timeout: float = DEFAULT_TIMEOUT,
        family: str = "",
        keeper: Keeper | None = None,
    ) -> None:
        keeper = keeper or Keeper()
        assumed = FAMILIES[family or DEFAULT]
        self.line = Line(assumed.codec, baud=baud, local_echo=local_echo, timeout=timeout)
        self.link = Link(name, transport, self.line, keeper)
        self._conversations = Conversations(self.link, keeper)
        self.witnesses = self._conversations.witnesses
        """The functions called at the end of every conversation."""
        self.keeper = keeper
        self.silent = ""
        """Why no drive is listed: the failure of the search for them; empty: none has failed."""
        self.roster = Roster(self._conversations, assumed, keeper)
        self.telemetry = Telemetry(self.roster)
        self._stopping = Stopping(self.roster)

    @property
    def name(self) -> str:
        return self.link.name

    @property
    def lost(self) -> TransportLost | None:
        """The loss of the port, until its drives are found again; None otherwise."""
        return self.link.loss

    def start(self) -> None:
        """Begin to read the line."""
        self.link.start()

    def now(self) -> float:
        """The time on the clock of the line, s."""
        return self.link.now()

    def watch(self, callback: Callable[[Any], None], *kinds: type) -> Callable[[], None]:
        """Call back with every event of these kinds; see `Publisher.subscribe`."""
        return self.link.watch(callback, *kinds)

    def notify(self, text: str, address: str = "", warning: bool = False) -> None:
        """Publish a notice for a person."""
        self.link.notify(text, address, warning)

    async def run(self, procedure: Procedure[T], state: DriveState, searching: bool = False) -> T:
        """Run a conversation to its end; see `Conversations.run`."""
        return await self._conversations.run(procedure, state, searching)

    # Drives

    def at(self, address: str) -> Drive:
        """The drive at an address, listed or not; see `Roster.at`."""
        return self.roster.at(address)

    @property
    def drives(self) -> dict[str, Drive]:
        return self.roster.drives

    @property
    def all_drives(self) -> list[Drive]:
        return self.roster.all_drives

    async def identify(self, hints: Hints) -> list[Drive]:
        """Find the drives on the line and how they are set. Raises NoAnswer if none answers."""
        self.roster.stated = hints.drives
        for state in await self.roster.search(hints):
            self.roster.found(state)
        await self.roster.search_over()
        self.link.publish(Changed(self.now()))
        return list(self.drives.values())

    async def search(self, procedure: Procedure[T]) -> T:
        """Run a search that lists no drive; a stop reaches every drive all the same."""
        family = self.roster.family
        results = await self._conversations.run(procedure, family.new_state(family.codec, ""), searching=True)
        if not self.link.departure.under_way:
            self.link.departure.cleared()
        return results

    async def add(self, found: Iterable[DriveState]) -> None:
        """List drives that such a search has found."""
        for state in found:
            self.silent = ""
            self.roster.found(state)
        await self.roster.search_over()
        self.link.publish(Changed(self.now()))

    # A person's own bytes

    async def reserve(self) -> None:
        """Wait until no conversation is under way, then keep every request off the line, but for a person's bytes.

        `find_again` ends that.
        """
        self.telemetry.pause()
        try:
            while ends := [conversation.over for conversation in self._conversations.under_way]:
                await asyncio.wait(ends)
        except asyncio.CancelledError:
            self.telemetry.resume()
            raise
        self.link.reserved = Reserved(f"{self.name} is raw: typed text goes to the port; /raw off finds its drives")
        self.link.publish(Changed(self.now()))

    # A line on which no drive has replied

    def unanswered(self, why: str) -> None:
        """Go on with the line, although no drive has replied."""
        self.silent = why
        self.link.resumed()
        self._stopping.count_as_done()
        self.telemetry.resume()
        self.link.publish(Changed(self.now()))

    def set_baud(self, baud: int) -> None:
        """Count with another baud rate, to which the port was set."""
        self.line.baud = self.keeper.baud = baud
        self.line.byte_time = 10.0 / baud if baud else 0.0

    # The return of a lost port

    def resume(self, transport: Transport) -> Halt | None:
        """Go on with another transport in place of the lost one; return the stop that was written first, if any.

        Until `find_again` has returned, nothing but the search for the drives and stops is written.
        """
        self.roster.probing = self.roster.stated
        self.link.resume(transport)
        halt = self._stopping.resume()
        self.roster.settings_may_have_changed(self.all_drives)
        return halt

    async def find_again(self, hints: Hints, *, release: bool = False) -> None:
        """Find the drives and their settings again, after `resume` or to `release` a reserved line. Moves nothing.

        `hints` are those of the first search. Raises NoAnswer, Stopped or TransportLost; the bus stays lost or reserved
        then. A reserved line that is back stays reserved, and nothing is searched for.
        """
        if self.link.reserved and not release:
            self.link.resumed()
            self._stopping.count_as_done()
            self.link.publish(Changed(self.now()))
            return
        if ends := [conversation.over for conversation in self._conversations.under_way]:
            await asyncio.wait(ends)
        self.roster.found_again(await self.roster.search_again(hints))
        self.silent = ""
        await self.roster.search_over()
        self.link.resumed()
        self.link.reserved = None
        self._stopping.resumed()
        self.telemetry.resume()
        self.link.publish(Changed(self.now()))

    # Stops

    @property
    def last_stop(self) -> Halt | None:
        return self._stopping.last

    def stop_ahead(self) -> None:
        """Write the stop from any thread; `halt` must follow in the loop."""
        self._stopping.ahead()

    def halt(
        self,
        only: Iterable[Drive] | None = None,
        follows: bool = True,
        *,
        started: Mapping[Drive, Started] | None = None,
    ) -> Halt:
        """Write a stop of all drives or some, and nothing else; see `Stopping.halt`. `halted` must follow."""
        return self._stopping.halt(only, follows, started=started)

    def halted(self, halt: Halt, confirm: bool = True) -> None:
        """Publish a stop, and look for its effect."""
        self._stopping.halted(halt, confirm)

    def stop(self, only: Iterable[Drive] | None = None) -> Halt:
        """Stop every drive at once, or some: both phases, for a caller with one bus."""
        halt = self.halt(only)
        self.halted(halt)
        return halt

    async def stopped(self) -> None:
        """Wait until the last stop was repeated and seen to work, or not."""
        while tasks := self._stopping.tasks:
            await asyncio.wait(tasks)

    async def settled(self) -> None:
        """Wait until the last stop was seen to work, or not, and the conversations of now are over."""
        if ends := {*self._stopping.tasks, *(conversation.over for conversation in self._conversations.under_way)}:
            await asyncio.wait(ends)

    async def close(self) -> None:
        """Remember the drives, end telemetry and conversations, and close the port."""
        self.roster.remember()
        self.telemetry.close()
        self.roster.restarts.close()
        conversations, tasks = self._conversations.under_way, self._stopping.tasks
        for conversation in conversations:
            conversation.interrupt()
        for task in tasks:
            task.cancel()
        self.link.shut()
        await asyncio.gather(*tasks, *(each.over for each in conversations), return_exceptions=True)
        await self.link.close()
