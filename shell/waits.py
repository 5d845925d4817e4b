"""Waits, and the state of drives from fresh readings: where they stand, and which of them would keep moving.

A wait is for a time, for drives to stand, for programs to end, for a value of a drive, or for a text.
"""

from __future__ import annotations

import asyncio
import contextlib
import operator
import re
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Timeout, TransportLost
from multidrop.dialects import Motion
from multidrop.drives.bus import Bus
from multidrop.drives.drive import LEAST_REST, Check, Drive, ProgramReading, confirmed_motion
from multidrop.shell.line_syntax import EVERYONE
from multidrop.shell.motions import MotionWatch, check_own
from multidrop.shell.origin import Origin
from multidrop.shell.stop_report import UNCONFIRMED, last_seen
from multidrop.shell.workspace import Workspace

if TYPE_CHECKING:  # few sessions need it
    from multidrop.shell.units import SessionUnits

WAIT_TIMEOUT = 60.0
"""The default time limit, s."""
READING_INTERVAL = LEAST_REST
"""The time between the two readings of a drive at rest, and between those of a value, s."""
LISTENING = 0.5
"""The time between two looks for a failed motion while a text is awaited, s."""
MOST_SHOWN_LINES = 3
"""The number of lines that a wait for a text shows when it runs out."""
SIGNS: Mapping[str, Callable[[float, float], bool]] = {
    "=": operator.eq,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_CONDITION = re.compile(
    r"(?:@(?P<target>\S+)\s+)?(?P<word>[A-Za-z][A-Za-z0-9_]*)\s*(?P<sign>[=!<>]=|[=<>])\s*(?:(?P<value>[+-]?\d{1,15})|(?P<quantity>\{[^{}]+\}))",
    re.ASCII,
)


@dataclass(frozen=True)
class WaitCondition:
    """A value that a drive must report: `I1=1` of the selected drive, `@b P>=51200` of another one."""

    target: str
    word: str
    sign: str
    value: float
    quantity: str = ""
    """In place of a number, `{100 mm}`; the value is what it is to the drive."""

    @property
    def text(self) -> str:
        """The condition without the drive."""
        return f"{self.word}{self.sign}{self.quantity or self.value}"

    def holds(self, seen: int) -> bool:
        """True if a value that was read fits."""
        return SIGNS[self.sign](seen, self.value)


def condition(text: str) -> WaitCondition | None:
    """Parse a condition; None for another text."""
    match = _CONDITION.fullmatch(text.strip())
    if match is None:
        return None
    target, quantity = match["target"] or "", match["quantity"] or ""
    return WaitCondition(target, match["word"], match["sign"], int(match["value"] or 0), quantity)


def seconds(text: str, wrong: Callable[[str], Exception]) -> float:
    """Parse a time, s: 0 to a day. Raises what `wrong` returns."""
    if not re.fullmatch(r"\d+(\.\d*)?|\.\d+", text, re.ASCII) or float(text) > 86400:
        raise wrong(f"no time {text}; valid: 0 to 86400 seconds")
    return float(text)


async def sleep(duration: float) -> None:
    await asyncio.sleep(duration)


async def wait(
    workspace: Workspace,
    origin: Origin,
    limit: float,
    *,
    idle: bool,
    drives: Sequence[Drive] | None = None,
    said: str = "",
    ended: bool = False,
) -> MotionWatch:
    """Wait until every drive is at rest in two readings, its motion over; with `idle`, also until no program runs.

    `drives` None: those that this session sent a line to, else the selected one. `said`: what a person called this.
    Raises MotionFailed for a motion that did not end as it should, unless `ended` accepts every ending; Timeout after
    `limit` seconds, DriveError for a drive in program mode (it would store the question).
    """
    deadline = workspace.now() + limit
    watch = MotionWatch(workspace, origin, _addressed(workspace) if drives is None else drives, ended)
    for drive in watch.drives:
        _check_asked(workspace, drive)
    await watch.begin()
    while moving := await _moving(workspace, watch, idle):
        if workspace.now() >= deadline:
            verb = said or f"/wait {'ended' if ended else 'idle' if idle else 'stopped'}"
            raise Timeout(f"{verb}: {workspace.display_name(moving)} still runs after {limit:g} s")
        await sleep(READING_INTERVAL)
    return watch


def _addressed(workspace: Workspace) -> list[Drive]:
    """The drives that this session sent a line to, else the selected one."""
    addressed = [(workspace.buses[bus].drives, address) for bus, address in sorted(workspace.addressed)]
    each_of = [(known, known if address in EVERYONE else [address]) for known, address in addressed]
    drives = [known[address] for known, addresses in each_of for address in addresses if address in known]
    return list(dict.fromkeys(drives)) or [workspace.drive()]


async def _moving(workspace: Workspace, watch: MotionWatch, idle: bool) -> Drive | None:
    """The first drive that is not at rest, in one place, in both of two readings, or whose motion is not over.

    The others are read on only as long as a motion of this sequence may have failed there meanwhile.
    """
    before: dict[Drive, tuple[int, ...]] = {}
    moving: Drive | None = None
    for reading in range(2):
        if reading:
            await sleep(READING_INTERVAL)
        for drive in watch.left:
            if (moving is not None and not watch.own(drive)) or (reading and drive not in before):
                continue
            _check_asked(workspace, drive)
            try:
                place = await drive.rest()
                rests = place is not None and before.setdefault(drive, place) == place
                rests = rests and not (idle and await drive.busy())
            except NoAnswer as error:
                watch.silent(drive, error)
                rests = False
                moving = moving or (drive if drive in watch.left else None)
            else:
                watch.heard(drive)
                moving = moving if rests else moving or drive
            if not rests:
                before.pop(drive, None)
    for drive in before:
        if not await watch.judge(drive):
            moving = moving or drive
    return moving


def _check_asked(workspace: Workspace, drive: Drive) -> None:
    """Raise DriveError where the drive would store a question."""
    if drive.programming:
        name = workspace.display_name(drive)
        raise DriveError(f"{name} is in program mode and would store the question; PG ends it")


async def wait_value(
    workspace: Workspace,
    origin: Origin,
    drive: Drive,
    wanted: WaitCondition,
    limit: float,
    units: SessionUnits | None,
    said: str = "/wait",
) -> None:
    """Wait until a drive reports a value. Raises Timeout after `limit` seconds, Diagnostic for no such value.

    It ends early with MotionFailed once a motion of this automation has failed. `units`: where it is a quantity.
    """
    line, name, check = question(workspace, drive, wanted), workspace.display_name(drive), None
    if units is not None:
        number, check, _ = await units.condition(drive, line, wanted.quantity)
        wanted = replace(wanted, value=number)
    deadline = workspace.now() + limit
    while not wanted.holds(seen := await _value(workspace, drive, line, check)):
        if workspace.now() >= deadline:
            raise Timeout(f"{said} {wanted.text}: {name} still reports {seen} after {limit:g} s")
        await check_own(workspace, origin)
        await sleep(READING_INTERVAL)


def question(workspace: Workspace, drive: Drive, wanted: WaitCondition) -> str:
    """The line that asks for the value. Raises Diagnostic."""
    name = workspace.display_name(drive)
    if drive.link.name in workspace.raw:
        raise Diagnostic("is in raw mode, where no drive is asked", drive.link.name, "/raw off ends it")
    line = drive.family.question(wanted.word)
    if line is None or drive.starts(line):
        raise Diagnostic(f"{wanted.word} has no value to wait for", name)
    return line


async def _value(workspace: Workspace, drive: Drive, line: str, check: Check | None) -> int:
    """Ask a drive for a value."""
    name = workspace.display_name(drive)
    _check_asked(workspace, drive)
    printed = await drive.send(line, check)
    if len(printed) != 1 or not re.fullmatch(r"\s*[+-]?\d{1,15}\s*", printed[0], re.ASCII):
        raise DriveError(f"{name}: {line} printed {', '.join(printed) or 'nothing'}; a wait needs a whole number")
    return int(printed[0])


async def wait_text(workspace: Workspace, origin: Origin, text: str, limit: float) -> None:
    """Wait until a drive prints a text; what came since the line before counts.

    It ends early with MotionFailed once a motion of this automation has failed. Raises Timeout after `limit` seconds.
    """
    if not await listened(workspace, origin, partial(workspace.lately.finds, origin, text), limit):
        seen = ", ".join(f'"{line}"' for line in workspace.lately.last(MOST_SHOWN_LINES)) or "nothing"
        raise Timeout(f'/wait "{text}": not printed within {limit:g} s; seen {seen}')


async def listened(
    workspace: Workspace, origin: Origin, finds: Callable[[float], Awaitable[bool]], limit: float
) -> bool:
    """Whether a text comes within `limit` seconds. `finds` waits for it for a time, s.

    Meanwhile the motions of this automation are judged, seldom: what a drive prints by itself can meet a question on
    the line. A drive that cannot be asked says nothing of them. Raises MotionFailed.
    """
    deadline = workspace.now() + limit
    while not await finds(max(0.0, min(LISTENING, deadline - workspace.now()))):
        if workspace.now() >= deadline:
            return False
        with contextlib.suppress(NoAnswer):
            await check_own(workspace, origin)
    return True


FRESH = 1.0
"""The age up to which a reading counts, s."""
PROGRAM_FRESH = 10.0
"""The age up to which it counts whether a program runs, s: the longest time between two readings of conditions."""
ANSWER_LIMIT = 2.0
"""The longest time to read the drives of a bus, s; a silent drive takes half of it."""


@dataclass(frozen=True)
class Standing:
    """Position and velocity of a drive, read now; without axes the reason why they are not known."""

    name: str
    axes: tuple[Motion, ...] = ()
    why: str = ""
    unconfirmed: bool = False
    """It reads velocity 0, and its position may change."""
    places: tuple[str, ...] = ()
    """The position of each axis in its unit, ` (12.5 mm)`; empty where it has no scale."""
    quantities: tuple[tuple[float, str] | None, ...] = ()
    """The same as numbers, each with its unit."""

    @property
    def text(self) -> str:
        """In words: `b is at rest at 51200`."""
        if not self.axes:
            return f"{self.name} not known ({self.why})"
        if self.unconfirmed:
            now = " and ".join(f"{motion.position}{place}" for motion, place in self._placed)
            return f"{self.name} {UNCONFIRMED}; now {now}"
        return f"{self.name} {' and '.join(_axis(*motion) for motion in self._placed)}"

    @property
    def _placed(self) -> list[tuple[Motion, str]]:
        return list(zip(self.axes, self.places or [""] * len(self.axes), strict=True))

    @property
    def fact(self) -> dict[str, Any] | None:
        """The position as an object for programs; None: not known."""
        if not self.axes:
            return None
        facts: dict[str, dict[str, Any]] = {}
        for axis, quantity in zip(self.axes, self.quantities or [None] * len(self.axes), strict=True):
            facts[axis.axis] = {"position": axis.position, "velocity": axis.velocity}
            if quantity is not None:
                facts[axis.axis] |= {"quantity": quantity[0], "unit": quantity[1]}
        return facts[""] if list(facts) == [""] else facts


def _axis(each: Motion, place: str) -> str:
    axis = f"{each.axis} " if each.axis else ""
    at = f"{each.position}{place}"
    return f"{axis}moves at {each.velocity} a second at {at}" if each.velocity else f"{axis}is at rest at {at}"


async def standings(
    workspace: Workspace, drives: Iterable[Drive], units: SessionUnits | None = None
) -> tuple[Standing, ...]:
    """Read the positions of drives: those of one bus in turn, ANSWER_LIMIT at most for each bus."""
    by_bus: dict[str, list[Drive]] = {}
    for drive in drives:
        by_bus.setdefault(drive.link.name, []).append(drive)
    of_buses = await asyncio.gather(*(_standing(workspace, each, units) for each in by_bus.values()))
    return tuple(standing for bus in of_buses for standing in bus)


async def _standing(workspace: Workspace, drives: Sequence[Drive], units: SessionUnits | None) -> list[Standing]:
    """Read the drives of one bus; the line has no time left for those that the limit leaves out."""
    states = {drive: Standing(workspace.display_name(drive), why="no time was left to ask") for drive in drives}
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(ANSWER_LIMIT):
            for drive in drives:
                name = workspace.display_name(drive)
                try:
                    states[drive] = Standing(name, why=_unasked(drive))
                    if not states[drive].why:
                        states[drive] = Standing(name, why="no answer")
                        axes = await confirmed_motion(drive)
                        states[drive] = Standing(
                            name,
                            axes,
                            unconfirmed=not (
                                any(axis.velocity for axis in axes) or (drive.seen and drive.seen.at_rest())
                            ),
                            places=tuple(units.words(drive, axis.axis, axis.position) for axis in axes if units),
                            quantities=tuple(units.given(drive, axis.axis, axis.position) for axis in axes if units),
                        )
                except (DriveError, TransportLost) as failure:
                    states[drive] = Standing(name, why=str(failure).removeprefix(f"{name}: "))
    return [states[drive] for drive in drives]


def _unconfirmed(drive: Drive) -> bool:
    return drive.seen is not None and not drive.seen.velocity and not drive.seen.at_rest()


def _unasked(drive: Drive) -> str:
    """The reason not to ask a drive; empty: it can be asked."""
    if drive.link.away is not None:
        return "the connection is lost"
    return "it is in program mode" if drive.programming else ""


async def in_motion(workspace: Workspace) -> list[str]:
    """A line for each drive that moves or runs a program, and for each known drive whose motion cannot be read."""
    begun = workspace.now()
    await asyncio.gather(*(_read(bus) for bus in workspace.buses.values()))
    lines = []
    for bus in workspace.buses.values():
        for drive in bus.all_drives:
            if text := _described(drive, begun, workspace.now()):
                lines.append(f"{workspace.display_name(drive)} {text}")
    return lines


async def _read(bus: Bus) -> None:
    """Read the drives whose readings are old, in turn; silent drives last, since time may run out."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(ANSWER_LIMIT):
            for drive in sorted(bus.all_drives, key=_last_contact, reverse=True):
                if (not _fresh(drive, bus.now()) or _unconfirmed(drive)) and _answers(drive):
                    with contextlib.suppress(DriveError, TransportLost):
                        await confirmed_motion(drive)
            for drive in bus.all_drives:
                at_rest = _fresh(drive, bus.now()) and drive.seen is not None and not drive.seen.velocity
                if at_rest and _answers(drive) and _program(drive, bus.now()) is None:
                    with contextlib.suppress(DriveError, TransportLost):
                        await drive.busy()


def _program(drive: Drive, now: float) -> ProgramReading | None:
    """True if a program runs in a drive, if that was read lately and after its last start."""
    running = drive.running
    return running if running is not None and running.at > max(now - PROGRAM_FRESH, drive.started_at) else None


def _answers(drive: Drive) -> bool:
    """True if a drive can be asked now: a drive in program mode would store the question."""
    return not drive.programming and not drive.transferring


def _last_contact(drive: Drive) -> float:
    return max(drive.started_at, drive.seen.at if drive.seen is not None else float("-inf"))


def _fresh(drive: Drive, since: float) -> bool:
    """True if a drive was read after its last start, at most FRESH before `since`, and its bus still works."""
    seen = drive.seen
    return seen is not None and seen.at > max(since - FRESH, drive.started_at) and not drive.link.away


def _described(drive: Drive, begun: float, now: float) -> str:
    if _fresh(drive, begun) and drive.seen is not None:
        if _unconfirmed(drive):
            return UNCONFIRMED
        if drive.seen.velocity:
            return f"moves at {drive.seen.velocity} a second"
        running = _program(drive, begun)
        return "runs a program, which may move it" if running is not None and running.runs else ""
    named = drive.product and not drive.state.stranger
    known = named or drive.seen is not None or drive.commands
    return f"is not known: {last_seen(drive, now)}" if known else ""
