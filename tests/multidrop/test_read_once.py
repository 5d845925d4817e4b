"""Files that another program changes while a command runs: what was checked is what is used, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.support.cell_session import bus, party
from tests.support.front_door import Command, change_before_opening

URL = "sim:cell.toml"
GOOD = "PG 1\nLB G1\n MR 51200\n E\nPG\n"
OTHER = GOOD.replace("51200", "999999")


@pytest.fixture(autouse=True)
def cell(tmp_path: Path) -> Path:
    path = tmp_path / "cell.toml"
    path.write_text(bus("press", party("a", CK=0), party("b", CK=0, VM=600000), baud=0))
    return path


Changes = Callable[[Path, str], None]


@pytest.fixture
def changes(monkeypatch: pytest.MonkeyPatch) -> Changes:
    """Let another program write a file once a command has checked its files, and before anything is opened."""
    return partial(change_before_opening, monkeypatch)


@pytest.mark.parametrize("drive", ["a", "all"])
def test_a_download_sends_the_text_that_was_checked(
    multidrop: Command, tmp_path: Path, changes: Changes, drive: str
) -> None:
    (tmp_path / "a.mxt").write_text(GOOD)
    changes(tmp_path / "a.mxt", "K9 wrong\n")
    done = multidrop("program", "download", URL, "a.mxt", "--drive", drive, "--run", "G1")
    assert done.returncode == 0 and "a: verified, 3 lines" in done.stderr and "a: started (EX G1)" in done.stderr
    (kept,) = (tmp_path / "state" / "sources").iterdir() if drive == "a" else [None]
    assert kept is None or json.loads(kept.read_text())["text"] == GOOD


def test_lines_that_act_are_those_that_were_checked(multidrop: Command, tmp_path: Path, changes: Changes) -> None:
    (tmp_path / "a.mxt").write_text(f"VM=100000\n{GOOD}")
    changes(tmp_path / "a.mxt", f"{GOOD}MR 999999\n")  # it would have to be agreed to
    done = multidrop("program", "download", URL, "a.mxt", "--drive", "a")
    assert done.returncode == 0 and "executed at once: VM=100000" in done.stderr


def test_a_comparison_is_with_the_text_that_was_read(multidrop: Command, tmp_path: Path, changes: Changes) -> None:
    (tmp_path / "a.mxt").write_text(GOOD)
    changes(tmp_path / "a.mxt", OTHER)
    done = multidrop("program", "diff", "a.mxt", URL, "--drive", "a")
    assert "51200" in done.stdout and "999999" not in done.stdout


def test_settings_are_those_of_the_file_that_was_checked(multidrop: Command, tmp_path: Path, changes: Changes) -> None:
    file = tmp_path / "p.toml"
    file.write_text("[parameters]\nVM = 500000\n")
    changes(file, "[parameters]\nVM = 1\nA = 7\n")
    done = multidrop("params", "restore", URL, "p.toml", "--drive", "a", "--yes")
    assert done.returncode == 0 and "VM=500000" in done.stdout and "A=7" not in done.stdout
    file.write_text("[parameters]\nVM = 500000\n")
    done = multidrop("params", "diff", URL, "p.toml", "--drive", "a")
    assert done.stdout.splitlines() == ["VM: here 768000, there 500000 steps/s"]


def test_a_macro_plays_what_was_checked_with_the_macros_that_it_calls(
    multidrop: Command, tmp_path: Path, changes: Changes
) -> None:
    folder = tmp_path / "conf" / "macros"
    folder.mkdir(parents=True)
    (folder / "m.toml").write_text("name = 'm'\n[[step]]\nline = '/play inner'\n")
    inner = folder / "inner.toml"
    inner.write_text("name = 'inner'\n[[step]]\nline = '@a PR 1'\n")
    changes(inner, "name = 'inner'\n[[step]]\nline = '@a MR 999999'\n")
    done = multidrop("macro", "play", "m", "--on", URL)
    assert done.returncode == 0 and done.stdout.splitlines() == ["1"]


def test_a_python_program_is_reported_with_the_lines_that_ran(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "p.py").write_text(
        "from pathlib import Path\nPath('p.py').write_text('# gone\\n' * 9)\nassert 1 == 2, 'no'\n"
    )
    done = multidrop("run", "p.py", "--on", URL, "--json")
    facts = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 1 and any("assert 1 == 2" in str(fact.get("sent", "")) for fact in facts)
