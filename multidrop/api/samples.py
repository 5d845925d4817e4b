"""Samples of position and velocity, as rows, as columns, and as a plot."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, overload

from multidrop.api.pictures import Curve, plot
from multidrop.dialects import Diagnostic

if TYPE_CHECKING:
    from typing import SupportsIndex


class Sample(NamedTuple):
    """Position and velocity of one axis of one drive."""

    elapsed: float
    """Seconds since the telemetry began."""
    time: float
    """Time of day, seconds since 1970."""
    drive: str
    axis: str
    position: int
    velocity: int


class Samples(Sequence[Sample]):
    """Samples in the order of their times."""

    def __init__(self, rows: Iterable[Sample] = ()) -> None:
        self._rows = tuple(rows)

    @overload
    def __getitem__(self, at: SupportsIndex) -> Sample: ...
    @overload
    def __getitem__(self, at: slice) -> Samples: ...
    def __getitem__(self, at: SupportsIndex | slice) -> Sample | Samples:
        """Return one of them, or some."""
        return Samples(self._rows[at]) if isinstance(at, slice) else self._rows[at]

    def __len__(self) -> int:
        """Return their number."""
        return len(self._rows)

    def __iter__(self) -> Iterator[Sample]:
        """Iterate over them."""
        return iter(self._rows)

    def __eq__(self, other: object) -> bool:
        """Return whether the others are the same."""
        return isinstance(other, Samples) and self._rows == other._rows

    def __hash__(self) -> int:
        """Return a hash of all."""
        return hash(self._rows)

    def __repr__(self) -> str:
        """Return their number and span."""
        span = f", {self._rows[-1].elapsed - self._rows[0].elapsed:.3f} s" if self._rows else ""
        return f"<{len(self)} samples{span}>"

    def of(self, drive: str, axis: str = "") -> Samples:
        """The samples of one drive; of one axis of it if that is named."""
        return Samples(row for row in self._rows if row.drive == drive and axis in ("", row.axis))

    def arrays(self) -> dict[str, list[str] | array[float] | array[int]]:
        """The columns by name: lists of text, arrays of numbers, which numpy takes without a copy."""
        return {
            "elapsed": array("d", (row.elapsed for row in self._rows)),
            "time": array("d", (row.time for row in self._rows)),
            "drive": [row.drive for row in self._rows],
            "axis": [row.axis for row in self._rows],
            "position": array("q", (row.position for row in self._rows)),
            "velocity": array("q", (row.velocity for row in self._rows)),
        }

    def arrow(self) -> Any:
        """The columns as a table of pyarrow. Raises Diagnostic where pyarrow is not installed."""
        try:
            import pyarrow
        except ModuleNotFoundError:
            hint = "pip install pyarrow; arrays() needs nothing"
            raise Diagnostic("Arrow needs pyarrow, which is not installed", "samples", hint) from None
        return pyarrow.table({name: pyarrow.array(column) for name, column in self.arrays().items()})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Return the columns for another library that speaks Arrow. Needs pyarrow."""
        return self.arrow().__arrow_c_stream__(requested_schema)

    def _repr_html_(self) -> str:
        """Return plots of position and velocity, for a notebook."""
        return plot("position", self._curves("position")) + plot("velocity", self._curves("velocity"))

    def _curves(self, field: str) -> Iterator[Curve]:
        series: dict[tuple[str, str], list[Sample]] = {}
        for row in self._rows:
            series.setdefault((row.drive, row.axis), []).append(row)
        for (drive, axis), rows in series.items():
            finite = [row for row in rows if math.isfinite(getattr(row, field))]
            yield f"{drive} {axis}".strip(), [row.elapsed for row in finite], [getattr(row, field) for row in finite]
