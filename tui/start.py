"""The first screen when nothing was named: saved connections, serial ports found, the demo cell, or a URL."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import ClassVar, NamedTuple

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from tui.banner import Banner


class Place(NamedTuple):
    """Something that can be opened."""

    kind: str
    name: str
    url: str
    about: str = ""


DEMO = Place("demo", "the demo cell", "sim:", "simulated drives, no hardware needed")
KINDS = (("saved", "Saved connections"), ("port", "Serial ports"), ("demo", "Without hardware"))
Connect = Callable[[str], Awaitable[str]]
"""Opens a URL; gives an empty string, or one line that says why not."""

Ports = Callable[[], Awaitable[Sequence[Place]]]


class Start(ModalScreen[None]):
    """Choose what to open. Closes when something is open; stays, and says why, when it could not be."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "leave", show=False),
        Binding("ctrl+r", "look_again", show=False),
    ]

    def __init__(
        self, connect: Connect, saved: Sequence[Place], ports: Ports, *, only: bool, trouble: str = ""
    ) -> None:
        super().__init__()
        self._connect, self._saved, self._ports = connect, list(saved), ports
        self._only, self._trouble = only, trouble
        self._places: list[Place | None] = []
        self._opening = False

    def compose(self) -> ComposeResult:
        """The list, the line for a URL, and what happened."""
        yield Banner()
        with Vertical(id="start"):
            yield Static("multidrop", classes="title")
            yield Static("a terminal for motion drives on a shared line", classes="about")
            yield OptionList(id="places")
            line = Input(placeholder="or type: /dev/ttyUSB0, tcp://HOST:503, sim:CELL.toml", compact=True, id="url")
            line.cursor_blink = False
            yield line
            yield Static("", id="outcome", markup=False)
            leave = "^Q quit" if self._only else "Esc close"
            yield Static(f"↑↓ choose   Enter open   Tab type   ^R look again   {leave}", classes="keys", markup=False)

    async def on_mount(self) -> None:
        """Show what is known at once; ports come when they are found."""
        self._fill([*self._saved, DEMO], looking=True)
        self.query_one("#places").focus()
        self.action_look_again()
        if self._trouble:
            self.say(f"✗ {self._trouble}", bad=True)

    def action_look_again(self) -> None:
        """Look for serial ports."""
        self.run_worker(self._look(), exclusive=True, group="ports")

    async def _look(self) -> None:
        self._fill([*self._saved, *await self._ports(), DEMO], looking=False)

    def _fill(self, places: Sequence[Place], *, looking: bool) -> None:
        options = self.query_one("#places", OptionList)
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
                options.add_option(Option(Text(f"  {place.name:<24}  {about}", no_wrap=True, overflow="ellipsis")))
            if not of_kind:
                self._places.append(None)
                options.add_option(Option(Text("  looking …" if looking else "  none found", "italic"), disabled=True))
        wanted = before if before in self._places and before is not None else next(p for p in self._places if p)
        options.highlighted = self._places.index(wanted)

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Open what is chosen."""
        place = self._places[event.option_index]
        if place is not None:
            self._open(place.url)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Open what was typed."""
        if event.value.strip():
            self._open(event.value.strip())

    def _open(self, url: str) -> None:
        if self._opening:
            return
        self._opening = True
        self.say(f"opening {url} …")
        self.run_worker(self._try(url))

    async def _try(self, url: str) -> None:
        trouble = await self._connect(url)
        self._opening = False
        if trouble:
            self.say(f"✗ {trouble}", bad=True)
        else:
            self.dismiss(None)

    def say(self, text: str, *, bad: bool = False) -> None:
        """One line about what happened."""
        outcome = self.query_one("#outcome", Static)
        outcome.set_class(bad, "bad")
        outcome.update(text)

    def action_leave(self) -> None:
        """Escape: to the main screen, if there is anything on it."""
        if not self._only:
            self.dismiss(None)
