"""The dialogs of one app: what each asks, from what is known at the time, and what an answer does."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import TypeVar

from rich.text import Text
from textual.app import App

from multidrop.drives.bus import Bus
from multidrop.shell.channel import AskedValue
from multidrop.shell.line_syntax import Place
from multidrop.shell.session import Session
from multidrop.tui.panels.view import Glance
from multidrop.tui.screens.dialogs import Confirm, Dialog, FormDialog, GoOn, ListedChoice, Match, TooSmall
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.text import visible

T = TypeVar("T")
Answers = list[tuple[str, str]]
"""(key, text) of each answer."""
PREVIEW = 6
"""Number of lines that a question shows of a longer list."""
FOUND = 100
"""Greatest number of history lines that a search lists; a longer text finds older ones."""


class ScreenQuestions:
    """Opens the dialogs of an app. Each method returns once its dialog is open and has the focus.

    `closed` is called after a question that the session asked.
    """

    def __init__(
        self, app: App[int], session: Session, main: MainScreen, keyboard: Keyboard, closed: Callable[[], None]
    ) -> None:
        self._app, self._session, self._main, self._keyboard = app, session, main, keyboard
        self._closed = closed

    async def open(self, dialog: Dialog[T], take: Callable[[T], Awaitable[object] | None]) -> None:
        """Open a dialog; `take` is given its answer, if there is one."""

        async def answered(answer: T | None) -> None:
            if answer is not None and (taking := take(answer)) is not None:
                await taking

        await self._app.push_screen(dialog, answered)

    async def paste(self, lines: list[str], send: Callable[[list[str], Place], None]) -> None:
        """Ask before several pasted lines are sent to the drive that the question names, whatever is selected later."""
        drive, place, count = self._session.selected, self._session.place, len(lines)
        to = f" to {drive.label or drive.address or self._session.selected_bus}" if drive is not None else ""
        shown = [f"  {line[:60]}" for line in lines[:PREVIEW]]
        if count > PREVIEW:
            shown.append(f"  … and {count - PREVIEW} more")
        answers = [("send", f"Send {count} lines"), ("no", "Do not send")]

        def answered(answer: str | None) -> None:
            if answer == "send":
                send(lines, place)

        question = Confirm(f"Send {count} pasted lines{to}?", shown, answers)
        self._keyboard.turn_deaf()  # an Enter that came with the paste is no answer
        question.told = self._keyboard.early
        await self._app.push_screen(question, answered)

    async def go_on(self, question: str) -> bool:
        """Ask before a step that needs a yes; return the answer. A cancellation closes the question."""
        try:
            box = GoOn(question, self._main.action_look, self._main.give_room)
            agreed: bool | None = await self._answer(box)
            return bool(agreed)
        finally:
            self._main.give_room(0)

    async def fill(self, title: str, fields: Sequence[AskedValue]) -> dict[str, str] | None:
        """Ask for values; return them by name, None if the form was closed. A cancellation closes it."""
        return await self._answer(FormDialog(title, fields))

    async def _answer(self, screen: Dialog[T], shown: Callable[[], None] = lambda: None) -> T | None:
        """Ask, and return the answer; keys that were typed before the question is shown are not for it."""
        app = self._app
        self._keyboard.turn_deaf()
        screen.told = self._keyboard.early
        given: asyncio.Future[T | None] = asyncio.get_running_loop().create_future()

        def answered(answer: T | None) -> None:
            if not given.done():
                given.set_result(answer)

        if isinstance(app.screen, TooSmall):
            app.pop_screen()
        await app.push_screen(screen, answered)
        shown()
        try:
            return await given
        finally:
            if app.screen_stack[-1:] == [screen]:  # the app may have ended meanwhile
                screen.dismiss(None)
            if app.screen_stack:
                self._closed()

    async def quit(self, question: Confirm, shown: Callable[[], None]) -> str | None:
        """Ask whether to quit; `shown` is called once the question has the focus. Return the answer, None for none."""
        return await self._answer(question, shown)


def place_of(key: str) -> tuple[str, str]:
    """The address and the bus of a key of `drive_choices`."""
    bus, _, address = key.partition("\n")
    return address, bus


def drive_choices(session: Session, glances: Callable[[Bus], list[Glance]]) -> tuple[list[ListedChoice], str]:
    """Every drive of every bus, the selected bus first, and the key of the selected one: bus, line feed, address."""
    now = session.now()
    options: list[ListedChoice] = []
    current = ""
    for bus in sorted(session.tabs.shown, key=lambda bus: bus.name != session.selected_bus):
        for glance in glances(bus):
            key = f"{bus.name}\n{glance.address}"
            current = key if glance.selected else current
            sign = glance.sign(now)[0]
            text = f" {bus.name:<8} {glance.address:<3} {glance.label:<12} {sign} {glance.product}"
            options.append(ListedChoice(key, text, f"{bus.name} {glance.address} {glance.label}"))
    return options, current


def lines_like(lines: Sequence[str], typed: str) -> list[Match]:
    """The lines that contain the typed text, in the order given."""
    wanted = typed.casefold()
    matching = (line for line in lines if wanted in line.casefold())
    return [Match(line, Text(visible(line))) for line, _ in zip(matching, range(FOUND), strict=False)]
