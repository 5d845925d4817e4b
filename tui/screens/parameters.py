"""The page of parameters: a table to search, to compare with defaults, a file or another drive, and to edit.

`/params read` reads the settings. A value is checked against the family's table before anything is sent; a second Enter
sends the lines that are shown. They go out as if they were typed, and then everything is read again.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import (
    ORDINARY,
    VARIABLES,
    Parameters,
    Permission,
    Reading,
    Readings,
    Scalar,
    Value,
    same,
)
from multidrop.drives.drive import Drive
from multidrop.shell import setting_units
from multidrop.shell.params import file as files
from multidrop.tui.panels.table import column_rows, panel
from multidrop.tui.panels.view import Glance, View, name_of
from multidrop.tui.screens.dialogs import Choose, ListedChoice
from multidrop.tui.screens.page import ListPage, PageHost, SendingPage, note_painted
from multidrop.tui.screens.settings_file import FileColumn
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.lines import Row, Span, spread

if TYPE_CHECKING:
    from multidrop.dialects.language import Language

_NUMBER = re.compile(r"[+-]?\d{1,20}")
_FRACTION = re.compile(r"[+-]?(?:\d{1,20}\.\d*|\.\d+)(?:[eE][+-]?\d{1,3})?")
NAME, VALUE, UNIT = 8, 16, 10
TOLD = ("range", "value", "values", "note")
"""The rows of help for the chosen setting, besides its title and meaning."""


@dataclass(frozen=True)
class ShownSetting:
    """One setting: its value here and what it is compared with, each as text."""

    reading: Reading
    value: str
    other: str = ""
    """Empty where there is nothing to compare with."""
    differs: bool = False
    meaning: str = ""


def rows(found: Readings, other: Mapping[str, Value] | None, meanings: Mapping[str, str]) -> list[ShownSetting]:
    """A row for each setting. `other`: the values to compare with."""
    made = []
    for reading in found.readings:
        there = None if other is None else other.get(reading.name)
        compared = "" if there is None else files.shown(there)
        differs = there is not None and not same(reading.value, there)
        made.append(
            ShownSetting(reading, files.shown(reading.value), compared, differs, meanings.get(reading.name, ""))
        )
    return made


def found_in(table: Sequence[ShownSetting], words: str, *, differing: bool = False) -> list[ShownSetting]:
    """The rows that contain every word: names, sections, values, meanings."""
    wanted = words.casefold().split()

    def contains(row: ShownSetting) -> bool:
        text = f"{row.reading.name} {row.reading.section} {row.value} {row.reading.unit} {row.meaning}".casefold()
        return all(word in text for word in wanted)

    chosen = [row for row in table if contains(row) and (row.differs or not differing)]
    return sorted(chosen, key=lambda row: row.reading.name.casefold() != words.strip().casefold())


def meanings_of(found: Readings, language: Language, product: str) -> dict[str, str]:
    """The first line of help on each setting, without its name."""
    made = {}
    for reading in found.readings:
        for word in (reading.name, reading.name.rstrip("0123456789")):
            try:
                first = language.describe(word, product)[0]
            except Diagnostic:
                continue
            made[reading.name] = re.sub(r" \((?:variable|flag)\)$", "", first.partition(": ")[2] or first)
            break
    return made


def parsed(text: str) -> Value:
    """Read a typed value: a number, a text, or the fields of a set-up with commas. Raises Diagnostic."""
    fields = [part.strip() for part in text.strip().strip("[]").split(",")]
    if not all(fields):
        raise Diagnostic("a value is missing", text, "such as 600000, or 1,1,0 for a set-up")
    values: list[Scalar] = []
    for typed in fields:
        if _NUMBER.fullmatch(typed):
            values.append(int(typed))
        elif _FRACTION.fullmatch(typed):
            values.append(float(typed))
        elif typed.isascii() and typed.isprintable():
            values.append(typed.strip('"'))
        else:
            raise Diagnostic("not a value", typed, "a number, or text in plain ASCII")
    return values[0] if len(values) == 1 else tuple(values)


@dataclass(frozen=True)
class SettingEdit:
    """The lines that change one setting, and what a person must know before they are sent."""

    lines: tuple[str, ...]
    warning: str = ""


def edit(parameters: Parameters, present: Readings, name: str, value: Value) -> SettingEdit:
    """Plan the lines that set one value. Raises Diagnostic for a value that the drive refuses."""
    made = parameters.plan(present, {name: value}, ORDINARY)
    warning = "; ".join(reason for _, reason in made.withheld)
    if made.withheld:
        made = parameters.plan(present, {name: value}, Permission(frozenset({name}), communication=True))
    if made.impossible:
        raise Diagnostic("; ".join(reason for _, reason in made.impossible), name)
    if not made.changes:
        raise Diagnostic(f"it is {files.shown(value)} already", name)
    return SettingEdit(tuple(change.text for change in made.changes), "; ".join(filter(None, (warning, *made.remarks))))


@dataclass
class SettingsTable:
    """The settings of one drive as they are searched and compared, and the chosen one."""

    words: str = ""
    only_differing: bool = False
    other: tuple[str, dict[str, Value]] | None = None
    """The other side of a comparison: its name, and its values."""
    at: int = 0
    shown: list[ShownSetting] = field(default_factory=list)
    found: Readings | None = None
    _drive: Drive | None = None
    _made_of: tuple[object, ...] = ()
    _meanings: dict[str, str] = field(default_factory=dict)

    def make(self, found: Readings | None, drive: Drive | None) -> None:
        """Make the table again if what it is made of has changed."""
        made_of = (found, self.words, self.only_differing, self.other)
        if found is not self.found:
            known = found is not None and drive is not None
            self._meanings = meanings_of(found, drive.family.language, drive.product) if known else {}  # type: ignore[arg-type,union-attr]
        if found is not self.found or made_of[1:] != self._made_of[1:]:
            other = self.other[1] if self.other is not None else None
            table = [] if found is None else rows(found, other, self._meanings)
            self.shown = found_in(table, self.words, differing=self.only_differing)
        self.found, self._drive, self._made_of = found, drive, made_of
        self.at = min(max(self.at, 0), max(0, len(self.shown) - 1))

    @property
    def chosen(self) -> ShownSetting | None:
        """The chosen setting of what the table is made of now: an Enter may follow in the same read."""
        self.make(self.found, self._drive)
        return self.shown[self.at] if self.shown else None

    def step(self, by: int) -> None:
        self.make(self.found, self._drive)
        self.at = min(max(self.at + by, 0), max(0, len(self.shown) - 1))

    def compare(self, name: str, values: dict[str, Value]) -> None:
        self.other, self.at = (name, values), 0

    def end_comparison(self) -> None:
        self.other, self.only_differing = None, False

    def heading(self, view: View, glance: Glance | None, width: int, below: Span) -> Row:
        """The drive, how many settings are shown, and when they were read."""
        name = f"{view.session.selected_bus}:{name_of(glance)}" if glance is not None else "no drive selected"
        left: list[Span] = [(" PARAMETERS   ", "strong"), (name, "accent")]
        if glance is None or self.found is None:
            return spread(left, [], width)
        left.append((f"   {len(self.shown)} of {len(self.found.readings)}", "text"))
        overtaken = glance.readout.touched > glance.readout.settings_at
        ago = f"read {age(view.now - glance.readout.settings_at)} ago{', lines were sent since' if overtaken else ''} "
        return spread(left, [below, (ago, "strong" if overtaken else "dim")], width)

    def columns(self, width: int) -> Row:
        """The names of the columns, and what is shown."""
        other = f"{fit(self.other[0], VALUE).strip():>{VALUE}} " if self.other is not None else ""
        only = "  only what differs" if self.only_differing else ""
        text = f"   {fit('name', NAME)} {'value':>{VALUE}} {fit('unit', UNIT)} {other}{only}"
        return ((fit(text, width), "dim"),)

    def about(self, drive: Drive | None) -> str:
        """The help on the chosen setting in one line: its title, and what it takes."""
        row = self.chosen
        if row is None or drive is None:
            return ""
        try:
            lines = [
                " ".join(paragraph.split())
                for paragraph in drive.family.language.describe(row.reading.name, drive.product)
            ]
            return "   ".join([*lines[:2], *(line for line in lines[2:] if line.split(" ")[0] in TOLD)])
        except Diagnostic:
            return f"{row.reading.name} {row.meaning}"

    def row(self, row: ShownSetting, width: int, chosen: bool, units: Callable[[str, Value], str] | None) -> Row:
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
        shown = units(row.reading.name, row.reading.value).strip(" ()") if units is not None else ""
        kind = "program variable" if row.reading.section == VARIABLES else ""
        about = "  ".join(filter(None, (shown, kind, meaning)))
        return (*left, (fit(about, room), "dim"))


def _aligned(text: str) -> str:
    """A value at the right of its column, a whole number without zeros before it; fields and texts are cut."""
    shown = str(int(text)) if text.lstrip("-").isdigit() else text
    return f"{fit(shown, VALUE).strip():>{VALUE}}"


FILE, DRIVE, EDIT, BACKUP, RESTORE = "file", "drive", "value", "backup", "restore"
DEFAULT = "default"
"""The name of the other side of a comparison with the defaults."""
READING = "reading; the footer shows how far"
ASKS = {
    FILE: "a file of settings, from /params backup",
    DRIVE: "the address of another drive, whose settings /params read has read",
    EDIT: "a value, or fields with commas; Enter shows the lines, Esc changes nothing",
    BACKUP: "a name for the new file; Enter reads every setting and writes them to it",
    RESTORE: "a file of settings, from /params backup; Enter shows what differs and asks before it is sent",
}


def settings_of(host: PageHost, name: str) -> dict[str, Value]:
    """Return the settings of another drive, which were read before. Raises Diagnostic."""
    bus, _, address = name.rpartition(":")
    readout = host.model.bus(bus or host.session.selected_bus).readouts.get(address)
    if readout is None or readout.settings is None:
        raise Diagnostic("its settings are not read", name, f"/params read {name} reads them")
    return readout.settings.values


class ParametersPage(ListPage, SendingPage):
    """All settings of the selected drive."""

    SHEET = "parameters"
    WANTS = frozenset({"motion"})
    PARTS = {"heading": None, "asked": None, "columns": None, "table": "1fr", "meaning": None, "said": None}
    FIELD, LIST = "asked", "table"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._table = SettingsTable()
        self._file_column = FileColumn(lambda: self._table, self.say, self.run_worker)
        self._asked_for = False
        """The settings were asked for, as nobody had read them."""
        self._reading = False
        """The settings are to be read again once no line runs or waits."""
        self._place = host.session.place
        self._glance: Glance | None = None

    @property
    def words(self) -> str:
        """What narrows the rows."""
        return self._table.words

    # What is shown

    def show(self, view: View) -> None:
        self._glance = view.chosen
        # Forget what was begun before a stop, or for another drive.
        place = view.session.place
        if place != self._place:
            self._place, self._table, self._asked_for = place, SettingsTable(), False
            self._close("")
        begun = [edit for edit in (self.asked, self.begun) if edit is not None]
        if any(edit.stops != view.session.stops for edit in begun):
            self._close("stopped; nothing was sent")
        if view.model.trouble:
            self.say(f"✗ {view.model.trouble}")
            view.model.trouble = ""
        if self._reading and self.host.outbox.idle:
            self._reading = False
            self.host.outbox.type("/params read")
        width, drive = self.size.width, self.host.session.selected
        if self._glance is not None and self._settings() is None and not self._asked_for and self.host.outbox.idle:
            self._asked_for = True
            self.action_read()
        if self.said[0] == READING and self._table.found is not self._settings():
            self.say("", "dim")
        self._table.make(self._settings(), drive)
        table, session = self._table, view.session
        units = partial(setting_units.shown, session.units, drive) if session.scaled and drive is not None else None
        below = self.put_rows(
            table.shown,
            table.at,
            lambda row, chosen: table.row(row, width, chosen, units),
            self._nothing(view),
        )
        self.lines("heading").put([table.heading(view, self._glance, width, below)])
        self.lines("columns").put([self._table.columns(width)])
        self.lines("meaning").put([((f" {fit(self._table.about(drive), width - 2)}", "dim"),)])
        self.lines("said").put([((f" {fit(self.said[0], width - 2)}", self.said[1]),)])
        note_painted(self)

    def _settings(self) -> Readings | None:
        return self._glance.readout.settings if self._glance is not None else None

    def _nothing(self, view: View) -> list[Row]:
        if self._glance is None:
            return [((" ^O chooses a drive", "dim"),)]
        if self._settings() is None:
            room = self.lines("table").size
            known = column_rows([[panel("drive")], [panel("drives")]], view, room.width, max(0, room.height - 2), False)
            return [
                ((" not read yet: ^P, read again, reads every setting; nothing is changed by it", "strong"),),
                (),
                *known,
            ]
        return [((" nothing differs" if self._table.only_differing else " no setting has that", "dim"),)]

    # Keys

    def choose(self, at: int) -> None:
        if self.begun is None and self.asked is None:
            self._table.at = at

    def action_step(self, by: int) -> None:
        if self.begun is None and self.asked is None:
            self._table.step(by)

    async def action_clicked(self, at: int) -> None:
        """Choose a setting and edit it. A click sends nothing."""
        if self.begun is None and self.asked is None:
            self.choose(at)
            self.action_enter()

    def action_read(self) -> None:
        if self._glance is None:
            self.say("no drive is selected")
        else:
            self.host.outbox.type("/params read")
            self.say(READING, "dim")
            self._file_column.look()

    def action_defaults(self) -> None:
        readings = self._settings()
        table = self._table
        if table.other is not None and table.other[0] == DEFAULT:
            table.end_comparison()
        elif readings is not None and readings.defaults:
            table.other = (DEFAULT, readings.defaults)
        else:
            self.say(
                "the defaults of its settings are not known"
                if readings is not None
                else "its settings are not read yet"
            )

    async def action_compare(self) -> None:
        """Choose what to compare with, or which rows of a comparison to show."""
        table = self._table
        actions: dict[str, tuple[str, Callable[[], None]]] = {
            "file": ("With a file", partial(self.action_ask, FILE)),
            "drive": ("With another drive", partial(self.action_ask, DRIVE)),
        }
        if table.other is None or table.other[0] != DEFAULT:
            actions = {"defaults": ("With the defaults", self.action_defaults), **actions}
        if table.other is not None:
            rows_shown = "Show every setting again" if table.only_differing else "Show only what differs"
            actions = {"differing": (rows_shown, self.action_differing), **actions}
            actions["end"] = ("End the comparison", table.end_comparison)

        def taken(answer: str | None) -> None:
            if answer is not None:
                actions[answer][1]()

        offers = [ListedChoice(key, words) for key, (words, _) in actions.items()]
        await self.app.push_screen(Choose("Compare the settings", offers), taken)

    def action_differing(self) -> None:
        table = self._table
        if table.other is None:
            self.say("choose first what to compare with: ^F")
        else:
            table.only_differing, table.at = not table.only_differing, 0
            self._file_column.look()

    def action_variables(self) -> None:
        self.field.value = "" if self.field.value == VARIABLES else VARIABLES

    def action_ask(self, kind: str, name: str = "", value: str = "") -> None:
        self.begun = None
        self.ask_for(kind, value, ASKS[kind], name)
        self.field.select_all()
        self.say(f"{name}: {ASKS[kind]}" if name else ASKS[kind], "dim")

    def action_enter(self) -> None:
        """Edit the chosen setting, or send what is pending."""
        if self.begun is not None:
            if (begun := self.accepted()) is not None:
                self._reading = True
                self.send(begun.lines)
        elif (row := self._table.chosen) is not None:
            self.action_ask(EDIT, row.reading.name, row.value.strip('[]"'))
            self._file_column.look()

    def action_save(self) -> None:
        if self._glance is None:
            self.say("no drive is selected")
        else:
            self.host.outbox.type("/params save")

    def action_leave(self) -> None:
        """Leave the field or the pending lines, then the page."""
        if self.asked is not None or self.begun is not None:
            self._close("nothing was sent" if self.asked is None or self.asked.kind == EDIT else "")
            return
        super().action_leave()

    # What is typed

    def edited(self, text: str) -> None:
        """Narrow while the words are typed; lines that wait for Enter are dropped."""
        if self.asked is None and text != self._table.words:
            self._table.words, self._table.at = text, 0
            if self.begun is not None:
                self._close("nothing was sent")

    def typed(self, text: str) -> None:
        asked = self.asked
        if asked is None:
            self.action_enter()
            return
        if asked.overtaken(self.host.session):
            self._close("it was not used")
            return
        try:
            if asked.kind == FILE:
                self._file_column.show(
                    text, self.host.session.selected, lambda: self._close("") if self.asked is asked else None
                )
            elif asked.kind == DRIVE:
                self._table.compare(text, settings_of(self.host, text))
                self._close("")
            elif asked.kind == EDIT:
                self._value(asked.name, text)
            else:
                self._type_with_file(asked.kind, text)
        except Diagnostic as failure:
            self.say(f"nothing was sent: {failure}")

    def _type_with_file(self, kind: str, text: str) -> None:
        """Type `/params backup FILE` or `/params restore FILE`, which asks before it sends anything."""
        if not text:
            raise Diagnostic("a file name is needed", f"/params {kind}")
        self._close("")
        self.host.outbox.type(f"/params {kind} {shlex.quote(text)}")
        self._reading = kind == RESTORE

    def _value(self, name: str, text: str) -> None:
        drive, present = self.host.session.selected, self._settings()
        if drive is None or present is None:
            raise Diagnostic("the settings of the drive are not read", name, "/params read reads them")
        planned: SettingEdit = edit(drive.family.values.parameters, present, name, parsed(text))
        self._close("")
        self.offer(EDIT, planned.lines)
        warning = f" - {planned.warning}" if planned.warning else ""
        self.say(f"Enter sends {', '.join(planned.lines)}{warning}   Esc: nothing")

    def _close(self, said: str) -> None:
        self.begun = None
        self.end_asking()
        self.say(said, "strong" if said else "dim")
