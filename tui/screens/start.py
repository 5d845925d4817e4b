"""The start page: saved connections, serial ports, the demo cell, or a URL."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.widgets import Static
from textual.widgets.option_list import Option

from dialects.visible import visible
from tui.assist import StartEntry
from tui.screens.dialogs import Field, Options, Over
from tui.widgets.banner import Banner

DEMO = StartEntry("demo", "the demo cell", "sim:", "simulated drives, no hardware needed")
KINDS = (("saved", "Saved connections"), ("port", "Serial ports"), ("demo", "Without hardware"))
Connect = Callable[[str], Awaitable[str]]
"""Opens a URL; returns an empty string, or one line with the reason of the failure."""

Ports = Callable[[], Awaitable[Sequence[StartEntry]]]


class Start(Over[None]):
    """Choose a connection. It closes when one is open; otherwise it stays and shows the reason.

    It calls `opening` with True when an opening begins and with False when it ends. Until then the meaning of later
    keys is unknown.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "leave", show=False),
        Binding("ctrl+l", "look_again", show=False),
        Binding("tab,shift+tab", "other", show=False),
        Binding("ctrl+p", "app.palette", show=False),
    ]

    def __init__(
        self,
        connect: Connect,
        saved: Sequence[StartEntry],
        ports: Ports,
        opening: Callable[[bool], None],
        *,
        only: bool,
        trouble: str = "",
    ) -> None:
        super().__init__()
        self._connect, self._saved, self._ports, self._tell_opening = connect, list(saved), ports, opening
        self.only, self._trouble = only, trouble
        self._places: list[StartEntry | None] = []
        self._opening = self._done = False

    def compose(self) -> ComposeResult:
        """Make the list, the line for a URL, and the outcome."""
        yield Banner()
        with Vertical(id="start"):
            yield Static("multidrop", classes="title")
            yield Static("a terminal for motion drives on a shared line", classes="about")
            yield Options((), self._taken, id="places")
            yield Field(self._entered, placeholder="or type: /dev/ttyUSB0, tcp://HOST:503, sim:CELL.toml", id="url")
            yield Static("", id="outcome", markup=False)
            leave = "^Q quit" if self.only else "Esc close"
            yield Static(f"↑↓ choose   Enter open   Tab type   ^L look again   {leave}", classes="keys", markup=False)

    def on_mount(self) -> None:
        """Show what is known at once; add the ports when they are found."""
        self._fill([*self._saved, DEMO], looking=True)
        self.set_focus(self.query_one(Options))
        self.action_look_again()
        if self._trouble:
            self.show(f"✗ {self._trouble}", bad=True)

    def action_look_again(self) -> None:
        """Look for serial ports."""
        self.run_worker(self._look(), exclusive=True, group="ports")

    async def _look(self) -> None:
        self._fill([*self._saved, *await self._ports(), DEMO], looking=False)

    def _fill(self, places: Sequence[StartEntry], *, looking: bool) -> None:
        options = self.query_one(Options)
        before = self._places[options.highlighted] if options.highlighted is not None else None
        options.clear_options()
        self._places = []
        for kind, title in KINDS:
            of_kind = [place for place in places if place.kind == kind]
            if not of_kind and kind == "saved":
                continue
            self._places.append(None)
            options.add_option(Option(Text(title, "bold"), disabled=True))
            for place in of_kind:
                self._places.append(place)
                about = place.about or place.url
                options.add_option(
                    Option(Text(visible(f"  {place.name:<24}  {about}"), no_wrap=True, overflow="ellipsis"))
                )
            if not of_kind:
                self._places.append(None)
                options.add_option(Option(Text("  looking …" if looking else "  none found", "italic"), disabled=True))
        wanted = before if before in self._places and before is not None else next(p for p in self._places if p)
        options.highlighted = self._places.index(wanted)

    def action_other(self) -> None:
        """Move from the list to the line, and back."""
        there = self.query_one(Options) if self.focused is self.query_one(Field) else self.query_one(Field)
        self.set_focus(there)

    def _taken(self, number: int) -> None:
        place = self._places[number]
        if place is not None:
            self._open(place.url)

    def _entered(self, url: str) -> None:
        if url:
            self._open(url)

    def _open(self, url: str) -> None:
        if self._opening:
            return
        self._opening = True
        self._tell_opening(True)
        self.show(f"opening {url} …")
        self.run_worker(self._try(url))

    async def _try(self, url: str) -> None:
        try:
            trouble = await self._connect(url)
        finally:
            self._opening = False
            self._tell_opening(False)
        if trouble:
            self.show(f"✗ {trouble}", bad=True)
            return
        self._done = True
        self.on_screen_resume()

    def on_screen_resume(self) -> None:
        """Close if something is open and no other screen covers this one."""
        if self._done and self.is_current:
            self._done = False
            self.dismiss(None)

    def show(self, text: str, *, bad: bool = False) -> None:
        """Show one line about the outcome."""
        outcome = self.query_one("#outcome", Static)
        outcome.set_class(bad, "bad")
        outcome.update(text)

    def action_leave(self) -> None:
        """Go to the main screen on Escape, unless nothing is open."""
        if not self.only:
            self.dismiss(None)
