"""Scripts, macros and typed lines from their beginning to their end.

The drives that an unfinished macro set in motion are stopped first; its `on_early_end` lines follow. After a stop of
everything no `on_early_end` line is executed, then or later.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice

from multidrop.base.errors import Diagnostic, NoAnswer, Stopped, TransportLost
from multidrop.base.text import counted
from multidrop.drives.drive import Drive
from multidrop.drives.events import Lost
from multidrop.macros import Macro
from multidrop.shell.automation import outcome, settled
from multidrop.shell.automation_record import Claim
from multidrop.shell.events import FAILURES, By, OnBus, SessionEvent
from multidrop.shell.origin import NO_ROLES, Origin
from multidrop.shell.quitting import say_unsent
from multidrop.shell.scripts.captured_prints import hearing
from multidrop.shell.scripts.execution import CUT, Execution, ScriptFrame, Unfinished
from multidrop.shell.scripts.model import Ended, Executed, LineResult, MacroEnding, MacroScript, Script, ScriptLine
from multidrop.shell.scripts.planning import bind, macro_claims, script_claims
from multidrop.shell.scripts.reading import read_macro
from multidrop.shell.session import Session
from multidrop.shell.state import crash_marks
from multidrop.shell.waits import Standing, standings
from multidrop.shell.workspace import LATCHED

# A connection that is lost while no line uses it: that ends a script or macro too, and not only its next line.


GRACE = 0.2
"""The time in which a line under way fails by itself, and then says more, s."""


@contextlib.asynccontextmanager
async def ended_by_loss(execution: Execution, buses: Collection[str]) -> AsyncIterator[None]:
    """End the body, in its task, when one of these buses is lost, or one that its lines went to.

    Raises TransportLost with the place of the line under way.
    """
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    losses: list[TransportLost] = []
    timers: list[asyncio.TimerHandle] = []

    def take(event: SessionEvent) -> None:
        if not (isinstance(event, OnBus) and isinstance(event.event, Lost)):
            return
        if event.bus in buses or event.bus in {bus for bus, _ in execution.addressed}:
            timers.append(loop.call_later(GRACE, end, event.event.error))

    def end(loss: TransportLost) -> None:
        if task is not None and not execution.is_over and not losses:
            losses.append(loss)
            task.cancel()

    leave = execution.session.subscribe(take, Lost)
    try:
        yield
    except asyncio.CancelledError:
        if task is None or not losses or execution.stops != execution.session.stops:
            raise
        task.uncancel()
        loss = TransportLost(str(losses[0]))
        if execution.current is not None:
            loss.add_note(execution.current.where)
        raise loss from None
    finally:
        leave()
        for timer in timers:
            timer.cancel()


async def run_script(
    session: Session, origin: Origin, script: Script, executed: Executed = lambda result: None
) -> None:
    """Execute a script for a line or a program. `executed` gets the result of each line. Raises the first failure."""
    own = script_claims(session, origin, script)
    await _agreed(session, own, By.SCRIPT)
    with hearing(session) as heard:
        execution = Execution(session, heard, executed)
        async with (
            session.automations.run(heard.of(origin), f"script {script.file}", own) as running,
            ended_by_loss(execution, {link.name for link, _ in own}),
            ending(execution, running, lambda end: None),
        ):
            await execution.block(script.body, ScriptFrame(dict(script.values), replace(running, by=By.SCRIPT)))
    execution.check_verified(origin)


async def _agreed(session: Session, own: Collection[Claim], by: By) -> None:
    """Refuse a script that writes to a device that did not identify itself before its first line. Raises Diagnostic."""
    for link, address in sorted(own, key=lambda claim: (claim[0].name, claim[1])):
        await session.path.agreed_to_write(session.bus(link.name).at(address), "", by)


async def run_typed(session: Session, origin: Origin, lines: Sequence[str], executed: Executed) -> None:
    """Execute typed lines in turn, without values and verbs of scripts. Raises the first failure."""
    with hearing(session) as heard:
        execution, frame = (
            Execution(session, heard, executed),
            ScriptFrame(None, replace(heard.of(origin), by=By.OPERATOR)),
        )
        for count, text in enumerate(lines, 1):
            await execution.line(ScriptLine("", count, text), frame)
            if session.quitting:
                say_unsent(session, lines[count:])
                return


async def play(
    session: Session,
    origin: Origin,
    macro: Macro,
    values: Mapping[str, str],
    *,
    times: int | None = 1,
    fast: bool = False,
    roles: Mapping[str, str] = NO_ROLES,
    executed: Executed = lambda result: None,
    ended: Ended = lambda end: None,
    checked: MacroScript | None = None,
) -> None:
    """Play a macro to its end as one automation, listed in `session.playing` meanwhile. Raises the first failure.

    It is checked whole first, and the drives that it moves are claimed, as far as its lines show them. Its early end
    stops those that it started, executes its `on_early_end` lines, and is reported. `times` None: until it is ended.
    `fast`: without recorded pauses. `roles`: the bus for each role. A line without an address goes to the drive that
    was selected when the macro began, or by a `/use` in it. `checked`: the macro with all that it calls, where that was
    read and checked with these values already.
    """
    played = checked or read_macro(macro, values, session.macros)
    if session.latched:
        raise Stopped(LATCHED)
    roles = bind(session, origin, macro, roles)
    name, begun = macro.name, session.now()
    own = macro_claims(session, origin, played, roles)
    await _agreed(session, own, By.MACRO)
    claimed = sorted({link.name for link, _ in own})  # a set of links has another order in each run
    state, ports = session.settings.state, {bus: session.of(session.buses[bus]).port for bus in claimed}
    with hearing(session) as heard, crash_marks.playing(state, ports.values(), name, session.wall(begun)):
        execution = Execution(session, heard, executed)
        async with (
            session.automations.run(heard.of(origin), f"macro {name}", own) as running,
            ended_by_loss(execution, ports),
            ending(execution, running, ended),
        ):
            playing = await execution.play(running, played, dict(played.values), times, fast, roles)
    rounds = counted(playing.rounds, "round") + ", ended by /quit" * session.quitting
    session.notify(f"macro {name}: {rounds} played in {session.now() - begun:.1f} s", outcome=True)
    ended(MacroEnding(name, playing.rounds))
    execution.check_verified(origin)


MOST_SHOWN_PRINTS = 3
"""The number of printed lines that the report of a step shows."""


@contextlib.asynccontextmanager
async def ending(execution: Execution, origin: Origin, ended: Ended) -> AsyncIterator[None]:
    """Take care of the macros that the body leaves unfinished, and report them. `origin`: with their automation.

    Raises what the body raises; Stopped with the place where a stop of everything cancelled it.
    """
    try:
        yield
    except (*FAILURES, asyncio.CancelledError) as failure:
        if not execution.unfinished:
            raise
        aftermath = _Aftermath(execution, origin)
        await aftermath.run(ended)
        if aftermath.stopped and isinstance(failure, asyncio.CancelledError):
            raise Stopped(f"{aftermath.at}: stopped before it was done") from None
        raise


class _Aftermath:
    def __init__(self, execution: Execution, origin: Origin) -> None:
        self._execution, self._origin = execution, origin
        self._session = execution.session
        self._left = list(execution.unfinished)
        """The macros whose `on_early_end` lines are not executed yet, the innermost first."""

    async def run(self, ended: Ended) -> None:
        """Stop, report, execute `on_early_end`, read where the drives stand. A stop of everything cuts it short."""
        halts = await self._session.automations.end(self._origin)
        self._execution.is_over = True
        states: tuple[Standing, ...] = ()
        try:
            # Report the place and the last lines, and then the outcome of the stops.
            for text in self._story():
                self._warn(text)
            await settled(self._session)
            for text in outcome(self._session, halts):
                self._warn(text)
            # Execute the lines of each macro, the innermost first; none after a stop of everything.
            if self.stopped:
                self._drop()
            while self._left:
                await self._lines_of(self._left[0])
                self._left.pop(0)
            states = await standings(
                self._session, self._drives(), self._session.units if self._session.scaled else None
            )
            if states:
                self._warn("; ".join(standing.text for standing in states))
        except asyncio.CancelledError:
            if self.stopped:
                self._drop()
            raise
        finally:
            outermost = self._execution.unfinished[-1].playing
            ended(MacroEnding(outermost.name, outermost.rounds, self.at, states))

    @property
    def stopped(self) -> bool:
        """True if a stop of everything came since its beginning."""
        return self._session.stops != self._execution.stops

    def _warn(self, text: str) -> None:
        self._session.notify(text, warning=True)

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
        drives: dict[Drive, None] = {}
        for bus, address in self._execution.addressed:
            with contextlib.suppress(Diagnostic, NoAnswer):
                drive = self._session.drive(bus, address)
                reached = [drive] if drive in (listed := self._session.buses[bus].all_drives) else listed
                drives.update(dict.fromkeys(reached))
        return list(drives)

    # The lines after it

    def _drop(self) -> None:
        for left in self._left:
            if lines := [node.line.text for node in left.played.on_early_end]:
                self._session.dropped.append(left.playing.name)
                hint = "type them if the machine needs them"
                self._warn(
                    f"macro {left.playing.name}: on_early_end is not executed after a stop: {' · '.join(lines)}; {hint}"
                )
        self._left.clear()

    async def _lines_of(self, each: Unfinished) -> None:
        """Execute each line of a macro, whatever became of the one before it."""
        automations = self._session.automations
        macro, failed = each.played.macro, False
        why = (
            ""
            if macro.on_early_end_moves
            else f"on_early_end of macro {macro.name} would start it, and on_early_end_moves is false"
        )
        frame = replace(each.frame, values=dict(each.frame.names), pace=None)
        with automations.still(self._origin, why):
            for node in each.played.on_early_end:
                try:
                    await self._execution.block([node], frame)
                except FAILURES as failure:
                    if self.stopped:
                        raise asyncio.CancelledError from failure
                    failed = True
                    self._warn(f"{node.line.where}: {failure}")
        if not failed:
            automations.leave(self._origin)
            return
        for text in outcome(self._session, await automations.end(self._origin)):
            self._warn(text)


def _reported(result: LineResult) -> str:
    """A line of the report: what was sent, and what came back."""
    line = result.line
    place = f"step {line.step}" if line.step else line.where
    place += f", round {result.round}" if result.round > 1 else ""
    shown = " | ".join(islice(result.printed, MOST_SHOWN_PRINTS)) + (
        " | ..." if len(result.printed) > MOST_SHOWN_PRINTS else ""
    )
    failure = f"FAILED: {result.error}" if result.error not in ("", CUT) else result.error
    answers = "; ".join(filter(None, (shown, failure)))
    return f"  {place}: {result.sent}" + (f" -> {answers}" if answers else "")
