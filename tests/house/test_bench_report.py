"""The table of `make bench`: what a row says, and that each bench yields rows."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "bench"


def _loaded(name):
    spec = importlib.util.spec_from_file_location(name, BENCH / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


report = _loaded("report")
run = _loaded("run")  # which imports `report`


def test_a_kept_result_keeps_the_benches_that_are_not_measured_again(tmp_path):
    kept = {"commit": "b", "date": "Monday", "earlier": {"stop": "commit a, Sunday"}}
    kept["benches"] = {name: [] for name in ("stop", "sweep", "logs", "one-that-is-gone")}
    (tmp_path / "reference.json").write_text(json.dumps(kept))
    found = run.earlier(tmp_path / "reference.json", ["logs"])
    assert found["earlier"] == {"stop": "commit a, Sunday", "sweep": "commit b, Monday"}
    assert [*found["benches"]] == ["stop", "sweep"] and run.earlier(tmp_path / "none.json", [])["benches"] == {}


def test_a_ratio_is_the_median_of_the_rounds_side_by_side():
    row = report.compared("trips", "/s", [10, 20, 300], [10, 10, 100], "bare")
    assert (row.ours, row.peer, row.ratio) == (20, 10, 2)


@pytest.mark.parametrize(
    ("better", "aim_of", "aim", "reached"),
    [
        ("less", "ours", 20, True),
        ("less", "ours", 19, False),
        ("more", "ours", 20, True),
        ("more", "ours", 21, False),
        ("more", "ratio", 2, True),
        ("less", "ratio", 1.9, False),
        ("less", "ratio", None, None),
    ],
)
def test_an_aim_is_of_the_figure_or_of_the_ratio(better, aim_of, aim, reached):
    row = report.compared("trips", "/s", [20], [10], "bare", better=better, aim_of=aim_of, aim=aim)
    assert row.reached is reached


def test_a_line_names_the_peer_and_an_aim_that_is_not_reached():
    row = report.compared("trips", "/s", [6000], [8000], "bare", better="more", aim_of="ratio", aim=0.9, note="a pty")
    assert report.line(row).split() == ["trips", "6000", "8000", "bare", "0.75", "!>=0.9x", "/s", "a", "pty"]


def test_a_peer_that_is_not_installed_is_said():
    row = report.absent("intake", "lines/s", [100], "tio")
    assert row.peer is None and row.note == "tio is not installed"
    assert report.line(row).endswith("tio is not installed")
