"""The end of the screen that a person asks for: Ctrl+Q, `/quit`, a macro's `/quit`.

It is decided once everything that was sent is answered: only then it is known what moves. Until then no line leaves
that waits for the one before it, and keys wait. Where a question is asked, keys that were typed before it could be read
answer nothing; they are dropped and named. After an accepted quit nothing that is typed is sent: it is named on the
terminal once the screen is gone. Only the stop key works until the process ends, and it passes none of this.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from textual.app import App

from multidrop.base.text import counted
from multidrop.shell.quitting import not_sent
from multidrop.shell.session import Session
from multidrop.tui.outbox import Outbox
from multidrop.tui.screens.dialogs import Confirm
from multidrop.tui.screens.questions import PREVIEW, Answers, ScreenQuestions
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.text import visible
from multidrop.tui.typist import NOT_TEXT

DECLINED = "it was typed after a quit"


@dataclass(eq=False, repr=False)
class Leaving:
    """Decides whether the app ends. `stop` stops all; `unsaved` names files with a text that was not saved."""

    _app: App[int]
    _session: Session
    _keyboard: Keyboard
    _outbox: Outbox
    _questions: ScreenQuestions
    _stop: Callable[[], None]
    _unsaved: Callable[[], Sequence[str]]
    _warn: Callable[[str], None]
    over: bool = False
    """The app ends."""
    undecided: bool = False
    """A quit was asked for, and it is neither decided nor is its question shown: keys wait."""
    _deciding: bool = False

    def key(self) -> None:
        """Quit on the key. Later keys wait until that is decided, or its question has the focus; frames do not."""
        if not (self._deciding or self.over):
            self.undecided = True
            self._keyboard.hold(self)
            self._app.run_worker(self._quit(self._session.stops))

    async def _quit(self, stops: int) -> None:
        if await self.ask(stops):
            self._session.quit()

    async def ask(self, stops: int | None = None) -> bool:
        """Return True if the app may end; nothing that is typed is sent from then on.

        `stops` is the session's count as the quit was asked for, if that was before: a later stop cancels it.
        """
        stops = self._session.stops if stops is None else stops
        if self._deciding:
            return False
        if isinstance(self._app.screen, Confirm):
            self.undecided = False
            self._keyboard.release(self)
            return False
        self._deciding = self.undecided = True
        self._keyboard.hold(self)
        self._outbox.pause()
        accepted = False
        try:
            accepted = await self._decide(stops)
        finally:
            self._deciding = self.undecided = False
            if accepted:
                self.accept()
                self._app.exit(0)
            else:
                self._outbox.go_on()
            self._keyboard.release(self)
            if not accepted:
                for text in not_sent(_lines(self._keyboard.take_dropped()), DECLINED):
                    self._warn(text)
        return accepted

    async def _decide(self, stops: int) -> bool:
        moving = await self._session.in_motion()
        if self._session.stops != stops:
            return False
        lines, answers = unfinished(self._session, moving, self._outbox.waiting, self._unsaved())
        if not lines:
            self._keyboard.drop()
            return True
        answer = await self._questions.quit(Confirm("Quit?", lines, answers), self._shown)
        if answer == "stop":
            self._stop()
        return answer in ("stop", "leave")

    def _shown(self) -> None:
        """Let keys answer the question, which has the focus now."""
        self.undecided = False
        self._keyboard.release(self)

    def accept(self) -> None:
        """Take nothing from now on: the app ends, also after a signal."""
        self.over = True
        self._keyboard.close()
        self._outbox.close()

    def named(self) -> list[str]:
        """Name what was typed and not sent, in lines for the terminal after the screen. Call it at the very end."""
        return not_sent([*self._outbox.left, *_lines(self._keyboard.take_dropped())])


def _lines(typed: str) -> list[str]:
    """The lines of a text with a NUL for each key that is not text."""
    lines = [re.sub(NOT_TEXT, "", line).strip() for line in re.split(r"\r\n|\r|\n", typed)]
    return [line for line in lines if line]


def unfinished(
    session: Session, moving: Sequence[str], waiting: int, unsaved: Sequence[str] = ()
) -> tuple[list[str], Answers]:
    """The work that quitting would leave unfinished (empty: no need to ask), and the possible answers.

    `moving` has a line for each drive that moves, or may; `waiting` is the number of typed lines that were not sent.
    """
    lines = list(moving[:PREVIEW])
    if len(moving) > PREVIEW:
        lines.append(f"… and {len(moving) - PREVIEW} more")
    if waiting:
        lines.insert(0, f"{counted(waiting, 'line waits', 'lines wait')} and would not be sent")
    lines += [f"{visible(file)} is not saved; a copy is offered when it is opened again" for file in unsaved]
    answers = [("stop", "Stop all and quit"), ("stay", "Stay")]
    if session.busy:
        lines.insert(0, "a macro, a script or a transfer runs")
    else:
        answers.insert(1, ("leave", "Quit, drives go on"))
    return lines, answers
