"""A plot as a table: rows of a CSV file or of a Parquet file, added to, cut off, refused."""

from __future__ import annotations

import csv
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Sample, Valued
from multidrop.features.plot_files import table
from multidrop.features.plot_files.plot import Plot, write
from multidrop.features.plot_files.request import PlotTarget
from multidrop.features.plot_files.table import COLUMNS
from multidrop.shell.plots.batch import Batch, PlottedCurve
from tests.support.plot_file import contents

ENDINGS = ["csv", "parquet"]


async def plotted(path: Path, position: int = 7, *, units: bool = False) -> str:
    clock, wall = (lambda: 0.0), (lambda at: datetime.fromtimestamp(1.8e9 + at, UTC))
    plot = await Plot.open(PlotTarget(file=path), clock=clock, wall=wall)
    plot.state("press", "a", "", "program", 0.25, "G1")
    plot.value("press", Valued(0.5, "b", "I1", 1.5))
    plot.sample("pmx", Sample(1.0, "00", position, -2, "x"))
    if units:
        plot.in_units("pmx", Sample(1.0, "00", position, -2, "x"), "velocity", -0.8, "um/s")
    plot.text("press", "a", 2.0, 'PR "x",\nP', "command")
    return await plot.close()


def rows(path: Path) -> list[dict[str, Any]]:
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            return list(csv.DictReader(file))
    table = pytest.importorskip("pyarrow.parquet").read_table(path)
    plain = table["time"].cast("timestamp[ms]")  # without a time zone, of which Windows has no table
    found: list[dict[str, Any]] = table.set_column(table.schema.get_field_index("time"), "time", plain).to_pylist()
    return found


@pytest.mark.parametrize("ending", ENDINGS)
async def test_each_value_state_and_line_is_a_row(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    assert await plotted(path) == f"2 samples in {path}"
    found = rows(path)
    assert [tuple(row) for row in found[:1]] == [COLUMNS]
    shown = [(float(row["elapsed"]), row["bus"], row["drive"], row["axis"], row["name"]) for row in found]
    assert shown == [
        (0.25, "press", "a", "", "program"),
        (0.5, "press", "b", "", "I1"),
        (1.0, "pmx", "00", "x", "position"),
        (1.0, "pmx", "00", "x", "velocity"),
        (2.0, "press", "", "", "command"),
    ]
    assert [float(row["value"]) for row in found[1:4]] == [1.5, 7, -2]
    assert [row["unit"] for row in found] == ["", "", "steps", "steps/s", ""]
    assert [found[0]["text"], found[4]["text"]] == ["G1", r'a: PR "x",\x0aP']
    assert str(found[1]["time"]).replace(" ", "T").startswith("2027-01-15T08:00:00.5")


async def test_a_quantity_in_units_is_a_row_with_its_unit(tmp_path: Path) -> None:
    await plotted(tmp_path / "run.csv", units=True)
    named = {row["name"]: (row["value"], row["unit"]) for row in rows(tmp_path / "run.csv")}
    assert (named["velocity"], named["velocity_um_per_s"]) == (("-2", "steps/s"), ("-0.8", "um/s"))


@pytest.mark.parametrize("ending", ENDINGS)
async def test_a_second_plot_is_added_after_the_first(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    await plotted(path)
    await plotted(path)
    found = rows(path)
    assert len(found) == 10
    times = [float(row["elapsed"]) for row in found]
    assert times == sorted(times) and times[5] > times[4]
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


async def test_a_row_that_a_kill_left_in_part_is_cut_before_the_next(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    await plotted(path, 1)
    path.write_bytes(path.read_bytes() + b"2027-01-15T08:00:03.000Z,3.00")
    await plotted(path, 2)
    assert [row["value"] for row in rows(path) if row["name"] == "position"] == ["1", "2"]


async def test_a_part_that_a_kill_left_is_in_the_next_parquet_file(tmp_path: Path) -> None:
    path, part = tmp_path / "run.parquet", tmp_path / "run.part.csv"
    await plotted(path, 1)
    await plotted(tmp_path / "run.part.csv", 2)
    await plotted(path, 3)
    assert [row["value"] for row in rows(path) if row["name"] == "position"] == [1, 2, 3]
    assert not part.exists()


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("data", [b"x", b"time,elapsed\n1,2\n", b"PAR1 and more", b"\xff\x00"])
async def test_a_file_of_others_is_left_as_it_is(ending: str, data: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    path.write_bytes(data)
    with pytest.raises(Diagnostic, match="is not a plot of multidrop"):
        await plotted(path)
    assert path.read_bytes() == data
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", ENDINGS)
async def test_a_file_that_is_plotted_to_is_refused_to_a_second_plot(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    plot = await Plot.open(PlotTarget(file=path), clock=lambda: 0.0, wall=lambda at: datetime.fromtimestamp(at, UTC))
    with pytest.raises(Diagnostic, match="another plot writes"):
        await plotted(path)
    await plot.close()
    assert rows(path) == []


async def test_without_pyarrow_a_parquet_file_is_one_line_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(Diagnostic, match="need pyarrow, which is not installed"):
        await plotted(tmp_path / "run.parquet")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ENDINGS)
async def test_a_disk_that_takes_no_more_ends_the_plot_with_one_line(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"run.{ending}"
    clock, wall = (lambda: 0.0), (lambda at: datetime.fromtimestamp(1.8e9 + at, UTC))
    plot = await Plot.open(PlotTarget(file=path), clock=clock, wall=wall)
    plot.value("press", Valued(0.5, "b", "I1", 1.0))

    def full(_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(table, "_rows", full)
    with pytest.raises(Diagnostic, match=r"plotting ended: cannot write .*No space left.* has what came before"):
        await plot.close()
    monkeypatch.undo()
    await plotted(path)
    assert len(rows(path)) == 5


@pytest.mark.parametrize("ending", ["csv", "rrd"])
async def test_samples_are_written_into_a_new_file_at_once(ending: str, tmp_path: Path) -> None:
    if ending == "rrd":
        pytest.importorskip("rerun")
    path = tmp_path / f"seen.{ending}"
    points = [(0.0, 1.8e9, 5.0), (0.5, 1.8e9 + 0.5, 6.0)]
    batch = Batch({PlottedCurve("press", "b", "", word): points for word in ("position", "velocity")})
    await write(PlotTarget(file=path), batch)
    if ending == "csv":
        assert [row["value"] for row in rows(path)] == ["5", "5", "6", "6"]
    else:
        assert contents(path)["/press/b/position"]["Scalars:scalars"] == [[5.0], [6.0]]
    before = path.read_bytes()
    with pytest.raises(Diagnostic, match="is there already; use another name"):
        await write(PlotTarget(file=path), batch)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("ending", ENDINGS)
async def test_what_a_drive_prints_is_no_formula_in_a_csv_file(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    texts = ["=1+1", "+1", "-5", "@SUM(A1)", "'=1", "-2+3+cmd", "plain", ""]
    clock, wall = (lambda: 0.0), (lambda at: datetime.fromtimestamp(1.8e9 + at, UTC))
    plot = await Plot.open(PlotTarget(file=path), clock=clock, wall=wall)
    for number, text in enumerate(texts):
        plot.state("=bus", "-a", "", "program", float(number), text)
    await plot.close()
    found = rows(path)
    shown = [row["text"] for row in found]
    if ending == "parquet":
        assert shown == texts and found[0]["bus"] == "=bus"
    else:
        assert shown == ["'=1+1", "+1", "-5", "'@SUM(A1)", "''=1", "'-2+3+cmd", "plain", ""]
        assert (found[0]["bus"], found[0]["drive"]) == ("'=bus", "'-a")
