"""The main screen: top line, transcript, side panel or plot, status, input, footer.

It is given rows, and decides their room.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.geometry import Size
from textual.screen import Screen

from tui.screen_model import Record
from tui.widgets.banner import Banner
from tui.widgets.entry import Complete, Draft, Entry, Menu
from tui.widgets.footer import Footer
from tui.widgets.lines import Lines, Row, width_of
from tui.widgets.topline import TopLine, rule_row
from tui.widgets.transcript import Transcript

WIDE = (110, 24)
"""Columns and lines from which there is a side panel."""
SIDE = 39
PLAIN = ("rule-above", "plot", "side", "rule-below", "status", "label", "hint")
"""Parts that are lines and nothing more."""
PLOT_SHARE = 0.5
"""Part of the transcript's height that the plot takes on a narrow screen."""


def _key(keys: str, action: str) -> Binding:
    """Seen before any widget: what is typed right behind a key that opens a dialog is for that, not for a drive."""
    return Binding(keys, f"app.{action}", show=False, priority=True)


class MainScreen(Screen[None]):
    """The main screen. It is given rows, and divides the room among them."""

    AUTO_FOCUS = "#entry"
    BINDINGS: ClassVar[list[BindingType]] = [
        _key("f1", "help"),
        *(_key(f"f{n}", f"play('F{n}')") for n in range(2, 13)),
        _key("ctrl+o", "choose_drive"),
        _key("ctrl+t", "plot"),
        _key("ctrl+r", "search_history"),
        _key("ctrl+p", "palette"),
        _key("ctrl+pageup", "bus(-1)"),
        _key("ctrl+pagedown", "bus(1)"),
        *(_key(f"alt+{n},ctrl+{n}", f"bus_number({n})") for n in range(1, 10)),
        Binding("pageup", "look(-1)", show=False, priority=True),
        Binding("pagedown", "look(1)", show=False, priority=True),
        Binding("ctrl+home", "look_end(False)", show=False, priority=True),
        Binding("ctrl+end", "look_end(True)", show=False, priority=True),
    ]

    def __init__(
        self,
        complete: Complete,
        history: Callable[[], Sequence[str]],
        clock: Callable[[float], str],
        typed: Callable[[str], Awaitable[None]],
        pasted: Callable[[list[str]], Awaitable[None]],
    ) -> None:
        super().__init__()
        self._clock = clock
        self._drafts: dict[str, Draft] = {}
        """The lines that are being edited on the pages that are not shown."""
        self.pages: dict[str, Transcript] = {}
        self.current = ""
        self.plot_on: bool | None = None
        """Switched by hand; None: as there is room."""
        self._hint = ""
        self.entry = Entry(complete, history, typed, pasted, id="entry")
        self.menu = Menu(id="menu")
        self._stack = Vertical(id="pages")
        # Kept here and not looked up: they are painted thirty times a second, and also while the app ends.
        self._parts: dict[str, Lines] = {name: Lines(id=name) for name in PLAIN}
        self._parts |= {"top": TopLine(id="top"), "footer": Footer(id="footer")}

    def compose(self) -> ComposeResult:
        """Everything, from top to bottom."""
        yield self.lines("top")
        yield self.lines("rule-above")
        yield Banner()
        with Horizontal(id="body"):
            with Vertical(id="left"):
                yield self.lines("plot")
                yield self._stack
            yield self.lines("side")
        yield self.lines("rule-below")
        yield self.lines("status")
        with Horizontal(id="bar"):
            yield self.lines("label")
            yield self.entry
            yield self.lines("hint")
        yield self.lines("footer")
        yield self.menu

    # Room

    @property
    def wide(self) -> bool:
        """Whether there is a side panel."""
        return self.size.width >= WIDE[0] and self.size.height >= WIDE[1]

    @property
    def plot_shown(self) -> bool:
        """Whether a plot is shown somewhere."""
        return self.wide if self.plot_on is None else self.plot_on

    def make_room(self) -> None:
        """Give each part its room."""
        wide, width = self.wide, self.size.width
        self.lines("side").display = wide
        self.lines("status").display = not wide
        plot = self.lines("plot")
        plot.display = self.plot_shown and not wide
        plot.styles.height = max(8, int((self.size.height - 7) * PLOT_SHARE))
        junction = width - SIDE if wide else None
        self.lines("rule-above").put([rule_row(width, junction, "┬")])
        self.lines("rule-below").put([rule_row(width, junction, "┴")])
        self.show_menu()
        self._fit_hint()

    def on_resize(self) -> None:
        """Arrange anew."""
        self.make_room()

    def lines(self, name: str) -> Lines:
        """The part of that name."""
        return self._parts[name]

    def size_of(self, name: str) -> Size:
        """The room that a part has; nothing while it is hidden."""
        part = self._parts[name]
        return part.size if part.display else Size(0, 0)

    # Transcripts

    def page(self, bus: str) -> Transcript:
        """The transcript of a bus, made when first needed."""
        page = self.pages.get(bus)
        if page is None:
            page = self.pages[bus] = Transcript(self._clock)
            page.display = bus == self.current
            self._stack.mount(page)
        return page

    def show_page(self, bus: str) -> None:
        """Show the transcript of a bus, and the line that is being edited there."""
        if bus != self.current:
            self._drafts[self.current] = self.entry.exchange(self._drafts.pop(bus, None))
        self.current = bus
        shown = self.page(bus)
        for page in self.pages.values():
            page.display = page is shown

    def adopt_page(self, bus: str) -> None:
        """The page on which nothing was open becomes that of a bus; its transcript is the caller's."""
        self.drop_page("")
        self.current = bus

    def drop_page(self, bus: str) -> str:
        """A bus was closed; the line that was being edited there."""
        page = self.pages.pop(bus, None)
        if page is not None:
            page.remove()
        draft = self._drafts.pop(bus, None)
        return draft.text.strip() if draft is not None else ""

    def take_lines(self) -> list[tuple[str, str]]:
        """Empty the line of every page; (bus, text) of those that held any."""
        self._drafts[self.current] = self.entry.exchange()
        drafts, self._drafts = self._drafts, {}
        return [(bus, draft.text.strip()) for bus, draft in drafts.items() if draft.text.strip()]

    def take(self, bus: str, records: list[Record]) -> None:
        """Records for the transcript of a bus."""
        self.page(bus).extend(records)

    def action_look(self, pages: int) -> None:
        """Look back or forth."""
        self.page(self.current).look_page(pages)

    def action_look_end(self, newest: bool) -> None:
        """Look at the oldest or the newest line."""
        self.page(self.current).look_end(newest)

    # The input line

    def set_label(self, row: Row) -> None:
        """What stands before the input."""
        label = self.lines("label")
        if label.rows != [row]:
            label.styles.width = width_of(row)
            label.put([row])

    def set_hint(self, text: str) -> None:
        """The meaning of what is typed, beside it where there is room."""
        if text != self._hint:
            self._hint = text
            self._fit_hint()

    def _fit_hint(self) -> None:
        hint, entry = self.lines("hint"), self.entry
        room = self.size.width - self.lines("label").size.width - max(30, -(-(len(entry.value) + 4) // 20) * 20)
        shown = bool(self._hint) and room >= 20
        if hint.display != shown:
            hint.display = shown
        if shown:
            text = self._hint if len(self._hint) <= room - 2 else self._hint[: room - 3] + "…"
            hint.styles.width = room
            hint.put([((" " * (room - len(text) - 1), "text"), (text, "dim"))])

    def show_menu(self) -> None:
        """The completions above the line."""
        below = 2 if self.wide else 4
        self.menu.show(self.entry.listing, self.lines("label").size.width, below)
