"""The bytes of the selected bus, both ways: a row for each piece, or several where it is long."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime

from rich.cells import cell_len

from multidrop.shell.raw import hex_of, parts_of, text_of
from multidrop.tui.panels.view import View, names_on
from multidrop.tui.screen_model import Piece
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row

OUT, IN = "↑", "↓"
CLOCK = 12
"""Width of `12:41:05.123`."""
NAME = 12
"""The largest width of a drive's name."""
HEX_FROM = 60
"""Width in cells from which a row has room for hex beside text."""
Wall = Callable[[float], datetime]


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


def piece_rows(piece: Piece, wall: Wall, width: int, names: Mapping[str, str], hex_too: bool = True) -> list[Row]:
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
    return "".join(chr(each) if 0x20 <= each < 0x7F else "·" for each in data)
