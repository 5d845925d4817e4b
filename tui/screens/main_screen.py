"""The main screen: top line, transcript in one half or two, panels beside or below it, status, input, footer."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import ClassVar

from rich.cells import cell_len
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from multidrop.shell.roles import Filter
from multidrop.tui.key_table import NONE
from multidrop.tui.panels.table import CONDITIONS, LAYOUTS, MOTION, PANELS, Place, ShownPanels, fitting, side_width
from multidrop.tui.screen_model import Record
from multidrop.tui.screens.page import Framed
from multidrop.tui.text import fit, shorter
from multidrop.tui.widgets.bars import Banner, rule_row
from multidrop.tui.widgets.entry import Complete, Entry, LineDraft, Typed
from multidrop.tui.widgets.lines import Lines, Roles, Row, width_of
from multidrop.tui.widgets.search_bar import SearchBar
from multidrop.tui.widgets.transcript import Transcript


class SideTranscript(Vertical):
    """A heading and a transcript that copies what another one takes in. Hidden while it shows nothing."""

    def __init__(self, clock: Callable[[float], str], changed: Callable[[], None]) -> None:
        super().__init__(id="beside")
        self.display = False
        self._changed = changed
        self.bus, self.address = "", ""
        """The line that it shows, and the one drive on it; an empty address is all of the line."""
        self._heading = Lines(id="beside-head")
        # Without a foot: its filter is not the person's, and `/filter` is for the other half.
        self.transcript = Transcript(clock, foot=False)

    def compose(self) -> ComposeResult:
        yield self._heading
        yield self.transcript

    def show(self, bus: str, address: str, of: Transcript) -> None:
        """Show a line, or one drive of it; `of` has its records so far."""
        self.bus, self.address = bus, address
        self.display = True
        self.transcript.clear()
        self.transcript.set_times(of.clocks.form)
        self.transcript.choose(Filter(address=address))
        self.transcript.extend(of.records)
        self._changed()

    def hide(self) -> None:
        self.bus = self.address = ""
        self.display = False
        self.transcript.clear()
        self._changed()

    def take(self, bus: str, records: Iterable[Record]) -> None:
        if self.display and bus == self.bus:
            self.transcript.take(records)

    def name_it(self, key: str) -> None:
        """Write the heading: what is shown, and the key that lets one type to it."""
        width = self.size.width
        if width:
            name = f" {':'.join(filter(None, (self.bus, self.address)))} "
            hint = f" {key} types here " if key and len(name) + len(key) + 16 < width else ""
            rule = "─" * max(0, width - len(name) - len(hint) - 2)
            row = (("─", "rule"), (fit(name, min(len(name), width - 1)), "accent"), (hint, "dim"), (f"{rule}─", "rule"))
            self._heading.put([row])


WIDE_FROM = (110, 24)
"""Smallest width and height with a column of panels."""
TALL, FEW_ROWS = 32, 7
"""Height from which the panels below the transcript take their share; below it they have so many rows."""
HALF = 60
"""Width from which the halves of a split screen are side by side; else they are one above the other."""
PLAIN = ("panel", "side", "rule-below", "tour", "status", "label", "hint")
"""Parts that are only rows."""
MENU_WIDTH = 64
PANEL_SHARE, WIDE_SHARE = 0.5, 0.55
"""Share of the height that the panels below the transcript take, on a narrow and on a wide screen."""


class MainScreen(Framed):
    """The main screen. It is given rows, and divides the room among them."""

    AUTO_FOCUS = "#entry"
    SHEET = "main"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(
            f"{NONE}panel-{panel.name}", f"act.panel('{panel.name}')", f"panel: {panel.about}", id=f"panel-{panel.name}"
        )
        for panel in PANELS
    ]

    def __init__(
        self,
        complete: Complete,
        history: Callable[[], Sequence[str]],
        clock: Callable[[float], str],
        typed: Typed,
        pasted: Callable[[list[str]], Awaitable[None]],
    ) -> None:
        super().__init__()
        self._clock = clock
        self._drafts: dict[str, LineDraft] = {}
        """The lines that are being edited on the pages that are not shown."""
        self.pages: dict[str, Transcript] = {}
        self.current = ""
        self.times = "clock"
        """The form of the times in the transcripts."""
        self.panels = ShownPanels()
        self._hint = self._first_hint = ""
        self.reader = SearchBar(self.take_keys, id="reader")
        self.entry = Entry(complete, history, typed, pasted, id="entry")
        self.menu = Lines(id="menu")
        """The list of completions, above the line."""
        self._stack = Vertical(id="pages")
        self.beside = SideTranscript(clock, self.make_room)
        self._halves = Vertical(self.beside, self._stack, id="halves")
        # Stored, not looked up: they are painted thirty times a second, and also while the app ends.
        self._parts |= {name: Lines(id=name) for name in PLAIN}

    def compose(self) -> ComposeResult:
        yield Roles()
        yield self.lines("top")
        yield self.lines("now")
        yield Banner()
        with Horizontal(id="body"):
            with Vertical(id="left"):
                yield self._halves
                yield self.reader
                yield self.lines("told")
                yield self.lines("panel")
            yield self.lines("side")
        yield self.lines("rule-below")
        yield self.lines("tour")
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
        return self.size.width >= WIDE_FROM[0] and self.size.height >= WIDE_FROM[1]

    def columns(self) -> list[tuple[str, list[Place]]]:
        """The parts that hold panels, and the places in each, from top to bottom."""
        if not self.wide:
            return [("panel", self.panels.alone())]
        layout = LAYOUTS[not self.beside.display]
        return [(name, self.panels.places(places)) for name, places in layout.items()]

    def wants(self) -> frozenset[str]:
        shown = [place for name, places in self.columns() for place in fitting(places, self.size_of(name).height)]
        below = frozenset[str]() if self.wide else frozenset({MOTION, CONDITIONS})
        return below.union(*(panel.wants for place in shown for panel in place))

    def make_room(self) -> None:
        wide, width = self.wide, self.size.width
        columns = dict(self.columns())
        for name in ("panel", "side"):
            self.lines(name).display = bool(columns.get(name))
        side = side_width(width)
        self.lines("side").styles.width = side
        self.lines("status").display = not wide
        room = self.size.height - 7
        share = FEW_ROWS if wide and self.size.height < TALL else int(room * (WIDE_SHARE if wide else PANEL_SHARE))
        self.lines("panel").styles.height = max([share, *(place[0].least + 1 for place in columns.get("panel", []))])
        beside = side if columns.get("side") else 0
        self.junctions = (width - beside,) if beside else ()
        self.lines("rule-below").put([rule_row(width, self.junctions, "┴")])
        self._halves.set_class(width - beside >= 2 * HALF, "side-by-side")
        self.show_menu()
        self._fit_hint()

    def give_room(self, rows: int) -> None:
        """Leave rows free above the transcript, for a question; of a low screen as many as there are to spare."""
        self._halves.styles.margin = (min(rows, max(0, self.size.height - 10)), 0, 0, 0)

    def toggle_panel(self, name: str) -> None:
        shown = [panel.name for _, places in self.columns() for place in places for panel in place]
        self.panels.switch(name, name not in shown, self.wide)
        self.make_room()

    def on_resize(self) -> None:
        self.make_room()

    def size_of(self, name: str) -> Size:
        """The room of a part; nothing while it is hidden."""
        part = self._parts[name]
        return part.size if part.display else Size(0, 0)

    # Transcripts

    def page(self, bus: str) -> Transcript:
        """The transcript of a bus, created when first needed."""
        page = self.pages.get(bus)
        if page is None:
            page = self.pages[bus] = Transcript(self._clock, self.times)
            page.display = bus == self.current
            self._stack.mount(page)
        return page

    def show_page(self, bus: str) -> None:
        """Show the transcript of a bus, and the line that is being edited there."""
        if bus != self.current:
            self.reader.close()
            self._drafts[self.current] = self.entry.exchange(self._drafts.pop(bus, None))
        self.current = bus
        shown = self.page(bus)
        for page in self.pages.values():
            page.display = page is shown

    def adopt_page(self, bus: str) -> None:
        """Give the page for no bus to a bus; the caller moves its transcript."""
        self.drop_page("")
        self.current = bus

    def rename_page(self, before: str, now: str) -> None:
        """Know the page of a bus, and the line that is edited there, by another name."""
        if before in self.pages:
            self.pages[now] = self.pages.pop(before)
        if before in self._drafts:
            self._drafts[now] = self._drafts.pop(before)
        if self.current == before:
            self.current = now
        if self.beside.bus == before:
            self.beside.bus = now

    def drop_page(self, bus: str) -> str:
        """Remove the page of a closed bus, and return the line that was being edited there."""
        page = self.pages.pop(bus, None)
        if page is not None:
            page.remove()
        if bus and bus == self.beside.bus:
            self.beside.hide()
        draft = self._drafts.pop(bus, None)
        return draft.text.strip() if draft is not None else ""

    def take_lines(self) -> list[tuple[str, str]]:
        """Empty the line of every page; return (bus, text) of those that held any."""
        self._drafts[self.current] = self.entry.exchange()
        drafts, self._drafts = self._drafts, {}
        return [(bus, draft.text.strip()) for bus, draft in drafts.items() if draft.text.strip()]

    @property
    def transcript(self) -> Transcript:
        return self.page(self.current)

    def take_keys(self) -> None:
        self.set_focus(self.entry)

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        if event.widget.id == "entry":
            self.reader.close()

    def action_look(self, pages: int) -> None:
        self.transcript.look_page(pages)

    def action_look_end(self, newest: bool) -> None:
        self.transcript.look_end(newest)

    def action_find(self) -> None:
        self.reader.find(self.transcript)

    def action_pause(self) -> None:
        self.transcript.pause()

    def action_pick(self, by: int) -> None:
        self.reader.pick(self.transcript, by)

    # The input line

    def set_label(self, row: Row) -> None:
        self.lines("label").styles.width = width_of(row)
        self.lines("label").put([row])

    def set_hint(self, text: str, first: str = "") -> None:
        """Show the meaning of the typed text beside it, if there is room, and `first` before it."""
        self._hint, self._first_hint = text, first
        self._fit_hint()

    def _fit_hint(self) -> None:
        """Give the hint the room that the line leaves, also while it is empty: a new layout costs a whole paint."""
        hint, entry = self.lines("hint"), self.entry
        room = self.size.width - self.lines("label").size.width - max(30, -(-(len(entry.value) + 4) // 20) * 20)
        shown = room >= 20
        hint.display = shown
        if shown:
            first = fit(self._first_hint, min(len(self._first_hint), room - 2))
            rest = room - 2 - cell_len(first) - 3 * bool(first)
            text = "   ".join(filter(None, (first, shorter(self._hint, rest) if rest > 10 else "")))
            hint.styles.width = room
            hint.put([((" " * (room - cell_len(text) - 1), "text"), (text, "dim"))] if text else [])

    def show_menu(self) -> None:
        """Show the completions above the text that they complete, or hide them."""
        listing, left = self.entry.listing, self.lines("label").size.width
        self.menu.display = listing.open
        if listing.open:
            below = 2 if self.wide else 2 + max(2, len(self.lines("status").rows))
            width = min(MENU_WIDTH, self.size.width - left - 1)
            self.menu.styles.width = width
            self.menu.styles.margin = (0, 0, below, max(0, left - 1))
            self.menu.put_all(listing.rows(width))
