"""The part of the main screen that reads back: scroll, pause, search, and copy the transcript that is shown."""

from __future__ import annotations

from typing import ClassVar

from textual import events
from textual.binding import Binding, BindingType

from multidrop.tui.keymap import named_key
from multidrop.tui.screens.framed import Framed
from multidrop.tui.widgets.reader import Reader
from multidrop.tui.widgets.transcript import Transcript


class Reading(Framed):
    """A screen with a transcript; the base of the main screen."""

    BINDINGS: ClassVar[list[BindingType]] = [
        named_key("look-back", "pageup", "look(-1)", "look back in the transcript"),
        named_key("look-on", "pagedown", "look(1)", "look on in the transcript"),
        named_key("oldest", "ctrl+home", "look_end(False)", "the beginning of the transcript"),
        named_key("newest", "ctrl+end", "look_end(True)", "follow the transcript again"),
        named_key("find", "ctrl+f", "find", "search the transcript"),
        named_key("pause", "ctrl+s", "pause", "stop the scrolling, or let it go on"),
        named_key("pick", "ctrl+y", "pick(0)", "pick lines of the transcript to copy; also Shift+Up"),
        named_key("times", "", "app.run_line('/times')", "times of the lines in another form"),
        named_key("filter-mine", "", "app.run_line('/filter mine')", "show only what you typed, and its replies"),
        named_key("filter-off", "", "app.run_line('/filter off')", "show all lines"),
        named_key("hex", "", "app.run_line('/hex')", "the bytes of the selected line beside its lines, or not"),
        Binding("shift+up", "pick(-1)", show=False, priority=True),
        Binding("shift+down", "pick(1)", show=False, priority=True),
    ]

    def __init__(self) -> None:
        super().__init__()
        self.reader = Reader(self.take_keys, id="reader")

    @property
    def transcript(self) -> Transcript:
        """The transcript that is shown."""
        raise NotImplementedError

    def take_keys(self) -> None:
        """Give the keys to the input line."""
        raise NotImplementedError

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        """Close the search when the input line gets the keys."""
        if event.widget.id == "entry":
            self.reader.close()

    def action_look(self, pages: int) -> None:
        """Scroll back or forth by pages."""
        self.transcript.look_page(pages)

    def action_look_end(self, newest: bool) -> None:
        """Scroll to the oldest or the newest line."""
        self.transcript.look_end(newest)

    def action_find(self) -> None:
        """Search the transcript."""
        self.reader.find(self.transcript)

    def action_pause(self) -> None:
        """Stop the scrolling, or let it go on."""
        self.transcript.pause()

    def action_pick(self, by: int) -> None:
        """Pick lines to copy."""
        self.reader.pick(self.transcript, by)
