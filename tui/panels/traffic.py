"""The bytes of the selected bus, both ways: a row for each piece, or several where it is long."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

from multidrop.shell.raw import hex_of, parts_of, text_of
from multidrop.tui.panels.view import View
from multidrop.tui.screen_model import Piece
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row

OUT, IN = "↑", "↓"
CLOCK = 12
"""Width of `12:41:05.123`."""
HEX_FROM = 60
"""Width in cells from which a row has room for hex beside text."""
Wall = Callable[[float], datetime]


def traffic_rows(view: View, width: int, height: int) -> list[Row]:
    """The last pieces that fit, without polls and their replies."""
    name = view.session.selected_bus
    pieces = view.model.bus(name).traffic.pieces if name in view.session.buses else ()
    rows: list[Row] = []
    for piece in reversed(pieces):
        if not piece.poll:
            rows[:0] = piece_rows(piece, view.session.wall, width)
        if len(rows) >= height:
            break
    return rows[-height:] or [((fit(" nothing yet; polls are not shown", width), "dim"),)]


def traffic_title(view: View) -> Row:
    """The title: the bus."""
    return ((f" traffic {view.session.selected_bus} ", "strong"), ("without polls ", "dim"))


def piece_rows(piece: Piece, wall: Wall, width: int, hex_too: bool = True) -> list[Row]:
    """A piece as rows: time, direction, drive, then text and hex, or text alone where there is no room."""
    at = wall(piece.at)
    clock = f"{at:%H:%M:%S}.{at.microsecond // 1000:03}"
    head = f" {clock} " if width >= HEX_FROM else f" {clock[6:]} "
    sign = OUT if piece.outgoing else IN
    role = "dim" if piece.poll else "strong" if piece.outgoing else "text"
    room = max(8, width - len(head) - 7)
    beside = hex_too and width >= HEX_FROM
    size = room // 4 if beside else room
    rows: list[Row] = []
    for number, part in enumerate(parts_of(piece.data, size, len(piece.data) * 4 if beside else room)):
        start = head if not number else " " * len(head)
        where = fit(piece.address, 3) if not number else "   "
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
