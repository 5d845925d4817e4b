"""The pages by name: title, meaning, key, class."""

from __future__ import annotations

from typing import NamedTuple

from dialects import Diagnostic
from tui.screens.all_drives import AllDrives
from tui.screens.controls import ControlsPage
from tui.screens.macros import MacrosPage
from tui.screens.page import Page
from tui.screens.parameters import ParametersPage
from tui.screens.plot_page import PlotPage
from tui.screens.program import ProgramPage
from tui.screens.traffic import TrafficPage


class PageEntry(NamedTuple):
    """A page, and how a person comes to it."""

    name: str
    title: str
    about: str
    """One line for the palette."""
    make: type[Page]
    key: str = ""
    """The key that opens it, as Textual spells it."""


PAGES: tuple[PageEntry, ...] = (
    PageEntry("drives", "All drives", "every drive of every line, the worst first", AllDrives, "ctrl+a"),
    PageEntry("plot", "Plots", "position, velocity and values over time", PlotPage, "ctrl+g"),
    PageEntry("macros", "Macros", "play, record, edit and put on keys", MacrosPage),
    PageEntry("program", "Program", "edit, check, download, run, trace and step", ProgramPage, "ctrl+e"),
    PageEntry("parameters", "Parameters", "every setting: search, compare, edit, save", ParametersPage),
    PageEntry("controls", "Controls", "jog by steps, move, home, stop, enable", ControlsPage, "ctrl+n"),
    PageEntry("traffic", "Traffic", "the bytes of the line, both ways, with times", TrafficPage),
)


def page_entry(name: str) -> PageEntry:
    """Find a page by name. Raises Diagnostic."""
    for entry in PAGES:
        if entry.name == name:
            return entry
    raise Diagnostic(f"no page {name}", "/page", f"pages: {', '.join(entry.name for entry in PAGES)}")
