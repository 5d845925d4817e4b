"""The program page: an editor of a text file, and the drive: download, run, trace, step and break point.

A text is opened, checked as it is typed, and saved. It stays when the page is left, after a stop and when the line is
lost. Soon after an edit a copy of it is on the disk (`base.store`), which survives a crash.

Every line that it sends is a typed line, which a dialog shows before it is sent, and the transcript afterwards.
"""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical

from multidrop.base.errors import Diagnostic
from multidrop.dialects.program_files import Problem, ProgramEntry, in_order
from multidrop.shell.programs.checking import ending_of
from multidrop.shell.programs.edited_file import real_text
from multidrop.shell.programs.program_text import ProgramGrammar
from multidrop.tui.editor import ConfigurationGrammar, Editor, Grammar, grammar_of, problem_of
from multidrop.tui.panels.program import SIGNS, index_of, spot_of, state_words
from multidrop.tui.panels.table import column_rows, panel, side_width
from multidrop.tui.panels.view import View
from multidrop.tui.readout import ProgramFacts
from multidrop.tui.screens.dialogs import Ask, Confirm, ListedChoice, SearchDialog, offers_like
from multidrop.tui.screens.page import Page, PageHost, start
from multidrop.tui.screens.program_file import FileOnDisk, FileOnScreen
from multidrop.tui.screens.program_rows import (
    MOST_PROBLEMS,
    UPLOAD,
    Finder,
    Findings,
    Unit,
    download_choices,
    download_facts,
    download_trouble,
    examined,
    files_in,
    heading_row,
    marks_of,
    news_rows,
    problem_rows,
    rule,
    run_choices,
    target_of,
    unit_of,
    with_target,
)
from multidrop.tui.texts import OpenText
from multidrop.tui.tour import FILE_HEADING

CHECK_DELAY = 0.4
"""Seconds without an edit after which a text is checked, and its copy is kept."""
WIDE_FROM = 110
NEWS = 3, 8
"""Least lines of the transcript below the editor; the rows of a screen for each, where there are more."""
NO_FACTS = ProgramFacts()


class ProgramPage(Page):
    """The editor, the file in it, what the check of its text found, and what the program in the drive does."""

    AUTO_FOCUS = "#editor"
    SHEET = "program"
    WANTS = frozenset({"motion", "conditions"})

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.editor = Editor(id="editor")
        self.text: OpenText | None = None
        self.grammar: Grammar | None = None
        self.file = FileOnScreen(self)
        self.findings = Findings()
        self.view = View(host.session, host.model, (), host.session.now(), True)
        self._edited_at: float | None = None
        """The time of the last edit that was not taken in; None: there is none."""
        self._taking_in = False
        self._compared: tuple[object, Unit] = ((), ("", "", ""))
        """The lines of the drive to which the text was compared, and the product for which it was checked."""
        self._checked: str | None = None
        """The text of which the findings are."""
        self._warned = ""
        self._step: asyncio.Task[bool] | None = None

    def content(self) -> ComposeResult:
        """Make the editor with its heading, the rows below it, and the panels of a wide screen."""
        with Horizontal(id="program"):
            with Vertical(id="program-left"):
                yield self.part("heading")
                yield self.editor
                yield self.part("below")
            yield self.part("program-side")

    async def on_mount(self) -> None:
        """Show the last text, or ask for a file."""
        self.editor.read_only = True
        self.host.texts.take = self.take_text
        self.set_interval(CHECK_DELAY / 2, self._settle)
        self.on_resize()
        if self.host.texts.current is not None:
            self.show_text(self.host.texts.current)
            self.file.come_back()
        else:
            await self.action_open()

    @property
    def in_front(self) -> bool:
        """Whether it is shown, without a box in front of it."""
        return self.is_attached and self.app.screen is self

    def on_unmount(self) -> None:
        """Keep the text as it was left."""
        self.host.keyboard.release(self)
        self.take_text()
        self.host.texts.take = None

    def on_resize(self) -> None:
        """Give the panels their column where there is room."""
        side = self.lines("program-side")
        side.display = self.size.width >= WIDE_FROM
        side.styles.width = side_width(self.size.width)

    # Painting

    def show(self, view: View) -> None:
        self.view = view
        width = self.editor.size.width
        title = self.grammar.title if self.grammar is not None else ""
        outside = self.file.outside
        self.lines("heading").put([heading_row(self.text, title, self.findings, view.chosen, width, outside)])
        lines, unit = self._compared
        if (self.program.lines is not lines or unit_of(self.host.session) != unit) and self._edited_at is None:
            self._edited_at = 0.0
        most = self.size.height // 2 if isinstance(self.grammar, ConfigurationGrammar) else MOST_PROBLEMS
        rows = problem_rows(self.findings.problems, self.editor.cursor_location[0] + 1, width, max(most, MOST_PROBLEMS))
        rows = [rule(self.findings.words[0].strip(), width), *rows] if rows else []
        rows.append(rule("transcript", width, self.state_words()))
        news = self.host.last_records(max(NEWS[0], self.size.height // NEWS[1]))
        rows += news_rows(news, self.host.session.wall, width)
        self.lines("below").put_all(rows)
        self._show_program(view)

    def _show_program(self, view: View) -> None:
        """Paint the signs beside the lines, and the panels."""
        chosen = view.chosen
        spot = spot_of(chosen.readout) if chosen is not None else None
        number = index_of(self.program.lines, spot.address) if spot is not None else None
        line = None if number is None else dict(self.findings.addresses).get(self.program.lines[number][0])
        current = (line, SIGNS[spot.phase]) if spot is not None and line is not None else None
        marks = marks_of(self.findings.problems, self._break_line(self.program), current)
        self.editor.show_marks(marks, line)
        side = self.lines("program-side")
        if side.display:
            places = [[panel("drive")], [panel(name) for name in ("program", "plot", "drives")]]
            side.put(column_rows(places, view, side.size.width, side.size.height, border=True))

    @property
    def program(self) -> ProgramFacts:
        return self.view.chosen.readout.program if self.view.chosen is not None else NO_FACTS

    def state_words(self) -> str:
        """The action of the program, where no panel says it."""
        if self.view.chosen is None or self.lines("program-side").display:
            return ""
        words = state_words(self.view.chosen, self.view.now)
        return f"program: {words}" if words else ""

    def _break_line(self, program: ProgramFacts) -> int | None:
        """The line of the text, from 0, at which the break point is."""
        place = program.break_point
        if place.isdecimal():
            return dict(self.findings.addresses).get(int(place))
        return next((entry.line - 1 for entry in self.findings.entries if place and entry.name == place), None)

    def _entries(self) -> Sequence[ProgramEntry]:
        return self.grammar.entries(self.editor.text) if self.grammar is not None else ()

    # The text

    def on_text_area_changed(self) -> None:
        """Note an edit; it is taken in after a pause."""
        self._edited_at = asyncio.get_running_loop().time()
        self.findings = replace(self.findings, pending=True)

    def take_text(self) -> None:
        if self.text is not None and not self.editor.read_only:
            self.text.text, self.text.cursor = self.editor.text, self.editor.cursor_location

    def _settle(self) -> None:
        """Take in the text after a pause in the editing."""
        now = asyncio.get_running_loop().time()
        if self._edited_at is not None and now - self._edited_at >= CHECK_DELAY and not self._taking_in:
            self._taking_in, self._edited_at = True, None
            self.run_worker(self._take_in())
        if self.file.look_is_due(now):
            self.run_worker(self.file.look())

    async def _examine(self) -> Findings | None:
        """Check the text on the screen, and compare it with the drive's program; None without a text."""
        self.take_text()
        text, grammar, lines = self.text, self.grammar, self.program.lines
        if text is None or grammar is None:
            return None
        unit, shown = unit_of(self.host.session), text.text
        self._compared = lines, unit
        findings = await asyncio.to_thread(examined, grammar, shown, unit, lines)
        if isinstance(grammar, ConfigurationGrammar):
            more = map(problem_of, self.host.troubles_of_text(real_text(shown), text.name))
            findings = replace(findings, problems=tuple(in_order([*findings.problems, *more])))
        self.take_text()
        if self.text is text and text.text == shown:
            self.findings, self._checked = findings, shown
        return findings

    async def _look_at_text(self) -> None:
        """Check the text now if it was edited since the last check: its lines have other addresses, and labels."""
        if self.editor.text != self._checked:
            await self._examine()

    async def _take_in(self) -> None:
        """Check the text, compare it with the drive's program, and keep a copy of it."""
        try:
            await self._examine()
            if (text := self.text) is not None and self.host.texts.due(text):
                await asyncio.to_thread(self.host.texts.keep, text)
        except Diagnostic as problem:
            self._warn(str(problem))
        finally:
            self._taking_in = False

    def _warn(self, text: str) -> None:
        if text != self._warned:
            self._warned = text
            self.host.show_line(text, "!")

    def show_text(self, text: OpenText) -> None:
        self.text, self.grammar, self.findings = text, grammar_of(text.name), Findings(pending=True)
        self.editor.read_only = False
        self.editor.show_text(text.text, self.grammar, text.cursor)
        self._edited_at = 0.0
        if text.file.mixed:
            self._warn(f"{text.name}: its line ends are mixed; a save makes them one kind")
        self.set_focus(self.editor)

    # Files

    async def action_open(self, folder: str = "") -> None:
        """Choose a file to edit, of this folder or of another one."""
        self.take_text()
        files = await asyncio.to_thread(files_in, folder)
        selected = self.host.session.selected
        drive = "" if selected is None else target_of(self.host.session) or selected.product
        find = Finder(files, self.host.texts.unsaved(), drive, folder)
        heading = f"Program file in {folder}" if folder else FILE_HEADING
        await self.app.push_screen(SearchDialog(heading, find, "open"), self._open)

    async def _open(self, name: str | None) -> None:
        if name == UPLOAD:
            await self.upload()
        elif name and name.endswith("/"):
            await self.action_open(name)
        elif name:
            self.host.keyboard.hold(self)
            self.run_worker(self.file.open(name))

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
                line = with_target("/upload", shlex.quote(file), target)
                self.run_worker(self._then_open(start(self, line), file))

        await self.app.push_screen(Ask(f"New file for the program in {target or base}", name), named)

    async def _then_open(self, task: asyncio.Task[bool], file: str) -> None:
        await asyncio.wait([task])
        if not task.cancelled() and task.result():
            await self.file.open(file)

    async def action_save(self) -> None:
        await self.file.save()

    def action_next_problem(self) -> None:
        """Go to the next problem below the cursor, errors before warnings."""
        problems: Sequence[Problem] = self.findings.problems
        place = self.editor.cursor_location
        wrong = [problem for problem in problems if not problem.warning] or list(problems)
        later = [problem for problem in wrong if (problem.line - 1, problem.column - 1) > place]
        if wrong:
            problem = (later or wrong)[0]
            self.editor.move_cursor((problem.line - 1, problem.column - 1), center=True)

    def action_leave(self) -> None:
        self.take_text()
        super().action_leave()

    # The drive

    async def action_download(self) -> None:
        """Send the text on the screen to the drive: show what that does, and ask how."""
        self.take_text()
        text, chosen = self.text, self.host.session.selected
        if text is None or chosen is None:
            self.notify("No drive is selected: ^O chooses one" if text is not None else "No file: ^E opens one")
            return
        if not isinstance(self.grammar, ProgramGrammar):
            self.notify(f"{text.name} is not a program: nothing to download")
            return
        if not chosen.family.offers("programs"):
            self.notify(f"Nothing was sent: {chosen.family.no_programs}")
            return
        self.host.keyboard.hold(self)  # keys are for the question
        self.run_worker(self._ask_download(text, chosen.product, self.host.session.stops))

    async def _ask_download(self, text: OpenText, product: str, stops: int) -> None:
        """Look at the disk, check the text that is on the screen then, and ask; that text is sent, and no other."""
        try:
            seen = await self.file.catch_up()
            if seen is FileOnDisk.ASKED or self.text is not text:
                return
            findings = await self._examine()
            if not self.in_front or self.text is not text or findings is None or self.host.session.stops != stops:
                return
            target, shown, outside = target_of(self.host.session), text.text, self.file.outside
            again = self.file.news.words if seen is FileOnDisk.READ else ""
            if trouble := download_trouble(text, findings):
                self.notify(trouble)
                return
            facts = download_facts(self.program, outside, again)

            def answered(line: str | None) -> None:
                if line:
                    self.run_worker(self._download(line, text, shown, self.host.session.stops))

            title = f"Download {text.name} to {target or product}?"
            choices = download_choices(text, target, bool(again))
            answers = [(choice.line, f"{choice.title}\n   {choice.line}".rstrip()) for choice in choices]
            await self.app.push_screen(Confirm(title, facts, answers), answered)
        finally:
            self.host.keyboard.release(self)

    async def _download(self, line: str, text: OpenText, shown: str, stops: int) -> None:
        """Save the text that was shown, if the file has another one, and send it. `stops`: those before the answer."""
        if not (text.file.new or shown != text.file.text) or await self.file.save(shown):
            start(self, line, real_text(shown), stops)

    async def action_run(self) -> None:
        await self._choose("", "Run in")

    async def _choose(self, only: str, title: str) -> None:
        chosen = self.host.session.selected
        if chosen is None:
            self.notify("No drive is selected: ^O chooses one")
            return
        program = self.program
        await self._look_at_text()
        choices = run_choices(self._entries(), target_of(self.host.session), program, chosen.family.debugging)
        choices = [choice for choice in choices if only in choice.line]
        known = "is this text" if self.findings.addresses else "may be another one than this text"
        heading = f"{title} {target_of(self.host.session) or chosen.product}: its program {known}"

        def taken(key: str | None) -> None:
            if key is not None:
                start(self, choices[int(key)].line)

        offers = [
            ListedChoice(str(number), f"{choice.title:<30}  {choice.line}") for number, choice in enumerate(choices)
        ]
        await self.app.push_screen(SearchDialog(heading, partial(offers_like, offers), "do it"), taken)

    async def action_step(self) -> None:
        """Execute one line of a program that waits; else choose where to begin. One press is one line at most."""
        if self._step is not None and not self._step.done():
            self.notify("The step before is not done yet", timeout=2)
            return
        program, chosen = self.program, self.host.session.selected
        if chosen is not None and (debugging := chosen.family.debugging) is not None and debugging.cannot_step:
            self.notify(f"Nothing was sent: {debugging.cannot_step}; ^R traces a program instead")
        elif program.line is not None and program.phase.waits:
            self._step = start(self, with_target("/step", target_of(self.host.session)))
        else:
            await self._choose("/step ", "Step in")

    async def action_break(self) -> None:
        """Set the break point at the line of the cursor, or remove it there."""
        row, target, program = self.editor.cursor_location[0], target_of(self.host.session), self.program
        if self.host.session.selected is None:
            return
        await self._look_at_text()
        if self._break_line(program) == row:
            start(self, with_target("/break", target, "off"))
            return
        place = next((entry.name for entry in self._entries() if entry.line == row + 1), "")
        place = place or next((str(at) for at, line in self.findings.addresses if line == row), "")
        if place:
            start(self, with_target("/break", target, place))
        else:
            self.notify(
                "No label here, and no address: the drive is not known to hold this text; ^D sends it", timeout=6
            )
