"""A page with a text file in an editor: opened, checked as it is typed, saved; its copy survives a crash.

The text stays when the page is left, after a stop and when the line is lost. Soon after an edit a copy of it is on the
disk (`shell.state.drafts`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical

from multidrop.dialects import Diagnostic
from multidrop.dialects.program_files import Part, Problem
from multidrop.shell.programs.edited_file import ChangedMeanwhile, real_text
from multidrop.tui.editor import Editor, Grammar, MacroGrammar, grammar_of
from multidrop.tui.panels.view import View
from multidrop.tui.readout import ProgramFacts
from multidrop.tui.screens.dialogs import Confirm, Search
from multidrop.tui.screens.page import Host, Page
from multidrop.tui.screens.program_rows import (
    UPLOAD,
    Finder,
    Findings,
    files_in,
    heading_row,
    news_rows,
    problem_rows,
    rule,
    target_of,
)
from multidrop.tui.texts import OpenText

if TYPE_CHECKING:
    from multidrop.shell.session import Session

# The lines of a file and those in a drive: which line of the file has which address, where both hold one program.


Parts = Callable[[str], Sequence[Part]]


def aligned(text: str, rows: Sequence[tuple[int, str]], parts: Parts) -> Mapping[int, int]:
    """Return the line of the file, from 0, by address; empty unless the lines of the drive are there once, in a row."""
    file = [(number, bare) for number, line in enumerate(text.split("\n")) if (bare := _bare(line, parts))]
    held = [_bare(line, parts) for _, line in rows]
    size = len(held)
    found = [at for at in range(len(file) - size + 1) if size and [bare for _, bare in file[at : at + size]] == held]
    if len(found) != 1:
        return {}
    return {address: number for (address, _), (number, _) in zip(rows, file[found[0] :], strict=False)}


def _bare(line: str, parts: Parts) -> str:
    """A line without its remark and its blanks, in capitals; `=` is a blank in most places."""
    end = next((part.start for part in parts(line) if part.kind == "remark"), len(line))
    return "".join(line[:end].upper().replace("=", " ").split())


PAUSE = 0.4
"""Seconds without an edit after which a text is checked, and its copy is kept."""
WIDE = 110
NEWS = 3
"""Lines of the transcript below the editor."""
NO_FACTS = ProgramFacts()


class EditPage(Page):
    """The editor, the file in it, and what the check of its text found."""

    AUTO_FOCUS = "#editor"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+s", "save", show=False, priority=True),
        Binding("ctrl+e", "open", show=False, priority=True),
        Binding("ctrl+l", "next_problem", show=False, priority=True),
    ]
    WANTS = frozenset({"motion", "conditions"})

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self.editor = Editor(id="editor")
        self.text: OpenText | None = None
        self.grammar: Grammar | None = None
        self.findings = Findings()
        self.view: View | None = None
        self._edited_at: float | None = None
        """The time of the last edit that was not taken in; None: there is none."""
        self._taking_in = False
        self._compared: tuple[object, str] = ((), "")
        """The lines of the drive to which the text was compared, and the product for which it was checked."""
        self._warned = ""

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
        self.set_interval(PAUSE / 2, self._settle)
        self.on_resize()
        if self.host.texts.current is not None:
            self._show_text(self.host.texts.current)
        else:
            await self.action_open()

    def on_unmount(self) -> None:
        """Keep the text as it was left."""
        self.take_text()
        self.host.texts.take = None

    def on_resize(self) -> None:
        """Give the panels their column where there is room."""
        self.lines("program-side").display = self.size.width >= WIDE

    # Painting

    def show(self, view: View) -> None:
        self.view = view
        width = self.editor.size.width
        title = self.grammar.title if self.grammar is not None else ""
        self.lines("heading").put([heading_row(self.text, title, self.findings, view.chosen, width)])
        lines, product = self._compared
        if (self.program.lines is not lines or product_of(self.host.session) != product) and self._edited_at is None:
            self._edited_at = 0.0
        clock = self.host.session.wall
        rows = problem_rows(self.findings.problems, self.editor.cursor_location[0] + 1, width)
        rows = [rule(self.findings.words[0].strip(), width), *rows] if rows else []
        rows.append(rule("transcript", width, self.state_words()))
        rows += news_rows(self.host.last_records(NEWS), lambda at: f"{clock(at):%H:%M:%S}", width)
        below = self.lines("below")
        if below.styles.height is None or below.styles.height.value != len(rows):
            below.styles.height = len(rows)
        below.put(rows)

    @property
    def program(self) -> ProgramFacts:
        chosen = self.view.chosen if self.view is not None else None
        return chosen.readout.program if chosen is not None else NO_FACTS

    def state_words(self) -> str:
        return ""

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
        if self._edited_at is not None and now - self._edited_at >= PAUSE and not self._taking_in:
            self._taking_in, self._edited_at = True, None
            self.run_worker(self._take_in())

    async def _take_in(self) -> None:
        """Check the text, compare it with the drive's program, and keep a copy of it."""
        try:
            self.take_text()
            text, grammar, lines = self.text, self.grammar, self.program.lines
            if text is None or grammar is None:
                return
            product = product_of(self.host.session)
            self._compared = lines, product
            found = await asyncio.to_thread(examined, grammar, text.text, product, lines)
            if self.text is text and self._edited_at is None:
                self.findings = found
            if self.host.texts.due(text):
                await asyncio.to_thread(self.host.texts.keep, text)
        except Diagnostic as problem:
            self._warn(str(problem))
        finally:
            self._taking_in = False

    def _warn(self, text: str) -> None:
        if text != self._warned:
            self._warned = text
            self.host.show_line(text, "!")

    def _show_text(self, text: OpenText) -> None:
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
        found = await asyncio.to_thread(files_in, folder)
        selected = self.host.session.selected
        drive = "" if selected is None else target_of(self.host.session) or selected.product
        find = Finder(found, self.host.texts.unsaved(), drive, folder)
        hint = "type a name, with / a folder   ↑↓ choose   Enter open   Esc close"
        await self.app.push_screen(
            Search(f"Program file in {folder}" if folder else "Program file", find, hint), self._open
        )

    async def _open(self, name: str | None) -> None:
        if name == UPLOAD:
            await self.upload()
        elif name and name.endswith("/"):
            await self.action_open(name)
        elif name:
            await self.open_file(name)

    async def upload(self) -> None:
        """Read what the drive holds into a new file, and open that."""
        raise NotImplementedError

    async def open_file(self, name: str) -> None:
        """Show a file; offer the copy of an earlier session, if there is one. A slow disk holds up nothing else."""
        try:
            text = await asyncio.to_thread(self.host.texts.open, name)
            draft = await asyncio.to_thread(self.host.texts.draft, text)
        except Diagnostic as problem:
            self.host.show_line(str(problem), "x")
            self.notify(str(problem), timeout=6)
            return
        self.take_text()
        self._show_text(text)
        if draft is not None:
            self._offer(text, draft.text, draft.at)

    def _offer(self, text: OpenText, copy: str, at: str) -> None:
        answers = [("take", "Go on with the copy"), ("file", "Use the file, and delete the copy")]
        lines = [f"{text.name} was edited and not saved; its copy is of {at}."]

        def answered(answer: str | None) -> None:
            if answer == "take":
                text.text, text.kept = copy, copy
                self._show_text(text)
            elif answer == "file":
                self.host.texts.drop_draft(text)

        self.app.push_screen(Confirm("A text that was not saved", lines, answers), answered)

    async def action_save(self) -> None:
        await self.save()

    async def save(self, over: bool = False) -> bool:
        """Save the text; return whether that was done. Ask where another program has written the file."""
        self.take_text()
        text = self.text
        if text is None:
            return False
        if why := refusal(self.grammar, text):
            self.host.show_line(why, "x")
            self.notify(why, timeout=6)
            return False
        try:
            await asyncio.to_thread(text.file.save, text.text, over)
        except ChangedMeanwhile as problem:
            self._ask_over(problem)
            return False
        except Diagnostic as problem:
            self.host.show_line(str(problem), "x")
            self.notify(str(problem), timeout=6)
            return False
        self.host.texts.drop_draft(text)
        self.host.show_line(f"saved {text.name}", ".")
        self.host.model.changed = True  # it may be a macro
        return True

    def _ask_over(self, problem: ChangedMeanwhile) -> None:
        answers = [
            ("no", "Save nothing"),
            ("over", "Save this text over it"),
            ("read", "Give up this text, read the file"),
        ]

        async def answered(answer: str | None) -> None:
            if answer == "over":
                await self.save(over=True)
            elif answer == "read" and self.text is not None:
                name = self.text.name
                self.host.texts.close(self.text)
                self.text = None
                await self.open_file(name)

        lines = [f"{problem.where} {problem.message}.", "Another program has written it."]
        self.app.push_screen(Confirm("Save?", lines, answers), answered)

    def action_next_problem(self) -> None:
        """Go to the next problem below the cursor, errors before warnings."""
        problems: Sequence[Problem] = self.findings.problems
        place = self.editor.cursor_location
        wrong = [each for each in problems if not each.warning] or list(problems)
        later = [each for each in wrong if (each.line - 1, each.column - 1) > place]
        if wrong:
            each = (later or wrong)[0]
            self.editor.move_cursor((each.line - 1, each.column - 1), center=True)

    def action_leave(self) -> None:
        self.take_text()
        super().action_leave()


def product_of(session: Session) -> str:
    return session.selected.product if session.selected is not None else ""


def refusal(grammar: Grammar | None, text: OpenText) -> str:
    """Say why a macro that is wrong is not saved; empty: it is saved. The old macro stays, and the text."""
    if not isinstance(grammar, MacroGrammar) or not (found := grammar.check(real_text(text.text), "")):
        return ""
    return f"{found[0].line_for(text.name)}; not saved: the macro is as it was, and this text stays"


def examined(grammar: Grammar, text: str, product: str, lines: tuple[tuple[int, str], ...]) -> Findings:
    """Check a text and compare it with the lines of a drive. For a thread."""
    problems = tuple(grammar.check(real_text(text), product))
    addresses = tuple(aligned(text, lines, grammar.parts).items())
    return Findings(problems, addresses, tuple(grammar.entries(text)))
