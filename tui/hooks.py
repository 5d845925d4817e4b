"""The functions of the screen that a session calls: questions, forms, pages, the editor, and the end."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from multidrop.shell.channel import Field
from multidrop.tui.actions import Actions
from multidrop.tui.presenter import Presenter
from multidrop.tui.terminal.keyboard import Keyboard


class Hooks:
    """Sets the functions of a session that need the screen. `closed` is called after each dialog."""

    def __init__(self, app: Actions, keyboard: Keyboard, presenter: Presenter, closed: Callable[[], None]) -> None:
        self._app, self._keyboard, self._presenter, self._closed = app, keyboard, presenter, closed
        session = app.session
        session.ask, session.fill = self._go_on, self._fill_in
        session.screen, session.edit = self._show_page, self._edit
        session.before_quit, session.renamed = self._before_quit, app.selection.rename

    async def _go_on(self, question: str) -> bool:
        """Put a question of the session. Keys typed ahead answer nothing."""
        self._keyboard.turn_deaf()
        main = self._app.main
        self._presenter.take_records(main)
        before = main.page(main.current).since_typed()
        return await self._app.questions.go_on(question, before, self._closed)

    async def _fill_in(self, title: str, fields: Sequence[Field]) -> dict[str, str] | None:
        """Put a form of the session. Keys typed ahead are not for it."""
        self._keyboard.turn_deaf()
        return await self._app.questions.fill(title, fields, self._closed)

    async def _show_page(self, name: str) -> None:
        """Show what `/page` and `/tour` name. Raises Diagnostic, and what an opening raises."""
        app = self._app
        if name == "tour":
            await app.tour.begin()
            return
        before = app.screen
        await app.action_page(name)
        if app.screen is not before:
            self._keyboard.turn_deaf()  # what was typed after the line was not meant for the page

    async def _edit(self, path: str) -> None:
        """Show a file in the editor. Raises Diagnostic."""
        self._app.texts.open(path)
        await self._app.action_page("program")

    async def _before_quit(self) -> bool:
        """Take `/quit` as Ctrl+Q, which ends the app by itself."""
        self._app.call_later(self._app.action_quit)
        return False
