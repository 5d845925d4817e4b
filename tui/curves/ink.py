"""The signs that curves are drawn with: braille, half blocks, or ASCII, for terminals that lack the others."""

from __future__ import annotations

from dataclasses import dataclass

MARKS = "*+ox#%"
"""The ASCII mark of each series."""
PATTERNS = ((1, 1), (2, 1), (4, 2), (4, 1), (6, 4), (8, 6))
"""For each series, the period of its dashes in columns of dots, and the length of a dash."""


@dataclass(frozen=True)
class Ink:
    """Cells of `wide` by `tall` dots. The bits of a dot pattern: the left column from its top, then the right one."""

    name: str
    wide: int
    tall: int
    glyphs: tuple[str, ...]
    """The sign of each dot pattern; none: the mark of the series."""

    def glyph(self, dots: int, series: int) -> str:
        """The sign of a dot pattern."""
        return self.glyphs[dots] if self.glyphs else MARKS[series % len(MARKS)]

    def shows(self, series: int, x: int) -> bool:
        """True if a series shows its flat parts in column `x` of dots; its marks tell it apart where it has any."""
        period, length = PATTERNS[series % len(PATTERNS)]
        return not self.glyphs or x % period < length

    def sample(self, series: int) -> str:
        """A piece of the line of a series, for a legend."""
        if not self.glyphs:
            return MARKS[series % len(MARKS)] * 2
        full = (1 << self.tall) - 1
        flat = 1 << (self.tall // 2)
        shown = [flat & full if self.shows(series, x) else 0 for x in range(2 * self.wide)]
        cells = (shown[n : n + self.wide] for n in range(0, len(shown), self.wide))
        return "".join(self.glyphs[sum(dots << (self.tall * n) for n, dots in enumerate(cell))] for cell in cells)


def _braille(dots: int) -> str:
    order = (0x01, 0x02, 0x04, 0x40, 0x08, 0x10, 0x20, 0x80)
    code = sum(bit for n, bit in enumerate(order) if dots >> n & 1)
    return chr(0x2800 + code) if code else " "


BRAILLE = Ink("full", 2, 4, tuple(_braille(dots) for dots in range(256)))
BLOCK = Ink("boxes", 1, 2, (" ", "▀", "▄", "█"))
ASCII = Ink("ascii", 1, 1, ())
INKS = {ink.name: ink for ink in (BRAILLE, BLOCK, ASCII)}
"""By the value of `tui.widgets.signs.Signs`."""
