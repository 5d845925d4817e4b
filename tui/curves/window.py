"""The part of time that a chart shows, in columns of cells and of dots."""

from __future__ import annotations

from typing import NamedTuple


class Window(NamedTuple):
    """The columns of cells that are shown. Both count from time 0."""

    span: float
    first: int
    columns: int
    wide: int
    """Dots in a cell."""

    @property
    def last(self) -> int:
        """The newest column."""
        return self.first + self.columns - 1

    @property
    def cell(self) -> float:
        """Seconds in a column of cells."""
        return self.span / self.columns

    @property
    def dot(self) -> float:
        """Seconds in a column of dots."""
        return self.cell / self.wide
