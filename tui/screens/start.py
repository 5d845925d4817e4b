"""The start page, and the opening of connections: those named at the start, and those chosen on the page.

It offers saved connections, what was opened lately, serial ports, the demo cell, the tour, or a URL. The line at its
top narrows the list, and takes a URL. Enter opens what is highlighted.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass

from rich.text import Text
from textual.app import App, ComposeResult
from textual.containers import Vertical
from textual.widgets import Static
from textual.widgets.option_list import Option

from multidrop.base.text import visible
from multidrop.shell.events import FAILURES
from multidrop.shell.session import Session
from multidrop.tui.assist import EDIT, Assist, StartEntry
from multidrop.tui.key_table import hint
from multidrop.tui.screens.dialogs import ChoiceList, Hint, InputField, Over
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.widgets.bars import Banner

DEMO = StartEntry("demo", "the demo cell", "sim:", "simulated drives, no hardware needed")
TOUR = StartEntry("demo", "the tour", "tour", "three minutes through it, on the demo cell")
KINDS = (
    ("wrong", "Wrong in the configuration"),
    ("typed", "Typed"),
    ("found", "Found by the search"),
    ("failed", "Could not be opened"),
    ("saved", "Saved connections"),
    ("lately", "Opened lately"),
    ("port", "Serial ports"),
    ("demo", "Without hardware"),
)
LOOK_PERIOD = 3.0
"""Seconds after which ports are looked for again."""
Connect = Callable[[str, bool], Awaitable[str]]
"""Opens a URL, raw or not; returns an empty string, or one line with the reason of the failure."""


class Start(Over[None]):
    """Choose a connection. It closes when one is open; otherwise it stays and shows the reason.

    Keys wait while a connection opens, as their meaning is unknown until then.
    """

    SHEET = "start"

    def __init__(self, connect: Connect, assist: Assist, keyboard: Keyboard, *, only: bool, trouble: str = "") -> None:
        super().__init__()
        self._connect, self._assist, self._keyboard = connect, assist, keyboard
        self.only, self._trouble = only, trouble
        self._found: Sequence[StartEntry] | None = None
        """The ports; None while they are looked for."""
        self._tried: dict[str, StartEntry] = {}
        """What could not be opened, and what a search has found, by URL."""
        self._places: list[StartEntry | None] = []
        self._opening = self._done = False

    def compose(self) -> ComposeResult:
        yield Banner()
        with Vertical(id="start"):
            yield Static("multidrop", classes="title")
            yield Static("a terminal for motion drives on a shared line", classes="about")
            about = "type to narrow, or a URL: /dev/ttyUSB0?baud=19200, tcp://HOST:503"
            yield InputField(self._entered, edited=lambda text: self._fill(), placeholder=about, id="url")
            yield Static("", id="outcome", markup=False)
            options = ChoiceList((), self._taken, id="places")
            options.can_focus = False
            yield options
            self.hint = hint("start").replace("Esc close", "^Q quit" if self.only else "Esc close")
            yield Hint(self.hint)

    def begin(self) -> None:
        """Show what is known at once; add the ports when they are found."""
        self._fill()
        self.set_focus(self.query_one(InputField))
        self.run_worker(self._look())
        self.set_interval(LOOK_PERIOD, self._look)
        if self._trouble:
            self.show(f"✗ {self._trouble}", bad=True)

    async def _look(self) -> None:
        """Look for ports, unless one is in use now: a search or an opening has it."""
        ports = self._found if self._opening else await self._assist.ports()
        if ports != self._found:
            self._found = ports
            self._fill()

    def _listed(self, typed: str) -> list[StartEntry]:
        """The offers that contain the typed words, and the typed text itself as a URL."""
        known = [*self._assist.saved(), *self._assist.lately(), *(self._found or ()), DEMO, TOUR]
        all_ = [
            *self._assist.wrong(),
            *self._tried.values(),
            *(start_entry for start_entry in known if start_entry.url not in self._tried),
        ]
        words = typed.casefold().split()
        fitting = [
            start_entry for start_entry in all_ if all(word in " ".join(start_entry).casefold() for word in words)
        ]
        is_url = bool(typed) and typed not in self._tried and (any(sign in typed for sign in ":/?") or not fitting)
        own = [StartEntry("typed", typed, typed, "open this")]
        return [*own, *fitting] if is_url else fitting

    def _fill(self) -> None:
        options = self.query_one(ChoiceList)
        before = self._highlighted
        typed = self.query_one(InputField).value.strip()
        places = self._listed(typed)
        options.clear_options()
        self._places = []
        for kind, title in KINDS:
            of_kind = [place for place in places if place.kind == kind]
            if not of_kind and (kind != "port" or typed):
                continue
            self._add(None, Text(title, "bold"))
            for place in of_kind:
                text = visible(f"  {place.name:<24}  {place.about or place.url}")
                self._add(place, Text(text, no_wrap=True, overflow="ellipsis"))
            if not of_kind:
                self._add(None, Text("  looking …" if self._found is None else "  none found", "italic"))
        wanted = [n for n, place in enumerate(self._places) if place and (typed or place.kind != "demo")]
        stays = before in self._places and before is not None and not typed
        options.highlighted = self._places.index(before) if stays else next(iter(wanted), None)

    def _add(self, place: StartEntry | None, text: Text) -> None:
        self._places.append(place)
        self.query_one(ChoiceList).add_option(Option(text, disabled=place is None))

    @property
    def _highlighted(self) -> StartEntry | None:
        number = self.query_one(ChoiceList).highlighted
        return self._places[number] if number is not None and number < len(self._places) else None

    def action_step(self, by: int) -> None:
        options = self.query_one(ChoiceList)
        if by > 0:
            options.action_cursor_down()
        else:
            options.action_cursor_up()

    def action_edit(self) -> None:
        """Put the URL of what is highlighted into the line; of a port with its baud rate."""
        if (place := self._highlighted) is not None and place.url not in (TOUR.url, EDIT):
            field = self.query_one(InputField)
            field.value = f"{place.url}?baud=9600" if place.kind == "port" else place.url
            field.cursor_position = len(field.value)

    def _taken(self, number: int) -> None:
        place = self._places[number]
        if place is not None:
            self._open(place.url)

    def _entered(self, url: str) -> None:
        if (place := self._highlighted) is not None:
            self._open(place.url)
        else:
            self.show("nothing is chosen: ↑↓ choose, or type a URL")

    def action_raw(self) -> None:
        """Open what is highlighted in raw mode: nothing is sent before a person does."""
        if (place := self._highlighted) is not None and place.url not in (TOUR.url, EDIT):
            self._open(place.url, raw=True)

    def _open(self, url: str, raw: bool = False) -> None:
        if url == EDIT:
            self.app.call_later(self.run_action, "act.edit_wrong")
        elif self._begin(f"opening {url} …"):
            self.run_worker(self._try(url, raw))

    async def _try(self, url: str, raw: bool) -> None:
        try:
            trouble = await self._connect(url, raw)
        finally:
            self._end()
        if trouble:
            self.show(f"✗ {trouble}", bad=True)
            self._tried[url] = StartEntry("failed", url, url, f"✗ {trouble}")
            self._fill()
            return
        self._done = True
        self.on_screen_resume()

    def action_scan(self) -> None:
        """Search the highlighted port for drives, whatever their baud rate and language."""
        place = self._highlighted
        if (
            place is not None
            and place.url not in (TOUR.url, EDIT)
            and self._begin(f"searching {place.url} …", keys=False)
        ):
            self.run_worker(self._scan(place.url), group="scan")

    async def _scan(self, url: str) -> None:
        words, field = list[str](), self.query_one(InputField)
        before = field.value

        def found(text: str) -> None:
            words.append(text)
            self.show(f"found {len(words)}: {text}")

        try:
            url = await self._assist.scan(url, found)
        except FAILURES as failure:
            self.show(f"✗ {failure}", bad=True)
            return
        finally:
            self._end(keys=False)
        self._tried[url] = StartEntry("found", url, url, "; ".join(words))
        if field.value == before:
            field.value = url
            field.cursor_position = len(url)
            self.show(f"found {len(words)}; Enter opens what is in the line")
        else:  # typed while it was searched: that stays
            self._fill()
            self.show(f"found {len(words)}: {url} is in the list")

    def stopped(self) -> None:
        """End a search after a stop."""
        for worker in self.workers:
            if worker.group == "scan" and worker.node is self and worker.is_running:
                worker.cancel()
                self.show("✗ stopped; the search has ended", bad=True)

    def _begin(self, text: str, keys: bool = True) -> bool:
        """Note that a port is in use now; False if one is already. `keys`: they wait for the outcome."""
        if self._opening:
            return False
        self._opening = True
        if keys:
            self._keyboard.hold(self)
        self.show(text)
        return True

    def _end(self, keys: bool = True) -> None:
        self._opening = False
        if keys:
            self._keyboard.release(self)

    def on_screen_resume(self) -> None:
        """Close if something is open and no other screen covers this one."""
        if self._done and self.is_current:
            self._done = False
            self.dismiss(None)

    def show(self, text: str, *, bad: bool = False) -> None:
        """Show the outcome, below what was typed: the list gives way where there is little room."""
        outcome = self.query_one("#outcome", Static)
        outcome.display = True
        outcome.set_class(bad, "bad")
        outcome.update(text)

    def action_leave(self) -> None:
        if not self.only:
            self.dismiss(None)


TRY = "try PR P, MR 51200 and @b PR P, each with Enter; /tour walks through everything"
"""A hint for an empty demo cell."""


@dataclass(eq=False, repr=False)
class Opener:
    """Opens connections."""

    _app: App[int]
    _session: Session
    _assist: Assist
    _keyboard: Keyboard
    _show_line: Callable[[str, str], None]
    """Writes to the transcript."""
    _begin_tour: Callable[[], Awaitable[None]]

    async def open_all(self, urls: Sequence[str]) -> None:
        """Open what was named at the start, side by side; ask if nothing could be opened."""
        failures: list[str] = []

        def failed(number: int, failure: BaseException) -> None:
            if not isinstance(failure, FAILURES):
                raise failure
            failures.append(str(failure))
            self._show_line(failures[-1], "x")

        for url in urls:
            self._show_line(f"opening {url} …", ".")
        await self._session.open_all(urls, failed)
        if DEMO.url in urls:
            self._show_line(TRY, ".")
        if not self._session.buses:
            self._keyboard.turn_deaf()
            await self.ask(failures[-1])

    async def connect(self, url: str, raw: bool = False) -> str:
        """Open a URL; return an empty string, or one line with the reason of the failure.

        `tour` opens the demo cell, and the tour on it.
        """
        tour = url == TOUR.url
        try:
            if tour:
                await self._begin_tour()
            else:
                await self._session.open(url, raw=raw)
        except FAILURES as failure:
            if self._session.buses:
                self._show_line(str(failure), "x")
            return str(failure)
        if url == DEMO.url:
            self._show_line(TRY, ".")
        elif not tour:
            await self._assist.opened(url)
        return ""

    async def ask(self, trouble: str = "") -> None:
        """Show what can be opened."""
        only = not self._session.buses
        await self._app.push_screen(Start(self.connect, self._assist, self._keyboard, only=only, trouble=trouble))
