"""The editor: Textual's text area with the styles of a grammar, and a sign in the gutter of lines that have one."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar, NamedTuple

from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual import events
from textual.binding import Binding, BindingType
from textual.strip import Strip
from textual.widgets import TextArea

from multidrop.base import places
from multidrop.base.errors import Diagnostic
from multidrop.dialects.program_files import LinePart, Problem, ProgramEntry
from multidrop.macros import parse_macro
from multidrop.shell import configuration
from multidrop.shell.programs.edited_file import STAND_INS, edited
from multidrop.shell.programs.program_text import ProgramGrammar

_LINE = re.compile(r":(\d+)(?::(\d+))?\Z")
_TOML = re.compile(
    r'(?P<remark>#.*)|(?P<text>"(?:[^"\\]|\\.)*"?|\'[^\']*\'?)|(?P<label>^\s*\[.*\])|(?P<word>^\s*\w+(?=\s*=))'
)


class MacroGrammar:
    """Macro files: TOML that holds a macro."""

    title = "macro"

    def __init__(self, file: str) -> None:
        self._file = file

    def parts(self, line: str) -> Sequence[LinePart]:
        """The parts of a line that have a style of their own."""
        return [LinePart(*match.span(), match.lastgroup or "") for match in _TOML.finditer(line)]

    def check(self, text: str, product: str) -> Sequence[Problem]:
        """Every problem of a text, in order: the macro is read as it is when it is played."""
        try:
            macro = parse_macro(text, self._file)
            tuple(macro.parameters)
        except Diagnostic as problem:
            return [problem_of(problem)]
        return ()

    def entries(self, text: str) -> Sequence[ProgramEntry]:
        """The places at which it can begin: a macro begins at its first step."""
        return ()


class ConfigurationGrammar(MacroGrammar):
    """The configuration file: all its errors at once."""

    title = "configuration"

    def check(self, text: str, product: str) -> Sequence[Problem]:
        """Every problem of a text, in order."""
        return [problem_of(problem) for problem in configuration.parse(text, self._file, lenient=True).problems]


def problem_of(found: Diagnostic) -> Problem:
    """An error as an editor marks it, at the place that it names."""
    place = _LINE.search(found.where)
    line, column = (int(place[1]), int(place[2] or 1)) if place else (1, 1)
    return Problem(line, column, found.message, found.hint)


Grammar = MacroGrammar | ProgramGrammar
"""The language of a file as an editor uses it."""


def grammar_of(file: str) -> Grammar:
    if Path(file) == places.config_file().absolute():
        return ConfigurationGrammar(file)
    return MacroGrammar(file) if file.lower().endswith(".toml") else ProgramGrammar(file)


KINDS = ("word", "starts", "label", "text", "remark", "wrong", "current", "error", "warning", "break")
_SHOWN = {ord(stand_in): "?" for stand_in in STAND_INS}
LARGEST_PASTE = 256 * 1024
"""Characters."""


class Mark(NamedTuple):
    """A sign in the gutter, with its role, one of `KINDS`."""

    sign: str
    role: str


class Editor(TextArea):
    """A text area for one file. It is given its grammar and its marks, by line from 0."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {f"editor--{kind}" for kind in KINDS}
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+home", "text_end(False)", show=False),
        Binding("ctrl+end", "text_end(True)", show=False),
        Binding("enter", "new_line", show=False),
        Binding("tab", "indent", show=False),
        Binding("shift+tab", "outdent", show=False),
    ]

    def __init__(self, *, id: str | None = None) -> None:
        self._styles_of: dict[str, Style] = {}
        super().__init__(
            id=id,
            soft_wrap=False,
            show_line_numbers=True,
            tab_behavior="indent",
            compact=True,
            max_checkpoints=200,
            highlight_cursor_line=False,
        )
        self.cursor_blink = False
        self._grammar: Grammar | None = None
        self._marks: Mapping[int, Mark] = {}
        self._current: int | None = None

    def show_text(self, text: str, grammar: Grammar, cursor: tuple[int, int]) -> None:
        self._grammar, self._marks, self._current = grammar, {}, None
        self.load_text(text)
        self.move_cursor(cursor, center=True)

    def show_marks(self, marks: Mapping[int, Mark], current: int | None) -> None:
        """Show signs, and the line that a program executes; follow that line when it changes."""
        if (marks, current) == (self._marks, self._current):
            return
        moved = current is not None and current != self._current
        self._marks, self._current = marks, current
        self.notify_style_update()
        self.refresh()
        if moved and current is not None and current < self.document.line_count:
            top, height = self.scroll_offset.y, self.size.height
            if not top <= current < top + height - 1:
                self.scroll_to(y=max(0, current - height // 2), animate=False)

    # Painting

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._styles_of.clear()

    def _style(self, kind: str) -> Style:
        style = self._styles_of.get(kind)
        if style is None:
            style = self._styles_of[kind] = self.get_component_rich_style(f"editor--{kind}", partial=True)
        return style

    def get_line(self, line_index: int) -> Text:
        """Return a line with the styles of its parts; a stand-in is shown as `?`."""
        plain = self.document.get_line(line_index)
        shown = plain.translate(_SHOWN)
        text = Text(shown, end="", no_wrap=True)
        for part in self._grammar.parts(plain) if self._grammar is not None else ():
            text.stylize(self._style(part.kind), part.start, part.stop)
        if shown != plain:
            for at, character in enumerate(plain):
                if ord(character) in _SHOWN:
                    text.stylize(self._style("wrong"), at, at + 1)
        if line_index == self._current:
            text.stylize(self._style("current"))
        return text

    @property
    def gutter_width(self) -> int:
        """The width of the numbers of lines, with a cell for the sign before them."""
        return super().gutter_width + 1

    def render_line(self, y: int) -> Strip:
        strip = super().render_line(y)
        mark = self._marks.get(y + self.scroll_offset.y)
        if mark is None or not strip.cell_length:
            return strip
        sign = Segment(mark.sign, self.rich_style + self._style(mark.role))
        return Strip.join([Strip([sign], 1), strip.crop(1, strip.cell_length)])

    # Keys

    def action_text_end(self, last: bool) -> None:
        """Go to the end of the text, or to its begin."""
        self.move_cursor(self.document.end if last else (0, 0))

    def action_new_line(self) -> None:
        row, column = self.cursor_location
        before = self.document.get_line(row)[:column]
        indent = before[: len(before) - len(before.lstrip(" \t"))]
        self.replace(f"\n{indent}", *self.selection, maintain_selection_offset=False)

    def action_indent(self) -> None:
        self.replace(" " * self._find_columns_to_next_tab_stop(), *self.selection, maintain_selection_offset=False)

    def action_outdent(self) -> None:
        """Remove blanks before the cursor, back to the stop before it."""
        row, column = self.cursor_location
        before = self.document.get_line(row)[:column]
        blanks = len(before) - len(before.rstrip(" "))
        stop = (column - 1) // self.indent_width * self.indent_width
        self.delete((row, max(stop, column - blanks)), (row, column), maintain_selection_offset=False)

    async def _on_paste(self, event: events.Paste) -> None:
        """Insert a pasted text; characters that act on a terminal have stand-ins."""
        event.stop()
        event.prevent_default()
        if len(event.text) > LARGEST_PASTE:
            self.notify(f"{len(event.text)} characters are more than a paste takes; nothing was inserted")
            return
        self.replace(edited(event.text), *self.selection, maintain_selection_offset=False)
