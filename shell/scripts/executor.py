"""The execution of a checked script: ordinary lines through the session, the verbs of scripts here.

The first failure ends it and is raised, with the place of its line as a note.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from dialects import DriveError, Stopped
from macros import fill
from shell.events import FAILURES, By, Failed
from shell.roles import Commands
from shell.scripts import words
from shell.scripts.asking import drive_of, known
from shell.scripts.expression import Expression, Word, evaluate, unknowns
from shell.scripts.hearing import Hearing, hearing
from shell.scripts.model import CallFile, If, Node, Repeat, Script, ScriptLine
from shell.scripts.results import Executed, Result
from shell.scripts.values import Value, number, quoted, written
from shell.workspace import LATCHED, Workspace

SHOWN = 3
"""The number of lines that a failed `/expect` shows."""
Values = dict[str, str]
"""The values of the names in one file."""
T = TypeVar("T")
Work = Callable[[str, Values], Awaitable[T]]


class CheckFailed(DriveError):
    """An `/assert` or `/expect` did not find what it wants."""


async def run_script(
    workspace: Workspace,
    commands: Commands,
    script: Script,
    executed: Executed = lambda result: None,
    by: By = By.SCRIPT,
) -> None:
    """Execute a script. `executed` gets the result of each line. Raises the first failure."""
    with hearing(workspace.subscribe) as heard:
        await _Execution(workspace, commands, heard, executed, by).block(script.body, dict(script.values))


async def run_told(workspace: Workspace, commands: Commands, lines: Sequence[str], executed: Executed) -> None:
    """Execute lines as typed, in turn: no values, no verbs of scripts. Tells each result; raises the first failure."""
    with hearing(workspace.subscribe) as heard:
        execution = _Execution(workspace, commands, heard, executed, By.OPERATOR)
        for count, text in enumerate(lines, 1):
            await execution.line(ScriptLine("", count, text), text)
            if workspace.quitting:
                return


@dataclass
class _Telling:
    sent: str


class _Execution:
    def __init__(self, workspace: Workspace, commands: Commands, heard: Hearing, executed: Executed, by: By) -> None:
        self._workspace = workspace
        self._commands = commands
        self._heard = heard
        self._executed = executed
        self._by = by

    async def block(self, body: Sequence[Node], values: Values) -> None:
        """Execute steps in turn, up to a `/quit`."""
        for node in body:
            if self._workspace.quitting:
                return
            await self._node(node, values)

    async def _node(self, node: Node, values: Values) -> None:
        if isinstance(node, If):
            holds = await self._own(node.line, values, self._condition)
            await self.block(node.body if holds else node.otherwise, values)
        elif isinstance(node, Repeat):
            await self._repeat(node, values)
        elif isinstance(node, CallFile):
            await self._call(node, values)
        else:
            await self._step(node.line, values)

    async def _repeat(self, node: Repeat, values: Values) -> None:
        for _ in range(await self._own(node.line, values, self._count)):
            if self._workspace.quitting:
                return
            await asyncio.sleep(0)  # a body that sends nothing must not delay a stop
            await self.block(node.body, values)

    async def _call(self, node: CallFile, values: Values) -> None:
        given = await self._own(node.line, values, self._given)
        try:
            await self.block(node.script.body, {**node.script.values, **given})
        except FAILURES as failure:
            failure.add_note(node.line.where)
            raise

    async def _step(self, line: ScriptLine, values: Values) -> None:
        if line.word == "/set":
            await self._own(line, values, self._set)
        elif line.word in self._checks:
            await self._own(line, values, self._checks[line.word], told=True)
        else:
            await self.line(line, line.text, values)

    async def line(self, line: ScriptLine, text: str, values: Values | None = None) -> None:
        """Execute an ordinary line, with values filled in if there are any. `/call` of a macro plays it."""
        with self._telling(line, text, afresh=True) as telling:
            if values is not None:
                telling.sent = text = fill(text, values)
            played = values is not None and line.word == "/call"
            await self._commands.run(f"/play {words.rest_of(text)}" if played else text, self._by)

    async def _own(self, line: ScriptLine, values: Values, work: Work[T], told: bool = False) -> T:
        """Execute a verb of scripts. One that is not `told` only steers: it has a result only where it fails."""
        with self._telling(line, line.text, told=told) as telling:
            telling.sent = text = fill(line.text, values)
            workspace = self._workspace
            if workspace.ready is not None:
                await workspace.ready()
            if told:
                workspace.notify(f"{line.where}: {text}")  # for the session log; only what can be replayed is `Entered`
            try:
                if workspace.latched and self._by is not By.OPERATOR:
                    raise Stopped(LATCHED)
                return await work(text, values)
            except FAILURES as failure:
                workspace.publish(Failed(workspace.now(), str(failure)))
                raise

    @contextlib.contextmanager
    def _telling(self, line: ScriptLine, text: str, told: bool = True, afresh: bool = False) -> Iterator[_Telling]:
        """Tell the result of the body; note the place of the line on its failure."""
        self._heard.begin(afresh)
        telling, begun, error, failed_check = _Telling(text), self._workspace.now(), "", False
        try:
            yield telling
        except FAILURES as failure:
            error, failed_check = str(failure), isinstance(failure, CheckFailed)
            if line.file:
                failure.add_note(line.where)
            raise
        except asyncio.CancelledError:
            error = "ended before it was done"
            raise
        finally:
            if told or error:
                self._tell(line, telling.sent, begun, error, failed_check)

    def _tell(self, line: ScriptLine, sent: str, begun: float, error: str, failed_check: bool) -> None:
        bus, drive = self._heard.target or ("", "")
        now, at = self._workspace.now(), self._workspace.wall(begun)
        printed = self._heard.printed()
        self._executed(Result(line, sent, at, now - begun, printed, bus, drive, error, failed_check))

    # The verbs of scripts

    @property
    def _checks(self) -> Mapping[str, Work[None]]:
        return {"/print": self._print, "/assert": self._assert, "/expect": self._expect}

    async def _set(self, text: str, values: Values) -> None:
        name, tree = words.setting(text, values)
        values[name] = written(await self._value(tree, values))

    async def _condition(self, text: str, values: Values) -> bool:
        return bool(number(await self._value(words.expression(text, values), values)))

    async def _count(self, text: str, values: Values) -> int:
        return words.repetitions(await self._value(words.expression(text, values), values))

    async def _given(self, text: str, values: Values) -> Values:
        return words.call(text)[1]

    async def _print(self, text: str, values: Values) -> None:
        self._workspace.output(words.rest_of(text))

    async def _assert(self, text: str, values: Values) -> None:
        tree = words.check(text, values)
        for word in (each for each in unknowns(tree) if isinstance(each, Word)):
            drive = drive_of(self._workspace, word)
            self._heard.target = self._heard.target or (drive.link.name, drive.address)
        found = await known(self._workspace, self._commands, tree, values, self._by)
        if evaluate(tree, found):
            return
        within = evaluate(tree.within, found)
        wanted = f"{tree.sign} {quoted(evaluate(tree.right, found))}" + (f" +- {written(within)}" if within else "")
        raise CheckFailed(f"{text}: wanted {wanted}, seen {quoted(evaluate(tree.left, found))}")

    async def _expect(self, text: str, values: Values) -> None:
        wanted, seconds = words.expectation(text)
        if not await self._heard.finds(wanted, seconds):
            seen = ", ".join(map(quoted, self._heard.last(SHOWN))) or "nothing"
            raise CheckFailed(f'{text}: wanted "{wanted}" within {seconds:g} s, seen {seen}')

    async def _value(self, tree: Expression, values: Values) -> Value:
        return evaluate(tree, await known(self._workspace, self._commands, tree, values, self._by))
