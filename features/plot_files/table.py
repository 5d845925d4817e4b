"""A plot as a table of rows: `FILE.csv`, or `FILE.parquet`. A kill loses half a second of new rows.

Theory of operation. Rows of a CSV file are added to it. A Parquet file is readable only as a whole, so its rows are
added to `FILE.part.csv` first; the close writes a new Parquet file of the old rows and the new ones, which replaces the
old one in one step. The next plot to the file goes on with a part that a killed process left.
"""

from __future__ import annotations

import contextlib
import csv
import os
import secrets
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.parquet import pyarrow
from multidrop.base.text import cell, visible
from multidrop.features.plot_files.file import SESSION_GAP, Locked, SinkBroken, disk_full, synced
from multidrop.features.plot_files.request import PlotTarget
from multidrop.shell.plots.batch import TWIN, Batch

COLUMNS = ("time", "elapsed", "bus", "drive", "axis", "name", "value", "unit", "text")
"""Time of day (UTC); seconds since the plot began; a quantity with its value and unit, or a state or a line with its
text."""
HEADER = ",".join(COLUMNS).encode() + b"\n"
TAIL_BYTES = 1 << 16
"""The bytes at the end of a table in which its last row is looked for."""
BLOCK = 1 << 20


class TableSink(Locked):
    """An open table. Every method may block; one thread at a time."""

    def __init__(self, target: PlotTarget) -> None:
        """Open the file. Raises Diagnostic if that fails, and leaves the file unchanged then."""
        assert target.file is not None
        self.target, path = target, target.file
        self._parquet = pyarrow("plot to FILE.csv") if path.suffix == ".parquet" else None
        self.writes = path.with_name(f"{path.stem}.part.csv") if self._parquet else path
        super().__init__(path)
        try:
            end = max(_end(self.writes), _parquet_end(self._parquet, self.path) if self._parquet else -SESSION_GAP)
            self._file = self.writes.open("a", encoding="utf-8", newline="")
            if not self._file.tell():
                self._file.write(HEADER.decode())
        except OSError as error:
            self.release()
            raise Diagnostic(f"cannot write {self.writes} ({error.strerror})") from None
        except Diagnostic:
            self.release()
            raise
        self.offset = end + SESSION_GAP
        """The first `elapsed`, s: after the rows that exist already."""
        self._good = 0
        self._rows = csv.writer(self._file, lineterminator="\n")

    def send(self, batch: Batch) -> None:
        """Write a batch. Raises SinkBroken."""
        try:
            for elapsed, wall, *row in sorted(_rows(batch), key=lambda row: row[0]):
                stamp = datetime.fromtimestamp(wall, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
                cells = row if self._parquet else [cell(value) if isinstance(value, str) else value for value in row]
                self._rows.writerow((stamp, f"{elapsed:.4f}", *cells))
            self._file.flush()
            self._good = self._file.tell()
        except OSError as error:
            raise SinkBroken(self.why(error)) from None

    def close(self) -> None:
        """Flush and close; make the Parquet file. Raises SinkBroken, and keeps the part."""
        try:
            self._file.close()
            if self._parquet:
                _make_parquet(self._parquet, self.path, self.writes)
            else:
                synced(self.path)
        except (OSError, ValueError) as error:
            raise SinkBroken(self.why(error)) from None
        finally:
            self.release()

    def leave_behind(self) -> None:
        """Nothing of a file blocks."""

    def abandon(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()

    def let_go(self) -> None:
        """Remove a row that was written in part; release the file."""
        with contextlib.suppress(OSError):
            if self._good:
                os.truncate(self.writes, self._good)
        self.release()

    def why(self, error: Exception) -> str:
        reason = "the disk is full" if disk_full(self.path.parent) else str(error)
        return f"cannot write {self.path}: {reason}; {self.writes} has what came before"


def _rows(batch: Batch) -> Iterator[tuple[Any, ...]]:
    """The rows of a batch, after the two times of each."""
    for curve, points in batch.curves.items():
        name = f"{TWIN} {curve.name}" if curve.twin else curve.name
        for elapsed, wall, value in points:
            shown = int(value) if value.is_integer() else value
            yield elapsed, wall, curve.bus, curve.address, curve.axis, name, shown, curve.shown_unit, ""
    for state, changes in batch.states.items():
        for elapsed, wall, text in changes:
            yield elapsed, wall, state.bus, state.address, state.axis, state.name, "", "", text
    for bus, texts in batch.texts.items():
        for elapsed, wall, text, level in texts:
            yield elapsed, wall, bus, "", "", level, "", "", visible(text)  # a row is one line


def _end(path: Path) -> float:
    """The last `elapsed` of a CSV table; cut a row that a kill left in part. Raises Diagnostic for another file."""
    if not os.path.exists(path) or not path.stat().st_size:
        return -SESSION_GAP
    with path.open("rb+") as file:
        if file.readline(len(HEADER)) != HEADER:
            raise _strange(path)
        size = file.seek(0, os.SEEK_END)
        file.seek(max(len(HEADER), size - TAIL_BYTES))
        whole = file.read().rpartition(b"\n")
        file.truncate(size - len(whole[2]))
        last = next(csv.reader([whole[0].rpartition(b"\n")[2].decode("utf-8", "replace")]), [])
    try:
        return float(last[1])
    except (IndexError, ValueError):  # no row
        return -SESSION_GAP


def _strange(path: Path) -> Diagnostic:
    return Diagnostic(f"{path} is not a plot of multidrop", hint="use another file; this one is unchanged")


def _parquet_end(pa: Any, path: Path) -> float:
    """The last `elapsed` of a Parquet table. Raises Diagnostic for another file."""
    if not path.stat().st_size:
        return -SESSION_GAP
    try:
        with pa.parquet.ParquetFile(path) as file:
            if tuple(file.schema_arrow.names) != COLUMNS:
                raise _strange(path)
            groups = (file.metadata.row_group(number).column(1) for number in range(file.num_row_groups))
            return max((group.statistics.max for group in groups), default=-SESSION_GAP)
    except (pa.ArrowInvalid, AttributeError):
        raise _strange(path) from None


def _make_parquet(pa: Any, path: Path, part: Path) -> None:
    """Write the rows of file and part into a new file, which replaces the file. Raises OSError, ValueError."""
    kinds = {name: pa.string() for name in COLUMNS} | {"elapsed": pa.float64(), "value": pa.float64()}
    schema = pa.schema({**kinds, "time": pa.timestamp("ms", "UTC")})
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.tmp")
    reading = pa.csv.ReadOptions(block_size=BLOCK)
    converting = pa.csv.ConvertOptions(column_types=schema)
    try:
        with pa.parquet.ParquetWriter(beside, schema) as out:
            if path.stat().st_size:
                with pa.parquet.ParquetFile(path) as old:
                    for batch in old.iter_batches():
                        out.write_batch(batch)
            with pa.OSFile(str(part)) as rows, pa.csv.open_csv(rows, reading, convert_options=converting) as new:
                for batch in new:
                    out.write_batch(batch)
        synced(beside)
        os.replace(beside, target)
        part.unlink()
    finally:
        beside.unlink(missing_ok=True)
