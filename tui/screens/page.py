"""Pages, what is interactive beyond the input line, in the frame of the main screen: top line, banner, footer.

A page is added to the table of pages. Escape leaves it, a stop does not. It sends lines through the outbox alone, so
that the transcript shows what was sent.
"""

from __future__ import annotations

import asyncio
from abc import ABCMeta, abstractmethod
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.screen import Screen

from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import imported
from multidrop.macros import Macro
from multidrop.shell.line_syntax import Place, showing
from multidrop.shell.session import Session
from multidrop.tui.frame_scheduler import Frames
from multidrop.tui.key_table import Keyed
from multidrop.tui.keymap import FunctionKeys
from multidrop.tui.outbox import Outbox, ended
from multidrop.tui.panels.view import View
from multidrop.tui.screen_model import Record, ScreenModel
from multidrop.tui.screens.dialogs import InputField
from multidrop.tui.terminal.canvas import FrontCompositor
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.text import at_words
from multidrop.tui.texts import Texts
from multidrop.tui.widgets.bars import Banner, Footer, TopLine
from multidrop.tui.widgets.lines import ActionText, Lines, Row, Span, T, in_view


class Framed(Keyed, Screen[None]):
    """A screen with a top line and a footer, which the presenter paints."""

    SHEET: ClassVar[str] = "screen"

    def __init__(self) -> None:
        super().__init__()
        self._compositor = FrontCompositor()
        # Stored, not looked up: they are painted thirty times a second, and also while the app ends.
        self._parts: dict[str, Lines] = {"top": TopLine(id="top"), "footer": Footer(id="footer")}
        self._parts |= {name: Lines(id=name) for name in ("now", "told")}
        self.junctions: tuple[int, ...] = ()
        """The columns at which the rule below the tabs joins a border."""
        self.told = ""
        """The line on the last key, which is shown for a while."""

    def lines(self, name: str) -> Lines:
        return self._parts[name]

    def tell(self, text: str) -> None:
        """Show a line above the footer, in rows of its own; an empty one gives them back."""
        self.told = text
        rows: list[Row] = [((f" {row}", "strong"),) for row in at_words(text, self.size.width - 2)] if text else []
        show_rows(self.lines("told"), rows)


def show_rows(part: Lines, rows: list[Row]) -> None:
    """Show a part in as many rows as it has; none hides it."""
    part.display = bool(rows)
    part.styles.height = max(1, len(rows))
    part.put(rows)


@dataclass
class PageHost:
    """The parts of the app that pages use."""

    session: Session
    model: ScreenModel
    outbox: Outbox
    texts: Texts
    macros: FunctionKeys
    frames: Frames
    keyboard: Keyboard
    select: Callable[[str, str], None]
    """Selects a drive (address) on a bus; an empty name is the selected one."""
    show_line: Callable[[str, str], None]
    """Appends a line of the app's own to the transcript that is shown, with its mark."""
    last_records: Callable[[int], Sequence[Record]]
    """The last records of the transcript that is shown."""
    troubles_of_text: Callable[[str, str], Sequence[Diagnostic]]
    """What is wrong in the text of a configuration file with this name, as far as only the screen knows it."""


class PendingLines(NamedTuple):
    """A text that is being typed, or lines that wait for Enter; the stops and the drive when it was begun."""

    kind: str
    stops: int
    place: Place
    name: str = ""
    lines: tuple[str, ...] = ()

    def overtaken(self, session: Session) -> bool:
        """True if a stop, or another drive, came since."""
        return (self.stops, self.place) != (session.stops, session.place)


class AbstractScreen(type(Framed), ABCMeta):  # type: ignore[misc]
    """The metaclass of screens with abstract methods; the name of the one that Textual has is private."""


class Page(Framed, metaclass=AbstractScreen):  # type: ignore[metaclass]
    """The base of all pages. `content` makes the widgets, `show` paints them when something has happened."""

    AUTO_FOCUS: ClassVar[str | None] = ""
    SHEET = "page"
    WANTS: ClassVar[frozenset[str]] = frozenset()
    """The readings that it needs while it is shown, in the words of `tui.panels.table`."""
    STOPS: ClassVar[frozenset[str]] = frozenset()
    """The keys that stop something: they work even right after the screen has changed by itself."""

    PARTS: ClassVar[Mapping[str, str | int | None]] = {}
    """The parts that are rows, from top to bottom, with their heights; None: as the style sheet has it."""

    def __init__(self, host: PageHost) -> None:
        super().__init__()
        self.host = host
        self.trouble = ""
        """What it shows in its place after a defect; empty: there was none."""

    def compose(self) -> ComposeResult:
        yield self.lines("top")
        yield self.lines("now")
        yield Banner()
        with Vertical(classes="page-body") as self.body:
            yield from self.content()
        yield self.lines("told")
        yield self.lines("footer")

    def content(self) -> ComposeResult:
        """Make the widgets between banner and footer."""
        for name, height in self.PARTS.items():
            part = self.part(name)
            if height is not None:
                part.styles.height = height
            yield part

    def on_worker_state_changed(self) -> None:
        """Paint what a worker has brought: nothing else may have happened."""
        self.host.frames.wake()

    @abstractmethod
    def show(self, view: View) -> None:
        """Paint it."""

    def part(self, name: str) -> Lines:
        """Make a part that is rows; `lines` finds it by its name."""
        self._parts[name] = Lines(id=name)
        return self._parts[name]

    def action_leave(self) -> None:
        self.dismiss(None)


def start(page: Page, line: str, shown: str | Macro | None = None, since: int | None = None) -> asyncio.Task[bool]:
    """Run a line as if it was typed on a page; a failure is shown in the transcript.

    `shown`: what a person was shown of the file that the line names; it is used instead of the file. `since`: the
    number of stops when a person agreed to the line.
    """
    task = page.host.session.start(line if shown is None else showing(line, shown) or line, since=since)
    page.run_worker(ended(task))
    return task


class AskingPage(Page):
    """A page with a line to type in, which is hidden until it is asked for, and a row for what is said last."""

    FIELD: ClassVar[str] = ""
    """The name of the line among the parts."""

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.field = InputField(self.typed, edited=self.edited, id=self.FIELD or None)
        self.said: Span = ("", "dim")
        self.asked: PendingLines | None = None
        """What the line to type in is shown for."""

    def content(self) -> ComposeResult:
        """Make the parts with the line in its place."""
        for part in super().content():
            if part.id == self.FIELD:
                self.field.display = False
                yield self.field
            else:
                yield part

    def typed(self, text: str) -> Awaitable[None] | None:
        """Take what was typed, on Enter."""
        return None

    def edited(self, text: str) -> None:
        """Take each change of it."""

    def ask_for(self, kind: str, text: str, placeholder: str, name: str = "") -> None:
        """Show the line to type in, with a text in it."""
        self.asked = self.begin(kind, name)
        self.field.value, self.field.placeholder = text, placeholder
        self.field.display = True
        self.set_focus(self.field)

    def end_asking(self) -> None:
        """Empty and hide the line to type in."""
        self.asked = None
        self.field.value = ""
        self.field.display = False
        self.set_focus(None)

    def say(self, text: str, role: str = "strong") -> None:
        self.said = (text, role)

    def begin(self, kind: str, name: str = "", lines: tuple[str, ...] = ()) -> PendingLines:
        return PendingLines(kind, self.host.session.stops, self.host.session.place, name, lines)


OVERTAKEN = "nothing was sent: a stop or another drive came in between"


AGAIN = "look at it, and press Enter again"


class SendingPage(AskingPage):
    """A page that shows lines before Enter sends them."""

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.begun: PendingLines | None = None
        """The lines that Enter would send."""
        self.painted = False
        """They were shown, and no key waited then that was typed before."""

    def offer(self, kind: str, lines: tuple[str, ...]) -> None:
        """Let Enter send lines, once they were shown."""
        self.begun, self.painted = self.begin(kind, lines=lines), False

    def accepted(self) -> PendingLines | None:
        """Return what Enter sends; None for an Enter that was typed before the lines were seen, or came too late."""
        begun = self.begun
        if begun is None:
            return None
        if not self.painted:
            self.say(f"not sent: {', '.join(begun.lines) or begun.kind}: Enter was typed before it was shown; {AGAIN}")
            return None
        self.begun = None
        if begun.overtaken(self.host.session):
            self.say(OVERTAKEN)
            return None
        return begun

    def send(self, lines: Sequence[str]) -> None:
        """Send lines in their order, each once the one before it is answered."""
        for line in lines:
            self.host.outbox.type(line)
        self.say(f"sent: {', '.join(lines)}", "dim")


def note_painted(page: SendingPage) -> None:
    """Note that a page is painted now: what Enter would send was seen unless a key waits that was typed before."""
    page.painted = page.begun is not None and (page.painted or page.host.keyboard.idle)


class ListPage(AskingPage):
    """A page of rows to choose from: typing narrows them, arrows and the wheel choose, Enter and a click take one."""

    AUTO_FOCUS = None
    LIST: ClassVar[str] = ""
    """The name of the rows among the parts."""

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.field = InputField(self.typed, edited=lambda text: self.edited(text.removeprefix("/")), id=self.FIELD)

    def content(self) -> ComposeResult:
        """Make the parts; the line that narrows the rows is always there."""
        for part in super().content():
            part.display = True
            yield part

    def on_mount(self) -> None:
        """Show what failed on this page alone, and take what is typed."""
        self.host.model.trouble = ""
        self.end_asking()

    def end_asking(self) -> None:
        """Narrow again with what was typed for that."""
        self.asked = None
        self.field.value, self.field.placeholder = self.words, "type to narrow"
        self.field.cursor_position = len(self.words)
        self.set_focus(self.field)

    @property
    def words(self) -> str:
        """What narrows the rows; a `/` before it, which begins a search elsewhere, is none of it."""
        return self.field.value.removeprefix("/")

    def put_rows(
        self,
        items: Sequence[T],
        at: int,
        row: Callable[[T, bool], Row],
        nothing: Sequence[Row],
        height: int | None = None,
    ) -> Span:
        """Show the rows around the chosen one; return how many are below them."""
        part = self.lines(self.LIST)
        shown = in_view(items, at, part.size.height if height is None else height)
        rows = [_linked(row(item, number == at), number) for number, item in shown]
        part.put(rows or nothing)
        below = len(items) - shown[-1][0] - 1 if shown else 0
        return f"▼ {below} below   " if below else "", "strong"

    @abstractmethod
    def choose(self, at: int) -> None:
        """Choose a row by its place."""

    @abstractmethod
    def action_step(self, by: int) -> None:
        """Choose another row."""

    def on_mouse_scroll_down(self) -> None:
        self.action_step(1)

    def on_mouse_scroll_up(self) -> None:
        self.action_step(-1)

    async def action_clicked(self, at: int) -> None:
        """Choose a row and take it."""
        self.choose(at)
        await self.field.action_submit()


def _linked(row: Row, number: int) -> Row:
    text, role = row[0]
    return (ActionText(text, f"screen.clicked({number})"), role), *row[1:]


class PageEntry(NamedTuple):
    """A page, and how a person comes to it."""

    name: str
    title: str
    about: str
    """One line for the palette."""
    place: str
    """Module and class in `tui.screens`."""

    def page(self) -> type[Page]:
        kind: type[Page] = imported(f"multidrop.tui.screens.{self.place}")
        return kind


PAGES: tuple[PageEntry, ...] = (
    PageEntry("drives", "All drives", "every drive of every line, the worst first", "all_drives:AllDrives"),
    PageEntry("plot", "Plots", "position, velocity and values over time", "plot_page:PlotPage"),
    PageEntry("macros", "Macros", "play, record, edit and put on keys", "macros:MacrosPage"),
    PageEntry("program", "Program", "edit, check, download, run, trace and step", "program:ProgramPage"),
    PageEntry("parameters", "Parameters", "every setting: search, compare, edit, save", "parameters:ParametersPage"),
    PageEntry("setup", "Set-up", "name, unit, travel, zero and guard of a drive, as a form", "setup:SetupPage"),
    PageEntry("variables", "Variables", "the variables of the programs as a table to edit", "variables:VariablesPage"),
    PageEntry("io", "I/O set-up", "functions and levels of inputs and outputs, as a form", "io_setup:IoSetupPage"),
    PageEntry("outputs", "Outputs", "switch the outputs of a drive, each by a key and Enter", "outputs:OutputsPage"),
    PageEntry("programs", "Programs", "run, pause, continue and stop programs in a drive", "programs:ProgramsPage"),
    PageEntry("controls", "Controls", "jog by steps, move, home, stop, enable", "controls:ControlsPage"),
    PageEntry("why", "Why", "what is wrong with the selected drive, and three keys that help", "why:WhyPage"),
    PageEntry("traffic", "Traffic", "the bytes of the line, both ways, with times", "traffic:TrafficPage"),
)


def page_entry(name: str) -> PageEntry:
    """Find a page by name. Raises Diagnostic."""
    for entry in PAGES:
        if entry.name == name:
            return entry
    raise Diagnostic(f"no page {name}", "/page", f"pages: {', '.join(entry.name for entry in PAGES)}")
