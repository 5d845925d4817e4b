"""The characters that a terminal can show: all, no braille and no rare signs, or ASCII alone.

All code writes the full signs. A filter replaces them at the very end, in panels, dialogs and borders alike, each by
one of the same width. So a new sign is added to the tables here, and no other module asks what a terminal can show.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from functools import lru_cache

from rich.cells import cell_len
from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

BRAILLE = range(0x2800, 0x2900)
UPPER, LOWER = 0b00011011, 0b11100100
"""The dots of the upper and the lower half of a braille character."""


class Signs(Enum):
    """The signs that the font of a terminal holds."""

    FULL = "full"
    BOXES = "boxes"
    """Lines and blocks, no braille: the Linux console, many fonts of PuTTY."""
    ASCII = "ascii"


def _pairs(text: str) -> dict[int, str]:
    """Make a table of pairs such as `▶>`."""
    return {ord(pair[0]): pair[1] for pair in text.split()}


def _braille(halves: str) -> dict[int, str]:
    """The characters for braille by what is set: nothing, the upper half, the lower half, both."""
    return {code: halves[bool(code & UPPER) + 2 * bool(code & LOWER)] for code in BRAILLE}


_RARE = "□_ ┊: ┄. ◇+ ≠! −- ✗x ✓v ●* ◉* ○o □o ›> …~ –- —- ▏| ▎| ▍| ▕| ╴- ╶- ╵| ╷|"
TABLES: Mapping[Signs, Mapping[int, str]] = {
    Signs.FULL: {},
    Signs.BOXES: _pairs(f"{_RARE} ▶► ▷» ▸► ◀◄ ◂◄ ╭┌ ╮┐ ╰└ ╯┘ ▁_ ▂▄ ▃▄ ▅▄ ▆█ ▇█ ▔▀") | _braille(" ▀▄█"),
    Signs.ASCII: _pairs(
        f"{_RARE} ▶> ▷) ▸> ►> ◀< ◂< ■# ◆@ ·. •* »}} «< →> ←< ↑^ ↓v ↔- ⇄- │| ─- ├+ ┤+ ┬+ ┴+ ┼+ ┌+ ┐+ └+ ┘+ ╭+ ╮+ ╰+ ╯+"
        " ◄< ▼v ▲^ ━= ┃| ═= ║| █# ▓# ▒: ░. ▀' ▄. ▌| ▐| ▁_ ▂_ ▃- ▄- ▅= ▆= ▇# ▔' ×x µu °o ±~ ²2 ³3"
    )
    | _braille(" '.:"),
}


def signs_for(wanted: str, environment: Mapping[str, str]) -> Signs:
    """The signs that a person set, or with `auto` those that fit the terminal."""
    if wanted != "auto":
        return Signs(wanted)
    locale = environment.get("LC_ALL") or environment.get("LC_CTYPE") or environment.get("LANG") or ""
    if locale and "utf8" not in locale.lower().replace("-", ""):
        return Signs.ASCII
    return Signs.BOXES if environment.get("TERM") == "linux" else Signs.FULL


@lru_cache(4096)
def shown_as(text: str, signs: Signs) -> str:
    """Write a text in the characters that a terminal can show, in as many cells."""
    if signs is Signs.FULL or text.isascii():
        return text
    found = text.translate(TABLES[signs])
    if signs is Signs.BOXES or found.isascii():
        return found
    return "".join(each if each.isascii() else "?" * cell_len(each) for each in found)


class SignFilter(LineFilter):
    """Replaces the signs of all that Textual paints."""

    def __init__(self, signs: Signs) -> None:
        super().__init__()
        self.font = signs

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """Replace the signs of a line."""
        return [Segment(shown_as(text, self.font), style, control) for text, style, control in segments]
