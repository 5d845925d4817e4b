"""What the acts at the prompt come to, watched where each line and each verb of a session passes.

Typed lines and those of macros and scripts go one way (`Session.run`, then `LinePath` or `VerbPath`). Here each is told
from the other: a line for a drive in program mode is stored, a text for a line in raw mode is only written, and a verb
that works by itself has an end, after which its drives are looked at.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Awaitable
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.shell.line_path import LinePath
from multidrop.shell.line_syntax import DriveLine, VerbLine
from multidrop.shell.origin import Origin
from multidrop.shell.session import VerbPath
from soak.simulation.records.history import Executed
from soak.simulation.records.phrases import PHRASES
from soak.simulation.records.told import Put, Run
from soak.simulation.system.process import Killed
from soak.simulation.world import World

if TYPE_CHECKING:
    from multidrop.shell.session import Session

SETTLED = 5.0
"""The time, s, after an early end in which its stops are confirmed, or a trouble is said."""
RAMP = 1.0
"""The time, s, in which a drive that got its stop stands."""
MOTIONS = ("SL ", "MR ", "MA ", "X", "MVP ")
STOPPED_TOO = "so these stopped too: "
TROUBLE = re.compile(
    r"NOT KNOWN|NOT REACHED|STILL |stop not sent|could not be read|slows down|trying again|not reached"
)


class WatchedPath(LinePath):
    """The way of the lines of a session, watched."""

    def __init__(self, session: Session, world: World) -> None:
        super().__init__(session, session.automations, session.units)
        self._world = world

    async def text(self, parsed: DriveLine, origin: Origin) -> None:
        """Pass a text on; note it where it is stored, or written as it is."""
        put = self._put(parsed, origin)
        try:
            await super().text(parsed, origin)
        except BaseException:
            if put is not None:
                put.sent = False
            raise
        if put is not None:
            put.sent = True

    def _put(self, parsed: DriveLine, origin: Origin) -> Put | None:
        session, history = self._workspace, self._world.history
        typed = parsed.typed.strip()
        with contextlib.suppress(Diagnostic, DriveError):
            bus = session.bus(origin.bus_of_role(parsed.bus))
            if bus.name in session.raw:
                history.commands.pop(typed, None)
                put = Put(session.now(), bus.name, "", str(parsed.text))
                history.told.raw.append(put)
                return put
            drive = session.drive(bus.name, parsed.address)
            waits = not drive.stores or bus._stopping.tasks  # for the end of program mode
            if drive.programming and (command := history.commands.pop(typed, None)) is not None:
                if waits:  # it may be stored or executed, once
                    history.told.repeated[command.line, command.drive, command.text] = 1
                    return None
                put = Put(session.now(), command.line, command.drive, command.text)
                history.told.stored.append(put)
                return put
        return None


class WatchedVerbs(VerbPath):
    """The way of the verbs of a session, watched."""

    def __init__(self, session: Session, world: World) -> None:
        super().__init__(session)
        self._world = world

    async def run(self, parsed: VerbLine, origin: Origin) -> None:
        """Run a verb; one that works by itself has an end."""
        told = self._world.history.told
        if parsed.name == "/resume":
            told.latches.append((self._world.loop.now, False))
        run = told.runs.get(parsed.typed.strip())
        work = super().run(parsed, origin)
        await (work if run is None else watched(self._world, run, work))


async def watched(world: World, run: Run, work: Awaitable[Any]) -> None:
    """Do the work of a run, and note its end; after an early one look at the drives."""
    run.began, run.latches, run.failure = world.loop.now, len(world.history.told.latches), ""
    run.executed = len(world.history.executed)
    if run.download is not None:
        run.download.old = held(world, run.download.line, run.download.drive)
        run.download.restarts = world.restarts(run.download.line, run.download.drive)
    try:
        await work
    except BaseException as failure:
        run.failure = str(failure) or type(failure).__name__
        if not isinstance(failure, Killed):  # a dead process stops nothing
            world.history.told.unexamined[run.typed] = run
            world.loop.call_later(SETTLED, examine, world, run)
        raise
    finally:
        run.ended = world.loop.now
        world.history.note(run.ended, "run", f"{run.typed}: {run.failure or 'done'}")
        if run.download is not None:
            run.download.new = held(world, run.download.line, run.download.drive)
            run.download.restarted = world.restarts(run.download.line, run.download.drive) != run.download.restarts


def held(world: World, line: str, drive: str) -> tuple[str, ...]:
    """The program that a drive holds: its own memory."""
    device = world.witnesses[line, drive].device
    if world.place(line).language in ("mcode", "modbus"):
        return tuple(f"{each.address} {each.text}" for _, each in sorted(device.program.lines.items()))
    if world.place(line).language == "tmcl":
        return ()  # its programs are not downloaded here
    memory = device.programs.memory
    return tuple(f"{at} {memory.line(at)}" for at, code in enumerate(memory.code) if code is not None)


def examine_before_a_stop(world: World) -> None:
    """Look at the drives of the early ends so far: afterwards everything stands."""
    told, now = world.history.told, world.loop.now
    for run in list(told.unexamined.values()):
        if run.ended < now - RAMP and not (world.climate.wire.harmful or world.history.damage):
            examine(world, run)
    told.unexamined.clear()


def examine(world: World, run: Run) -> None:
    """Look at the drives after an early end: what the run had moved stands, and what others had moved goes on."""
    told, now = world.history.told, world.floor.now()
    if told.unexamined.pop(run.typed, None) is not run or run.download is not None:
        return  # a person's own line starts what a download starts
    last = {(each.line, each.drive): each for each in world.history.executed if each.text.startswith(MOTIONS)}
    for placed in world.floor.floor.drives:
        line, drive = placed.bus, placed.spec.name
        before = last.get((line, drive))
        if before is None or placed.unit.shadow is None:
            continue
        moves = any(each.velocity for each in placed.unit.shadow.motion(now))
        text = f"{line}:{drive} after {run.typed!r} ({run.failure}) ended at {run.ended:.3f}"
        since = world.history.executed[run.executed :]
        if (line, drive, before.text) in run.moves and before in since and before.at <= run.ended:
            if moves and not _said(world, line, run.began, TROUBLE):
                told.unstopped.append(f"{text}: {before.text!r} goes on")
        elif (line, drive) in {move[:2] for move in run.moves}:
            continue  # a person's motion of a drive that the run had moved ends with it
        elif not moves and before.at < run.ended and _only_ended_by(world, run, before):
            words = f"{text}: {before.text!r} was not of it, and was stopped"
            if not run.moves and "refused '" in run.failure:
                told.unspared.append(words)
            elif not _stopped_as_well(world, before):
                told.stopped_too.append(words)


def _only_ended_by(world: World, run: Run, started: Executed) -> bool:
    """Whether nothing but the end of a run can have ended a motion that goes on for ever."""
    told, place = world.history.told, world.place(started.line)
    if not PHRASES[place.language].endless or not re.match("SL [1-9]", started.text):
        return False
    others = (each for each in told.runs.values() if each is not run and each.failure and each.ended >= started.at)
    return not (
        any(each >= started.at for each in (*told.halts, *(stop.at for stop in world.history.stops)))
        or any(others)
        or started.line in told.raw_written  # ESC and ^C are typed there
        or world.climate.wire.harmful
        or world.history.damage.get(started.line)
        or any(at >= started.at for at in world.cut.get((started.line, started.drive), []))
        or _said(world, started.line, started.at, re.compile("trying again|was lost|restart"))
    )


def _stopped_as_well(world: World, started: Executed) -> bool:
    """Whether the session said that the stop of a line has reached a drive, too; one line alone is not named."""
    names = {started.drive, f"{started.line}:{started.drive}"}
    said = [text for at, text in world.history.notices if at >= started.at and STOPPED_TOO in text]
    return any(names & set(text.rpartition(STOPPED_TOO)[2].split(", ")) for text in said)


def _said(world: World, line: str, since: float, words: re.Pattern[str]) -> bool:
    return any(at >= since and line in text and words.search(text) for at, text in world.history.notices)
