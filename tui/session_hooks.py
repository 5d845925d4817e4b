"""The answers of the screen to its session: questions, forms, pages, the editor, changes of transcripts, the end."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from datetime import datetime, timedelta

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted, visible
from multidrop.shell.channel import Front
from multidrop.shell.roles import Filter, Transcripts
from multidrop.tui.actions import ScreenActions, ScreenParts
from multidrop.tui.presenter import Presenter
from multidrop.tui.screen_model import Record
from multidrop.tui.widgets.transcript import MARKS


class Hooks:
    """The answers of the screen to what a session asks of its front end."""

    def __init__(self, parts: ScreenParts, actions: ScreenActions, presenter: Presenter) -> None:
        self._parts, self._actions, self._presenter = parts, actions, presenter
        parts.session.front = Front(
            self._go_on,
            parts.questions.fill,
            before_quit=parts.leaving.ask,
            renamed=parts.selection.rename,
            edit=self._edit,
            unsaved=lambda: {str(text.file.path.absolute()) for text in parts.texts.unsaved()},
            screen=self._show_page,
            clear=actions.action_clear,
            transcripts=Transcripts(
                lambda: parts.main.times, self._set_times, self._choose, self._save, self._offer_unsent
            ),
        )

    async def _go_on(self, question: str) -> bool:
        self._presenter.take_records(self._parts.main)
        return await self._parts.questions.go_on(question)

    async def _show_page(self, name: str) -> None:
        """Show what `/page` and `/tour` name. Raises Diagnostic, and what an opening raises."""
        app = self._parts.app
        if name == "tour":
            await self._parts.tour.begin()
            return
        before = app.screen
        await self._actions.action_page(name)
        if app.screen is not before:
            self._parts.keyboard.turn_deaf()  # what was typed after the line was not meant for the page

    async def _edit(self, path: str) -> None:
        """Show a file in the editor. Raises Diagnostic."""
        self._parts.texts.open(path)
        await self._actions.action_page("program")

    # Transcripts

    def _set_times(self, form: str) -> None:
        main = self._parts.main
        main.times = form
        for page in (*main.pages.values(), main.beside.transcript):
            page.set_times(form)

    def _choose(self, wanted: Filter) -> None:
        """Show only some lines of the page that is shown."""
        self._parts.main.transcript.choose(wanted, typed=True)
        self._parts.main.transcript.look_end(newest=True)

    async def _save(self, path: str) -> str:
        """Write the lines of the page that is shown to a new file. Raises Diagnostic."""
        page, session = self._parts.main.transcript, self._parts.session
        records = [page.records[number] for number in page.sight.numbers]
        new_file.check(path)
        now = session.now()
        await asyncio.to_thread(_write, path, records, session.wall(now) - timedelta(seconds=now))
        what = f", {page.sight.filter.words}" if page.sight.filter else ""
        dropped = page.records.dropped
        older = f"; {counted(dropped, 'older line was', 'older lines were')} dropped before" if dropped else ""
        return f"{counted(len(records), 'line')}{what}, in {path}{older}"

    async def _offer_unsent(self) -> None:
        """Offer the lines that were not sent. Raises Diagnostic if there are none."""
        outbox = self._parts.outbox
        lines = outbox.unsent_lines()
        if not lines:
            raise Diagnostic("every line was sent", "/unsent", "it offers the lines that a failure or a stop held back")
        self._parts.keyboard.turn_deaf()
        await self._parts.questions.paste(lines, outbox.paste_again)


def _write(path: str, records: Sequence[Record], zero: datetime) -> None:
    """Write records to a new file. `zero`: the time of day at time 0 of the session's clock. Raises Diagnostic."""
    lines = []
    for record in records:
        time = (zero + timedelta(seconds=record.at)).isoformat(" ", "milliseconds")
        lines.append(f"{time}  {record.address:3} {MARKS[record.mark][0]} {visible(record.text)}\n")
    new_file.write(path, "".join(lines))
