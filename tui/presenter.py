"""Paints the screen model onto the main screen and pages: what they show is computed from facts and the time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from multidrop.drives.bus import Bus
from multidrop.shell.session import Session
from multidrop.tui.boundary import Boundary
from multidrop.tui.key_table import footer
from multidrop.tui.keymap import FunctionKeys, Keymap
from multidrop.tui.panels.drive import trouble_of
from multidrop.tui.panels.drives import narrow_rows
from multidrop.tui.panels.now import now_row
from multidrop.tui.panels.table import column_rows
from multidrop.tui.panels.view import View, glances_of
from multidrop.tui.purpose import Purpose
from multidrop.tui.readout import ReadoutState
from multidrop.tui.screen_model import BusFacts, Record, ScreenModel, bus_old, bus_state
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.screens.page import Framed, Page
from multidrop.tui.widgets.bars import TRYING, Tab, banner_row, footer_row, rule_row, top_row
from multidrop.tui.widgets.lines import Row

FLOOD = 3
"""The number of lines in one frame that are too many to read."""
FLOOD_PERIOD = 0.16
"""Seconds between two paints of a transcript that gets as many."""


class Presenter:
    """Computes the rows of the main screen, and puts them there."""

    def __init__(
        self,
        session: Session,
        model: ScreenModel,
        purpose: Purpose,
        macros: FunctionKeys,
        keys: Keymap,
        boundary: Boundary,
    ) -> None:
        self.boundary = boundary
        self.session, self.model, self.purpose, self.macros, self.keymap = session, model, purpose, macros, keys
        self._shown_at = float("-inf")
        self._flooded = False
        self.behind = False
        """Records wait for the next paint of a transcript."""
        self.on_records: dict[str, Callable[[str, Sequence[Record]], None]] = {}
        """Called with the new records of a bus; by what each makes, in words, which name it where it has a defect."""
        self.notes: list[Callable[[int], str]] = []
        """Each makes a note for the top line from its width in cells; an empty one is none."""

    def view(self, now: float) -> View:
        bus = self.session.buses.get(self.session.selected_bus)
        glances = [] if bus is None else glances_of(self.session, self.model, bus)
        return View(
            self.session,
            self.model,
            glances,
            now,
            self.purpose.polling.on,
            self.purpose.works,
            keys=self.keymap,
            macros=self.macros,
            boundary=self.boundary,
        )

    def tabs(self, now: float) -> list[Tab]:
        tabs: list[Tab] = []
        for number, bus in enumerate(self.session.tabs.shown, 1):
            facts, drives, lost = self.model.buses.get(bus.name), list(bus.drives), self.session.tabs.missing(bus)
            state = ReadoutState.SILENT if bus.silent and not lost else bus_state(facts, drives, lost)
            selected, old = bus.name == self.session.selected_bus, bus_old(facts, drives, now)
            tabs.append(Tab(number, bus.name, state, selected, old, trouble_mark(facts, drives, lost)))
        return tabs

    def paint(self, main: MainScreen, now: float, panels: bool, page: Page | None = None) -> None:
        """Paint new records, and all else if `panels`.

        `page`: the page that is shown in front of the main screen.
        """
        with self.boundary.at("the transcript"):
            self._show_records(main, now)
        if not panels:
            return
        view = self.view(now)
        self._paint_frame(main, view)
        if page is not None:
            self._paint_frame(page, view)
            _show_page(page, view)
            return
        main.set_label(self.boundary.do("the label", self.purpose.label, lambda _: ((" ▸ ", "error"),)))
        with self.boundary.at("the heading of the other half"):
            main.beside.name_it(self.keymap.shown("split"))
        with self.boundary.at("the search in the transcript"):
            main.reader.tell()
        with self.boundary.at("the panels"):
            self._paint_panels(main, view)

    def take_records(self, main: MainScreen) -> None:
        """Pass new records on to the transcripts, whether the terminal accepts a frame or not."""
        self._flooded = any(len(facts.fresh) >= FLOOD for facts in self.model.buses.values())
        for name, facts in list(self.model.buses.items()):
            if facts.fresh and (main.current or not name):  # else the page of no bus is about to become its page
                main.page(name).take(facts.fresh)
                main.beside.take(name, facts.fresh)
                for what, take in self.on_records.items():
                    with self.boundary.at(what):
                        take(name, facts.fresh)
                facts.fresh.clear()

    def _show_records(self, main: MainScreen, now: float) -> None:
        """Show new records: few of them, or the first of many, in every frame; a flood six times a second."""
        self.behind = self._flooded and now - self._shown_at < FLOOD_PERIOD
        if self.behind:
            return
        if self._flooded:
            self._shown_at = now
        for page in main.pages.values():
            page.show_new()
        main.beside.transcript.show_new()

    def banner(self, width: int) -> Row:
        """The line below the tabs: what is known since a stop that is latched, and why a bus is lost."""
        bus = self.session.buses.get(self.session.selected_bus)
        lost = self.loss(bus) if bus is not None else ""
        if self.session.latched and not lost:
            lost = next(filter(None, map(self.loss, self.session.tabs.shown)), "")
        return banner_row(self.session.tally() if self.session.latched else None, lost, width)

    def loss(self, bus: Bus) -> str:
        """The reason of a loss, and whether the bus is being tried again; empty while it is not lost."""
        if not self.session.tabs.missing(bus):
            return ""
        return f"{bus.lost}{TRYING}" if bus.name in self.session.reconnections.trying else str(bus.lost)

    def _paint_frame(self, screen: Framed, view: View) -> None:
        top, footer_ = partial(self._top_row, screen, view.now), partial(self._footer_row, screen)
        width = screen.size.width
        row = self.boundary.do("the line below the tabs", partial(now_row, view, width), _trouble_row)
        screen.lines("now").put([row or rule_row(width, screen.junctions, "┬")])
        screen.lines("top").put([self.boundary.do("the top line", top, _trouble_row)])
        screen.lines("footer").put([self.boundary.do("the footer", footer_, _trouble_row)])

    def _top_row(self, screen: Framed, now: float) -> Row:
        clock = f"{self.session.wall(now):%H:%M:%S}"
        playing = " ".join(each.short for each in self.session.playing)
        log = self.session.log is not None
        tabs, width = self.tabs(now), screen.size.width
        notes = [*filter(None, (note(width) for note in self.notes))]
        return top_row(tabs, self.session.recording, clock, width, log, playing, notes)

    def _footer_row(self, screen: Framed) -> Row:
        width = screen.size.width
        keys = footer(screen.SHEET)
        shown = [(self.keymap.shown(key.name) if key.name else key.shown, key.word) for key in keys]
        first: list[tuple[str, str]] = []
        plays = isinstance(screen, MainScreen)
        if plays and self.macros.place:
            key = self.keymap.shown("macro-page") or self.keymap.shown("page-macros")
            first.append((key, self.macros.place))
        for key, name in self.macros.shown if plays else ():  # a person may have given it another key
            first.append((self.keymap.shown(f"play-{key.lower()}") or key, name))
        recording, latched = bool(self.session.recording), self.session.latched and self.purpose.works
        help_ = self.keymap.shown("help")
        return footer_row([*first, *shown], recording, latched, width, self.model.progress, help_)

    def _paint_panels(self, main: MainScreen, view: View) -> None:
        """Paint the columns beside the transcript, or the panel and the status lines below it."""
        joined: list[int] = []
        for name, places in main.columns():
            size = main.size_of(name)
            rows = column_rows(places, view, size.width, size.height, border=name != "panel")
            # Titles at the left join the border; while the terminal is resized the parts may not fit each other.
            for y in (y for y in joined if name != "panel" and 0 <= y < len(rows)):
                (edge, role), *rest = rows[y]
                rows[y] = (("┤" if edge == "│" else "┼", role), *rest)
            top = main.size_of("side").height - size.height
            joined = [y + top for y, row in enumerate(rows) if row[:1] and row[0][0] in ("─", "├", "┼")]
            main.lines(name).put(rows)
        if not main.wide:
            status = self.boundary.do(
                "the status", lambda: narrow_rows(view, main.size.width), lambda text: [_trouble_row(text)]
            )
            main.lines("status").put_all(status)


def _show_page(page: Page, view: View) -> None:
    """Show a page; after a defect nothing but that: what it showed before may no longer be true."""
    with view.boundary.at(f"the page {type(page).__name__}") as attempt:
        page.show(view)
    if attempt.trouble != page.trouble and page.is_attached:
        page.body.visible = not attempt.trouble
        page.tell(attempt.trouble)
        page.trouble = attempt.trouble


def _trouble_row(text: str) -> Row:
    return ((f" {text}", "error"),)


def trouble_mark(facts: BusFacts | None, addresses: Sequence[str], lost: bool) -> str:
    """The mark of a tab whose bus has trouble that its state does not show."""
    if facts is None or lost or bus_state(facts, list(addresses), lost) in (ReadoutState.TROUBLE, ReadoutState.DIFFERS):
        return ""
    readouts = [facts.readout(address) for address in addresses]
    if any(readout.silent_since is not None for readout in readouts):
        return "" if bus_state(facts, list(addresses), lost) is ReadoutState.SILENT else "?"
    if any(trouble_of(axis) for readout in readouts for axis in readout.axes):
        return "!"
    return ReadoutState.DIFFERS.sign if any(readout.differs for readout in readouts) else ""
