"""What a plot holds in its file: curves, states, views; a twin beside its drive, and what reads back."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from multidrop import read_rrd
from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Sample, Valued
from multidrop.features.plot_files.plot import Plot
from multidrop.features.plot_files.request import PlotTarget, parse_target
from multidrop.features.plot_files.rerun_calls import DIFFERS, LINE_COLOURS, PALE, RUNS, drives_of, layout
from multidrop.shell.events import Predicted
from multidrop.shell.plots.batch import TWIN
from tests.support.plot_file import contents

PATHS = {
    "/press/a/position",
    "/press/a/velocity",
    "/press/a/I1",
    "/press/b/position",
    "/press/log",
    "/press/a/state/program",
}


async def plotted(path: Path) -> None:
    clock, wall = (lambda: 0.0), (lambda at: datetime.fromtimestamp(1.8e9 + at, UTC))
    plot = await Plot.open(PlotTarget(file=path), clock=clock, wall=wall)
    plot.label("press", "a", "gantry")
    plot.label("press", "b", "")
    plot.value("press", Valued(0.5, "b", "I1", 1.0))
    plot.sample("press", Sample(1.0, "b", 1, 2))
    plot.sample("press", Sample(1.0, "a", 1, 2))
    plot.sample("pmx", Sample(1.0, "00", 1, 2, "x"))
    for at, program in ((1.0, "G1"), (2.0, "G1"), (3.0, "none")):
        plot.state("press", "a", "", "program", at, program)
    plot.gap("press", 4.0)
    plot.state("press", "a", "", "program", 5.0, "none")
    await plot.close()


async def test_a_drive_has_one_colour_and_the_name_that_a_person_gave(rerun: Any, tmp_path: Path) -> None:
    await plotted(tmp_path / "run.rrd")
    found = contents(tmp_path / "run.rrd")
    colours = {path: found[path]["SeriesLines:colors"][0][0] for path in found if "SeriesLines:colors" in found[path]}
    assert {colours[f"/press/a/{word}"] for word in ("position", "velocity")} == {LINE_COLOURS[0]}
    assert {colours[f"/press/b/{word}"] for word in ("position", "velocity", "I1")} == {LINE_COLOURS[1]}
    assert colours["/pmx/00/x/position"] not in LINE_COLOURS[:2]
    names = [found["/press/a/velocity"]["SeriesLines:names"][0], found["/press/b/I1"]["SeriesLines:names"][0]]
    assert names == [["press:a gantry velocity (steps/s)"], ["press:b I1"]]


async def test_a_colour_stays_when_a_file_is_continued(rerun: Any, tmp_path: Path) -> None:
    await plotted(tmp_path / "run.rrd")
    plot = await Plot.open(
        PlotTarget(file=tmp_path / "run.rrd"), clock=lambda: 0.0, wall=lambda at: datetime.fromtimestamp(1.8e9, UTC)
    )
    plot.label("press", "c", "")
    plot.sample("press", Sample(1.0, "c", 1, 2))
    await plot.close()
    found = contents(tmp_path / "run.rrd")
    colours = [found[f"/press/{each}/position"]["SeriesLines:colors"][-1][0] for each in "abc"]
    assert colours[:2] == [LINE_COLOURS[0], LINE_COLOURS[1]] and colours[2] not in LINE_COLOURS[:3]


async def test_states_are_kept_when_they_change_and_a_lost_line_ends_them(rerun: Any, tmp_path: Path) -> None:
    await plotted(tmp_path / "run.rrd")
    lane = contents(tmp_path / "run.rrd")["/press/a/state/program"]
    assert [each for each in lane["StateChange:state"] if each is not None] == [["G1"], ["none"], [""], ["none"]]
    assert [at / 1e9 for at in lane["elapsed"] if at is not None] == [1.0, 3.0, 4.0, 5.0]


def test_drives_are_found_by_their_curves(rerun: Any) -> None:
    assert drives_of(PATHS) == ["/press/a", "/press/b"]


@pytest.mark.parametrize(("connection", "host"), [("10.0.0.9 51 10.0.0.5 22", "10.0.0.5"), ("", "shop-pc")])
def test_the_line_for_the_desk(connection: str, host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSH_CONNECTION", connection)
    monkeypatch.setattr("socket.gethostname", lambda: "shop-pc")
    assert parse_target(None, "9876").desk == f"ssh -L 9876:127.0.0.1:9876 {host}"
    assert parse_target(None, "[::1]:9876").desk == f"ssh -L '9876:[::1]:9876' {host}"
    assert parse_target(None, "0.0.0.0:9876").desk == "" == parse_target("run.rrd", None).desk


async def plotted_with_twins(path: Path) -> dict[str, dict[str, list[Any]]]:
    """Two drives, of which `b` falls behind its twin, and an axis of a third one."""
    plot = await Plot.open(
        PlotTarget(file=path), clock=lambda: 0.0, wall=lambda at: datetime.fromtimestamp(1.8e9 + at, UTC)
    )
    plot.label("press", "a", "")
    plot.label("press", "b", "clamp")
    for n in range(4):
        plot.sample("press", Sample(1.0 + n, "a", n, 0))
        plot.sample("press", Sample(1.0 + n, "b", 100 * n, 100))
        plot.predicted("press", Predicted(1.0 + n, "b", 150 * n, 150, -50 * n))
        plot.sample("pmx", Sample(1.0 + n, "00", n, 0, "y"))
        plot.predicted("pmx", Predicted(1.0 + n, "00", n, 0, 0, "y"))
    plot.state("press", "b", "", TWIN, 3.0, DIFFERS)
    plot.twin_ended("press", "b", 5.0)
    assert await plot.close() == f"12 samples in {path}"
    return contents(path)


async def test_a_twin_has_the_colour_of_its_drive_as_a_pale_band_and_a_name(rerun: Any, tmp_path: Path) -> None:
    found = await plotted_with_twins(tmp_path / "run.rrd")
    own, twin = found["/press/b/position"], found["/press/b/twin/position"]
    assert own["SeriesLines:colors"][0] == [LINE_COLOURS[1]]
    assert twin["SeriesLines:colors"][0] == [LINE_COLOURS[1] & ~0xFF | PALE]
    assert twin["SeriesLines:widths"][0][0] > 2 * own["SeriesLines:widths"][0][0]
    assert twin["SeriesLines:names"][0] == ["press:b clamp twin position (steps)"]
    difference = found["/press/b/twin/difference"]
    assert difference["SeriesLines:names"][0] == ["press:b clamp difference (steps)"]
    assert difference["SeriesLines:colors"][0] == [LINE_COLOURS[1]]
    assert "/press/a/twin/position" not in found and "/pmx/00/y/twin/velocity" in found


async def test_the_state_of_a_twin_is_a_lane_that_ends_with_it(rerun: Any, tmp_path: Path) -> None:
    lane = (await plotted_with_twins(tmp_path / "run.rrd"))["/press/b/state/twin"]
    assert [each for each in lane["StateChange:state"] if each is not None] == [[RUNS], [DIFFERS], [""]]
    assert [at / 1e9 for at in lane["elapsed"] if at is not None] == [1.0, 3.0, 5.0]


async def test_a_run_with_a_twin_reads_back(rerun: Any, tmp_path: Path) -> None:
    await plotted_with_twins(tmp_path / "run.rrd")
    measured, predicted = read_rrd(tmp_path / "run.rrd"), read_rrd(tmp_path / "run.rrd", twin=True)
    assert {(each.drive, each.axis) for each in measured} == {("press:a", ""), ("press:b", ""), ("pmx:00", "y")}
    assert {(each.drive, each.axis) for each in predicted} == {("press:b", ""), ("pmx:00", "y")}
    assert [each.position for each in measured.of("press:b")] == [0, 100, 200, 300]
    assert [(each.position, each.velocity) for each in predicted.of("press:b")] == [
        (0, 150),
        (150, 150),
        (300, 150),
        (450, 150),
    ]
    assert [each.elapsed for each in measured.of("press:b")] == [each.elapsed for each in predicted.of("press:b")]


async def test_a_run_without_a_twin_says_so(rerun: Any, tmp_path: Path) -> None:
    plot = await Plot.open(PlotTarget(file=tmp_path / "a.rrd"), clock=lambda: 0.0, wall=lambda at: datetime.now(UTC))
    plot.sample("press", Sample(1.0, "a", 1, 2))
    await plot.close()
    with pytest.raises(Diagnostic, match=r"no samples of twins; /twin on"):
        read_rrd(tmp_path / "a.rrd", twin=True)


async def test_the_difference_alone_is_a_plot(rerun: Any, tmp_path: Path) -> None:
    plot = await Plot.open(PlotTarget(file=tmp_path / "a.rrd"), clock=lambda: 0.0, wall=lambda at: datetime.now(UTC))
    plot.predicted("press", Predicted(1.0, "a", 5, 6, -7), alone=True)
    assert (await plot.close()).startswith("1 sample in")
    found = contents(tmp_path / "a.rrd")
    assert found["/press/a/twin/difference"]["Scalars:scalars"] == [[-7.0]] and "/press/a/twin/position" not in found


def views(part: Any) -> Iterator[tuple[str, list[str], Any]]:
    """The charts below a part of a layout: name, contents, legend."""
    for each in getattr(part, "contents", None) or []:
        if isinstance(each, str):
            continue
        if type(each).__name__ == "TimeSeriesView":
            yield each.name, list(each.contents), each.properties["PlotLegend"].visible.as_arrow_array().to_pylist()[0]
        else:
            yield from views(each)


def test_a_twin_shares_the_charts_of_its_drive_and_the_difference_has_its_own(rerun: Any) -> None:
    own = {"/press/b/position", "/press/b/velocity", "/press/log", "/press/b/state/twin"}
    paths = own | {f"/press/b/twin/{word}" for word in ("position", "velocity", "difference")}
    assert drives_of(paths) == ["/press/b"]
    assert list(views(layout(paths, {}).root_container)) == [
        ("press/b position (steps)", ["/press/b/position", "/press/b/twin/position"], True),
        ("press/b velocity (steps/s)", ["/press/b/twin/velocity", "/press/b/velocity"], True),
        ("press/b difference (steps)", ["/press/b/twin/difference"], False),
    ]
    assert [visible for _, _, visible in views(layout(own, {}).root_container)] == [False, False]


@pytest.mark.parametrize("path", ["/twin/position", "/twin/twin/position"])
def test_a_line_of_drives_may_be_called_twin(path: str, rerun: Any) -> None:
    assert drives_of({path}) == ["/twin"]


# From a session


def test_charts_have_most_of_the_height_and_states_more_than_the_log(rerun: Any) -> None:
    for own, shares in (
        ({"/press/a/position", "/press/a/state/program", "/press/log"}, [4.0, 1.5, 1.0]),
        ({"/press/a/position", "/press/log"}, [4.0, 1.0]),
        ({"/press/a/state/program", "/press/log"}, [4.0, 1.0]),
        ({"/press/log"}, [1.0]),
    ):
        assert list(layout(own, {}).root_container.row_shares) == shares
