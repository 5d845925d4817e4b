"""The panels by name: what each shows, how much room it takes, what must be polled for it, and its key.

On a wide screen several are shown, in places: below the transcript, and in a column next to it. The places depend only
on the size of the screen and on the panels that a person has hidden, never on what they show. Panels that share a place
have it in turn: the first one leaves the next one the room that it needs at least, and what it does not use itself. One
that has nothing to show is left out. On a narrow screen there is a single panel, below the transcript.

The panels of the log and of the traffic are here; those of drives, programs and plots have modules of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import NamedTuple

from rich.cells import cell_len

from multidrop.shell.raw import hex_of, parts_of, text_of
from multidrop.tui.panels.drive import drive_title
from multidrop.tui.panels.drive_table import drives_rows
from multidrop.tui.panels.facts import next_rows, selected_rows
from multidrop.tui.panels.plot import panel_rows, plot_title
from multidrop.tui.panels.plotted import plot_shows
from multidrop.tui.panels.program import program_rows, program_shows, program_title
from multidrop.tui.panels.view import View, names_on
from multidrop.tui.screen_model import TrafficPiece
from multidrop.tui.text import at_words, fit, visible
from multidrop.tui.widgets.lines import Row, width_of

OUT, IN = "↑", "↓"
CLOCK = 12
"""Width of `12:41:05.123`."""
NAME = 12
"""The largest width of a drive's name."""
HEX_FROM = 60
"""Width in cells from which a row has room for hex beside text."""
Wall = Callable[[float], datetime]
OFF = (" off", " /log on: a new file in the state folder", " /log FILE: one that you name")


def log_title(view: View) -> Row:
    """The title: on or off, and the size."""
    log = view.session.log
    if log is None:
        return ((" log ", "strong"), ("off ", "dim"))
    return ((" log ", "strong"), ("◉ on ", "accent"), (f"{size_words(log.size)} ", "dim"))


def log_rows(view: View, width: int, height: int) -> list[Row]:
    """The file, and the last entries without traffic."""
    log = view.session.log
    if log is None:
        return [((fit(text, width), "dim"),) for text in OFF]
    path = visible(str(log.path))
    end = path if len(path) < width else f"…{path[2 - width :]}"  # where file names differ
    rows: list[Row] = [((" ", "text"), (end, "dim"))]
    return rows + [((fit(f" {text}", width), "text"),) for text in log.last(height - 1)]


def size_words(size: int) -> str:
    """`512 B`, `12 kB`, `3.4 MB`."""
    if size < 1000:
        return f"{size} B"
    return f"{size / 1000:.0f} kB" if size < 1e6 else f"{size / 1e6:.1f} MB"


def traffic_rows(view: View, width: int, height: int) -> list[Row]:
    """The last pieces that fit, without polls and their replies."""
    name = view.session.selected_bus
    pieces = view.model.bus(name).traffic.pieces if name in view.session.buses else ()
    rows, names = list[Row](), names_on(view.session, name)
    for piece in reversed(pieces):
        if not piece.poll:
            rows[:0] = piece_rows(piece, view.session.wall, width, names)
        if len(rows) >= height:
            break
    return rows[-height:] or [((fit(" nothing yet; polls are not shown", width), "dim"),)]


def traffic_title(view: View) -> Row:
    """The title: the bus."""
    return ((f" traffic {view.session.selected_bus} ", "strong"), ("without polls ", "dim"))


def piece_rows(
    piece: TrafficPiece, wall: Wall, width: int, names: Mapping[str, str], hex_too: bool = True
) -> list[Row]:
    """A piece as rows: time, direction, drive by its name, then text and hex, or text alone where there is no room."""
    at = wall(piece.at)
    clock = f"{at:%H:%M:%S}.{at.microsecond // 1000:03}"
    head = f" {clock} " if width >= HEX_FROM else f" {clock[6:]} "
    sign = OUT if piece.outgoing else IN
    role = "dim" if piece.poll else "strong" if piece.outgoing else "text"
    place = min(NAME, max(3, *map(cell_len, ("", *names.values()))))
    room = max(8, width - len(head) - place - 4)
    beside = hex_too and width >= HEX_FROM
    size = room // 4 if beside else room
    rows: list[Row] = []
    for number, part in enumerate(parts_of(piece.data, size, len(piece.data) * 4 if beside else room)):
        start = head if not number else " " * len(head)
        where = fit("" if number else names.get(piece.address, piece.address), place)
        rows.append(
            (
                (start, "dim"),
                (f"{sign} " if not number else "  ", role),
                (f"{where} ", "dim"),
                (fit(_dots(part), size + 1) if beside else text_of(part), role),
                *([(hex_of(part), "dim")] if beside else []),
            )
        )
    return rows


def _dots(data: bytes) -> str:
    """Bytes as text of the same length, beside their hex: a dot for each that is not printable."""
    return "".join(chr(byte) if 0x20 <= byte < 0x7F else "·" for byte in data)


MOTION, CONDITIONS, PLOT = "motion", "conditions", "plot"
"""The wants of a panel: position and velocity; lamps, errors and programs; samples as fast as the wire allows."""


class Panel(NamedTuple):
    """A panel, and how it is shown."""

    name: str
    title: Callable[[View], Row] | str
    rows: Callable[[View, int, int], list[Row]]
    """Rows in (width, height) cells: `height` of them at most, fewer if there is less to show."""
    least: int
    """Rows below which it is not shown. Its title takes one more."""
    most: int
    """Rows that it can use."""
    wants: frozenset[str]
    about: str
    """One line for the palette."""
    first: bool = True
    """Shown on a wide screen until a person hides it."""
    shows: Callable[[View], bool] = lambda view: True
    """Whether it has something to show; if not, the next one in its place is shown."""


_ALL, _FAST, _FREE = frozenset({MOTION, CONDITIONS}), frozenset({MOTION, PLOT}), frozenset[str]()
PANELS: tuple[Panel, ...] = (
    Panel("drive", drive_title, selected_rows, 9, 14, _ALL, "position, travel, state, lamps, error and program"),
    Panel("drives", "drives", drives_rows, 4, 24, _ALL, "every drive of every line in a row"),
    Panel("program", program_title, program_rows, 3, 60, _ALL, "the lines around the current one", shows=program_shows),
    Panel("next", "next", next_rows, 3, 15, _FREE, "what fits the state in front of you, and the macros on keys"),
    Panel("plot", plot_title, panel_rows, 10, 60, _FAST, "velocity and position of what moves", shows=plot_shows),
    Panel("traffic", traffic_title, traffic_rows, 3, 40, _FREE, "the bytes of the line, both ways", first=False),
    Panel("log", log_title, log_rows, 2, 12, _FREE, "the session log: where, how large, its last entries", first=False),
)


Place = Sequence[Panel]
"""Panels that share a place."""
Places = tuple[tuple[str, ...], ...]
_PROGRAM, _ASKED_FOR = ("program", "next"), (("traffic",), ("log",))
_BELOW = ("drives", "plot")
LAYOUTS: dict[bool, dict[str, Places]] = {
    True: {"panel": (_BELOW,), "side": (("drive",), _PROGRAM, *_ASKED_FOR)},
    False: {"side": (("drive",), ("drives",), _PROGRAM, ("plot",), *_ASKED_FOR)},
}
"""The places in each part of a wide screen, from top to bottom; False: a split screen needs the room below."""


def panel(name: str) -> Panel:
    return next(panel for panel in PANELS if panel.name == name)


class ShownPanels:
    """The panels that a person shows and hides."""

    def __init__(self) -> None:
        self._by_hand: dict[str, bool] = {}
        self._alone = ""
        """The panel of a narrow screen."""

    def alone(self) -> list[Place]:
        """The places of a narrow screen."""
        return [[panel(self._alone)]] if self._alone else []

    def places(self, wanted: Places) -> list[Place]:
        """These places of a wide screen with the panels that are shown in them; one without any is left out."""
        return [
            shown
            for place in wanted
            if (shown := [panel(name) for name in place if self._by_hand.get(name, panel(name).first)])
        ]

    def switch(self, name: str, on: bool, wide: bool) -> None:
        """Show a panel, or hide it."""
        if wide:
            self._by_hand[name] = on
        if not wide or on:
            self._alone = name if on else ""


HEAD_ROWS = 1
"""Rows of a title."""


def side_width(width: int) -> int:
    """The width of a column of panels on a screen."""
    return min(max(width * 3 // 8, 39), 60)


def fitting(places: Sequence[Place], height: int) -> list[Place]:
    """The places that find room, first come, first served."""
    shown: list[Place] = []
    for place in places:
        if sum(panel[0].least + HEAD_ROWS for panel in [*shown, place]) <= height:
            shown.append(place)
    return shown


def heights(places: Sequence[Place], height: int) -> list[int]:
    """The rows of each place with its title; the last one takes what the others cannot use."""
    room = height - sum(place[0].least + HEAD_ROWS for place in places)
    given: list[int] = []
    for number, (first, *_) in enumerate(places):
        spare = -(-room // (len(places) - number))
        more = spare if number == len(places) - 1 else min(first.most - first.least, spare)
        given.append(first.least + HEAD_ROWS + more)
        room -= more
    return given


def column_rows(places: Sequence[Place], view: View, width: int, height: int, border: bool) -> list[Row]:
    """Exactly `height` rows of `width` cells with these panels, with a border at the left if there is one."""
    shown = fitting(places, height)
    left_out = [place[0].name for place in places if place not in shown]
    if left_out:
        height -= 1
        shown = fitting(shown, height)
        left_out = [place[0].name for place in places if place not in shown]
    side: Row = (("│", "rule"),) if border else ()
    rows: list[Row] = []
    for place, given in zip(shown, heights(shown, height), strict=True):
        rows += _place_rows(place, view, width, given, side)
    rows += [side] * (height - len(rows))
    if left_out:
        text = fit(f" no room: {', '.join(left_out)}", width - len(side))
        rows.append((*side, (text, "dim")))
    return rows


def _place_rows(place: Place, view: View, width: int, height: int, side: Row) -> list[Row]:
    """The rows of a place: its panels that have something to show, each in the rows that those before it leave."""
    rows: list[Row] = []
    shown = [panel for panel in place if _shows(panel, view)] or [*place[:1]]
    for number, panel in enumerate(shown):
        room = height - len(rows) - HEAD_ROWS
        if room < (panel.least if rows else 0):
            break
        after = shown[number + 1].least + HEAD_ROWS if number + 1 < len(shown) else 0
        if room - after >= panel.least:
            room -= after
        inside = width - len(side)
        title, content = view.boundary.do(
            f"the panel {panel.name}",
            partial(_panel_rows, panel, view, width, inside, room, "├" if side else "─"),
            partial(_defect_rows, panel, width, inside, "├" if side else "─"),
        )
        rows.append(title)
        rows += [(*side, *row) for row in content[:room]]
    return [*rows, *[side] * (height - len(rows))]


def _shows(panel: Panel, view: View) -> bool:
    return view.boundary.do(f"the panel {panel.name}, whether it is shown", lambda: panel.shows(view), lambda _: True)


def _panel_rows(panel: Panel, view: View, width: int, inside: int, room: int, edge: str) -> tuple[Row, list[Row]]:
    return title_row(panel, view, width, edge), panel.rows(view, inside, room)


def _defect_rows(panel: Panel, width: int, inside: int, edge: str, trouble: str) -> tuple[Row, list[Row]]:
    title = ((edge, "rule"), (f" {panel.name} ", "strong"))
    rows: list[Row] = [((f" {row}", "error"),) for row in at_words(trouble, inside - 1)]
    return (*title, ("─" * max(0, width - width_of(title)), "rule")), rows


def title_row(panel: Panel, view: View, width: int, edge: str) -> Row:
    title: Row = ((f" {panel.title} ", "strong"),) if isinstance(panel.title, str) else panel.title(view)
    kept: list[tuple[str, str]] = [(edge, "rule")]
    for text, role in title:
        room = width - width_of(kept)
        kept.append((text if width_of([(text, role)]) <= room else fit(text, room), role))
    return (*kept, ("─" * max(0, width - width_of(kept)), "rule"))
