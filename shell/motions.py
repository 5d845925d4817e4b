"""How motions ended: a line that begins one, and the one place where the end of a motion is judged.

Waits, scripts, macros, typed lines and the Python API come here. Before a line that begins a motion the drive's signs
of failure are read; at rest they are read again, and the family judges them. The record of the drive says whose motion
it was, and who stopped it (`drives.motion_record`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

from multidrop.base.errors import Inexpressible, MotionFailed, NoAnswer, Refused, Stopped, TransportLost
from multidrop.dialects import Procedure
from multidrop.dialects.motions import NO_SIGNS, Ending, Evidence, Motions, MoveKind, Outcome, Signs, joined
from multidrop.drives.drive import NOT_SENT, Check, Drive, still
from multidrop.drives.motion_record import Course, Courses, restart
from multidrop.drives.port_journal import GLOBAL
from multidrop.shell.origin import Origin
from multidrop.shell.workspace import Workspace

T = TypeVar("T")
MISSES = 3
"""Readings in a row without a reply after which nobody knows how a motion ended."""
WORST = (
    Outcome.UNKNOWN,
    Outcome.POWER,
    Outcome.ERROR,
    Outcome.STALL,
    Outcome.LIMIT,
    Outcome.STOPPED,
    Outcome.REPLACED,
    Outcome.REACHED,
)
"""The outcomes, the one to report of several first."""


def failure(name: str, ending: Ending) -> MotionFailed:
    """The error for a motion that failed: `a stopped at 1200 of 4000: stalled`."""
    reason = ending.reason or ending.outcome.value
    return MotionFailed(ending.described(name), reason, ending.position, ending.target, ending.outcome.value)


def _motions(drive: Drive) -> Motions:
    """What the family says of a drive's motions; nothing is asked of a device that did not identify itself."""
    return Motions(drive.state) if drive.state.stranger else drive.family.motions


# Lines


async def send(
    workspace: Workspace, origin: Origin, drive: Drive, text: str, check: Check | None = None
) -> tuple[str, ...]:
    """Send a line as `Drive.send` does, and record what it does to motions.

    Raises MotionFailed where an error shows that a motion of the same automation has failed: before the line, which is
    then not sent, or after it. A person at the session is only told. A line that ends motion is never held back.
    """
    line = _MotionLine(workspace, origin, drive, (text,), check)
    return await line.run(lambda check: drive.send(text, check))


async def perform(workspace: Workspace, origin: Origin, drive: Drive, lines: Sequence[str], work: Procedure[T]) -> T:
    """Run a conversation that does what these lines do, as `send` sends a line."""

    def checked(check: Check | None) -> Procedure[T]:
        if check is not None:
            yield from check(drive)
        return (yield from work)

    return await _MotionLine(workspace, origin, drive, lines, None).run(
        lambda check: drive.run(checked(check), typed=True)
    )


class _MotionsBefore:
    """The motions of a drive before a line."""

    def __init__(self, drive: Drive, courses: Courses, suspects: list[Course]) -> None:
        self.drive, self.courses, self.suspects, self.errors = drive, courses, suspects, drive.state.errors.count


class _MotionLine:
    """A line, the drives that it reaches, and what it does to their motions."""

    def __init__(
        self, workspace: Workspace, origin: Origin, drive: Drive, lines: Sequence[str], check: Check | None
    ) -> None:
        motions = _motions(drive)
        self.by, self._unattended = origin.sequence(workspace), origin.automation is not None
        self.effect = joined(() if drive.stores else [motions.effect(line) for line in lines])
        bus = workspace.buses.get(drive.link.name)
        to_all = bus is not None and drive.address in GLOBAL
        self.reached = bus.all_drives if bus is not None and to_all else [drive]
        self._workspace, self._text, self._check, self._to_all = workspace, " ".join(lines).strip(), check, to_all

    async def run(self, execute: Callable[[Check | None], Awaitable[T]]) -> T:
        """Execute it, with a check right before it, and record what it did."""
        check = self._check
        if self.effect.begins or not self.effect.stops:
            for drive in self.reached:
                if self._may_have_failed(drive):
                    await drive.run(self._judged_before(drive))
        if self.effect.begins and self._to_all:
            await self._prepare_each()
        elif self.effect.begins:
            check = self._checked
        before = [_MotionsBefore(drive, drive.motions.copy(), self._suspect(drive)) for drive in self.reached]
        try:
            result = await execute(check)
        except NOT_SENT as refusal:
            if isinstance(refusal, Refused) and not refusal.certain:
                self._took_effect()
            else:
                for was in before:
                    was.drive.motions.restore(was.courses, self.by)
            if not isinstance(refusal, MotionFailed):
                await self._judge_after(before, f"; {refusal}")
            raise
        except BaseException:
            self._took_effect()
            raise
        self._took_effect()
        await self._judge_after(before, f"; '{self._text}' was executed")
        return result

    def _suspect(self, drive: Drive) -> list[Course]:
        """The motions of this sequence of which an error may be: not those that it has stopped itself."""
        return [course for course in drive.motions.open_of(self.by) if not course.stopped]

    def _may_have_failed(self, drive: Drive) -> bool:
        """Whether something is known already that shows, or may show, that a motion of this sequence has failed."""
        shown = bool(drive.state.error) or self.effect.clears
        return any(course.restarted or shown for course in self._suspect(drive))

    def _took_effect(self) -> None:
        for drive in self.reached:
            drive.motions.effect(self.effect, self.by)

    async def _prepare_each(self) -> None:
        """Read the signs of each drive that a line to all reaches: one that does not reply has none."""
        for drive in self.reached:
            signs = NO_SIGNS
            if not (drive.programming or drive.link.away):
                with contextlib.suppress(Refused, NoAnswer, Inexpressible):
                    signs = await drive.run(self._signs(drive))
            self._record(drive, signs)

    def _checked(self, drive: Drive) -> Procedure[None]:
        """Read the signs of the drive in the conversation of its line, right before that, and record its motion."""
        if self._check is not None:
            yield from self._check(drive)
        self._record(drive, (yield from self._signs(drive)))

    def _signs(self, drive: Drive) -> Procedure[Signs]:
        motions = _motions(drive)
        unsent = f"'{self._text}' was not sent"
        try:
            signs = yield from motions.signs()
        except NoAnswer:
            raise NoAnswer(f"{drive.shown} does not reply: {unsent}") from None
        except Stopped:
            raise Stopped(f"{drive.shown}: stopped; {unsent}") from None
        if self._may_have_failed(drive):
            yield from self._judged_before(drive)
        return (yield from motions.old(signs, True))

    def _record(self, drive: Drive, signs: Signs) -> None:
        motions, state = _motions(drive), drive.state
        courses = []
        for move in self.effect.begins:
            place = None if move.relative is None else motions.place(signs, move.axis)
            if place is not None and move.relative is not None:
                move = replace(move, target=place + move.relative)
            courses.append(Course(move, self.by, signs, state.errors.count, motions.runs(signs), drive.commands))
        drive.motions.begin(courses)
        if courses:
            state.errors.motion(True, any(course.move.kind is MoveKind.PROGRAM for course in courses))

    def _judged_before(self, drive: Drive) -> Procedure[None]:
        """Judge the motions of this sequence whose error the next line would clear. Raises MotionFailed."""
        for course in self._suspect(drive):
            failed = yield from _sign_of(drive, course)
            if failed is not None:
                self._report(drive, failed, f"; '{self._text}' was not sent")

    async def _judge_after(self, before: Sequence[_MotionsBefore], fate: str) -> None:
        """Judge the motions of this sequence of which an error was read with the line. Raises MotionFailed."""
        for drive_before in before:
            drive = drive_before.drive
            if any(map(_motions(drive).fails, drive.state.errors.since(drive_before.errors))):
                for course in drive_before.suspects:
                    failed = await _sign_read(drive, course) if course.open else None
                    if failed is not None:
                        self._report(drive, failed, fate)

    def _report(self, drive: Drive, failed: Ending, fate: str) -> None:
        name = self._workspace.display_name(drive)
        _note_restart(self._workspace, drive, failed)
        if self._unattended:
            error = failure(name, failed)
            error.args = (f"{error}{fate}",)
            raise error
        self._workspace.notify(failed.described(name), bus=drive.link.name, warning=True)


def _sign_of(drive: Drive, course: Course) -> Procedure[Ending | None]:
    """Judge a motion that may be under way still: by a sign of failure only, not by where it is."""
    if (ending := course.cut_off) is None:
        ending = yield from _motions(drive).judge(course.move.axis, _evidence(drive, course))
    if ending is None or ending.outcome in (Outcome.REACHED, Outcome.STOPPED):
        return None
    return _judged(drive, course, ending)


async def _sign_read(drive: Drive, course: Course) -> Ending | None:
    """The same in a conversation of its own: where it fails, the line before it has its outcome all the same."""
    try:
        return await drive.run(_sign_of(drive, course))
    except (Refused, NoAnswer, TransportLost) as error:
        return _judged(drive, course, _unread(course, error))


def _unread(course: Course, error: Exception) -> Ending:
    return Ending(Outcome.UNKNOWN, course.move.axis, reason=f"its end could not be read ({error})")


def _evidence(drive: Drive, course: Course) -> Evidence:
    return course.evidence(drive.state.errors.since(course.errors), drive.commands)


def _judged(drive: Drive, course: Course, found: Ending) -> Ending:
    ending = course.judged(found)
    if not drive.motions.any_open:
        drive.state.errors.motion(False)
    return ending


def _note_restart(workspace: Workspace, drive: Drive, ending: Ending) -> None:
    """Have a restart reported that the end of a motion has shown: positions and settings are other ones now."""
    if ending.restart and (bus := workspace.buses.get(drive.link.name)) is not None:
        drive.motions.restarted()
        bus.roster.restarts.replied_again(drive, ending.restart)


# Waits


class MotionWatch:
    """The motions whose end a wait waits for: those of its own sequence, else whatever moves each drive."""

    def __init__(self, workspace: Workspace, origin: Origin, drives: Sequence[Drive], ended: bool = False) -> None:
        """`ended`: the wait accepts every ending, also of a motion that was judged before."""
        self._workspace, self.drives = workspace, drives
        self._by, self._accepts = origin.sequence(workspace), ended
        self._signs: dict[Drive, Signs] = {}
        self._errors: dict[Drive, int] = {}
        self._restarts = {drive: drive.motions.restarts for drive in drives}
        self._silent: set[Drive] = set()
        self._missed: dict[Drive, int] = {}
        """How many readings in a row got no reply."""
        self.endings: dict[Drive, list[Ending]] = {}
        """How the motions of each drive ended that was judged."""

    def own(self, drive: Drive) -> list[Course]:
        """The motions of this sequence that are not judged yet."""
        return drive.motions.open_of(self._by)

    async def begin(self) -> None:
        """Read the signs of the drives that this sequence did not move."""
        for drive in self.drives:
            if not self.own(drive) and not drive.programming:
                motions, state = _motions(drive), drive.state
                signs = await drive.run(motions.signs())
                self._signs[drive] = await drive.run(motions.old(signs, False))
                self._errors[drive] = state.errors.count

    async def judge(self, drive: Drive) -> bool:
        """Judge the motions of a drive that is at rest; False: one is not over yet. Raises MotionFailed."""
        endings = await (self._judge_own(drive) if self.own(drive) else self._judge_other(drive))
        if endings is None:
            return False
        self.endings.setdefault(drive, []).extend(endings)
        failed = [ending for ending in endings if ending.failed]
        if failed and not self._accepts:
            raise failure(self._workspace.display_name(drive), min(failed, key=_rank))
        return True

    async def _judge_own(self, drive: Drive) -> list[Ending] | None:
        endings = []
        for course in self.own(drive):
            motions, axis = _motions(drive), course.move.axis
            ending = course.cut_off
            try:
                if ending is None:
                    ending = await drive.run(motions.judge(axis, _evidence(drive, course)))
            except (Refused, NoAnswer) as error:
                ending = _unread(course, error)
            if ending is None:
                return None
            endings.append(_judged(drive, course, ending))
            _note_restart(self._workspace, drive, ending)
        return endings

    async def _judge_other(self, drive: Drive) -> list[Ending] | None:
        if drive in self.endings or drive.programming:
            return []
        if self._accepts and (mine := drive.motions.of(self._by)):
            return [course.ending for course in mine if course.ending is not None]
        motions, state = _motions(drive), drive.state
        if drive.motions.restarts != self._restarts[drive]:
            return [restart("")]
        signs = self._signs.get(drive, NO_SIGNS)
        evidence = Evidence(None, signs, state.errors.since(self._errors.get(drive, state.errors.count)))
        endings: list[Ending] = []
        if type(motions) is Motions:
            return endings
        for axis in drive.family.units.axes():
            ending = await drive.run(motions.judge(axis, evidence))
            if ending is None:
                return None
            bad = ending.outcome not in (Outcome.REACHED, Outcome.STOPPED, Outcome.REPLACED, Outcome.UNKNOWN)
            endings.append(replace(ending, failed=bad))
        return endings

    @property
    def left(self) -> list[Drive]:
        """The drives that can still be asked."""
        return [drive for drive in self.drives if drive not in self._silent]

    def heard(self, drive: Drive) -> None:
        """Take a reply of a drive."""
        self._missed.pop(drive, None)

    def silent(self, drive: Drive, error: NoAnswer) -> None:
        """Take a reading without a reply. Raises the error, unless any ending will do.

        One lost reply is no ending, as the drive may move on. After `MISSES` in a row the ending is not known.
        """
        if not self._accepts:
            raise error
        self._missed[drive] = self._missed.get(drive, 0) + 1
        if self._missed[drive] < MISSES:
            return
        self._silent.add(drive)
        for course in self.own(drive):
            _judged(drive, course, Ending(Outcome.UNKNOWN, course.move.axis, reason=str(error)))
        self.endings[drive] = [Ending(Outcome.UNKNOWN, reason=str(error))]

    @property
    def worst(self) -> tuple[Drive, Ending] | None:
        """The ending to report of all."""
        endings = [(drive, ending) for drive, endings in self.endings.items() for ending in endings]
        return min(endings, key=lambda each: _rank(each[1])) if endings else None


def _rank(ending: Ending) -> int:
    return WORST.index(ending.outcome)


async def check_own(workspace: Workspace, origin: Origin, drives: Iterable[Drive] | None = None) -> None:
    """Judge the motions of this automation that have come to rest. Raises MotionFailed for one that failed.

    `drives` None: of every open bus. For waits that ask for something else than the end of a motion.
    """
    by = origin.sequence(workspace)
    every = drives if drives is not None else [each for bus in workspace.buses.values() for each in bus.all_drives]
    for drive in every:
        if drive.motions.open_of(by) and not drive.programming and await still(drive):
            await MotionWatch(workspace, origin, [drive]).judge(drive)
