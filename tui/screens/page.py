"""A page: what is interactive beyond the input line, in the frame of the main screen.

A page is added to `tui.screens.table`. Escape leaves it, a stop does not. It sends lines through the outbox alone, so
that the transcript shows what was sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Protocol

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical

from multidrop.tui.editor.texts import Texts
from multidrop.tui.frames import Frames
from multidrop.tui.function_keys import FunctionKeys
from multidrop.tui.keymap import named_key
from multidrop.tui.outbox import Outbox
from multidrop.tui.panels.view import View
from multidrop.tui.screen_model import Record, ScreenModel
from multidrop.tui.screens.framed import Framed
from multidrop.tui.session_view import SessionView
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.widgets.banner import Banner
from multidrop.tui.widgets.lines import Lines


class Host(Protocol):
    """The part of the app that pages use."""

    session: SessionView
    model: ScreenModel
    outbox: Outbox
    texts: Texts
    macros: FunctionKeys
    frames: Frames
    keyboard: Keyboard

    def last_records(self, number: int) -> Sequence[Record]:
        """The last records of the transcript that is shown."""

    def show_line(self, text: str, mark: str = ".") -> None:
        """Append a line of the app's own to the transcript that is shown."""

    def action_select(self, address: str, bus: str = "") -> None:
        """Select a drive or a bus."""


class Page(Framed):
    """The base of all pages. `content` makes the widgets, `show` paints them when something has happened."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "leave", show=False),
        named_key("help", "f1", "app.help", "help for where you are"),
        Binding("ctrl+o", "app.choose_drive", show=False, priority=True),
        named_key("palette", "ctrl+p", "app.palette", "everything by name: type some letters of it"),
    ]
    KEYS: ClassVar[Sequence[tuple[str, str]]] = ()
    """The keys of this page with their meanings."""
    WANTS: ClassVar[frozenset[str]] = frozenset()
    """What must be polled while it is shown, in the words of `tui.panels.table`."""

    def __init__(self, host: Host) -> None:
        super().__init__()
        self.host = host

    def compose(self) -> ComposeResult:
        """Make the frame with the content in it."""
        yield self.lines("top")
        yield Banner()
        with Vertical(classes="page-body"):
            yield from self.content()
        yield self.lines("footer")

    def content(self) -> ComposeResult:
        """Make the widgets between banner and footer."""
        raise NotImplementedError

    def on_worker_state_changed(self) -> None:
        """Paint what a worker has brought: nothing else may have happened."""
        self.host.frames.wake()

    def show(self, view: View) -> None:
        """Paint the facts."""
        raise NotImplementedError

    def part(self, name: str) -> Lines:
        """Make a part that is rows; `lines` finds it by its name."""
        self._parts[name] = Lines(id=name)
        return self._parts[name]

    def action_leave(self) -> None:
        """Go back to the main screen."""
        self.dismiss(None)
