"""What a plot holds beside its curves, and the views with which it opens."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from multidrop.drives.events import Sample, Valued
from multidrop.shell.plots.plot import Plot
from multidrop.shell.plots.request import PlotTarget, parse_target
from multidrop.shell.plots.sink import LINES, drives_of
from tests.support.plot_file import contents

PATHS = {
    "/press/a/position",
    "/press/a/velocity",
    "/press/a/I1",
    "/press/b/position",
    "/press/log",
    "/press/a/state/program",
}


@pytest.fixture
def rerun() -> Iterator[Any]:
    os.environ["RUST_LOG"] = "off"
    yield pytest.importorskip("rerun")


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
    assert {colours[f"/press/a/{word}"] for word in ("position", "velocity")} == {LINES[0]}
    assert {colours[f"/press/b/{word}"] for word in ("position", "velocity", "I1")} == {LINES[1]}
    assert colours["/pmx/00/x/position"] not in LINES[:2]
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
    assert colours[:2] == [LINES[0], LINES[1]] and colours[2] not in LINES[:3]


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
