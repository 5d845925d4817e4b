"""The end of macros that were stopped or failed: their drives, their `on_stop` lines, and the report.

The drives that they set in motion are stopped first. After a stop of everything no `on_stop` line is executed, then or
later.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from itertools import islice

from multidrop.dialects import Diagnostic, NoAnswer, Stopped
from multidrop.drives.drive import Drive
from multidrop.drives.halt import Halt
from multidrop.shell.automation import outcome, settled
from multidrop.shell.events import FAILURES
from multidrop.shell.motion import Standing, standings
from multidrop.shell.playing import cast
from multidrop.shell.scripts.execution import CUT, Execution, Unfinished
from multidrop.shell.scripts.results import Ending, Result
from multidrop.shell.scripts.runner import Runner

SHOWN = 3
"""The number of printed lines that the report of a step shows."""
Ended = Callable[[Ending], None]


@contextlib.asynccontextmanager
async def ending(runner: Runner, execution: Execution, ended: Ended) -> AsyncIterator[None]:
    """Take care of the macros that the body leaves unfinished, and report them.

    Raises what the body raises; Stopped with the place where a stop of everything cancelled it.
    """
    try:
        yield
    except (*FAILURES, asyncio.CancelledError) as failure:
        if not execution.unfinished:
            raise
        aftermath = _Aftermath(runner, execution)
        await aftermath.run(ended)
        if aftermath.stopped and isinstance(failure, asyncio.CancelledError):
            raise Stopped(f"{aftermath.at}: stopped before it was done") from None
        raise


class _Aftermath:
    def __init__(self, runner: Runner, execution: Execution) -> None:
        self._runner = runner
        self._execution = execution
        self._workspace = execution.workspace
        self._left = list(execution.unfinished)
        """The macros whose `on_stop` lines are not executed yet, the innermost first."""

    async def run(self, ended: Ended) -> None:
        """Stop, report, execute `on_stop`, read where the drives stand. A stop of everything cuts it short."""
        halts = self._runner.automations.end()
        self._execution.is_over = True
        found: tuple[Standing, ...] = ()
        try:
            await self._stopping(halts)
            await self._on_stop()
            found = await standings(self._workspace, self._drives())
            if found:
                self._warn("; ".join(each.text for each in found))
        except asyncio.CancelledError:
            if self.stopped:
                self._drop()
            raise
        finally:
            outermost = self._execution.unfinished[-1].playing
            ended(Ending(outermost.name, outermost.rounds, self.at, found))

    async def _stopping(self, halts: list[Halt]) -> None:
        """Report the place and the last lines, and then the outcome of the stops."""
        for text in self._story():
            self._warn(text)
        await settled(self._workspace)
        for text in outcome(self._workspace, halts):
            self._warn(text)

    @property
    def stopped(self) -> bool:
        """Whether a stop of everything came since its beginning."""
        return self._workspace.stops != self._execution.stops

    def _warn(self, text: str) -> None:
        self._workspace.notify(text, warning=True)

    # The report

    @property
    def at(self) -> str:
        """The place of the end, the outermost macro first."""
        unfinished = reversed(self._execution.unfinished)
        return ": ".join(f"macro {each.playing.name}, {each.playing.at}" for each in unfinished)

    def _story(self) -> Iterator[str]:
        recent = self._execution.recent
        yield f"{self.at}: {'stopped' if self.stopped else 'ended early'}" + ("; its last lines:" if recent else "")
        yield from map(_reported, recent)

    def _drives(self) -> list[Drive]:
        """The drives that its lines went to, without those of a bus that was closed."""
        found: dict[Drive, None] = {}
        for bus, address in self._execution.addressed:
            with contextlib.suppress(Diagnostic, NoAnswer):
                drive = self._workspace.drive(bus, address)
                each = [drive] if drive in (listed := self._workspace.buses[bus].all_drives) else listed
                found.update(dict.fromkeys(each))
        return list(found)

    # The lines after it

    def _drop(self) -> None:
        """Say which lines are not executed."""
        for each in self._left:
            if lines := [node.line.text for node in each.played.on_stop]:
                self._workspace.dropped.append(each.playing.name)
                hint = "type them if the machine needs them"
                self._warn(
                    f"macro {each.playing.name}: on_stop is not executed after a stop: {' · '.join(lines)}; {hint}"
                )
        self._left.clear()

    async def _on_stop(self) -> None:
        """Execute the lines of each macro, the innermost first; none after a stop of everything."""
        if self.stopped:
            self._drop()
        while self._left:
            await self._lines_of(self._left[0])
            self._left.pop(0)

    async def _lines_of(self, each: Unfinished) -> None:
        """Execute each line of a macro, whatever became of the one before it."""
        automations = self._runner.automations
        macro, failed = each.played.macro, False
        why = "" if macro.on_stop_moves else f"on_stop of macro {macro.name} would start it, and on_stop_moves is false"
        frame = replace(each.frame, values=dict(each.frame.names), pace=None)
        with cast(each.roles), automations.still(why):
            for node in each.played.on_stop:
                try:
                    await self._execution.block([node], frame)
                except FAILURES as failure:
                    if self.stopped:
                        raise asyncio.CancelledError from failure
                    failed = True
                    self._warn(f"{node.line.where}: {failure}")
        if not failed:
            automations.leave()
            return
        for text in outcome(self._workspace, automations.end()):
            self._warn(text)


def _failure(result: Result) -> str:
    return f"FAILED: {result.error}" if result.error not in ("", CUT) else result.error


def _reported(result: Result) -> str:
    """A line of the report: what was sent, and what came back."""
    line = result.line
    place = f"step {line.step}" if line.step else line.where
    place += f", round {result.round}" if result.round > 1 else ""
    shown = " | ".join(islice(result.printed, SHOWN)) + (" | ..." if len(result.printed) > SHOWN else "")
    answers = "; ".join(filter(None, (shown, _failure(result))))
    return f"  {place}: {result.sent}" + (f" -> {answers}" if answers else "")
