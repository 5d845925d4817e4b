"""Positions of the protocol: columns count code units of the encoding that client and server agreed on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lsprotocol import types

from multidrop.dialects.program_editing import Span

_LIMITS: Mapping[str, tuple[int, ...]] = {
    types.PositionEncodingKind.Utf8: (0x80, 0x800, 0x10000),
    types.PositionEncodingKind.Utf16: (0x10000,),
    types.PositionEncodingKind.Utf32: (),
}
"""The characters from which on each takes one code unit more."""


class Positions:
    """Converts columns of lines between characters and code units; UTF-16 unless both agreed on another encoding."""

    def __init__(self, encoding: str | None) -> None:
        self._limits = _LIMITS[encoding or types.PositionEncodingKind.Utf16]

    def _width(self, character: str) -> int:
        return 1 + sum(ord(character) >= limit for limit in self._limits)

    def units(self, line: str, column: int) -> int:
        """Return the code units of the first characters of a line."""
        part = line[:column]
        return len(part) if part.isascii() or not self._limits else sum(map(self._width, part))

    def column(self, line: str, units: int) -> int:
        """Return the characters before a number of code units; a position inside a character is before it."""
        if line.isascii() or not self._limits:
            return min(units, len(line))
        for column, character in enumerate(line):
            units -= self._width(character)
            if units < 0:
                return column
        return len(line)

    def range(self, lines: Sequence[str], place: Span) -> types.Range:
        """Return the range of a place."""
        line = lines[place.line] if place.line < len(lines) else ""
        start, stop = self.units(line, place.start), self.units(line, place.stop)
        return types.Range(types.Position(place.line, start), types.Position(place.line, stop))
