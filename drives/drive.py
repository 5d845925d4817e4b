"""One address on a link, with what is known of the drive there."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, TypeVar

from multidrop.base.errors import (
    Differs,
    DriveError,
    Inexpressible,
    MotionFailed,
    NoAnswer,
    Refused,
    Stopped,
    TransportLost,
    Unreferenced,
)
from multidrop.base.files import SourceLine
from multidrop.dialects.codec import Codec, Priority, Procedure
from multidrop.dialects.families import family_of, program_languages
from multidrop.dialects.family import Motion, Programs
from multidrop.dialects.program_files import Held, ProgramFiles
from multidrop.dialects.state import DriveState
from multidrop.dialects.values import Value
from multidrop.drives.conversations import ASKING, Conversation, Conversations, OnOver, awaited, refuse_stranger
from multidrop.drives.counting import Counting
from multidrop.drives.events import Changed, ConversationOutcome, Transaction
from multidrop.drives.line_checks import check_name, check_quantities
from multidrop.drives.link import Link
from multidrop.drives.motion_record import MotionRecord
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.protected_units import TakenValues, protection, silent
from multidrop.drives.readings import LEAST_REST as LEAST_REST
from multidrop.drives.readings import Judged, MotionReading
from multidrop.drives.readings import ProgramReading as ProgramReading

T = TypeVar("T")
NOT_SENT = (Refused, Inexpressible, Differs, MotionFailed)
"""Failures after which a line was not executed."""


class Neighbours(Protocol):
    """The drives of a link, as far as each of them needs the others."""

    @property
    def all_drives(self) -> list[Drive]:
        """Every drive found on the link or addressed by the user."""

    def conversation_begins(self, drive: Drive) -> bool:
        """List the drive for the stop; return whether it was addressed before without being listed."""

    def replied_again(self, drive: Drive) -> None:
        """Look for a restart of a drive after a missing reply."""

    def homes(self, drive: Drive, axis: str) -> None:
        """Watch a homing of an axis whose position does not count."""

    def conversation_ended(self, drive: Drive, before: str, commanded: bool) -> None:
        """Update the list. `before`: the address at the start; `commanded`: more was sent than questions."""


Check = Callable[["Drive"], Procedure[None]]
"""A conversation before a line for a drive. Raises Differs where the drive is not as the line takes it to be."""


class Drive:
    """A drive to talk to. Its methods raise Refused, NoAnswer, Stopped, Inexpressible or TransportLost."""

    def __init__(self, conversations: Conversations, neighbours: Neighbours, state: DriveState) -> None:
        self.state = state
        self.transferring = False
        """A program is being transferred: the drive stays busy for a while."""
        self.seen: MotionReading | None = None
        self.running: ProgramReading | None = None
        self.resting: tuple[float, int, dict[str, int]] = (float("-inf"), 0, {})
        """When its positions were last requested, `commands` then, and the positions, if all axes were at rest."""
        self.calm = False
        """No program was known to run at that time."""
        self.settings: dict[str, tuple[Mapping[str, Value], int]] = {}
        """Settings as last read, by the part of the conditions, and the number of `commands` then."""
        self.anchored: frozenset[str] = frozenset()
        """The axes whose positions are places of the machine: setting a position gives them no reference."""
        self.counting = Counting()
        """What the scales of its axes rest on."""
        self.missing = False
        """It did not reply to the last request; replies since then are not compared yet."""
        self.started_at = float("-inf")
        """When something that can start motion or a program was last sent to it, even if the drive refused it."""
        self.commanded_at = float("-inf")
        """The same without what the drive refused."""
        self.starting = 0
        """Number of lines under way that can start it, and that it may still refuse."""
        self.commands = 0
        """Number of requests sent to it that may do more than ask."""
        self.requests = 0
        """Number of requests sent to it."""
        self.rested_at = float("-inf")
        """When a wait last asked whether it moves, and it did not."""
        self.noted: tuple[float, bool] | None = None
        """When it was last asked both whether it moves and whether a program runs, and whether it did either."""
        self.homings: dict[str, tuple[int, float, int]] = {}
        """What had been sent, and the stops, as the last homing of each axis had begun."""
        self.homed: dict[str, bool] = {}
        """The axes whose last homing was seen to end, and whether it ended well."""
        self.motions = MotionRecord()
        self.hold = ""
        """The reason for which nothing may start it while its position is not referenced; empty: there is none."""
        self.strict = False
        """A restart is such a reason."""
        self.link: Link = conversations.link
        self._conversations = conversations
        self._neighbours = neighbours
        self._judged = Judged()
        self._values = TakenValues()

    @property
    def address(self) -> str:
        """Its address on the wire; empty where it needs none."""
        return self.state.address

    @property
    def state(self) -> DriveState:
        """What the host knows of it: another object once it was found again after a loss."""
        return self._state

    @state.setter
    def state(self, state: DriveState) -> None:
        self._state, self.family = state, family_of(state)

    @property
    def codec(self) -> Codec:
        return self.state.codec

    @property
    def programs(self) -> Programs:
        """Its family's programs. Raises Inexpressible where the host loads none."""
        if self.family.programs is None:
            raise Inexpressible(f"{self.shown}: {self.family.no_programs}")
        return self.family.programs

    @property
    def program_files(self) -> ProgramFiles:
        """Its family's program files. Raises Inexpressible where the host loads none."""
        files = program_languages().get(self.family.name)
        if files is None:
            raise Inexpressible(f"{self.shown}: {self.family.no_programs}")
        return files

    @property
    def product(self) -> str:
        return self.state.product

    @property
    def version(self) -> str:
        return self.state.version

    @property
    def programming(self) -> bool:
        return self.state.programming

    @property
    def stores(self) -> bool:
        """Whether it stores a line that is sent now: not behind a conversation, as a download, which ends that mode."""
        return self.state.programming and not self.engaged

    @property
    def label(self) -> str:
        """The name that a person gave it; empty without one."""
        return self.state.label

    @label.setter
    def label(self, label: str) -> None:
        self.state.label = label

    @property
    def shown(self) -> str:
        """Its name in messages: its label, else its address, or the name of the link where it has none."""
        return self.label or self.address or self.link.name

    @property
    def stops(self) -> int:
        """The number of stops of it so far; a line from before one must not be sent after it."""
        return self._conversations.stops(self.state)

    @property
    def engaged(self) -> bool:
        return self._conversations.engaged(self.state)

    # What is sent

    async def send(self, text: str, check: Check | None = None) -> tuple[str, ...]:
        """Send a line in the drive's own language; return what it printed.

        `check`: runs in the same conversation right before the line, which is not sent if that raises.
        """
        self.check_line(text)
        if starts := self.starts(text):
            self.check_start(text)
        if not starts or self.one_by_one:
            return await self._send(text, check)
        before = {drive: drive.commanded_at for drive in self._meant}
        self.starts_now()
        noted = self.commanded_at
        self.starting += 1
        try:
            return await self._send(text, check)
        except NOT_SENT:
            if self.commanded_at == noted:
                self.commanded_at = before[self]
            raise
        except TransportLost:  # a stop that the loss kept from these drives is still for them
            for drive, at in before.items():
                drive.commanded_at = at if drive.commanded_at == noted else drive.commanded_at
            raise
        finally:
            self.starting -= 1

    def check_line(self, text: str) -> None:
        """Raise Inexpressible for a line that cannot be sent whole, or that its language lacks."""
        check_quantities(self.shown, text)
        self.check_address(text)
        if self.state.address not in GLOBAL or self.codec.broadcasts:  # else each drive that the line is for checks it
            self.family.check_line(text)

    def check_address(self, text: str) -> None:
        """Raise Inexpressible for a line that begins with the address of a drive of this line, as on the wire."""
        drives = [(drive.address, drive.state.name) for drive in self._neighbours.all_drives]
        check_name(self.shown, text, self.family.addressed(text, self.state.product), drives)
        if self.state.address not in (*GLOBAL, *(address for address, _ in drives)):  # `@bMR 5`, without a blank
            whole = f"{self.state.address} {text}"
            check_name(self.shown, f"@{whole}", self.family.addressed(whole, self.state.product), drives)

    async def _send(self, text: str, check: Check | None) -> tuple[str, ...]:
        to_all = self.state.address in GLOBAL
        if self.one_by_one:
            _refuse_while_stored(self.recipients, "end that mode first")
            return await _to_each(self.recipients, text, check)
        procedure = self.family.perform(text)
        if check is not None:
            procedure = _checked(check(self), procedure, self)
        if to_all:
            return await self.run(self._to_all(procedure, text))
        stored, before = self.stores, self._sent
        known = protection(self.link, self.family) if not self.state.address else None
        refused = False
        try:
            printed = await self.run(procedure, typed=True)
        except NoAnswer as error:
            if self.state.address:
                raise
            raise silent(error, self.link, self.family, self.product) from None
        except NOT_SENT as error:
            refused = True
            if isinstance(error, Refused):
                raise self._values.refused(known, text, error, self.product) from None
            raise
        finally:
            if not (refused or stored):
                self._disturbed(text)
        self._values.took(known, text)
        asked = not stored and (self.state.unreferenced or self.starts(text))
        referencing = self.family.referencing(text) if asked else None
        if referencing is not None and referencing.homing:
            self._homes(referencing.axis, before)
            if self.state.unreferenced:
                self._neighbours.homes(self, referencing.axis)
        elif referencing is not None and referencing.axis not in self.anchored:
            self.state.referenced(referencing.axis)
        return printed

    @property
    def rested(self) -> Mapping[str, int]:
        """Its positions as last read at rest; none where a program ran, or something was sent since."""
        at, commands, positions = self.resting
        return positions if self.calm and self.started_at <= at and commands == self.commands else {}

    @property
    def _sent(self) -> tuple[int, float, int]:
        return self.commands, self.started_at, self.link.stops

    def _homes(self, axis: str, before: tuple[int, float, int]) -> None:
        """Note the homing of an axis; it does not disturb those of other axes."""
        now = self.homings[axis] = self._sent
        self.homed.pop(axis, None)
        same = [each for each, sent in self.homings.items() if (sent[0], sent[2]) == (before[0], before[2])]
        self.homings.update(dict.fromkeys(same, now))

    async def homing_ended(self, axis: str) -> bool:
        """Whether the last homing of an axis, after which the drive rests, ended well and as the last command."""
        if axis in self.homed:
            return self.homed[axis]
        sent = self.homings.get(axis)
        well = await self.run(self.family.homed())
        if self.homings.get(axis) == sent:
            self.homed[axis] = well and sent == self._sent
            if self.homed[axis]:
                self.state.referenced(axis)
        return self.homed.get(axis, False)

    def check_start(self, text: str = "") -> None:
        """Raise Unreferenced where a line must not start it, or a drive that the line is for, as `hold` says."""
        for each in [drive for drive in self._meant if drive.hold and drive.state.unreferenced]:
            moved = {field.axis for field in each.family.units.fields(text)}
            ends = each.family.referencing(text) is not None or each.family.only_ends(text)
            if not ends and (not moved or moved & each.state.unreferenced):
                raise Unreferenced(
                    f"{each.shown}: {each.hold}: its position is not referenced, and '{text or 'this'}' was not sent; "
                    f"home it, set its position, or accept() if it is right"
                )

    def _disturbed(self, text: str) -> None:
        """Note the places of the machine that a line, which may have been executed, has left without a reference."""
        if self.anchored:
            self.state.reference_lost(self.anchored.intersection(self.family.units.disturbs(text)))

    def starts(self, text: str) -> bool:
        """Whether a line can start motion or a program in it; in program mode the line is stored."""
        return not self.stores and self.state.codec.starts_motion(text)

    def starts_now(self) -> None:
        """Note that something that can start it is being sent; with a global address, note it for all drives."""
        if self.link.away is None:
            at = self.link.stamp()
            for drive in self._meant:
                drive.started_at = drive.commanded_at = at
                drive._judged.still.clear()

    @property
    def one_by_one(self) -> bool:
        """Whether it stands for all drives of a line whose language has no command to all: each gets its own."""
        return self.state.address in GLOBAL and not self.codec.broadcasts

    @property
    def recipients(self) -> list[Drive]:
        """The drives that get a line for it."""
        return self._neighbours.all_drives if self.one_by_one else [self]

    @property
    def _meant(self) -> list[Drive]:
        return [self, *self._neighbours.all_drives] if self.state.address in GLOBAL else [self]

    def _to_all(self, procedure: Procedure[T], text: str) -> Procedure[T]:
        """Run a command to all; refuse it if a drive stores a program when it goes out, not when it is typed."""
        others = self._neighbours.all_drives
        _refuse_while_stored(others, "leave it with PG first")
        result = yield from procedure
        for drive in others:
            drive._disturbed(text)
            drive.calm = False  # what was read of it before says nothing of what is read next
            drive.resting = (drive.resting[0], drive.commands - 1, {})
            drive.settings.clear()
            if self.state.settings_unknown:
                drive.state.settings_may_have_changed()
        return result

    # Programs

    async def download(
        self,
        lines: Sequence[SourceLine],
        held: Held | None = None,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> Sequence[SourceLine]:
        """Send a program file; call `progress` with lines done and lines in all. Returns the lines sent.

        `held`: what was just read from the drive.
        """
        self.transferring = True
        try:
            return await self.run(self.programs.download(lines, held, progress))
        finally:
            self.transferring = False

    # What is read

    async def motion(self, priority: Priority = Priority.OPERATOR) -> tuple[Motion, ...]:
        return await awaited(lambda over: self.start_motion(priority, over))

    def start_motion(self, priority: Priority, on_over: OnOver[tuple[Motion, ...]]) -> Conversation[tuple[Motion, ...]]:
        """Begin to read position and velocity of each axis."""
        family = self.family

        def over(outcome: ConversationOutcome[tuple[Motion, ...]]) -> None:
            if outcome.error is None:
                assert outcome.first is not None and outcome.last is not None
                axes, at = outcome.result[0], outcome.first.sent_at
                self.seen = self._judged.reading(at, outcome.last.transmitted_at, axes, family.rests_in_place)
                if axes[0].program is not None:
                    self._program_read(at, axes[0].program)
                self.calm = not (self.state.running or (self.running is not None and self.running.runs))
                at_rest = self.seen.velocity == 0
                self.resting = (at, self.commands, {axis.axis: axis.position for axis in axes} if at_rest else {})
            on_over(outcome)

        return self.start(family.motion(priority), over)

    def scale_holds(self, axis: str) -> bool:
        """Whether the scale of an axis rests on what was accepted, as far as is known."""
        return self.counting.holds(axis, self.state.recounts)

    async def rest(self) -> tuple[int, ...] | None:
        """Read whether it rests: None while it moves; else what a reading LEAST_REST later must show again, too."""
        at = self.link.now()
        if await self.run(self.family.moving()):
            return None
        self.rested_at = at
        if not self.family.rests_in_place:
            return ()
        axes = await self.motion()
        return None if any(axis.velocity for axis in axes) else tuple(axis.position for axis in axes)

    async def busy(self) -> bool:
        at = self.link.now()
        runs = await self.run(self.family.busy())
        self._program_read(at, runs)
        return runs

    def _program_read(self, at: float, runs: bool) -> None:
        self.running = ProgramReading(at, runs)
        self.motions.runs(runs)

    async def run(self, procedure: Procedure[T], typed: bool = False) -> T:
        return await awaited(lambda over: self.start(procedure, over, typed))

    def start(self, procedure: Procedure[T], on_over: OnOver[T], typed: bool = False) -> Conversation[T]:
        state = self.state
        address, *_ = before = (state.address, state.programming, state.codec)
        commanded, replied = self._neighbours.conversation_begins(self), False

        def watch(transaction: Transaction) -> None:
            nonlocal commanded, replied
            replied = transaction.replied
            self.requests += transaction.sent
            if transaction.request.kind not in ASKING:
                commanded, self.commands = True, self.commands + transaction.sent
            if transaction.sent:
                for drive in self._meant:
                    drive.counting.sent(transaction.request, drive.family.units, drive.state)

        def over(outcome: ConversationOutcome[T]) -> None:
            self._neighbours.conversation_ended(self, address, commanded or isinstance(outcome.error, Stopped))
            if isinstance(outcome.error, NoAnswer) and not replied:
                self.missing = True
                self.motions.missed()
            elif self.missing and outcome.error is None and not self.state.programming:
                self.missing = False
                self.state.counts_may_have_changed()  # it may have been switched off and on
                self._neighbours.replied_again(self)
            if (self.state.address, self.state.programming, self.state.codec) != before:
                self.link.publish(Changed(self.link.now(), self.address))
            on_over(outcome)

        return self._conversations.start(procedure, state, over, watch, typed=typed)


def _refuse_while_stored(drives: Sequence[Drive], remedy: str) -> None:
    if names := [drive.shown for drive in drives if drive.programming]:
        raise Refused(f"{', '.join(names)}: in program mode a command to all would be stored; {remedy}")


def _checked(check: Procedure[None], procedure: Procedure[T], drive: Drive) -> Procedure[T]:
    refuse_stranger(drive.state, drive.shown)
    yield from check
    return (yield from procedure)


async def _to_each(drives: Sequence[Drive], text: str, check: Check | None) -> tuple[str, ...]:
    """Send to each of these drives in turn; raise the first failure once all have been tried."""
    printed: list[str] = []
    failures: list[DriveError] = []
    for drive in drives:
        try:
            printed += await drive.send(text, check)
        except Stopped:
            raise
        except DriveError as failure:
            failures.append(failure)
    if failures:
        raise failures[0]
    return tuple(printed)


async def confirmed_motion(drive: Drive) -> tuple[Motion, ...]:
    """Read position and velocity of each axis; at velocity 0 once more, unless earlier readings confirm it."""
    axes = await drive.motion()
    if drive.seen is not None and not drive.seen.velocity and not drive.seen.at_rest():
        await asyncio.sleep(LEAST_REST)
        axes = await drive.motion()
    return axes


async def still(drive: Drive) -> bool:
    """Read twice, LEAST_REST apart, whether a drive is at rest."""
    place = await drive.rest()
    if place is None:
        return False
    await asyncio.sleep(LEAST_REST)
    return place == await drive.rest()
