"""Screens that lie over the main one: choose a drive, name a macro, confirm, help, too small. Escape closes them.

None of them knows of the stop: it works in all of them because it is found below any screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Generic, TypeVar

from rich.table import Column, Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

T = TypeVar("T")


class Dialog(ModalScreen[T], Generic[T]):
    """A dialog: Escape closes it with None."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "leave", show=False)]

    def action_leave(self) -> None:
        """Close without an answer."""
        self.dismiss(None)


class Choose(Dialog[str]):
    """Choose one of a list; gives its key. `letters` chooses by typing a key of one character."""

    def __init__(self, title: str, options: Sequence[tuple[str, str]], current: str = "") -> None:
        super().__init__()
        self.heading, self.options, self.current = title, list(options), current

    def compose(self) -> ComposeResult:
        """The list."""
        with Vertical(classes="box"):
            yield Static(self.heading, classes="title", markup=False)
            yield OptionList(*(Option(Text(text), id=f"k{n}") for n, (_, text) in enumerate(self.options)))
            yield Static("↑↓ choose   Enter take   Esc close", classes="keys")

    def on_mount(self) -> None:
        """Stand on the current one."""
        keys = [key for key, _ in self.options]
        self.query_one(OptionList).highlighted = keys.index(self.current) if self.current in keys else 0

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Taken."""
        self.dismiss(self.options[event.option_index][0])


class Ask(Dialog[str]):
    """Ask for one line."""

    def __init__(self, title: str, value: str = "", hint: str = "Enter take   Esc close") -> None:
        super().__init__()
        self.heading, self.value, self.hint = title, value, hint

    def compose(self) -> ComposeResult:
        """The question and its line."""
        with Vertical(classes="box"):
            yield Static(self.heading, classes="title", markup=False)
            line = Input(self.value, compact=True)
            line.cursor_blink = False
            yield line
            yield Static(self.hint, classes="keys", markup=False)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Answered; nothing typed is no answer."""
        self.dismiss(event.value.strip() or None)


class Confirm(Dialog[str]):
    """A question with a few answers, each by its key; Escape is none of them."""

    def __init__(self, title: str, lines: Sequence[str], answers: Sequence[tuple[str, str]]) -> None:
        super().__init__()
        self.heading, self.lines, self.answers = title, list(lines), list(answers)

    def compose(self) -> ComposeResult:
        """The question, what it is about, the answers."""
        with Vertical(classes="box"):
            yield Static(self.heading, classes="title", markup=False)
            yield Static("\n".join(self.lines), classes="about", markup=False)
            yield OptionList(*(Option(Text(text)) for _, text in self.answers))
            yield Static("↑↓ choose   Enter take   Esc close", classes="keys")

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Answered."""
        self.dismiss(self.answers[event.option_index][0])


HELP = (
    ("Keys", ""),
    ("^X", "STOP ALL: drives, macros, scripts; from anywhere"),
    ("/resume", "after a stop: macros and scripts may run again"),
    ("^P", "everything by name: type some letters of it"),
    ("^O", "choose the drive that plain text goes to"),
    ("^T", "plot of velocity and position on, off"),
    ("^R", "record a macro; end the recording"),
    ("F2 .. F12", "play the macro that is on the key"),
    ("^PgUp ^PgDn", "the other buses; also Alt+1 .. Alt+9"),
    ("PgUp PgDn", "look back in the transcript; ^End follows again"),
    ("Tab", "completions of what is typed"),
    ("Up Down", "lines typed before that begin with what is typed"),
    ("^Q", "quit"),
    ("", ""),
    ("Lines", ""),
    ("MR 51200", "goes to the selected drive, in its own language"),
    ("@b PR P", "to drive b; @* to all; @press:b on another bus"),
    ("/help MR", "what a word means; /help alone lists the verbs"),
    ("", ""),
    ("Signs", ""),
    ("› »", "typed by a person; sent by a macro or a script"),
    ("«", "printed by a drive that was not asked"),
    ("✗", "refused, not answered, lost"),
    ("· !", "what goes on; something to know"),
    ("▶ ■", "velocity read as not 0; read as 0"),
    ("? ·", "does not answer; nobody has looked lately"),
    ("◆", "program mode: lines are stored, not executed"),
)


class Help(Dialog[None]):
    """The keys and the signs, on one page."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("f1,q,enter", "leave", show=False)]

    def compose(self) -> ComposeResult:
        """The page."""
        page = Table.grid(Column(no_wrap=True, width=12), Column(), padding=(0, 1, 0, 0))
        for key, what in HELP:
            page.add_row(Text(key, "bold"), what)
        with Vertical(classes="box wide"), VerticalScroll():
            yield Static(page)
            yield Static("Esc close", classes="keys")


LEAST = (60, 15)
"""Columns and lines that the main screen needs."""


class TooSmall(ModalScreen[None]):
    """Says that the terminal is too small; goes by itself when it is not."""

    def compose(self) -> ComposeResult:
        """The line."""
        yield Static(id="too-small", markup=False)

    def on_resize(self) -> None:
        """Say what is there."""
        width, height = self.app.size
        need = f"{LEAST[0]}x{LEAST[1]}"
        text = f"too small: {need} needed, this is {width}x{height}; ^X still stops"
        self.query_one("#too-small", Static).update(text)
