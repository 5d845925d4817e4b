"""The page of all drives of all lines: the worst first, a row each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from multidrop.base.text import visible
from multidrop.shell.roles import Series
from multidrop.tui.panels.drive import SIGN, alarm_words, program_words, trouble_of
from multidrop.tui.panels.drives import STATE, short_words, spark
from multidrop.tui.panels.facts import selected_rows
from multidrop.tui.panels.plot import plot_rows
from multidrop.tui.panels.table import panel, title_row
from multidrop.tui.panels.view import NOT_REFERENCED, Glance, View, glances_of
from multidrop.tui.readout import ReadoutState
from multidrop.tui.screens.page import ListPage, PageHost
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row, Span, beside, spread, width_of

URGENCY = (
    *(
        ReadoutState.LOST,
        ReadoutState.SILENT,
        ReadoutState.MOVING,
        ReadoutState.DWELL,
        ReadoutState.STORING,
        ReadoutState.UNKNOWN,
    ),
    *(ReadoutState.NO_CURRENT, ReadoutState.STOPPED, ReadoutState.IDLE),
)
"""The states, the worst first."""
AT_REST = (ReadoutState.NO_CURRENT, ReadoutState.STOPPED, ReadoutState.IDLE)
ROOMY, NARROW = 100, 80
"""Widths of the page: from `ROOMY` on, the column of the last seconds is wide. Below `NARROW`, neither that column nor
the velocity is shown, to leave room for trouble."""
LAST_GAP = 2
"""Blank cells between the last column and the text that fills the row."""
WIDE_FROM, LEAST_ROOM = 110, 16
"""Least width of the page, and least rows below the list, with the chosen drive there."""
HEAD_ROWS, FEWEST = 6, 8
"""Rows of the page that neither list drives nor show the chosen one, and the least rows of the list."""


class DriveOnLine(NamedTuple):
    """A drive and its line."""

    bus: str
    glance: Glance

    @property
    def name(self) -> str:
        """`press:a gantry`."""
        where = ":".join(filter(None, (self.bus, self.glance.address)))
        return f"{where} {self.glance.label}".strip()

    @property
    def trouble(self) -> str:
        """The errors and limits of its axes."""
        return "; ".join(filter(None, map(trouble_of, self.glance.readout.axes)))

    def alarm(self, room: int = 200) -> str:
        """Its trouble, and the differences of its axes from their twins."""
        return alarm_words(self.trouble, self.glance.readout.axes, room)

    def besides(self, room: int, now: float) -> Span:
        """The fact that matters most besides its state: trouble and its twin, its program, else its product."""
        if alarm := self.alarm(room):
            return alarm, "error"
        if self.glance.unreferenced:
            return NOT_REFERENCED, "strong"
        released = [readout.axis for readout in self.glance.readout.others.values() if readout.no_current]
        if released:
            return f"{', '.join(released)}: {ReadoutState.NO_CURRENT.word}", "strong"
        if program := program_words(self.glance.readout, now):
            return program, "dim" if self.glance.readout.program_aged(now) else "motion"
        return self.glance.product, "dim"

    @property
    def urgency(self) -> tuple[bool, int]:
        """Orders drives, the worst first."""
        return not self.in_trouble, URGENCY.index(self.glance.state())

    @property
    def in_trouble(self) -> bool:
        """True if there is a reason to ask why: an error, a limit, a twin that differs, silence, a loss."""
        return self.glance.state() in URGENCY[:2] or bool(self.alarm())


def worst_first(view: View, filtered: str) -> list[DriveOnLine]:
    """The drives of all lines whose row contains each word of the text.

    A single letter is looked for at the beginning of names only: nearly every row has one in its state or its product.
    """
    buses = view.session.tabs.shown
    places = [DriveOnLine(bus.name, glance) for bus in buses for glance in glances_of(view.session, view.model, bus)]
    wanted = filtered.casefold().split()
    matching = [place for place in places if all(_has(place, word, view.now) for word in wanted)]
    return sorted(matching, key=lambda place: place.urgency)


def _has(place: DriveOnLine, word: str, now: float) -> bool:
    if len(word) == 1 and word.isalnum():
        return any(name.startswith(word) for name in place.name.casefold().replace(":", " ").split())
    sign, _ = place.glance.sign(now)
    return word in f"{place.name} {sign} {place.alarm()} {place.glance.product}".casefold()


class DriveColumn(NamedTuple):
    """A column of the list. A number that is longer than it takes the room from the next one."""

    head: str
    cells: int
    span: Callable[[DriveOnLine, float, bool, int], Span]
    """What it shows of a drive, now, whether it is chosen, in so many cells."""
    right: bool = False
    gap: int = 0
    """Blank cells after it."""
    least: int = 0
    """The least width of the page with it."""
    few: int = 0
    """Its cells on a page that is not roomy; 0: as many."""

    def room(self, width: int) -> int:
        """The cells that it has on a page of a width."""
        return self.few if self.few and width < ROOMY else self.cells

    def put(self, text: str, cells: int) -> str:
        return f"{text:>{max(0, cells)}}" if self.right else fit(text, cells)


def _position(place: DriveOnLine, now: float, chosen: bool, cells: int) -> Span:
    position, _, role = place.glance.values(now)
    return position, role


def _velocity(place: DriveOnLine, now: float, chosen: bool, cells: int) -> Span:
    _, velocity, role = place.glance.values(now)
    return f" {velocity}", role


def _last_seconds(place: DriveOnLine, now: float, chosen: bool, cells: int) -> Span:
    role = place.glance.values(now)[2]
    return spark(place.glance.readout, now, cells), "dim" if role == "dim" else "accent"


def _state(place: DriveOnLine, now: float, chosen: bool, cells: int) -> Span:
    return short_words(place.glance, place.glance.readout, now), place.glance.sign(now)[1]


def _name(place: DriveOnLine, now: float, chosen: bool, cells: int) -> Span:
    return visible(place.name), "accent" if chosen else "text"


COLUMNS = (
    DriveColumn("drive", 17, _name, gap=1),
    DriveColumn("state", STATE, _state),
    DriveColumn("position", 13, _position, right=True),
    DriveColumn("velocity", 11, _velocity, right=True, gap=1, least=NARROW),
    DriveColumn("20 s", 16, _last_seconds, right=True, gap=2, least=NARROW, few=5),
)
"""The columns of the list; what matters most besides these fills the row."""


def _columns(width: int) -> list[DriveColumn]:
    return [column for column in COLUMNS if width >= column.least]


def drive_row(place: DriveOnLine, now: float, width: int, chosen: bool) -> Row:
    """The columns of a drive, and what matters most besides these."""
    row: list[Span] = [("▸" if chosen else " ", "accent")]
    beyond, columns = 0, _columns(width)
    for column in columns:
        cells = column.room(width)
        text, role = column.span(place, now, chosen, cells)
        row.append((column.put(text, cells - beyond) + " " * column.gap, role))
        beyond = max(0, len(text) - cells) if column.right else 0
    room, between = width - width_of(row), " " * (LAST_GAP - columns[-1].gap)
    text, role = place.besides(room - len(between), now)
    return (*row, (fit(between + text, room), role))


def columns_row(width: int) -> Row:
    heads = (each.put(each.head, each.room(width)) + " " * each.gap for each in _columns(width))
    return ((f" {''.join(heads)}".rstrip(), "dim"),)


def summary(places: Sequence[DriveOnLine]) -> str:
    """`1 error · 2 moving · 1 silent`, the worst first. A drive at rest with an error is counted as that alone."""
    errors = sum(bool(place.trouble) for place in places)
    states = [(place.glance.state(), bool(place.trouble)) for place in places]
    counts = Counter(state for state, troubled in states if not (troubled and state in AT_REST))
    differ = sum(place.glance.readout.differs for place in places)
    said = [f"{errors} error"] if errors else []
    said += [f"{differ} {SIGN} twin"] if differ else []
    return " · ".join([*said, *(f"{counts[state]} {state.word}" for state in URGENCY if counts[state])])


class AllDrives(ListPage):
    """All drives. Enter selects one; what is typed filters."""

    SHEET = "drives"
    WANTS = frozenset({"motion", "conditions"})
    PARTS = {"heading": None, "filter": None, "columns": None, "drives": "1fr", "chosen": 0}
    FIELD, LIST = "filter", "drives"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._chosen: tuple[str, str] | None = None
        """The drive that a person chose; None: the worst one is chosen."""
        # Known from the beginning: keys of the read that opened the page count, too.
        self._view = View(host.session, host.model, (), host.session.now(), True)
        self._places = worst_first(self._view, "")

    def show(self, view: View) -> None:
        self._view = view
        self._places = worst_first(view, self.words)
        at = self._at()  # what a person chose stays chosen when another gets worse
        now, width = view.now, self.size.width
        part = self.lines("chosen")
        drives = sum(len(bus.drives) for bus in view.session.tabs.shown)
        room = self.size.height - HEAD_ROWS - max(FEWEST, drives)
        room = room if width >= WIDE_FROM and room >= LEAST_ROOM else 0
        part.styles.height = room
        part.put(self._chosen_rows(view, at, width, room) if room and self._places else [])
        below = self.put_rows(self._places, at, lambda place, chosen: drive_row(place, now, width, chosen), [_NOTHING])
        heading: Row = ((" ALL DRIVES   ", "strong"), (summary(self._places), "text"))
        self.lines("heading").put([spread(heading, [below, ("worst first ", "dim")], width)])
        self.lines("columns").put([columns_row(width)])

    def _chosen_rows(self, view: View, at: int, width: int, height: int) -> list[Row]:
        """The panel of the chosen drive beside its curves."""
        place, half = self._places[at], width // 2
        glance = replace(place.glance, selected=True)
        one = replace(view, glances=(glance,), only=(Series(place.bus, glance.address),))
        titles = [title_row(panel(name), one, wide, "─") for name, wide in (("drive", half), ("plot", width - half))]
        curves = plot_rows(one, width - half, height - 1)
        return [(*titles[0], *titles[1]), *beside(selected_rows(one, half - 1, height - 1), curves, half)]

    def _at(self) -> int:
        """The place of the chosen drive in the list; the first one if it is not there."""
        keys = [(place.bus, place.glance.address) for place in self._places]
        return keys.index(self._chosen) if self._chosen in keys else 0

    def action_step(self, by: int) -> None:
        if self._places:
            self.choose(min(max(self._at() + by, 0), len(self._places) - 1))

    def choose(self, at: int) -> None:
        if at < len(self._places):
            self._chosen = (self._places[at].bus, self._places[at].glance.address)

    def typed(self, text: str) -> Awaitable[None]:
        return self.action_take()

    def edited(self, text: str) -> None:
        """Narrow the list at once: Enter may follow in the same read. An address that is typed is the chosen drive."""
        self._places = worst_first(self._view, text)
        named = [
            place for place in self._places if text in (place.glance.address, f"{place.bus}:{place.glance.address}")
        ]
        chosen = (named or self._places)[:1]
        self._chosen = (chosen[0].bus, chosen[0].glance.address) if chosen and text else None

    async def action_take(self) -> None:
        """Select the drive; one in trouble is shown with the reason, any other on the main screen."""
        if self._places:
            place = self._places[self._at()]
            self.host.select(place.glance.address, place.bus)
            if place.in_trouble:
                await self.run_action("act.page('why')")
            else:
                self.dismiss(None)


_NOTHING: Row = ((" no drive", "dim"),)
