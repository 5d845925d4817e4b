"""The program page: the editor and the drive; download, run, trace, step and break point.

Every line that it sends is a typed line, which a dialog shows before it is sent, and the transcript afterwards.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from functools import partial
from typing import ClassVar

from textual.binding import Binding, BindingType

from multidrop.dialects.program_files import Entry
from multidrop.shell.programs.checking import ending_of
from multidrop.shell.programs.program_text import ProgramGrammar
from multidrop.tui.panels.program import SIGNS, index_of, spot_of, state_words
from multidrop.tui.panels.table import column_rows, panel
from multidrop.tui.panels.view import View
from multidrop.tui.readout import ProgramFacts
from multidrop.tui.screens.dialogs import Ask, Confirm, Offer, Search, offers_like
from multidrop.tui.screens.edit import EditPage
from multidrop.tui.screens.page import Host
from multidrop.tui.screens.program_rows import (
    download_choices,
    download_facts,
    marks_of,
    quoted,
    run_choices,
    target_of,
    with_target,
)


class ProgramPage(EditPage):
    """The editor, with what the program in the selected drive does."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+d", "download", show=False, priority=True),
        Binding("ctrl+r", "run", show=False, priority=True),
        Binding("ctrl+t", "step", show=False, priority=True),
        Binding("ctrl+b", "break", show=False, priority=True),
    ]
    KEYS = (
        ("^S", "save"),
        ("^D", "download"),
        ("^R", "run"),
        ("^T", "step"),
        ("^B", "break"),
        ("^L", "next error"),
        ("^E", "open"),
        ("^O", "drive"),
    )

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._step: asyncio.Task[bool] | None = None

    # Painting

    def show(self, view: View) -> None:
        super().show(view)
        chosen = self.view.chosen if self.view is not None else None
        spot = spot_of(chosen.readout) if chosen is not None else None
        number = index_of(self.program.lines, spot.address) if spot is not None else None
        line = None if number is None else dict(self.findings.addresses).get(self.program.lines[number][0])
        current = (line, SIGNS[spot.phase]) if spot is not None and line is not None else None
        marks = marks_of(self.findings.problems, self._break_line(self.program), current)
        self.editor.show_marks(marks, line)
        side = self.lines("program-side")
        if side.display:
            panels = [panel(name) for name in ("drive", "program")]
            side.put(column_rows(panels, view, side.size.width, side.size.height, border=True))

    def state_words(self) -> str:
        """The action of the program, where no panel says it."""
        chosen = self.view.chosen if self.view is not None else None
        if self.view is None or chosen is None or self.lines("program-side").display:
            return ""
        words = state_words(chosen, self.view.now)
        return f"program: {words}" if words else ""

    def _break_line(self, program: ProgramFacts) -> int | None:
        """The line of the text, from 0, at which the break point is."""
        place = program.break_point
        if place.isdecimal():
            return dict(self.findings.addresses).get(int(place))
        return next((each.line - 1 for each in self.findings.entries if place and each.name == place), None)

    def _entries(self) -> Sequence[Entry]:
        return self.grammar.entries(self.editor.text) if self.grammar is not None else ()

    # The drive

    async def upload(self) -> None:
        """Read what the drive holds into a new file, and open that."""
        chosen = self.host.session.selected
        if chosen is None:
            return
        target = target_of(self.host.session)
        base = "-".join(filter(None, (self.host.session.selected_bus, chosen.address)))
        name = f"{base}-{self.host.session.wall(self.host.session.now()):%Y%m%d-%H%M}{ending_of(chosen.product)}"

        def named(file: str | None) -> None:
            if file:
                line = with_target("/upload", quoted(file), target)
                self.run_worker(self._then_open(self._start(line), file))

        await self.app.push_screen(Ask(f"New file for the program in {target or base}", name), named)

    async def _then_open(self, task: asyncio.Task[bool], file: str) -> None:
        await asyncio.wait([task])
        if not task.cancelled() and task.result():
            await self.open_file(file)

    # The drive

    def _start(self, line: str) -> asyncio.Task[bool]:
        """Run a line as if it was typed; a failure is shown in the transcript."""
        task = self.host.session.start(line)
        self.run_worker(_ended(task))
        return task

    def _target(self) -> str:
        return target_of(self.host.session)

    async def action_download(self) -> None:
        """Send the file to the drive: show what that does, and ask how."""
        self.take_text()
        text, chosen = self.text, self.host.session.selected
        if text is None or chosen is None:
            self.notify("No drive is selected: ^O chooses one" if text is not None else "No file: ^E opens one")
            return
        if not isinstance(self.grammar, ProgramGrammar):
            self.notify(f"{text.name} is not a program: nothing to download")
            return
        ways = download_choices(text, self._target())
        facts = download_facts(text, self.findings, self.program)

        async def answered(line: str | None) -> None:
            if line and (await self.save() if text.changed or text.file.new else True):
                self._start(line)

        title = f"Download {text.name} to {self._target() or chosen.product}?"
        answers = [(each.line, f"{each.title:<38} {each.line}") for each in ways]
        await self.app.push_screen(Confirm(title, facts, answers), answered)

    async def action_run(self) -> None:
        await self._choose("", "Run in")

    async def _choose(self, only: str, title: str) -> None:
        chosen = self.host.session.selected
        if chosen is None:
            self.notify("No drive is selected: ^O chooses one")
            return
        program = self.program
        found = run_choices(self._entries(), self._target(), program)
        found = [each for each in found if only in each.line]
        known = "is this text" if self.findings.addresses else "may be another one than this text"
        heading = f"{title} {self._target() or chosen.product}: its program {known}"

        def taken(key: str | None) -> None:
            if key is not None:
                self._start(found[int(key)].line)

        hint = "type to narrow   ↑↓ choose   Enter do it   Esc close"
        offers = [Offer(str(number), f"{each.title:<30}  {each.line}") for number, each in enumerate(found)]
        await self.app.push_screen(Search(heading, partial(offers_like, offers), hint), taken)

    async def action_step(self) -> None:
        """Execute one line of a program that waits; else choose where to begin. One press is one line at most."""
        if self._step is not None and not self._step.done():
            self.notify("The step before is not done yet", timeout=2)
            return
        program = self.program
        if program.line is not None and program.phase.waits:
            self._step = self._start(with_target("/step", self._target()))
        else:
            await self._choose("/step ", "Step in")

    async def action_break(self) -> None:
        """Set the break point at the line of the cursor, or remove it there."""
        row, target, program = self.editor.cursor_location[0], self._target(), self.program
        if self.host.session.selected is None:
            return
        if self._break_line(program) == row:
            self._start(with_target("/break", target, "off"))
            return
        place = next((each.name for each in self._entries() if each.line == row + 1), "")
        place = place or next((str(at) for at, line in self.findings.addresses if line == row), "")
        if place:
            self._start(with_target("/break", target, place))
        else:
            self.notify(
                "No label here, and no address: the drive is not known to hold this text; ^D sends it", timeout=6
            )


async def _ended(task: asyncio.Task[bool]) -> None:
    """Wait for a line; a bug in it ends the app."""
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()
