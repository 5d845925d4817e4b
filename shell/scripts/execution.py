"""The execution of a checked script or macro: ordinary lines through the session, the verbs of scripts here.

The first failure ends it and is raised, with the place of its line as a note.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.base.text import counted
from multidrop.macros import checked_values, fill
from multidrop.shell import waits
from multidrop.shell.events import FAILURES, By, Failed
from multidrop.shell.motions import check_own
from multidrop.shell.operations.operation import Scripted, VerbKind
from multidrop.shell.operations.table import script_verb
from multidrop.shell.origin import Origin
from multidrop.shell.playing import Playing, StepProgress
from multidrop.shell.scripts import words
from multidrop.shell.scripts.captured_prints import Hearing
from multidrop.shell.scripts.model import (
    CallFile,
    CallMacro,
    Executed,
    If,
    LineResult,
    MacroScript,
    Node,
    Repeat,
    ScriptLine,
)
from multidrop.shell.scripts.planning import bind
from multidrop.shell.scripts.questions import MacroSelection
from multidrop.shell.scripts.use import CheckFailed, LineUse, chosen
from multidrop.shell.session import Session
from multidrop.shell.workspace import LATCHED

# The pace of a macro: as recorded, or as fast as its lines are done.


class ScriptPace:
    """Waits before each line. A line starts its time after the start of the line before it, or when that is done."""

    def __init__(self, now: Callable[[], float], fast: bool = False) -> None:
        """Begin now. `fast`: recorded pauses are left out."""
        self.fast = fast
        self._now = now
        self._begun = now()

    async def before(self, after: float) -> None:
        """Wait until a line may start that was recorded `after` seconds after the one before it."""
        wait = 0.0 if self.fast else self._begun + after - self._now()
        if wait > 0:
            await waits.sleep(wait)
        self._begun = self._now()


MOST_SHOWN_PLACES = 3
"""The number of places of failed `/verify` lines that the report shows."""
CUT = "ended before it was done"
"""The error of a line that was under way at the end of its script."""
RECENT = 5
"""The number of last lines that the report of a macro shows."""
Values = dict[str, str]
"""The values of the names in one file."""
T = TypeVar("T")


@dataclass(frozen=True)
class ScriptFrame:
    """The common state of the lines of one file or macro."""

    values: Values | None
    """None: lines are executed as typed."""
    origin: Origin
    place: MacroSelection | None = None
    """The selection of a macro; None: lines go to what is selected as they run."""
    pace: ScriptPace | None = None
    """The pace of a macro; None: a line follows at once."""
    playing: Playing | None = None

    @property
    def names(self) -> Values:
        """The values, for the verbs of scripts."""
        return self.values if self.values is not None else {}


@dataclass(frozen=True)
class Unfinished:
    """A macro that ended early, and how far it was."""

    played: MacroScript
    frame: ScriptFrame
    playing: Playing


Work = Callable[[str, ScriptFrame], Awaitable[T]]


@dataclass
class _Reported:
    sent: str


class Execution:
    """One run of a script or of a macro, with everything that it calls."""

    def __init__(self, session: Session, heard: Hearing, executed: Executed) -> None:
        self.session = session
        self.stops = session.stops
        """The number of stops of everything before it began."""
        self.unfinished: list[Unfinished] = []
        """The macros that ended early, the innermost first."""
        self.recent: deque[LineResult] = deque(maxlen=RECENT)
        """The last results."""
        self.addressed: dict[tuple[str, str], None] = {}
        """(bus, address) of the drives that its lines went to."""
        self.current: ScriptLine | None = None
        """The line under way; after an early end the last one before it."""
        self.failed: list[str] = []
        """The places of `/verify` lines that did not hold."""
        self.is_over = False
        """It ended early, and only the lines after that are executed."""
        self._heard = heard
        self._executed = executed

    def check_verified(self, origin: Origin) -> None:
        """Raise CheckFailed at the end where a `/verify` did not hold. `origin`: that of the line that ran it."""
        if not self.failed:
            return
        places = list(dict.fromkeys(self.failed))
        more = (
            f" and {counted(len(places) - MOST_SHOWN_PLACES, 'other place')}" if len(places) > MOST_SHOWN_PLACES else ""
        )
        times = "a /verify" if len(self.failed) == 1 else f"{len(self.failed)} times a /verify"
        self.session.automations.leave(origin)  # it has come to its end: what moves goes on, as after a good one
        raise CheckFailed(f"{times} did not hold: {', '.join(places[:MOST_SHOWN_PLACES])}{more}; the rest was done")

    @property
    def _quits(self) -> bool:
        """True if a `/quit` ends it; the lines after an early end are executed all the same."""
        return self.session.quitting and not self.is_over

    async def play(
        self,
        origin: Origin,
        played: MacroScript,
        values: Values,
        times: int | None,
        fast: bool,
        roles: Mapping[str, str],
        caller: MacroSelection | None = None,
    ) -> Playing:
        """Play a macro: one round, several, or until it is ended.

        `origin`: that of the line that plays it. `caller`: the selection of the calling macro.
        """
        workspace, macro = self.session, played.macro
        playing = Playing(macro.name, len(macro.steps), times, macro.key)
        origin = replace(origin.cast(roles), by=By.MACRO)
        frame = ScriptFrame(
            values, origin, MacroSelection(workspace, origin, caller), ScriptPace(workspace.now, fast), playing
        )
        with self._listed(playing):
            try:
                while times is None or playing.rounds < times:
                    await asyncio.sleep(0)  # a round that sends nothing must not delay a stop
                    await self.block(played.body, replace(frame, values=dict(values)))
                    if self._quits:
                        break
                    playing.rounds += 1
            except (*FAILURES, asyncio.CancelledError) as failure:
                self.unfinished.append(Unfinished(played, frame, playing))
                if playing.ended and isinstance(failure, asyncio.CancelledError) and workspace.stops == self.stops:
                    raise Stopped(f"macro {macro.name} was ended by /play stop") from None
                raise
        return playing

    @contextlib.contextmanager
    def _listed(self, playing: Playing) -> Iterator[None]:
        """List a macro as playing, and show its progress; then that of the one that plays on."""
        workspace = self.session
        playing.progress = progress = StepProgress(workspace, playing)
        workspace.playing.append(playing)
        workspace.changed()
        try:
            yield
        finally:
            workspace.playing.remove(playing)
            progress.end()
            if workspace.playing and workspace.playing[-1].progress is not None:
                workspace.playing[-1].progress.show()
            workspace.changed()

    async def block(self, body: Sequence[Node], frame: ScriptFrame) -> None:
        """Execute steps in turn, up to a `/quit`."""
        for node in body:
            if self._quits:
                return
            if frame.pace is not None:
                await frame.pace.before(node.line.after)
            self.current = self.current if self.is_over else node.line
            if frame.playing is not None and frame.playing.progress is not None and node.line.step:
                frame.playing.progress.begins(node.line.step, _shown(node.line.text, frame))
            if isinstance(node, If):
                holds = await self._own(node.line, frame, self._done)
                await self.block(node.body if holds else node.otherwise, frame)
            elif isinstance(node, Repeat):
                await self._repeat(node, frame)
            elif isinstance(node, CallFile):
                given = await self._own(node.line, frame, self._given)
                values = {**node.script.values, **given}
                with _noted(node.line):
                    await self.block(node.script.body, replace(frame, values=values, pace=None))
            elif isinstance(node, CallMacro):
                await self._play(node, frame)
            else:
                await self._step(node.line, frame)

    async def _repeat(self, node: Repeat, frame: ScriptFrame) -> None:
        """Execute a block a number of times, or as its condition says before each round."""
        counted = _scripted(node.line).kind is VerbKind.COUNT
        left = await self._own(node.line, frame, self._done) if counted else 0
        while not self._quits and (left > 0 if counted else await self._goes_on(node.line, frame)):
            left -= 1
            await asyncio.sleep(0)  # a body that sends nothing must not delay a stop
            await self.block(node.body, frame)

    async def _goes_on(self, line: ScriptLine, frame: ScriptFrame) -> bool:
        """Whether a loop has another round; one that waits for a motion which has failed ends with that failure."""
        goes_on: bool = await self._own(line, frame, self._done)
        if goes_on and not self.is_over:
            await self._own(line, frame, lambda text, frame: check_own(self.session, frame.origin))
        return goes_on

    async def _play(self, node: CallMacro, frame: ScriptFrame) -> None:
        async def values(text: str, frame: ScriptFrame) -> tuple[Values, Mapping[str, str]]:
            call = words.macro_call(text)
            given, roles = call.divided(node.played.macro)
            return checked_values(node.played.macro, given), bind(self.session, frame.origin, node.played.macro, roles)

        given, roles = await self._own(node.line, frame, values)
        with _noted(node.line):
            fast = node.fast or (frame.pace is not None and frame.pace.fast)
            await self.play(frame.origin, node.played, given, node.times, fast, roles, frame.place)

    async def _step(self, line: ScriptLine, frame: ScriptFrame) -> None:
        if script_verb(line.word) is None:
            return await self.line(line, frame)
        scripted = _scripted(line)
        try:
            await self._own(line, frame, self._done, counts=not scripted.steers)
        except CheckFailed as failure:
            if self.is_over or not scripted.goes_on:
                raise
            self.failed.append(line.where)
            self.session.notify(f"{line.where}: {failure}", warning=True)

    async def line(self, line: ScriptLine, frame: ScriptFrame) -> None:
        """Execute an ordinary line, with values filled in if there are any."""
        outcome: list[str] = []
        origin = replace(frame.origin, outcome=outcome)
        with self._reporting(line, frame, afresh=True) as reported:
            if frame.values is not None:
                reported.sent = fill(line.text, frame.values)
            place = frame.place
            await self.session.run(place.pinned(reported.sent) if place else reported.sent, origin)
            if place is not None:
                place.passed(reported.sent)
            frame.names.update((words.OUTCOME, word) for word in outcome)
        if self._quits and line.where:
            self.session.notify(f"{line.where}: it quits here, and nothing after this line is executed", warning=True)

    async def _own(self, line: ScriptLine, frame: ScriptFrame, work: Work[T], counts: bool = False) -> T:
        """Execute a verb of scripts. One that only steers has a result only where it fails; any other one `counts`."""
        with self._reporting(line, frame, counts=counts) as reported:
            reported.sent = text = fill(line.text, frame.names)
            workspace = self.session
            if workspace.front.ready is not None:
                await workspace.front.ready()
            if counts:
                workspace.notify(f"{line.where}: {text}")  # for the session log; only what can be replayed is `Entered`
            try:
                if workspace.latched and frame.origin.by is not By.OPERATOR:
                    raise Stopped(LATCHED)
                return await work(text, frame)
            except FAILURES as failure:
                workspace.publish(Failed(workspace.now(), str(failure)))
                raise

    @contextlib.contextmanager
    def _reporting(
        self, line: ScriptLine, frame: ScriptFrame, counts: bool = True, afresh: bool = False
    ) -> Iterator[_Reported]:
        """Report the result of the body; note the place of the line on its failure."""
        self._heard.begin(afresh)
        reported, begun, error, failed_check = _Reported(line.text), self.session.now(), "", False
        refused_here = False
        try:
            yield reported
        except FAILURES as failure:
            error, failed_check = str(failure), isinstance(failure, CheckFailed)
            refused_here = isinstance(failure, Diagnostic)
            if line.where:
                failure.add_note(line.where)
            raise
        except asyncio.CancelledError:
            error = CUT
            raise
        finally:
            if self._heard.target is not None and self._heard.target[0] and not refused_here:
                self.addressed.setdefault(self._heard.target)
            if counts or error:
                bus, drive = self._heard.target or ("", "")
                now, at = self.session.now(), self.session.wall(begun)
                number = frame.playing.round if frame.playing is not None else 0
                printed = self._heard.printed()
                result = LineResult(
                    line, reported.sent, at, now - begun, printed, bus, drive, error, failed_check, number
                )
                self.recent.append(result)
                self._executed(result)

    async def _done(self, text: str, frame: ScriptFrame) -> Any:
        """Do what a verb of scripts does; return what that returns."""
        form = chosen(text)
        return await form.form.done(
            LineUse(self.session, self._heard, frame.names, frame.place, frame.origin, form.form.name, text),
            form.values,
        )

    async def _given(self, text: str, frame: ScriptFrame) -> Values:
        return words.call(text)[1]


def _scripted(line: ScriptLine) -> Scripted:
    verb = script_verb(line.word)
    assert verb is not None and verb.script is not None  # the line was checked
    return verb.script


@contextlib.contextmanager
def _noted(line: ScriptLine) -> Iterator[None]:
    """Note the place of a call on a failure in what it calls."""
    try:
        yield
    except FAILURES as failure:
        failure.add_note(line.where)
        raise


def _shown(text: str, frame: ScriptFrame) -> str:
    """A line with its values, as a person reads it while it is executed; as it stands where one is not known yet."""
    try:
        return fill(text, frame.names)
    except Diagnostic:
        return text
