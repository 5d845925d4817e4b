"""Samples of position and velocity: read as they come, as rows, as columns, as a plot, and from files of plots."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, SupportsIndex, overload

from multidrop.api.notebooks import picture
from multidrop.api.streams import AsyncStream
from multidrop.base.errors import Diagnostic
from multidrop.dialects.units import Takes
from multidrop.drives.drive import Drive
from multidrop.drives.events import Lost
from multidrop.drives.events import Sample as Read
from multidrop.shell import plot_targets
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.session import Session
from multidrop.shell.workspace import address_of


class _Sample(NamedTuple):
    elapsed: float
    """Seconds since the telemetry began."""
    time: float
    """Time of day, seconds since 1970."""
    drive: str
    axis: str
    position: int
    velocity: int


class Sample(_Sample):
    """Position and velocity of one axis of one drive, in its own numbers; as a tuple it has only these."""

    unit: str = ""
    """The unit of the two below; empty where the axis has no scale, or none that holds.

    With `?`: the scale is not confirmed.
    """
    place: float | None = None
    """The position in that unit."""
    speed: float | None = None
    """The velocity in that unit a second."""

    def in_units(self, unit: str, place: float, speed: float | None) -> Sample:
        """Add the same in units, and return it."""
        self.unit, self.place, self.speed = unit, place, speed
        return self


class Samples(Sequence[Sample]):
    """Samples in the order of their times."""

    def __init__(self, rows: Iterable[Sample] = ()) -> None:
        self._rows = tuple(rows)

    @overload
    def __getitem__(self, at: SupportsIndex) -> Sample: ...
    @overload
    def __getitem__(self, at: slice) -> Samples: ...
    def __getitem__(self, at: SupportsIndex | slice) -> Sample | Samples:
        return Samples(self._rows[at]) if isinstance(at, slice) else self._rows[at]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Sample]:
        return iter(self._rows)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Samples) and self._rows == other._rows

    def __hash__(self) -> int:
        return hash(self._rows)

    def __repr__(self) -> str:
        """Return their number and span."""
        span = f", {self._rows[-1].elapsed - self._rows[0].elapsed:.3f} s" if self._rows else ""
        return f"<{len(self)} samples{span}>"

    def of(self, drive: str, axis: str = "") -> Samples:
        """The samples of one drive; of one axis of it if that is named."""
        return Samples(row for row in self._rows if row.drive == drive and axis in ("", row.axis))

    def arrays(self, units: bool = False) -> dict[str, list[str] | array[float] | array[int]]:
        """The columns by name: lists of text, arrays of numbers, which numpy takes without a copy.

        `units`: also `unit`, `place` and `speed`; these are "" and NaN where an axis has no scale.
        """
        columns: dict[str, list[str] | array[float] | array[int]] = {
            "elapsed": array("d", (row.elapsed for row in self._rows)),
            "time": array("d", (row.time for row in self._rows)),
            "drive": [row.drive for row in self._rows],
            "axis": [row.axis for row in self._rows],
            "position": array("q", (row.position for row in self._rows)),
            "velocity": array("q", (row.velocity for row in self._rows)),
        }
        if units:
            columns["unit"] = [row.unit for row in self._rows]
            for name in ("place", "speed"):
                values = (getattr(row, name) for row in self._rows)
                columns[name] = array("d", (math.nan if value is None else value for value in values))
        return columns

    def arrow(self, units: bool = False) -> Any:
        """The columns of `arrays` as a table of pyarrow. Raises Diagnostic where pyarrow is not installed."""
        try:
            import pyarrow
        except ModuleNotFoundError:
            hint = "pip install pyarrow; arrays() needs nothing"
            raise Diagnostic("Arrow needs pyarrow, which is not installed", "samples", hint) from None
        return pyarrow.table({name: pyarrow.array(column) for name, column in self.arrays(units).items()})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Return the columns for another library that speaks Arrow. Needs pyarrow."""
        return self.arrow().__arrow_c_stream__(requested_schema)

    def _repr_html_(self) -> str | None:
        """Return plots of position and velocity, for a notebook."""
        return picture("Samples", self)


RATE = 50.0
"""Samples of each drive a second, at most."""
MOST_KEPT_SAMPLES = 200_000
"""The number of samples that wait to be taken; then the oldest are dropped."""


class AsyncTelemetry(AsyncStream[Sample]):
    """Samples from now until `close`, the end of the session, or the loss of a line. Polls only while it is open."""

    def __init__(self, shell: Session, drives: Sequence[Drive], rate: float = RATE) -> None:
        """Begin to read. A rate of `math.inf` is as fast as the line allows."""
        self.missed = 0
        """The number of samples that were dropped because the program did not take them."""
        self._names = {(drive.link.name, drive.address): address_of(shell, drive) for drive in drives}
        self._begun = shell.now()
        super().__init__(
            shell,
            [
                shell.buses[bus].telemetry.subscribe([own for name, own in self._names if name == bus], 1.0 / rate)
                for bus in dict.fromkeys(bus for bus, _ in self._names)
            ],
        )

    def _take(self, event: SessionEvent) -> None:
        if not isinstance(event, OnBus):
            return
        if isinstance(event.event, Read) and (event.bus, event.event.address) in self._names:
            self._add(self._sample(event.bus, event.event))
            if len(self._rows) > MOST_KEPT_SAMPLES:
                self._rows.popleft()
                self.missed += 1
        elif isinstance(event.event, Lost) and any(bus == event.bus for bus, _ in self._names):
            self._end(event.event.error)

    def _sample(self, bus: str, read: Read) -> Sample:
        at, wall = read.at - self._begun, self._shell.wall(read.at).timestamp()
        sample = Sample(at, wall, self._names[bus, read.address], read.axis, read.position, read.velocity)
        drive = self._shell.buses[bus].drives.get(read.address) if self._shell.scaled else None
        if drive is None or (place := self._shell.units.given(drive, read.axis, read.position, Takes.PLACE)) is None:
            return sample
        speed = self._shell.units.given(drive, read.axis, read.velocity, Takes.VELOCITY)
        return sample.in_units(place[1], place[0], speed[0] if speed is not None else None)

    async def samples(self) -> Samples:
        """Take all samples that have come and were not taken yet."""
        rows, self._rows = self._rows, deque()
        return Samples(rows)


def read_rrd(file: str | Path, *, twin: bool = False) -> Samples:
    """Read the samples of a plot that multidrop wrote; `twin`: those that the twins of its drives predicted.

    Raises Diagnostic for another file, for one without such samples, and without rerun.
    """
    samples: Samples = plot_targets.needed("multidrop.read_rrd").read(file, twin)
    return samples
