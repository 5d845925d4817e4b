"""The picture on the terminal, cell by cell: of a new one only the cells that differ are written.

Theory of operation. The canvas keeps a row of the screen as two texts of equal length: a character for each cell, and
the pen of each cell. A new row is compared with the one that is shown. Lines that have moved up by some rows move on
the terminal itself (a scroll region), if they fill its width. A wide character fills its second cell with `TAIL`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import groupby
from typing import NamedTuple, cast

from rich.cells import cell_len
from rich.color import Color, ColorSystem, ColorType
from rich.segment import Segment
from rich.style import Style
from textual._compositor import ChopsUpdate, Compositor, CompositorUpdate, LayoutUpdate
from textual.geometry import Region
from textual.strip import Strip

# The composition of a screen without the work for covered widgets.
#
# Textual's compositor cuts every row of every widget into pieces, then takes the front one of each place. A transcript
# lies in five containers of its own size. So most of the pieces are made in vain.


Row = dict[int, Strip | None]
"""The pieces of a row by the column at which each begins; None: nothing there yet."""


class FrontCompositor(Compositor):
    """A compositor that renders only the visible places of a widget."""

    def _render_chops(self, crop: Region, is_rendered_line: Callable[[int], bool]) -> Sequence[Mapping[int, Strip]]:
        """Render the rows of a region, from front to back."""
        rows: list[Row] = [dict.fromkeys(cuts[:-1]) for cuts in self.cuts]
        for widget, (region, clip) in self.visible_widgets.items():
            shown = region.intersection(clip)
            if not crop.overlaps(clip) or not shown:
                continue
            open_ = {y: free for y in shown.line_range if is_rendered_line(y) and (free := _free(rows, y, shown))}
            if open_:
                strips = widget.render_lines(shown.translate(-region.offset))
                for y, strip in zip(shown.line_range, strips, strict=False):
                    if y in open_:
                        # Put the pieces of a widget's row into its visible places; a strip may be too short for some.
                        ends = [cut for cut in self.cuts[y] if shown.x < cut <= shown.right]
                        pieces = strip.divide([end - shown.x for end in ends])
                        for place, piece in zip([shown.x, *ends], pieces, strict=False):
                            if place in open_[y]:
                                rows[y][place] = piece
        return cast("Sequence[Mapping[int, Strip]]", rows)


def _free(rows: Sequence[Row], y: int, shown: Region) -> list[int]:
    return [x for x, strip in rows[y].items() if strip is None and shown.x <= x < shown.right]


# Styles of cells as the shortest escape sequences: a pen is a number, and a table says how one becomes another.


_LEVELS = (0, 95, 135, 175, 215, 255)
"""The six levels of a colour in the cube of the 256 colours (xterm, ctlseqs)."""
_CUBE = {
    (red, green, blue): 16 + 36 * r + 6 * g + b
    for r, red in enumerate(_LEVELS)
    for g, green in enumerate(_LEVELS)
    for b, blue in enumerate(_LEVELS)
}
_GREYS = {(level, level, level): 232 + n for n, level in enumerate(range(8, 239, 10))}
PALETTE = _GREYS | _CUBE
"""The number of each of the 256 colours that a terminal does not change, by red, green and blue."""
ATTRIBUTES = (
    ("bold", 1, 22),
    ("dim", 2, 22),
    ("italic", 3, 23),
    ("underline", 4, 24),
    ("blink", 5, 25),
    ("reverse", 7, 27),
    ("strike", 9, 29),
)
"""Attributes of a style, and the codes that switch them on and off."""
MOST_STYLES = 4096
"""Styles that are kept."""
SEEN_ON_BLANKS = frozenset({4, 7, 9})
"""Codes of the attributes that change the look of a blank."""


class CellLook(NamedTuple):
    """The codes of a cell: those of its colours (empty: the terminal's own), and those of its attributes."""

    colour: str
    ground: str
    attributes: frozenset[int]


PLAIN = CellLook("", "", frozenset())


class Pens:
    """Numbers for styles. `system` is the range of colours of the terminal; None: no colours."""

    def __init__(self, system: ColorSystem | None) -> None:
        self._system = system
        self._looks: list[CellLook] = [PLAIN]
        self._numbers: dict[CellLook, int] = {PLAIN: 0}
        self._of: dict[Style, int] = {}
        self._changes: dict[tuple[int, int], str] = {}
        self._blanks: dict[int, int] = {0: 0}

    def number(self, style: Style | None) -> int:
        """The pen of a style; 0 is the terminal's own look."""
        if style is None:
            return 0
        number = self._of.get(style)
        if number is None:
            if len(self._of) >= MOST_STYLES:
                self._of.clear()
            attributes = frozenset(on for name, on, _ in ATTRIBUTES if getattr(style, name))
            number = self._of[style] = self._number(
                CellLook(self._codes(style.color, True), self._codes(style.bgcolor, False), attributes)
            )
        return number

    def blank(self, pen: int) -> int:
        """A pen that makes the same blank: the colour of letters does not count there."""
        number = self._blanks.get(pen)
        if number is None:
            look = self._looks[pen]
            seen = look.attributes & SEEN_ON_BLANKS
            number = self._blanks[pen] = pen if seen else self._number(CellLook("", look.ground, frozenset()))
        return number

    def change(self, before: int, after: int) -> str:
        if before == after:
            return ""
        change = self._changes.get((before, after))
        if change is None:
            change = self._changes[before, after] = self._sequence(self._looks[before], self._looks[after])
        return change

    def _number(self, look: CellLook) -> int:
        number = self._numbers.get(look)
        if number is None:
            number = self._numbers[look] = len(self._looks)
            self._looks.append(look)
        return number

    def _codes(self, colour: Color | None, letters: bool) -> str:
        """The codes of a colour, the shortest that are exact."""
        if colour is None or self._system is None or colour.is_default:
            return ""
        fitting = colour.downgrade(self._system)
        if fitting.type is ColorType.TRUECOLOR and fitting.triplet in PALETTE:
            return f"{38 if letters else 48};5;{PALETTE[fitting.triplet]}"
        return ";".join(fitting.get_ansi_codes(foreground=letters))

    @staticmethod
    def _sequence(before: CellLook, after: CellLook) -> str:
        afresh = ["0", *map(str, sorted(after.attributes)), after.colour, after.ground]
        lost = before.attributes - after.attributes
        off = {on: end for _, on, end in ATTRIBUTES}
        codes = sorted({off[on] for on in lost})
        kept = {on for on in before.attributes if off[on] not in codes}
        changes = [*map(str, codes), *map(str, sorted(after.attributes - kept))]
        if before.colour != after.colour:
            changes.append(after.colour or "39")
        if before.ground != after.ground:
            changes.append(after.ground or "49")
        ways = (";".join(filter(None, afresh)), ";".join(changes))
        return f"\x1b[{min(ways, key=len)}m" if after != PLAIN else "\x1b[m"


TAIL = "\0"
"""The second cell of a wide character."""
UNSEEN = "\1"
"""A cell that may show anything."""
BRIDGE = 6
"""Cells that are written again rather than jumped over."""
LEAST_SCROLLED = 3
"""Rows that must move for a scroll region to be worth its codes."""
Piece = tuple[int, Iterable[Segment]]
"""A column, and the segments from there on."""


class CanvasRow(NamedTuple):
    """A row: a character and a pen for each cell."""

    text: str
    pens: str


@lru_cache(maxsize=4096)
def cells(text: str) -> str | None:
    """The characters of a text, one for each cell; None if two share a cell."""
    if text.isascii() or all(cell_len(char) == 1 for char in text):
        return text
    widths = [cell_len(char) for char in text]
    return None if 0 in widths else "".join(char + TAIL * (width - 1) for char, width in zip(text, widths, strict=True))


class Canvas:
    """The terminal's screen as it is. `draw` makes the bytes that change it."""

    def __init__(self, system: ColorSystem | None) -> None:
        self._pens = Pens(system)
        self._size = (0, 0)
        self._rows: list[CanvasRow] = []
        self._pen = 0

    def forget(self) -> None:
        """Take nothing on the terminal for granted: another program may have written there."""
        self._rows = [self._unseen] * len(self._rows)

    @property
    def _unseen(self) -> CanvasRow:
        return CanvasRow(UNSEEN * self._size[0], TAIL * self._size[0])

    def draw(self, pieces: Mapping[int, Iterable[Piece]], width: int, height: int) -> str:
        """Return what shows these pieces, by row. It begins and ends with the terminal's own look."""
        if self._size != (width, height):
            self._size = (width, height)
            self._rows = [self._unseen] * height
        drawn: dict[int, CanvasRow] = {}
        plain: dict[int, list[Piece]] = {}
        self._pen = 0
        for y, wide in pieces.items():
            if 0 <= y < height:
                row = [piece for piece in wide if piece[0] < width]  # of an older size of the terminal
                new = self._compose(self._rows[y], row, width)
                if new is None:
                    plain[y] = row
                elif new != self._rows[y]:
                    drawn[y] = new
        written = [self._scrolled(drawn)]
        written += [self._changed(y, new) for y, new in drawn.items()]
        written += [self._write_plainly(y, row, width) for y, row in plain.items()]
        written.append(self._pens.change(self._pen, 0))
        return "".join(written)

    # A row

    def _compose(self, shown: CanvasRow, row: Iterable[Piece], width: int) -> CanvasRow | None:
        """The row with the pieces in place; None if a character shares a cell with another."""
        text, pens = shown
        for x, segments in row:
            new_text, new_pens = [], []
            for piece, style, control in segments:
                if control or not piece:
                    continue
                composed = cells(piece)
                if composed is None:
                    return None
                pen = self._pens.number(style)
                new_text.append(composed)
                new_pens.append(chr(self._pens.blank(pen) if piece.isspace() else pen) * len(composed))
            put, put_pens = "".join(new_text)[: width - x], "".join(new_pens)[: width - x]
            text = text[:x] + put + text[x + len(put) :]
            pens = pens[:x] + put_pens + pens[x + len(put) :]
        return CanvasRow(text, pens)

    def _write_plainly(self, y: int, row: Iterable[Piece], width: int) -> str:
        """Write pieces whose characters share cells, as they are. What the row shows then is not known.

        The terminal does not wrap meanwhile: one that counts other widths would scroll the last row away.
        """
        self._rows[y] = self._unseen
        written = ["\x1b[?7l"]
        for x, segments in row:
            written.append(f"\x1b[{y + 1};{x + 1}H")
            for text, style, control in Segment.adjust_line_length(list(segments), width - x, pad=False):
                if not control:
                    written += [self._switch(self._pens.number(style)), text]
        return "".join([*written, "\x1b[?7h"])

    def _changed(self, y: int, new: CanvasRow) -> str:
        """Write the cells of a row that differ."""
        old, self._rows[y] = self._rows[y], new
        written: list[str] = []
        end = 0
        for start, stop in _differences(old, new):
            if not written or start > end:
                written.append(f"\x1b[{y + 1};{start + 1}H" if not written else f"\x1b[{start - end}C")
            written.append(self._run(new, start, stop))
            end = stop
        return "".join(written)

    def _run(self, new: CanvasRow, start: int, stop: int) -> str:
        """Write cells with as few changes of the pen as possible."""
        written: list[str] = []
        at = start
        for pen, group in groupby(new.pens[start:stop]):
            length = len(list(group))
            text = new.text[at : at + length]
            at += length
            wanted = ord(pen)
            if text.isspace() and self._pens.blank(wanted) == self._pens.blank(self._pen):
                wanted = self._pen
            written += [self._switch(wanted), text]
        return "".join(written).replace(TAIL, "")

    def _switch(self, pen: int) -> str:
        before, self._pen = self._pen, pen
        return self._pens.change(before, pen)

    # Rows that move

    def _scrolled(self, drawn: dict[int, CanvasRow]) -> str:
        """Let the terminal move rows up that it shows further down; the rest is still to be drawn."""
        moved = self._moved(drawn)
        if moved is None:
            return ""
        top, bottom, by = moved
        before = self._rows[top : bottom + 1]
        self._rows[top : bottom + 1] = before[by:] + [self._unseen] * by
        for y, old in enumerate(before, top):
            wanted = drawn.pop(y, old)
            if wanted != self._rows[y]:
                drawn[y] = wanted
        newlines = "\n" * by
        return f"{self._switch(0)}\x1b[{top + 1};{bottom + 1}r\x1b[{bottom + 1};1H{newlines}\x1b[r"

    def _moved(self, drawn: dict[int, CanvasRow]) -> tuple[int, int, int] | None:
        """(first row, last row, by how many rows up) of the rows that moved; None if it is not worth it."""
        where = {row: y for y, row in enumerate(self._rows) if row.text.strip(" " + UNSEEN)}
        steps = Counter(where[row] - y for y, row in drawn.items() if row in where and where[row] > y)
        for by, count in steps.most_common(1):
            rows = [y for y, row in drawn.items() if where.get(row) == y + by]
            top, last = min(rows), max(rows)
            if count >= LEAST_SCROLLED and 2 * count > last - top:
                return top, last + by, by
        return None


def _differences(old: CanvasRow, new: CanvasRow) -> list[tuple[int, int]]:
    """The runs of cells that differ; runs that are close together are one."""
    runs: list[tuple[int, int]] = []
    pairs = zip(old.text, new.text, old.pens, new.pens, strict=True)
    for at, (before, after, pen, new_pen) in enumerate(pairs):
        if before == after and pen == new_pen:
            continue
        if runs and at - runs[-1][1] <= BRIDGE:
            runs[-1] = (runs[-1][0], at + 1)
        else:
            runs.append((at, at + 1))
    return [_whole(new.text, start, stop) for start, stop in runs]


def _whole(text: str, start: int, stop: int) -> tuple[int, int]:
    """A run that cuts no wide character."""
    while start and text[start] == TAIL:
        start -= 1
    while stop < len(text) and text[stop] == TAIL:
        stop += 1
    return start, stop


def pieces_of(update: CompositorUpdate) -> dict[int, list[Piece]]:
    """The pieces of a picture of Textual's compositor, by row."""
    if isinstance(update, LayoutUpdate):
        rows = enumerate(update.strips, update.region.y)
        return {y: _side_by_side(strips, update.region.x) for y, strips in rows}
    assert isinstance(update, ChopsUpdate), "the app is not inline"
    by_row: dict[int, list[Piece]] = {}
    for y, begin, end in update.spans:
        row = by_row.setdefault(y, [])
        for stop, (x, strip) in zip(update.chop_ends[y], update.chops[y].items(), strict=False):
            if strip is not None and x <= end and stop > begin:
                row.append((x, strip if stop <= end else strip.crop(0, end - x)))
    return by_row


def _side_by_side(strips: Iterable[Strip], x: int) -> list[Piece]:
    joined: list[Piece] = []
    for strip in strips:
        joined.append((x, strip))
        x += strip.cell_length
    return joined
