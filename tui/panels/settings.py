"""The table of a drive's settings as rows: what is searched, compared and chosen in it."""

from __future__ import annotations

from dataclasses import dataclass, field

from multidrop.dialects import Diagnostic
from multidrop.dialects.parameters import VARIABLES, Readings, Value
from multidrop.shell.params.page import Row as Setting
from multidrop.shell.params.page import found_in, meanings_of, rows
from multidrop.tui.panels.glance import Glance, name_of
from multidrop.tui.panels.view import View
from multidrop.tui.session_view import DriveView
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.lines import Row, Span, spread

NAME, VALUE, UNIT = 8, 16, 10
TOLD = ("range", "value", "values", "note")
"""The rows of help for the chosen setting, besides its title and meaning."""


@dataclass
class SettingsTable:
    """The settings of one drive as they are searched and compared, and the chosen one."""

    words: str = ""
    only_differing: bool = False
    other: tuple[str, dict[str, Value]] | None = None
    """What the settings are compared with: its name, and its values."""
    at: int = 0
    shown: list[Setting] = field(default_factory=list)
    found: Readings | None = None
    _made_of: tuple[object, ...] = ()
    _meanings: dict[str, str] = field(default_factory=dict)

    def make(self, found: Readings | None, drive: DriveView | None) -> None:
        """Make the table again if what it is made of has changed."""
        made_of = (found, self.words, self.only_differing, self.other)
        if found is not self.found:
            known = found is not None and drive is not None
            self._meanings = meanings_of(found, drive.family.language, drive.product) if known else {}  # type: ignore[arg-type,union-attr]
        if found is not self.found or made_of[1:] != self._made_of[1:]:
            other = self.other[1] if self.other is not None else None
            table = [] if found is None else rows(found, other, self._meanings)
            self.shown = found_in(table, self.words, differing=self.only_differing)
        self.found, self._made_of = found, made_of
        self.at = min(max(self.at, 0), max(0, len(self.shown) - 1))

    @property
    def chosen(self) -> Setting | None:
        """The chosen setting."""
        return self.shown[self.at] if self.shown else None

    def step(self, by: int) -> None:
        """Choose another one."""
        self.at = min(max(self.at + by, 0), max(0, len(self.shown) - 1))

    def compare(self, name: str, values: dict[str, Value]) -> None:
        """Compare with these values."""
        self.other, self.at = (name, values), 0

    def rows(self, width: int, height: int) -> list[Row]:
        """The rows around the chosen one."""
        first = max(0, min(self.at - height // 2, len(self.shown) - height))
        return [
            self._row(each, width, n == self.at) for n, each in enumerate(self.shown[first : first + height], first)
        ]

    def heading(self, view: View, glance: Glance | None, width: int) -> Row:
        """The drive, how many settings are shown, and when they were read."""
        name = f"{view.session.selected_bus}:{name_of(glance)}" if glance is not None else "no drive selected"
        left: list[Span] = [(" PARAMETERS   ", "strong"), (name, "accent")]
        if glance is None or self.found is None:
            return spread(left, [], width)
        left.append((f"   {len(self.shown)} of {len(self.found.readings)}", "text"))
        overtaken = glance.readout.touched > glance.readout.settings_at
        ago = f"read {age(view.now - glance.readout.settings_at)} ago{', lines were sent since' if overtaken else ''} "
        return spread(left, [(ago, "strong" if overtaken else "dim")], width)

    def columns(self, width: int) -> Row:
        """The names of the columns, and what is searched."""
        other = f"{fit(self.other[0], VALUE).strip():>{VALUE}} " if self.other is not None else ""
        only = "  only what differs" if self.only_differing else ""
        search = f"  search: {self.words}" if self.words else ""
        text = f"   {fit('name', NAME)} {'value':>{VALUE}} {fit('unit', UNIT)} {other}{only}{search}"
        return ((fit(text, width), "dim"),)

    def about(self, drive: DriveView | None) -> str:
        """The help on the chosen setting in one line: its title, and what it takes."""
        row = self.chosen
        if row is None or drive is None:
            return ""
        try:
            lines = [" ".join(each.split()) for each in drive.family.language.describe(row.reading.name, drive.product)]
            return "   ".join([*lines[:2], *(each for each in lines[2:] if each.split(" ")[0] in TOLD)])
        except Diagnostic:
            return f"{row.reading.name} {row.meaning}"

    def _row(self, row: Setting, width: int, chosen: bool) -> Row:
        there: list[Span] = []
        if self.other is not None:
            there.append((f"{_aligned(row.other or '–')} ", "strong" if row.differs else "dim"))
        left: list[Span] = [
            ("▸" if chosen else " ", "accent"),
            ("≠ " if row.differs else "  ", "strong"),
            (f"{fit(row.reading.name, NAME)} ", "accent" if chosen else "text"),
            (f"{_aligned(row.value)} ", "strong" if chosen or row.differs else "text"),
            (f"{fit(row.reading.unit, UNIT)} ", "dim"),
            *there,
        ]
        room = width - sum(len(text) for text, _ in left)
        meaning = row.meaning or (row.reading.unit if len(row.reading.unit) > UNIT else "")
        about = ("program variable  " if row.reading.section == VARIABLES else "") + meaning
        return (*left, (fit(about, room), "dim"))


def _aligned(text: str) -> str:
    """A value at the right of its column, a whole number without zeros before it; fields and texts are cut."""
    shown = str(int(text)) if text.lstrip("-").isdigit() else text
    return f"{fit(shown, VALUE).strip():>{VALUE}}"
