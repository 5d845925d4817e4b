"""The pages by name: title, meaning, key, and where its class is; the class is imported when the page is shown."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.on_demand import imported
from multidrop.tui.screens.page import Page


class PageEntry(NamedTuple):
    """A page, and how a person comes to it."""

    name: str
    title: str
    about: str
    """One line for the palette."""
    place: str
    """Module and class in `tui.screens`."""
    key: str = ""
    """The key that opens it, as Textual spells it."""

    def page(self) -> type[Page]:
        """Import the class."""
        found: type[Page] = imported(f"multidrop.tui.screens.{self.place}")
        return found


PAGES: tuple[PageEntry, ...] = (
    PageEntry("drives", "All drives", "every drive of every line, the worst first", "all_drives:AllDrives", "ctrl+a"),
    PageEntry("plot", "Plots", "position, velocity and values over time", "plot_page:PlotPage", "ctrl+g"),
    PageEntry("macros", "Macros", "play, record, edit and put on keys", "macros:MacrosPage"),
    PageEntry("program", "Program", "edit, check, download, run, trace and step", "program:ProgramPage", "ctrl+e"),
    PageEntry("parameters", "Parameters", "every setting: search, compare, edit, save", "parameters:ParametersPage"),
    PageEntry("controls", "Controls", "jog by steps, move, home, stop, enable", "controls:ControlsPage", "ctrl+n"),
    PageEntry("traffic", "Traffic", "the bytes of the line, both ways, with times", "traffic:TrafficPage"),
)


def page_entry(name: str) -> PageEntry:
    """Find a page by name. Raises Diagnostic."""
    for entry in PAGES:
        if entry.name == name:
            return entry
    raise Diagnostic(f"no page {name}", "/page", f"pages: {', '.join(entry.name for entry in PAGES)}")
