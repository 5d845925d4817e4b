"""The signs that curves are drawn with: braille, half blocks, or ASCII, for terminals that lack the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MARKS = "*+ox#%"
"""The ASCII mark of each series."""
PATTERNS = ((1, 1), (2, 1), (4, 2), (4, 1), (6, 4), (8, 6))
"""For each series, the period of its dashes in columns of dots, and the length of a dash."""

TWINS = len(PATTERNS)
"""The number of a series and this is that of its twin, whose line is of single dots."""
TWIN_MARKS = ".,:;'~"
"""The ASCII mark of each twin."""
SPARSE = 5
"""Dots of a line of which a twin shows one or two, in whatever direction the line goes."""


@dataclass(frozen=True)
class Ink:
    """Cells of `wide` by `tall` dots. The bits of a dot pattern: the left column from its top, then the right one."""

    name: str
    wide: int
    tall: int
    glyphs: tuple[str, ...]
    """The sign of each dot pattern; none: the mark of the series."""
    shown: tuple[int, ...] = (0,)
    """The dots of a twin that are shown, of `SPARSE`."""

    def glyph(self, dots: int, series: int) -> str:
        """The sign of a dot pattern."""
        return self.glyphs[dots] if self.glyphs else _mark(series)

    def dots(self, series: int, x: int, top: int, bottom: int) -> Sequence[int]:
        """The dots that a series shows in column `x` of dots, of those from `top` to `bottom`.

        Flat parts are dashed, unless the series has marks of its own.
        """
        if series >= TWINS and self.glyphs:
            return [y for y in range(top, bottom + 1) if (x + 2 * y) % SPARSE in self.shown]
        period, length = PATTERNS[series % len(PATTERNS)]
        shown = not self.glyphs or x % period < length or bottom - top >= self.tall
        return range(top, bottom + 1) if shown else range(0)

    def sample(self, series: int) -> str:
        """A piece of the line of a series, for a legend."""
        if not self.glyphs:
            return _mark(series) * 2
        middle = self.tall // 2
        if series >= TWINS:
            ends = (0, 3 * self.wide - 1)
            shown = [1 << middle if x in ends else 0 for x in range(3 * self.wide)]
        else:
            shown = [1 << middle if self.dots(series, x, middle, middle) else 0 for x in range(2 * self.wide)]
        cells = (shown[n : n + self.wide] for n in range(0, len(shown), self.wide))
        return "".join(self.glyphs[sum(dots << (self.tall * n) for n, dots in enumerate(cell))] for cell in cells)


def _mark(series: int) -> str:
    marks = TWIN_MARKS if series >= TWINS else MARKS
    return marks[series % len(marks)]


def _braille(dots: int) -> str:
    order = (0x01, 0x02, 0x04, 0x40, 0x08, 0x10, 0x20, 0x80)
    code = sum(bit for n, bit in enumerate(order) if dots >> n & 1)
    return chr(0x2800 + code) if code else " "


BRAILLE = Ink("full", 2, 4, tuple(_braille(dots) for dots in range(256)))
BLOCK = Ink("boxes", 1, 2, (" ", "▀", "▄", "█"), (0, 2))
ASCII = Ink("ascii", 1, 1, ())
INKS = {ink.name: ink for ink in (BRAILLE, BLOCK, ASCII)}
"""By the value of `tui.widgets.signs.Signs`."""
