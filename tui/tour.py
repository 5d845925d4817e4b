"""The tour: steps that name what to type or press, on the demo cell, each over when a person has done it.

Nothing is typed for the person, and only lines to the simulated drives count. It ends with its last step, or at any
time with Escape.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from multidrop.shell.events import By, Entered, SessionEvent
from multidrop.shell.session import Session
from multidrop.tui.keymap import Keymap
from multidrop.tui.text import at_words
from multidrop.tui.widgets.lines import Row

FILE_HEADING = "Program file; with / a folder"
"""The heading of the dialog that asks for a program file."""
LINE = "press"
"""The line of the demo cell that it is on."""
TOUR_ROWS = 3
"""Height of the tour: its step in words, and how to end it."""


KEYS = ("page-drives", "page-controls", "page-plot", "page-program", "page-macros", "palette", "help")
"""The functions whose keys the steps name."""


class TourStep(NamedTuple):
    """A task, and what ends it. `{NAME}` is replaced by the key of a function."""

    words: str
    until: str
    """`typed LINE`: a line was sent that begins so. `shown NAME | NAME`: one of these dialogs or screens is in front.

    `recording`, `recorded`: a macro is being recorded, or no longer. `stopped`, `resumed`: there was a stop, or it is
    over.
    """


STEPS = (
    TourStep("Drive a answers in its own language. Type PR P and press Enter: it prints its position.", "typed PR P"),
    TourStep(
        "Now a move: type MR 512000 and press Enter. Its row shows the travel and what is left of it.", "typed MR"
    ),
    TourStep(
        "The same in units: MR {12.5 mm} and Enter. The drive gets steps, which the transcript shows.", "typed MR {"
    ),
    TourStep("Another drive of the same line: @b PR P goes to drive b, whatever is selected.", "typed @B"),
    TourStep("{page-drives} shows all drives of all lines, the worst first.", "shown AllDrives"),
    TourStep("Escape goes back from every page.", "shown MainScreen"),
    TourStep("Let drive a run without end: SL 100000 and Enter.", "typed SL"),
    TourStep("^X stops every drive, macro and script, from anywhere, always. Press it now.", "stopped"),
    TourStep(
        "STOPPED below the tabs means: velocity 0 was read from every drive. Macros and scripts wait: type /resume.",
        "resumed",
    ),
    TourStep(
        "{page-controls} moves a drive by keys, step by step. Look at it, then press Escape.", "shown ControlsPage"
    ),
    TourStep("{page-plot} draws its curves. Look at them, then press Escape.", "shown PlotPage"),
    TourStep(
        "{page-program} edits, checks and downloads programs. It first asks for a file: press Escape twice.",
        f"shown ProgramPage | {FILE_HEADING}",
    ),
    TourStep("Record a macro: type /record tour --replace and press Enter.", "recording"),
    TourStep("What you type now is kept. Type MR 51200 and Enter, then /record stop and Enter.", "recorded"),
    TourStep(
        "{page-macros} lists your macros: Enter plays one, {page-macros} there puts it on a key.", "shown MacrosPage"
    ),
    TourStep("{palette} finds everything by name. Open it, look, and close it with Escape.", "shown Everything"),
    TourStep("{help} is help for where you are. Open it and type a word, then Escape.", "shown Help"),
)
END = "That was the tour. The demo cell stays open; /close closes a line. Escape ends the tour."


class Tour:
    """The tour of one app. `front` returns the heading of the dialog in front, else the class of the screen."""

    def __init__(self, session: Session, keys: Keymap, front: Callable[[], str]) -> None:
        self._session, self._keys, self._front = session, keys, front
        self.bus = ""
        """The simulated line that it is on; empty while there is no tour."""
        self._at = 0
        self._lines: list[str] = []
        """Lines that a person sent to the demo cell since the step began, in capitals."""
        self._stops = 0
        session.subscribe(self._take)

    @property
    def on(self) -> bool:
        return bool(self.bus)

    async def begin(self) -> None:
        """Begin with the first step, on the demo cell, which is opened unless it is. Raises what an opening does.

        Nothing is opened twice: a line has one owner, and a second one would take its replies.
        """
        if not self._session.of_demo(LINE):
            await self._session.open(f"sim:#{LINE}" if self._session.buses else "sim:")
        self.begin_on(self._session.of_demo(LINE))

    def begin_on(self, bus: str) -> None:
        self.bus, self._at = bus, 0
        self._session.select("", bus)
        self._next(0)

    def end(self) -> None:
        self.bus = ""

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, Entered) and event.by is By.OPERATOR and event.bus == self.bus and self.on:
            self._lines.append(event.line.upper())

    def _next(self, at: int) -> None:
        self._at, self._lines, self._stops = at, [], self._session.stops

    def _is_done(self, until: str) -> bool:
        what, _, text = until.partition(" ")
        match what:
            case "typed":
                return any(line.startswith(text) for line in self._lines)
            case "shown":
                return self._front() in text.split(" | ")
            case "recording" | "recorded":
                return bool(self._session.recording) is (what == "recording")
            case "stopped":
                return self._session.stops != self._stops
            case _:
                return not self._session.latched

    def rows(self, width: int) -> list[Row]:
        """The step in words; goes on to the next one once it was done."""
        if self.on and self._at < len(STEPS) and self._is_done(STEPS[self._at].until):
            self._next(self._at + 1)
        words = [f" {row}" for row in at_words(self._words(), width - 2)][: TOUR_ROWS - 1]
        last = f" tour {min(self._at + 1, len(STEPS))} of {len(STEPS)}   Esc ends it"
        rows: list[Row] = [((row, "strong"),) for row in words]
        return [*rows, ((last, "dim"),)]

    def _words(self) -> str:
        if self.bus not in self._session.buses:
            return "The demo cell of the tour is closed. Escape ends the tour."
        if self._at >= len(STEPS):
            return END
        if self._session.selected_bus != self.bus:
            return f"Lines go to {self._session.selected_bus} now. The tour goes on on {self.bus}: type /use {self.bus}"
        words = STEPS[self._at].words
        for name in KEYS:
            words = words.replace(f"{{{name}}}", self._keys.shown(name) or f"/{name.replace('page-', 'page ')}")
        return words
