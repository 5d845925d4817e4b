"""Scripts, macros and typed lines from their beginning to their end."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from multidrop.dialects import Stopped
from multidrop.drives.events import Lost
from multidrop.shell import unfinished
from multidrop.shell.events import By, OnBus, SessionEvent
from multidrop.shell.scripts.ending import ending
from multidrop.shell.scripts.execution import Execution, Frame
from multidrop.shell.scripts.hearing import hearing
from multidrop.shell.scripts.model import MacroScript, Script, ScriptLine
from multidrop.shell.scripts.planning import bind, macro_claims, script_claims
from multidrop.shell.scripts.results import Ending, Executed, Result, Watcher
from multidrop.shell.scripts.runner import Runner
from multidrop.shell.workspace import LATCHED, Workspace
from multidrop.transports import TransportLost

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

    leave = execution.workspace.subscribe(take)
    try:
        yield
    except asyncio.CancelledError:
        if task is None or not losses or execution.stops != execution.workspace.stops:
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


@dataclass(frozen=True)
class Playback:
    """The manner in which a macro is played."""

    times: int | None = 1
    """The number of rounds; None: until it is ended."""
    fast: bool = False
    """Without recorded pauses."""
    roles: Mapping[str, str] = field(default_factory=dict)
    """The bus for each role."""


class _Nobody:
    def executed(self, result: Result) -> None:
        """Take no notice."""

    def ended(self, ending: Ending) -> None:
        """Take no notice."""


async def run_script(
    workspace: Workspace,
    runner: Runner,
    script: Script,
    executed: Executed = lambda result: None,
    by: By = By.SCRIPT,
) -> None:
    """Execute a script. `executed` gets the result of each line. Raises the first failure."""
    own = script_claims(workspace, script)
    with hearing(workspace.subscribe) as heard:
        execution = Execution(workspace, runner, heard, executed)
        async with (
            runner.automations.run(f"script {script.file}", own),
            ended_by_loss(execution, {link.name for link, _ in own}),
            ending(runner, execution, _Nobody().ended),
        ):
            await execution.block(script.body, Frame(dict(script.values), by))


async def run_typed(workspace: Workspace, runner: Runner, lines: Sequence[str], executed: Executed) -> None:
    """Execute typed lines in turn, without values and verbs of scripts. Raises the first failure."""
    with hearing(workspace.subscribe) as heard:
        execution = Execution(workspace, runner, heard, executed)
        for count, text in enumerate(lines, 1):
            await execution.line(ScriptLine("", count, text), Frame(None, By.OPERATOR))
            if workspace.quitting:
                return


async def play_macro(
    workspace: Workspace, runner: Runner, played: MacroScript, playback: Playback, watcher: Watcher | None = None
) -> None:
    """Play a checked macro, as one automation. Raises the first failure.

    The drives that it moves are claimed first, as far as its lines show them. Its early end stops those that it
    started, executes its `on_stop` lines, and is reported.
    """
    if workspace.latched:
        raise Stopped(LATCHED)
    watcher = watcher or _Nobody()
    roles = bind(workspace, played.macro, playback.roles)
    name, begun = played.macro.name, workspace.now()
    own = macro_claims(workspace, played, roles)
    state, ports = workspace.settings.state, {link.name: workspace.ports.get(link.name, "") for link, _ in own}
    with hearing(workspace.subscribe) as heard, unfinished.playing(state, ports.values(), name, workspace.wall(begun)):
        execution = Execution(workspace, runner, heard, watcher.executed)
        async with (
            runner.automations.run(f"macro {name}", own),
            ended_by_loss(execution, ports),
            ending(runner, execution, watcher.ended),
        ):
            playing = await execution.play(played, dict(played.values), playback.times, playback.fast, roles)
    rounds = f"{playing.rounds} round{'s' * (playing.rounds != 1)}" + ", ended by /quit" * workspace.quitting
    workspace.notify(f"macro {name}: {rounds} played in {workspace.now() - begun:.1f} s", outcome=True)
    watcher.ended(Ending(name, playing.rounds))
