"""A session log, taken again on other drives: the same lines, and where the answers differ.

A number that a drive prints while it may move may be another number. A drive may move from a line that can start it
until a wait or a stop. The replay ends at the first difference in an error, and stops the drives that it moved. Against
a cell, it also compares the positions in the log with those of the simulated drives at the same times.

Against a cell it runs in virtual time.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, DriveError, Stopped
from multidrop.base.text import counted
from multidrop.shell import waits
from multidrop.shell.automation import outcome, settled
from multidrop.shell.events import By, Printed, SessionEvent
from multidrop.shell.line_syntax import EVERYONE, join_target
from multidrop.shell.log.steps import WORLD, LoggedStep, LoggedSteps, compared, errors_differ
from multidrop.shell.log.targets import targets
from multidrop.shell.openings import model
from multidrop.shell.streams.stdout import write
from multidrop.shell.workspace import LATCHED

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.features.log_analysis.positions import Divergence, LoggedPositions, Reading
    from multidrop.shell.channel import Channel
    from multidrop.shell.session import Session


class ReplayReport:
    """Writes what differs to standard output as it is found. `as_json`: as objects, and the summary too."""

    def __init__(self, as_json: bool = False) -> None:
        self._json = as_json

    def differs(self, step: LoggedStep, text: str, difference: str) -> None:
        fact: dict[str, object] = {
            "where": step.where,
            "bus": step.bus,
            "drive": step.drive,
            "line": step.text,
            "differs": difference,
        }
        self._put(text, fact)

    def diverged(self, found: Divergence) -> None:
        fact = {
            "drive": found.drive,
            "time": found.at.isoformat(timespec="microseconds"),
            "difference": found.difference,
            "limit": found.limit,
            "causes": found.causes,
        }
        self._put(found.text, {"diverged": fact})

    def summary(
        self, channel: Channel, lines: int, differences: int, uncompared: int, positions: LoggedPositions | None
    ) -> None:
        moved = f"; {uncompared} in motion printed another number" if uncompared else ""
        channel.notify(
            f"{counted(lines, 'line')} replayed, {differences} differ{moved}",
            outcome=True,
        )
        fact: dict[str, object] = {"lines": lines, "differ": differences}
        if positions is not None:
            largest, compared = positions.largest, positions.compared
            for name, number in compared.items():
                most = counted(largest[name], "step")
                text = f"{name}: {counted(number, 'position')} compared, largest difference {most}"
                channel.notify(text, outcome=True)
            fact |= {"compared": sum(compared.values()), "diverged": len(positions.diverged), "largest": largest}
        if self._json:
            write(sys.stdout, json.dumps({"summary": fact}))

    @staticmethod
    def words(lines: int, differences: int, positions: LoggedPositions | None) -> str:
        """The differences in words; empty: none."""
        said = [f"{differences} of {counted(lines, 'line')} gave another answer than in the log"] if differences else []
        if positions is not None and positions.diverged:
            axes = f"{len(positions.diverged)} of {len(positions.compared)} axes"
            said.append(f"{axes} were not where the log has them")
        return "; ".join(said)

    def _put(self, text: str, fact: dict[str, object]) -> None:
        write(sys.stdout, json.dumps(fact) if self._json else text)


async def replay(
    session: Session, found: LoggedSteps, *, fast: bool, positions: bool = False, report: ReplayReport | None = None
) -> None:
    """Take the steps on the open buses; `fast`: without the pauses of the log.

    `positions`: also compare the positions in the log; the drives are simulated.

    Raises Diagnostic where the drives do not fit or the person does not agree, DriveError where an answer differs.
    """
    work = Replay(session, found, report or ReplayReport())
    await work.agree()
    differences = await work.run(fast, positions and not fast)
    if differences:
        raise DriveError(differences)
    session.automations.interrupt()
    await settled(session)
    for text in outcome(session, session.automations.interrupted):
        session.notify(text, outcome=True)


class Replay:
    """The steps of a log with the drives that they are for."""

    def __init__(self, session: Session, found: LoggedSteps, report: ReplayReport) -> None:
        """Find the drives. Raises Diagnostic where a bus or a drive of the log has no counterpart."""
        self._session, self._found, self._report = session, found, report
        self._simulated = all(name in session.cells for name in session.buses)
        self.steps = [step for step in found.steps if self._simulated or step.text.split()[:1] != [WORLD]]
        self._targets = targets(session, self.steps)
        self._moving: set[Drive] = set()
        """The drives that may move."""
        self._uncompared = 0
        self._printed: list[str] = []

    async def agree(self) -> None:
        """Say what is left out; where drives are real, list them and what can move them, and ask."""
        left_out = [*self._found.skipped, *([WORLD] if len(self.steps) < len(self._found.steps) else [])]
        if left_out:
            self._session.notify(f"not replayed: {', '.join(left_out)}", outcome=True)
        if self._found.unsent:
            self._session.notify(
                f"not replayed: {counted(self._found.unsent, 'line')} that the log has as not sent", outcome=True
            )
        if not self._simulated:
            session, moving = self._session, 0
            for target in dict.fromkeys(self._targets.values()):
                session.notify(f"drive {_name(target)}: {model(target)} on {target.link.transport.name}", outcome=True)
            for step in self.steps:
                if (drive := self._targets.get((step.bus, step.drive))) is None:
                    continue
                guarded = session.settings.guards.what(drive.family, step.text)
                if guarded or drive.codec.starts_motion(step.text):
                    session.notify(
                        f"{step.where}: {_name(drive)} {step.text}" + f" ({guarded})" * bool(guarded), outcome=True
                    )
                    moving += 1
            lines = counted(len(self.steps), "line is", "lines are")
            await session.questions.confirm(f"{lines} sent; {moving} of them can start motion or ask first")
        self._session.questions.agreed = True

    async def run(self, fast: bool, positions: bool) -> str:
        """Take the steps; return what differs, in words. Raises DriveError at a difference in an error."""
        leave = self._session.subscribe(self._note)
        measured = self._positions() if positions and self.steps else None
        differences = done = 0
        began = self._session.now()
        try:
            async with _beside(measured, began):
                for step in self.steps:
                    if not fast:
                        await waits.sleep(
                            max(0.0, began + (step.at - self.steps[0].at).total_seconds() - self._session.now())
                        )
                    differences += await self._step(step)
                    done += 1
        finally:
            leave()
            self._report.summary(self._session, done, differences, self._uncompared, measured)
        return self._report.words(len(self.steps), differences, measured)

    def _positions(self) -> LoggedPositions:
        from multidrop.features.log_analysis.positions import LoggedPositions

        targets = {place: drive for place, drive in self._targets.items() if drive.address not in EVERYONE}
        polls = [poll for poll in self._found.polls if (poll.bus, poll.drive) in targets]
        return LoggedPositions(targets, polls, self.steps, self._read, self._report.diverged)

    def _read(self, drive: Drive) -> Reading:
        """The simulated drive in the part of one, and its time. Raises Diagnostic."""
        bus = self._session.buses[drive.link.name]
        cell = self._session.cells[bus.name]
        shadow = cell.shadow(bus.link.transport.name.rpartition("#")[2], drive.address)
        if shadow is None:
            raise Diagnostic("the simulator does not tell where it is", _name(drive))
        return shadow, cell.now()

    async def _step(self, step: LoggedStep) -> bool:
        """Take a step; whether its answer differs, which is shown."""
        if not step.text:  # every drive was stopped then, and the session went on
            if self._session.latched:
                raise Stopped(LATCHED)
            self._session.stop("the stop in the log")
            self._session.resume()
            await settled(self._session)
            self._moving.clear()
            return False
        drive = self._targets.get((step.bus, step.drive))
        if drive is not None and drive.starts(step.text):
            everyone = drive.address in EVERYONE
            self._moving |= {drive, *(self._session.buses[drive.link.name].all_drives if everyone else ())}
        may_move = drive in self._moving
        self._printed, failed = [], ""
        target = f"@{join_target(drive.link.name, drive.address)} " if drive is not None else ""
        origin = replace(self._session.origin, by=By.SCRIPT)
        try:
            await self._session.run(f"{target}{step.text}", origin)
        except Stopped:
            raise
        except (DriveError, Diagnostic) as failure:
            failed = str(failure)
        if step.is_verb and not failed:
            self._moving.clear()
        difference = compared(step, self._printed, failed, may_move)
        if not difference:
            self._uncompared += self._printed != step.printed
            return False
        text = f"{step.where}: {_name(drive) + ' ' if drive else ''}{step.text}: {difference}"
        if errors_differ(step.failed, failed):
            raise DriveError(text)
        self._report.differs(step, text, difference)
        return True

    def _note(self, event: SessionEvent) -> None:
        if isinstance(event, Printed):
            self._printed.append(event.text)


@contextlib.asynccontextmanager
async def _beside(positions: LoggedPositions | None, began: float) -> AsyncIterator[None]:
    """Compare positions meanwhile, to the end of the log; an early end ends that, too."""
    if positions is None:
        yield
        return
    comparing = asyncio.create_task(positions.run(began))
    try:
        yield
        await comparing
    finally:
        comparing.cancel()
        await asyncio.wait([comparing])


def _name(drive: Drive) -> str:
    return join_target(drive.link.name, drive.address) if drive.address else drive.link.name
