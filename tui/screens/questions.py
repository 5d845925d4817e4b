"""The dialogs of one app: what each asks, from what is known at the time, and what an answer does."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import TypeVar

from rich.text import Text
from textual.app import App

from multidrop.dialects.text import counted
from multidrop.drives.bus import Bus
from multidrop.shell.channel import Field
from multidrop.shell.session import Session
from multidrop.tui.panels.view import Glance
from multidrop.tui.screens.dialogs import Ask, Choose, Confirm, Dialog, Form, GoOn, Match, Offer, Search, TooSmall
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.text import visible
from multidrop.tui.widgets.theme import THEMES, Signs

T = TypeVar("T")
HELP = "Help"
"""The heading of the help."""
Answers = list[tuple[str, str]]
"""(key, text) of each answer."""
PREVIEW = 6
"""Number of lines that a question shows of a longer list."""
FOUND = 100
"""Greatest number of history lines that a search lists; a longer text finds older ones."""


class Questions:
    """Opens the dialogs of an app. Each method returns once its dialog is open and has the focus."""

    def __init__(self, app: App[int], session: Session, main: MainScreen, keyboard: Keyboard) -> None:
        self._app, self._session, self._main, self._keyboard = app, session, main, keyboard

    async def _open(self, dialog: Dialog[T], take: Callable[[T], Awaitable[object] | None]) -> None:
        """Open a dialog; `take` is given its answer, if there is one."""

        async def answered(answer: T | None) -> None:
            if answer is not None and (taking := take(answer)) is not None:
                await taking

        await self._app.push_screen(dialog, answered)

    async def paste(self, lines: list[str], send: Callable[[list[str]], None]) -> None:
        """Ask before several pasted lines are sent."""
        title, shown, answers = sending(self._session, lines)

        def answered(answer: str | None) -> None:
            if answer == "send":
                send(lines)

        await self._app.push_screen(Confirm(title, shown, answers), answered)

    async def go_on(self, question: str, closed: Callable[[], None]) -> bool:
        """Ask before a step that needs a yes; return the answer. A cancellation closes the question."""
        try:
            box = GoOn(question, self._main.action_look, self._main.give_room)
            agreed: bool | None = await self._answer(box, closed)
            return bool(agreed)
        finally:
            self._main.give_room(0)

    async def fill(self, title: str, fields: Sequence[Field], closed: Callable[[], None]) -> dict[str, str] | None:
        """Ask for values; return them by name, None if the form was closed. A cancellation closes it."""
        return await self._answer(Form(title, fields), closed)

    async def _answer(self, screen: Dialog[T], closed: Callable[[], None]) -> T | None:
        """Ask what nobody opened with a key; keys that were typed before it is shown are not for it."""
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
        try:
            return await given
        finally:
            if app.screen is screen:
                screen.dismiss(None)
            closed()

    async def macro_name(self, record: Callable[[str], Awaitable[None]], key: str = "") -> None:
        """Ask for the name of a macro that is recorded; for a key, which ends the recording."""

        async def named(name: str) -> None:
            if name:
                await record(name)

        await self._open(
            Ask(
                f"{key and f'{key} plays nothing yet. '}Record what is typed as a macro named",
                about=f"{key or '/record stop'} ends it",
            ),
            named,
        )

    async def history(self, lines: Sequence[str], take: Callable[[str], None]) -> None:
        """Search the lines typed before, oldest first in `lines`."""
        kept = list(dict.fromkeys(reversed(lines)))
        await self._open(Search("Lines typed before", lambda text: lines_like(kept, text), "into the line"), take)

    async def palette(self, find: Callable[[str], list[Match]], run: Callable[[int], Awaitable[object]]) -> None:
        """Search all commands; `run` is given the number of the one that was taken."""
        await self._open(Search("Everything", find, "do it"), lambda key: run(int(key)))

    async def drive(self, glances: Callable[[Bus], list[Glance]], select: Callable[[str, str], None]) -> None:
        options, current = drive_choices(self._session, glances)
        if not options:
            self._app.notify("No drive is known: /open URL opens a line of drives", timeout=4)
            return
        await self._open(Choose("Plain text goes to", options, current), lambda key: select(*_place_of(key)))

    async def half(self, glances: Callable[[Bus], list[Glance]], show: Callable[[str, str], None]) -> None:
        """Choose the drive or the line for the other half of the screen."""
        drives, _ = drive_choices(self._session, glances)
        lines = [Offer(f"{name}\n", f" {name:<8} all of the line") for name in self._session.buses]
        if lines:
            await self._open(Choose("The other half shows", [*drives, *lines]), lambda key: show(*_place_of(key)))

    async def theme(self) -> None:
        ours = [theme.name for theme in THEMES]
        themes = [Offer(name, name) for name in [*ours, *sorted(set(self._app.available_themes) - set(ours))]]
        await self._open(Choose("Theme", themes, self._app.theme), partial(setattr, self._app, "theme"))

    async def signs(self, show: Callable[[Signs], None]) -> None:
        answers = [
            Offer(Signs.FULL.value, "full     ⣀⠔⠉ ▶ ■ ✗ ● ○   all signs"),
            Offer(Signs.BOXES.value, "boxes    no braille: Linux console, PuTTY"),
            Offer(Signs.ASCII.value, "ascii    nothing but ASCII"),
        ]
        await self._open(Choose("Signs", answers), lambda name: show(Signs(name)))

    async def quit(
        self,
        waiting: Callable[[], int],
        stop: Callable[[], None],
        closed: Callable[[], None],
        unsaved: Sequence[str] = (),
    ) -> None:
        """Quit; ask first if that leaves something unfinished.

        `waiting` counts the lines that were not sent; `unsaved` are files with a text that was not saved.
        """
        app = self._app
        if isinstance(app.screen, Confirm):
            return
        lines, answers = leaving(self._session, await self._session.in_motion(), waiting(), unsaved)
        if not lines:
            app.exit(0)
            return

        def answered(answer: str | None) -> None:
            if answer == "stop":
                stop()
            if answer in ("stop", "leave"):
                app.exit(0)
            closed()

        if isinstance(app.screen, TooSmall):
            app.pop_screen()
        await app.push_screen(Confirm("Quit?", lines, answers), answered)

    async def help(self, find: Callable[[str], list[Match]]) -> None:
        await self._app.push_screen(Search(HELP, find, "close"))


def _place_of(key: str) -> tuple[str, str]:
    """The address and the bus of a key of `drive_choices`."""
    bus, _, address = key.partition("\n")
    return address, bus


def drive_choices(session: Session, glances: Callable[[Bus], list[Glance]]) -> tuple[list[Offer], str]:
    """Every drive of every bus, the selected bus first, and the key of the selected one: bus, line feed, address."""
    now = session.now()
    options: list[Offer] = []
    current = ""
    for bus in sorted(session.buses.values(), key=lambda bus: bus.name != session.selected_bus):
        for glance in glances(bus):
            key = f"{bus.name}\n{glance.address}"
            current = key if glance.selected else current
            sign = glance.sign(now)[0]
            text = f" {bus.name:<8} {glance.address:<3} {glance.label:<12} {sign} {glance.product}"
            options.append(Offer(key, text, f"{bus.name} {glance.address} {glance.label}"))
    return options, current


def leaving(
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


def sending(session: Session, lines: Sequence[str]) -> tuple[str, list[str], Answers]:
    """Title, preview and answers for several pasted lines."""
    drive = session.selected
    to = f" to {drive.label or drive.address or session.selected_bus}" if drive is not None else ""
    shown = [f"  {line[:60]}" for line in lines[:PREVIEW]]
    if len(lines) > PREVIEW:
        shown.append(f"  … and {len(lines) - PREVIEW} more")
    answers = [("send", f"Send {len(lines)} lines"), ("no", "Do not send")]
    return f"Send {len(lines)} pasted lines{to}?", shown, answers


def lines_like(lines: Sequence[str], typed: str) -> list[Match]:
    """The lines that contain the typed text, in the order given."""
    wanted = typed.casefold()
    found = (line for line in lines if wanted in line.casefold())
    return [Match(line, Text(visible(line))) for line, _ in zip(found, range(FOUND), strict=False)]
