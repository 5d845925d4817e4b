"""A session that notes what the caller of each line got: the host's word."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any

from multidrop.base.errors import Diagnostic, DriveError, TransportLost
from multidrop.shell.configuration import Settings
from multidrop.shell.line_syntax import TypedLine
from multidrop.shell.session import Session
from multidrop.shell.workspace import LATCHED
from soak.judge import Word, word
from soak.simulation.records.commands import Command, Outcome
from soak.simulation.system.process import Process
from soak.simulation.watching.path import WatchedPath, WatchedVerbs, examine_before_a_stop
from soak.simulation.world import World

WORDS = {
    Word.DONE: Outcome.OK,
    Word.UNCONFIRMED: Outcome.UNKNOWN,
    Word.REFUSED: Outcome.REFUSED,
    Word.NOT_EXECUTED: Outcome.NOT_SENT,
    Word.UNKNOWN: Outcome.UNKNOWN,
}
ASKED: ContextVar[tuple[str, float] | None] = ContextVar("asked", default=None)
"""The question that runs in this task, and when it began; None: none that the judge knows."""


@contextlib.contextmanager
def ahead(world: World) -> Iterator[None]:
    """Note what the stop's thread writes meanwhile: the one that runs this."""
    stops, me = world.history.stops, threading.get_ident()
    # a key may cut in between another key and its stop
    stop = next((each for each in reversed(stops) if each.at == world.loop.now and not each.done), stops[-1])
    world.stopping[me] = stop
    try:
        yield
    finally:
        del world.stopping[me]
        stop.done = len(world.history.written)
        if not stop.who:
            world.history.told.latches.append((world.loop.now, True))
        for name in stop.forms:
            stop.own.setdefault(name, (stop.done, world.kernel.rest(name)))


class WatchedSession(Session):
    """A session that notes what the caller of each line got."""

    def __init__(self, settings: Settings, world: World, process: Process | None = None) -> None:
        super().__init__(settings, reconnect=True)
        self._world, self._process = world, process
        self.path, self.verbs = WatchedPath(self, world), WatchedVerbs(self, world)

    @property
    def _dead(self) -> bool:
        return self._process is not None and self._process.dead

    def stop_ahead(self) -> None:
        """Write the stop, and note it."""
        with ahead(self._world):
            super().stop_ahead()

    def stop(self, why: str = "stop", follows: bool = True) -> None:
        """Stop everything, and note it."""
        examine_before_a_stop(self._world)
        self._world.history.told.halts.append(self.now())
        super().stop(why, follows)

    async def run(self, line: str | TypedLine, *arguments: Any, **named: Any) -> None:
        """Run a line, and note its outcome."""
        text = (line if isinstance(line, str) else line.typed).strip()
        history = self._world.history
        command = history.commands.get(text)
        ASKED.set((text, self.now()) if text in history.questions else None)
        if command is None:
            return await super().run(line, *arguments, **named)
        command.began = self.now()
        command.times += self.recording.startswith("r")
        try:
            await super().run(line, *arguments, **named)
        except (DriveError, Diagnostic, TransportLost) as failure:
            self._ended(command, failure)
            raise
        except asyncio.CancelledError:
            if not self._dead:
                left = (command.line, command.text) in history.sent
                command.outcome = Outcome.UNKNOWN if left else Outcome.NOT_SENT
                command.said, command.ended = "cancelled", self.now()
            raise
        else:
            self._ended(command, ())

    def _ended(self, command: Command, result: tuple[str, ...] | BaseException) -> None:
        if self._dead:
            return
        command.ended, command.said = self.now(), str(result)
        notices = [
            text for at, text in self._world.history.notices if at >= command.began and f"'{command.text}'" in text
        ]
        command.outcome = WORDS[word(result, notices, command.text)]
        if isinstance(result, Diagnostic) or str(result) == LATCHED:  # before anything is sent
            command.outcome = Outcome.NOT_SENT
        where = f"{command.line}:{command.drive} {command.text!r}"
        self._world.history.note(command.ended, "host", f"{where}: {command.outcome.value} ({command.said})")
