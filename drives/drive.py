"""One address on a bus, with what is known of the drive there."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from dialects import Codec, DriveError, DriveState, Kind, Motion, Priority, Procedure, Refused, SourceLine, Stopped
from drives.events import Changed, Transaction

if TYPE_CHECKING:
    from drives.bus import Bus

T = TypeVar("T")
ASKING = {Kind.PRINT, Kind.LIST, Kind.QUIET}
"""What is asked and moves nothing."""
GLOBAL = ("*", "^")
"""Addresses that several drives hear: all of them, and all that are queued (MCode QD=1)."""


@dataclass(frozen=True)
class Seen:
    """The last reading of a drive's motion."""

    at: float
    """When it was asked for, s of the bus's clock."""
    velocity: int
    """That of its fastest axis, signed, a second."""


class Drive:
    """A drive to talk to. Its methods raise Refused, NoAnswer, Stopped, Inexpressible or TransportLost."""

    def __init__(self, bus: Bus, state: DriveState) -> None:
        self.bus = bus
        self.state = state
        self.label = ""
        self.transferring = False
        """A program is on its way: the drive will not be free for a while."""
        self.seen: Seen | None = None
        self.started_at = float("-inf")
        """When something was last sent to it that can start motion or a program."""
        self.commands = 0
        """Requests that were written to it and may do more than ask."""

    @property
    def address(self) -> str:
        """What it is called on the wire; empty where it needs no address."""
        return self.state.address

    @property
    def codec(self) -> Codec:
        """Its language, as it is set."""
        return self.state.codec

    @property
    def product(self) -> str:
        """The product's short name, such as LMDCM; empty where it is not known."""
        return self.state.product

    @property
    def version(self) -> str:
        """What it said of its version."""
        return self.state.version

    @property
    def programming(self) -> bool:
        """In program mode: every line is stored."""
        return self.state.programming

    @property
    def shown(self) -> str:
        """How a person reads of it: its address, or the bus where it has none."""
        return self.address or self.bus.name

    async def send(self, text: str) -> tuple[str, ...]:
        """Send a line in the drive's own language; what it printed."""
        if self.starts(text):
            self.starts_now()
        if self.address in GLOBAL and not self.codec.broadcasts:
            return await self._to_each(text)
        talk = self.codec.perform(self.state, text)
        return await self._run(self._to_all(talk) if self.address in GLOBAL else talk)

    def starts(self, text: str) -> bool:
        """Whether a line can start motion or a program in it; in program mode it is stored."""
        return not self.programming and self.codec.starts_motion(text)

    def starts_now(self) -> None:
        """Note that something is being sent that can start it; all of the line, where it goes to all."""
        for each in self.bus.all_drives if self.address in GLOBAL else [self]:
            each.started_at = self.bus.now()

    def hears_stop(self, data: bytes) -> bool:
        """Whether a stop of other drives, as written, stops this one, too."""
        return self.codec.hears_stop(data, self.address or self.state.name, not self.state.settings_unknown)

    async def _to_each(self, text: str) -> tuple[str, ...]:
        """To every drive that is known, one after the other; what fails with one is told when all were told."""
        printed: list[str] = []
        failures: list[DriveError] = []
        for drive in self.bus.all_drives:
            try:
                printed += await drive.send(text)
            except Stopped:
                raise
            except DriveError as failure:
                failures.append(failure)
        if failures:
            raise failures[0]
        return tuple(printed)

    def _to_all(self, talk: Procedure[T]) -> Procedure[T]:
        """A command that every drive hears: none may be storing a program when it goes out, not when it is typed."""
        others = self.bus.all_drives
        if names := [drive.shown for drive in others if drive.programming]:
            raise Refused(
                f"{', '.join(names)}: in program mode a command to all would be stored; leave it with PG first"
            )
        result = yield from talk
        for drive in others:
            drive.state.settings_unknown = drive.state.settings_unknown or self.state.settings_unknown
        return result

    async def list_program(self, start: str = "") -> list[str]:
        """The program in it from a label or address, as the drive lists it."""
        self.transferring = True
        try:
            return list(await self._run(self.codec.listing(self.state, start)))
        finally:
            self.transferring = False

    async def download(self, lines: Sequence[SourceLine], progress: Callable[[int, int], None] | None = None) -> None:
        """Send a program file; `progress` is called with lines done and lines in all."""
        self.transferring = True
        try:
            await self._run(self.codec.download(self.state, lines, progress or (lambda done, total: None)))
        finally:
            self.transferring = False

    async def motion(
        self, priority: Priority = Priority.OPERATOR, ended: Callable[[Transaction], None] | None = None
    ) -> tuple[Motion, ...]:
        """Position and velocity of each axis."""
        asked: list[Transaction] = []

        def watch(transaction: Transaction) -> None:
            asked.append(transaction)
            if ended:
                ended(transaction)

        axes = await self._run(self.codec.motion(self.state, priority), watch)
        self.seen = Seen(asked[0].sent_at, max((axis.velocity for axis in axes), key=abs))
        return axes

    async def still(self) -> bool:
        """Whether the drive says that it does not move."""
        return not await self._run(self.codec.moving(self.state))

    async def busy(self) -> bool:
        """Whether a program runs in it."""
        return await self._run(self.codec.busy(self.state))

    async def run(self, talk: Procedure[T]) -> T:
        """A conversation that its language offers besides those above."""
        return await self._run(talk)

    async def _run(self, talk: Procedure[T], ended: Callable[[Transaction], None] | None = None) -> T:
        before = (self.address, self.programming, self.codec)
        commanded = self.address in self.bus.unlisted
        if self.address not in GLOBAL and self.address not in self.bus.drives:
            self.bus.unlisted[self.address] = self

        def watch(transaction: Transaction) -> None:
            nonlocal commanded
            if transaction.request.kind not in ASKING:
                commanded, self.commands = True, self.commands + transaction.sent
            if ended:
                ended(transaction)

        try:
            return await self.bus.run(talk, self.state, watch)
        except (Stopped, asyncio.CancelledError):
            commanded = True
            raise
        finally:
            self.bus.conversation_ended(self, before[0], commanded)
            if (self.address, self.programming, self.codec) != before:
                self.bus.publish(Changed(self.bus.now(), self.address))
