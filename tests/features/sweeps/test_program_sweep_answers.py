"""The answers of `multidrop program sweep`: lines by value, map, boundary, tables, a search, a resumed sweep."""

from __future__ import annotations

import csv
import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base import atomic
from multidrop.base.errors import Diagnostic
from multidrop.features.sweeps import plan, results, trial
from multidrop.features.sweeps.answers import _words
from multidrop.features.sweeps.trial import TrialResult
from tests.support.cell_session import bus, drive
from tests.support.front_door import Command, Done

GO = 'PG 1\nLB SU\n MR 51200\n H\n PR "at ",P\nE\nPG\n'
CELL = bus("line", drive("LMDCM", "b", EE=1), baud=0)
GRID = ("--vary", "b.load=0..0.2:0.1", "--vary", "b.stall_at=100000,200000,700000")
EXPECT = ("--expect", "position == 51200 +- 2")
Sweep = Callable[..., Done]


@pytest.fixture
def sweep(multidrop: Command, tmp_path: Path) -> Sweep:
    """Runs `program sweep go.mxt --cell cell.toml` in a folder of its own, in this process."""
    (tmp_path / "go.mxt").write_text(GO)
    (tmp_path / "cell.toml").write_text(CELL)
    return lambda *arguments: multidrop(
        "program", "sweep", "go.mxt", "--cell", "cell.toml", *arguments, *EXPECT, "--jobs", "1"
    )


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the cases that run."""
    found: list[int] = []
    tried = trial.Bench.tried

    def noted(self: trial.Bench, case: trial.Case) -> TrialResult:
        found.append(case[0])
        return tried(self, case)

    monkeypatch.setattr(trial.Bench, "tried", noted)
    return found


def test_each_value_has_a_line_then_come_the_map_and_the_boundary(sweep: Sweep) -> None:
    assert sweep(*GRID).stdout.splitlines()[:12] == [
        "b.load=0            33%  1 of 3  margin -43385 of position == 51200 +- 2",
        "b.load=0.1          33%  1 of 3  margin -43385 of position == 51200 +- 2",
        "b.load=0.2          33%  1 of 3  margin -43385 of position == 51200 +- 2",
        "b.stall_at=100000    0%  0 of 3  margin -43385 of position == 51200 +- 2",
        "b.stall_at=200000    0%  0 of 3  margin -35573 of position == 51200 +- 2",
        "b.stall_at=700000  100%  3 of 3  margin 2 of position == 51200 +- 2",
        "per cent that passed: b.load down, b.stall_at across",
        "b.load 100000 200000 700000",
        "0           0      0    100",
        "0.1         0      0    100",
        "0.2         0      0    100",
        "fails from b.stall_at 200000 down",
    ]


def test_a_picture_has_a_cell_for_each_pair_and_replaces_a_picture_only(sweep: Sweep, tmp_path: Path) -> None:
    for _ in range(2):
        assert sweep(*GRID, "--svg", "map.svg").returncode == 1
    root = ElementTree.parse(tmp_path / "map.svg").getroot()
    texts = [each.text for each in root.iter() if each.tag.endswith("text")]
    assert texts[:9] == ["0", "0", "100"] * 3 and {"b.load", "0.1", "200000"} < {*" ".join(map(str, texts)).split()} | {
        *texts
    }
    refused = sweep(*GRID, "--svg", "cell.toml")
    assert refused.returncode == 2 and refused.stderr == (
        "cell.toml: exists already and is not a picture; name a new file for the report\n"
    )
    one = sweep(*GRID[:2], "--svg", "one.svg")
    assert one.returncode == 2 and "two keys" in one.stderr and not (tmp_path / "one.svg").exists()


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_table_has_all_cases_with_seed_and_versions(sweep: Sweep, tmp_path: Path) -> None:
    sweep(*GRID, "--csv", "all.csv")
    found = rows(tmp_path / "all.csv")
    assert [(each["case"], each["ok"]) for each in found] == [
        (str(number), "true" if number % 3 == 0 else "false") for number in range(1, 10)
    ]
    first = found[0]
    assert {name: first[name] for name in ("b.load", "b.stall_at", "failed", "why", "position", "errors", "ended")} == {
        "b.load": "0",
        "b.stall_at": "100000",
        "failed": "position == 51200 +- 2",
        "why": "position == 7813",
        "position": "7813",
        "errors": "[86]",
        "ended": "E",
    }
    assert first["seed"] == "1" and first["multidrop"] == trial.version() and first["python"]
    assert first["vary"] == "b.load=0..0.2:0.1 b.stall_at=100000,200000,700000"
    assert float(first["margin of position == 51200 +- 2"]) == 2 - (51200 - 7813)


def test_parquet_has_the_same_rows_with_types_and_is_resumed_too(sweep: Sweep, tmp_path: Path, ran: list[int]) -> None:
    pa = pytest.importorskip("pyarrow.parquet")
    sweep(*GRID, "--csv", "all.csv", "--parquet", "all.parquet")
    table = pa.read_table(tmp_path / "all.parquet").to_pylist()
    assert [list(each) for each in table[:1]] == [list(rows(tmp_path / "all.csv")[0])]
    assert (table[0]["b.load"], table[0]["ok"], table[0]["position"], table[8]["ok"]) == (0.0, False, 7813, True)
    ran.clear()
    again = sweep(*GRID, "--resume", "all.parquet", "--csv", "again.csv")
    assert again.stderr == "9 cases of 9 are in the file already\n"
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "all.csv").read_bytes()
    assert not set(ran) & {3, 6, 9}  # it runs for the simplest worlds only


def test_without_pyarrow_nothing_runs(sweep: Sweep, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = sweep(*GRID, "--parquet", "all.parquet")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1) and "multidrop[rerun]" in done.stderr
    assert not (tmp_path / "all.parquet").exists()


def test_a_killed_sweep_goes_on_where_it_was(
    sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: list[int]
) -> None:
    sweep(*GRID, "--csv", "whole.csv")
    whole = (tmp_path / "whole.csv").read_bytes()
    noted = trial.Bench.tried

    def killed(self: trial.Bench, case: trial.Case) -> TrialResult:
        if case[0] == 5:
            raise SystemExit(137)
        return noted(self, case)

    with monkeypatch.context() as context:
        context.setattr(trial.Bench, "tried", killed)
        context.setattr(results, "LEAST_WRITE_PERIOD", 0.0)
        context.setattr(results, "SHARE", 0)
        assert sweep(*GRID, "--resume", "part.csv").returncode == 137
    assert [each["case"] for each in rows(tmp_path / "part.csv")] == ["1", "2", "3", "4"]
    ran.clear()
    done = sweep(*GRID, "--resume", "part.csv")
    assert done.stderr == "4 cases of 9 are in the file already\n" and "9 cases, 6 failed" in done.stdout
    assert (tmp_path / "part.csv").read_bytes() == whole and ran[:5] == [5, 6, 7, 8, 9]


def test_a_resumed_sweep_reports_all_cases_in_order(sweep: Sweep, tmp_path: Path) -> None:
    sweep(*GRID, "--csv", "all.csv")
    head, *lines = (tmp_path / "all.csv").read_text().splitlines(keepends=True)
    (tmp_path / "all.csv").write_text("".join([head, *lines[3:5], lines[8]]))
    done = sweep(*GRID, "--resume", "all.csv", "--json")
    assert [json.loads(line).get("case") for line in done.stdout.splitlines()] == [*range(1, 10), None]


OTHERS: list[tuple[tuple[str, ...], dict[str, str], str]] = [
    (("--vary", "b.load=0"), {}, "its vary is"),
    ((*GRID, "--until", "5"), {}, "its expect is"),
    ((*GRID, "--seed", "2"), {}, "its seed is '1', and here it is '2'"),
    (GRID, {"go.mxt": GO.replace("51200", "51201")}, "its program is another one"),
    (GRID, {"cell.toml": CELL.replace("EE = 1", "EE = 0")}, "its cell is another one"),
]


@pytest.mark.parametrize(("arguments", "files", "what"), OTHERS)
def test_a_table_of_another_sweep_is_refused_and_unchanged(
    sweep: Sweep, tmp_path: Path, arguments: tuple[str, ...], files: dict[str, str], what: str
) -> None:
    sweep(*GRID, "--csv", "all.csv")
    before = (tmp_path / "all.csv").read_bytes()
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    for option in ("--resume", "--csv"):
        done = sweep(*arguments, option, "all.csv")
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1) and what in done.stderr
        assert (tmp_path / "all.csv").read_bytes() == before


def test_a_row_whose_values_were_edited_is_refused(sweep: Sweep, tmp_path: Path) -> None:
    sweep(*GRID, "--csv", "all.csv")
    edited = (tmp_path / "all.csv").read_text().replace("\n4,0.1,100000,", "\n4,0.1,300000,")
    (tmp_path / "all.csv").write_text(edited)
    done = sweep(*GRID, "--resume", "all.csv")
    assert (done.returncode, done.stdout) == (2, "") and done.stderr == (
        "all.csv:5: is not a row of this sweep; name a new file\n"
    )
    assert (tmp_path / "all.csv").read_text() == edited


def test_a_table_of_another_version_is_refused(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep(*GRID, "--csv", "all.csv")
    monkeypatch.setattr(plan, "version", lambda: "99.0")
    done = sweep(*GRID, "--resume", "all.csv")
    assert done.returncode == 2 and "its multidrop is '0.1.0', and here it is '99.0'" in done.stderr


def test_a_part_of_a_sweep_is_replaced_by_no_new_one(sweep: Sweep, tmp_path: Path) -> None:
    sweep(*GRID, "--csv", "all.csv")
    assert sweep(*GRID, "--csv", "all.csv").returncode == 1  # complete, and the same
    head, first, *_ = (tmp_path / "all.csv").read_text().splitlines(keepends=True)
    (tmp_path / "all.csv").write_text(head + first)
    done = sweep(*GRID, "--csv", "all.csv")
    assert (done.returncode, done.stderr) == (
        2,
        "all.csv: has 1 of 9 cases of this sweep already; --resume all.csv goes on with them\n",
    )


@pytest.mark.parametrize(
    ("file", "what"),
    [
        ("-", "-: is standard output"),
        ("gone/all.csv", "its folder does not exist"),
        ("cell.toml", "is not a table of a sweep"),
        (".", "."),
    ],
)
def test_a_file_that_cannot_be_a_table_is_one_line_and_nothing_runs(sweep: Sweep, file: str, what: str) -> None:
    for option in ("--csv", "--resume"):
        done = sweep(*GRID, option, file)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1) and what in done.stderr


def test_a_table_that_cannot_be_written_any_more_is_said(
    sweep: Sweep, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def full(path: Path, data: bytes) -> None:
        if data.count(b"\n") > 4:
            raise OSError(28, "No space left on device")
        atomic.write_atomically(path, data)

    monkeypatch.setattr(results, "write_atomically", full)
    done = sweep(*GRID, "--csv", "all.csv")
    assert done.returncode == 2 and done.stderr.startswith("all.csv: cannot be written: No space left on device\n")


def test_an_output_that_cannot_be_made_leaves_no_other_and_nothing_runs(
    sweep: Sweep, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, ran: list[int]
) -> None:
    def locked(path: Path, data: bytes) -> None:
        if path.name == "locked.csv":
            raise PermissionError(13, "Permission denied")
        atomic.write_atomically(path, data)

    monkeypatch.setattr(results, "write_atomically", locked)
    done = sweep(*GRID, "--resume", "new.csv", "--csv", "locked.csv")
    assert (done.returncode, done.stdout) == (2, "") and "locked.csv: cannot be written" in done.stderr
    monkeypatch.setattr(os, "access", lambda *_: False)
    for option in ("--junit", "--svg"):
        done = sweep(*GRID, option, "map", "--csv", "new.csv")
        assert (done.returncode, done.stderr.startswith("map: its folder cannot be written; name a file")) == (2, True)
    assert ran == [] and {each.name for each in tmp_path.iterdir() if each.is_file()} == {"go.mxt", "cell.toml"}


def table_of(folder: Path) -> tuple[plan.SweepPlan, bytes]:
    """A plan, and the bytes of its table."""
    (folder / "go.mxt").write_text(GO)
    made = plan.make(
        plan.SweepArguments(str(folder / "go.mxt"), vary=[("load", "0..0.3:0.1")], expect=["virtual_s < 2"])
    )
    found = results.ResultTable(made, str(folder / "all.csv"))
    for number in range(1, 5):
        found.take(trial.bench(made.job).tried(made.case(number)))
    found.save(now=True)
    return made, (folder / "all.csv").read_bytes()


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, plan.SweepPlan, bytes]:
    folder = tmp_path_factory.mktemp("table")
    return folder, *table_of(folder)


@given(st.data())
def test_a_damaged_table_is_read_or_refused_and_never_changed(kept: Any, data: st.DataObject) -> None:
    folder, made, whole = kept
    begin = data.draw(st.integers(0, len(whole)))
    end = data.draw(st.integers(begin, min(len(whole), begin + 40)))
    damaged = whole[:begin] + data.draw(st.binary(max_size=12)) + whole[end:]
    (folder / "bad.csv").write_bytes(damaged)
    try:
        known = results.ResultTable(made, resume=str(folder / "bad.csv")).known
    except Diagnostic as problem:
        assert "\n" not in str(problem)
    else:
        assert set(known) <= {1, 2, 3, 4} and all(isinstance(each, TrialResult) for each in known.values())
    assert (folder / "bad.csv").read_bytes() == damaged
    assert not [each for each in folder.iterdir() if each.name.endswith(".tmp")]


def test_a_search_finds_the_boundary_with_few_cases(sweep: Sweep, ran: list[int], tmp_path: Path) -> None:
    vary = ("--vary", "b.load=0,0.5", "--vary", "b.stall_at=100000..800000:10")
    done = sweep(*vary, "--search", "b.stall_at", "--csv", "some.csv", "--json")
    cases = [json.loads(line) for line in done.stdout.splitlines()[:-1]]
    assert len(cases) < 40 and len(set(ran)) < 45
    walls = {load: [each["set"]["b.stall_at"] for each in cases if each["set"]["b.load"] == load] for load in (0, 0.5)}
    passing = min(each["set"]["b.stall_at"] for each in cases if each["ok"])
    assert all({passing, passing - 10} <= {*each} for each in walls.values())
    text = sweep(*vary, "--search", "b.stall_at", "--resume", "some.csv").stdout
    assert f"\nfails from b.stall_at {passing - 10} down\n" in text and "per cent that passed" not in text


def test_a_search_without_a_boundary_says_so(sweep: Sweep, ran: list[int]) -> None:
    done = sweep("--vary", "b.stall_at=700000..900000", "--search", "b.stall_at")
    said = "passes at both ends of b.stall_at; nothing between was tried\n2 cases, 0 failed"
    assert done.returncode == 0 and said in done.stdout and ran == [1, 200001]
    two = sweep("--vary", "b.load=0,0.1", "--vary", "b.stall_at=100000..200000", "--search", "b.stall_at")
    assert "\nfails at both ends of b.stall_at; nothing between was tried\n" in two.stdout
    mixed = sweep("--vary", "b.stall_at=700000,100000,900000", "--search", "b.stall_at")
    assert mixed.returncode == 2
    assert mixed.stderr == "--search b.stall_at: its values go up and down; write them in order\n"
    wrong = sweep("--vary", "b.load=0", "--search", "load")
    assert wrong.returncode == 2 and wrong.stderr == "--search load: has no values; --vary load=A..B:STEP\n"
    both = sweep("--vary", "b.load=0", "--search", "b.load", "--random", "3")
    assert both.returncode == 2 and "not allowed with" in both.stderr


@given(st.lists(st.integers(-1000, 1000), min_size=2, unique=True), st.data())
def test_the_words_for_a_boundary_name_the_first_value_that_fails(values: list[int], data: st.DataObject) -> None:
    limit = data.draw(st.sampled_from(sorted(values)[1:]))
    up = {str(value): value >= limit for value in values}
    assert _words("load", up) == (f"fails from load {limit}", " up")
    down = {str(value): value < limit for value in values}
    assert _words("load", down) == (f"fails from load {max(each for each in values if each < limit)}", " down")


@pytest.mark.parametrize(
    ("failing", "words"),
    [
        ("", "passes at every load"),
        ("01234", "fails at every load"),
        ("14", "fails for load 1, 4"),
        ("123", "fails for load 1..3"),
    ],
)
def test_other_boundaries_in_words(failing: str, words: str) -> None:
    assert "".join(_words("load", {str(each): str(each) in failing for each in range(5)})) == words


def test_the_boundary_of_each_value_of_the_other_key(sweep: Sweep) -> None:
    expect = ("--expect", "virtual_s < 1.28")
    vary = ("--vary", "b.A=300000..900000:100000", "--vary", "b.VM=60000,90000,120000,150000")
    said = [line for line in sweep(*vary, *expect).stdout.splitlines() if "b.A" in line and " at b.VM " in line]
    assert len(said) > 1 and all(line.startswith(("fails ", "passes ")) for line in said)
    assert any(line.startswith("fails from b.A ") and line.endswith(" down") for line in said)


def test_many_values_come_as_stretches(sweep: Sweep) -> None:
    lines = [line.split() for line in sweep("--vary", "seed=1..201", "--vary", "b.stall_at=1").stdout.splitlines()]
    assert (
        lines[0]
        == ["seed=1..11", "0%", "0", "of", "11", "margin", "-51198", "of", "position", "==", "51200"] + lines[0][11:]
    )
    assert sum(each[0].startswith("seed=") for each in lines) == 19


def test_nothing_else_writes_the_files(sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file appears by one replacement: a reader never sees a part of a row."""
    seen: list[int] = []
    replace = os.replace

    def watched(new: Path, old: Path) -> None:
        if Path(old).name == "all.csv":
            assert new.read_bytes().endswith(b"\n")
            seen.append(new.read_bytes().count(b"\n"))
        replace(new, old)

    monkeypatch.setattr(os, "replace", watched)
    monkeypatch.setattr(results, "LEAST_WRITE_PERIOD", 0.0)
    monkeypatch.setattr(results, "SHARE", 0)
    sweep(*GRID, "--csv", "all.csv")
    assert seen == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10]


def test_the_motor_is_varied_and_a_margin_leaves_out_what_an_error_ended(sweep: Sweep) -> None:
    vary = ("--vary", "b.motor=nema17,nema34", "--vary", "b.load=0.1,0.9", "--vary", "b.A=100000")
    done = sweep(*vary, "--expect", "errors == []", "--expect", "virtual_s < 60", "--until", "50")
    assert done.stdout.splitlines()[:2] == [
        "b.motor=nema17   50%  1 of 2  margin 58.46 of virtual_s < 60; 2 of position == 51200 +- 2",
        "b.motor=nema34    0%  0 of 2",
    ]
    refused = sweep("--vary", "b.motor=nema17,own.csv")
    assert refused.returncode == 2 and refused.stderr == (
        "--vary b.motor=own.csv: motor: is not one of nema17, nema23, nema34; name a file in the cell\n"
    )


@given(why=st.text(alphabet="=+-@'\t1x ,\"", max_size=8))
def test_no_cell_of_a_table_is_a_formula_and_each_is_read_again(kept: Any, why: str) -> None:
    folder, made, _ = kept
    table = results.ResultTable(made)
    columns = table._columns[table._kept]
    cells = (why,) * len(columns)
    margins = [name.startswith(results.MARGIN) for name in columns]
    cells = tuple("" if margin else cell for cell, margin in zip(cells, margins, strict=True))
    path = folder / "formula.csv"
    path.unlink(missing_ok=True)
    table = results.ResultTable(made, str(path))
    table.take(TrialResult(1, results.ALL_HELD, why, cells))
    table.save(now=True)
    for row in csv.reader(path.read_text().splitlines()):
        assert not [each for each in row if each[:1] in "=+-@" and each[:1] and not _is_number(each)], row
    assert results.ResultTable(made, resume=str(path)).known[1] == TrialResult(1, results.ALL_HELD, why, cells)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
