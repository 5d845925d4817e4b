"""Styles of cells as the shortest escape sequences: a pen is a number, and a table says how one becomes another."""

from __future__ import annotations

from typing import NamedTuple

from rich.color import Color, ColorSystem, ColorType
from rich.style import Style

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


class Look(NamedTuple):
    """The codes of a cell: those of its colours (empty: the terminal's own), and those of its attributes."""

    colour: str
    ground: str
    attributes: frozenset[int]


PLAIN = Look("", "", frozenset())


class Pens:
    """Numbers for styles. `system` is the range of colours of the terminal; None: no colours."""

    def __init__(self, system: ColorSystem | None) -> None:
        self._system = system
        self._looks: list[Look] = [PLAIN]
        self._numbers: dict[Look, int] = {PLAIN: 0}
        self._of: dict[Style, int] = {}
        self._changes: dict[tuple[int, int], str] = {}
        self._blanks: dict[int, int] = {0: 0}

    def number(self, style: Style | None) -> int:
        """The pen of a style; 0 is the terminal's own look."""
        if style is None:
            return 0
        found = self._of.get(style)
        if found is None:
            if len(self._of) >= MOST_STYLES:
                self._of.clear()
            found = self._of[style] = self._number(self._look(style))
        return found

    def blank(self, pen: int) -> int:
        """A pen that makes the same blank: the colour of letters does not count there."""
        found = self._blanks.get(pen)
        if found is None:
            look = self._looks[pen]
            seen = look.attributes & SEEN_ON_BLANKS
            found = self._blanks[pen] = pen if seen else self._number(Look("", look.ground, frozenset()))
        return found

    def change(self, before: int, after: int) -> str:
        """The shortest sequence from one pen to another."""
        if before == after:
            return ""
        found = self._changes.get((before, after))
        if found is None:
            found = self._changes[before, after] = self._sequence(self._looks[before], self._looks[after])
        return found

    def _number(self, look: Look) -> int:
        found = self._numbers.get(look)
        if found is None:
            found = self._numbers[look] = len(self._looks)
            self._looks.append(look)
        return found

    def _look(self, style: Style) -> Look:
        attributes = frozenset(on for name, on, _ in ATTRIBUTES if getattr(style, name))
        return Look(self._codes(style.color, True), self._codes(style.bgcolor, False), attributes)

    def _codes(self, colour: Color | None, letters: bool) -> str:
        """The codes of a colour, the shortest that are exact."""
        if colour is None or self._system is None or colour.is_default:
            return ""
        fitting = colour.downgrade(self._system)
        if fitting.type is ColorType.TRUECOLOR and fitting.triplet in PALETTE:
            return f"{38 if letters else 48};5;{PALETTE[fitting.triplet]}"
        return ";".join(fitting.get_ansi_codes(foreground=letters))

    @staticmethod
    def _sequence(before: Look, after: Look) -> str:
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
