"""The results of a sweep in a file: a table with a row for each case, as CSV or Parquet.

Each row has the values, the result, and the facts of the sweep, among them its seed and the versions; so a table needs
nothing beside it. A file is replaced as a whole while the sweep runs: at any moment it has whole rows of the cases that
are done, and `--resume` takes them.
"""

from __future__ import annotations

import csv
import io
import os
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from multidrop.base import new_file
from multidrop.base.atomic import write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.files import bytes_of, utf8, why
from multidrop.base.parquet import pyarrow
from multidrop.base.text import cell, counted, of_cell, whole
from multidrop.features.sweeps.plan import SweepPlan
from multidrop.features.sweeps.trial import ALL_HELD, CUT, DIED, MARGIN, REFUSED, TrialResult, bench
from multidrop.features.sweeps.variation import spelled

LARGEST_FILE = 1 << 30
"""The largest file that is read, bytes."""
LEAST_WRITE_PERIOD, SHARE = 1.0, 20
"""The shortest time between two writes, s; and that time as a multiple of what a write takes."""
PARQUET = ".parquet"
MAGIC = b"PAR1"
_NUMBER = re.compile(r"-?(?:\d+(?:\.\d*)?(?:e[+-]?\d+)?|inf)", re.ASCII)
REASONS = {CUT: "still running", REFUSED: "refused", DIED: "died"}
"""The texts in place of a failed condition."""


class ResultTable:
    """The rows of a sweep, and the files that they are written to."""

    def __init__(self, plan: SweepPlan, csv_file: str = "", parquet: str = "", resume: str = "") -> None:
        """Read and check the files; make those that do not exist. Raises Diagnostic, and changes no other file then."""
        self._plan, self._facts = plan, plan.facts()
        self._reasons = dict(enumerate(plan.job.expects)) | REASONS
        kept, keys = bench(plan.job).columns, [key.text for key in plan.job.keys]
        self._columns = ["case", *keys, "ok", "failed", "why", *kept, *self._facts]
        self._kept = slice(4 + len(keys), 4 + len(keys) + len(kept))
        self._rows: dict[int, bytes] = {}
        self._cells: dict[int, bytes] = {}
        """The rows as a CSV file has them: no cell is a formula."""
        self.known: dict[int, TrialResult] = {}
        """The results that the file to resume has."""
        if csv_file and csv_file == parquet:
            raise Diagnostic("is the CSV file already", f"--parquet {parquet}", "name another file")
        wanted = {resume: resume.endswith(PARQUET), csv_file: False, parquet: True}
        self._files = {
            file: pyarrow("write CSV: --csv FILE") if as_parquet else None
            for file, as_parquet in wanted.items()
            if file
        }
        for file in self._files:
            self._check(file, resume)
        for number in self.known:
            self.take(self.known[number])
        self._next = 0.0
        made = [file for file in self._files if not os.path.exists(file)]
        try:
            self._write(made)
        except Diagnostic:
            for file in made:
                with suppress(OSError):
                    os.unlink(file)
            raise

    def _check(self, file: str, resume: str) -> None:
        if file == new_file.STANDARD_OUTPUT:
            raise Diagnostic("is standard output, which has the answer", file, "name a file for the table")
        new_file.check_folder(file)
        if not os.path.exists(file):
            return
        kept = self._read(file)
        if file == resume:
            self.known = kept
        elif 0 < len(kept) < self._plan.count:
            what = f"has {len(kept)} of {counted(self._plan.count, 'case')} of this sweep already"
            raise Diagnostic(what, file, f"--resume {file} goes on with them")

    def take(self, result: TrialResult) -> None:
        if self._files:
            values = self._values(result.number)
            failed = self._reasons.get(result.failed, "")
            row = [str(result.number), *values, "true" if result.ok else "false", failed, result.why, *result.cells]
            row += self._facts.values()
            self._rows[result.number] = _line(row)
            self._cells[result.number] = _line(map(cell, row))

    def _values(self, number: int) -> list[str]:
        return [each if isinstance(each, str) else spelled(each) for each in self._plan.values_of(number)]

    def save(self, *, now: bool = False) -> None:
        """Write the files, if it is time or `now`. Raises Diagnostic."""
        begin = time.monotonic()
        if self._files and (now or begin >= self._next):
            self._write(self._files)
            end = time.monotonic()
            self._next = end + max(LEAST_WRITE_PERIOD, SHARE * (end - begin))

    def _write(self, files: Iterable[str]) -> None:
        for file in files:
            pa = self._files[file]
            rows = self._cells if pa is None else self._rows
            data = b"".join([_line(self._columns), *(rows[number] for number in sorted(rows))])
            try:
                write_atomically(Path(file), data if pa is None else self._as_parquet(pa, data))
            except (OSError, ValueError) as problem:
                raise Diagnostic(f"cannot be written: {why(problem)}", file) from None

    def _as_parquet(self, pa: Any, data: bytes) -> bytes:
        kinds = dict.fromkeys(("failed", "why", "errors", "ended", *self._facts), pa.string())
        kinds |= {name: pa.float64() for name in self._columns if name == "virtual_s" or name.startswith(MARGIN)}
        converting = pa.csv.ConvertOptions(column_types=kinds | {"ok": pa.bool_()})
        parsing = pa.csv.ParseOptions(newlines_in_values=True)
        table = pa.csv.read_csv(pa.BufferReader(data), parse_options=parsing, convert_options=converting)
        out = io.BytesIO()
        pa.parquet.write_table(table, out)
        return out.getvalue()

    def _read(self, file: str) -> dict[int, TrialResult]:
        """The results in a file. Raises Diagnostic for one that is not of this sweep."""
        results = {}
        try:
            rows = csv.reader(io.StringIO(_text(file), newline=""), strict=True)
            head = next(rows, [])
            if head[:1] != ["case"] or not {"ok", "failed", "why", "vary"} <= {*head}:
                raise _strange(file)
            for row in (list(map(of_cell, cells)) for cells in rows):
                if len(row) != len(head):
                    raise Diagnostic("is not a whole row", f"{file}:{rows.line_num}", "remove it, or name a new file")
                self._check_facts(file, dict(zip(head, row, strict=True)))
                result = self._result(row) if head == self._columns else None
                if result is None:
                    raise Diagnostic("is not a row of this sweep", f"{file}:{rows.line_num}", "name a new file")
                results[result.number] = result
        except csv.Error:
            raise _strange(file) from None
        return results

    def _check_facts(self, file: str, row: Mapping[str, str]) -> None:
        for name, ours in self._facts.items():
            if (theirs := row.get(name, "")) != ours:
                what = "is another one" if name in ("program", "cell") else f"is {theirs!r}, and here it is {ours!r}"
                raise Diagnostic(f"is of another sweep: its {name} {what}", file, "name a new file")

    def _result(self, row: Sequence[str]) -> TrialResult | None:
        """The result in a row; None if the row is none of this sweep."""
        codes = {text: code for code, text in reversed([*self._reasons.items()])} | {"": ALL_HELD}
        ok, failed, said = row[self._kept.start - 3 : self._kept.start]
        number, code, cells = whole(row[0], 1, self._plan.count), codes.get(failed), tuple(row[self._kept])
        for name, of_column in zip(self._columns[self._kept], cells, strict=True):
            if name.startswith(MARGIN) and of_column and not _NUMBER.fullmatch(of_column):
                return None
        if number is None or code is None or (ok == "true") != (code == ALL_HELD):
            return None
        if not all(map(_same, row[1:], self._values(number))):
            return None
        return TrialResult(number, code, said, cells)


def _line(row: Iterable[str]) -> bytes:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(row)
    return line.getvalue().encode("utf-8", "backslashreplace")


def _same(found: str, value: str) -> bool:
    """Whether a cell has a value. Parquet writes numbers in another way."""
    try:
        return found == value or float(found) == float(value)
    except ValueError:
        return False


def _text(file: str) -> str:
    """The text of a table. Raises Diagnostic."""
    data = bytes_of(file, LARGEST_FILE)
    if data.startswith(MAGIC):
        pa = pyarrow("use a CSV file")
        try:
            out = io.BytesIO()
            pa.csv.write_csv(pa.parquet.read_table(pa.BufferReader(data)), out)
            data = out.getvalue()
        except (pa.ArrowException, OSError):
            raise _strange(file) from None
    return utf8(data, file)


def _strange(file: str) -> Diagnostic:
    return Diagnostic("is not a table of a sweep", file, "name a new file; this one is unchanged")
