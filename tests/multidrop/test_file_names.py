"""Names of files on the command line: `-` is standard output or refused; none makes a folder or a late failure."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from multidrop.__main__ import main
from tests.support.cases import for_each
from tests.support.cell_session import bus, drive

CELL = bus("press", drive("LMDCM", "a", 'program_text = """\nPG 1\nLB SU\nE\nPG\n"""'), baud=0)
LONG = "x" * 300
URL = "sim:cell.toml#press"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "moves.txt").write_text("MR 100\n")
    return tmp_path


def _files(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_a_program_goes_to_standard_output(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["program", "upload", URL, "-"]) == 0
    done = capsys.readouterr()
    assert done.out.splitlines()[:2] == ["PG 1", "LB SU"] and done.err.endswith("5 lines\n")
    assert _files(folder) == ["cell.toml", "moves.txt"]


def test_a_machine_goes_to_standard_output(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["snapshot", URL, "-o", "-"]) == 0
    done = capsys.readouterr()
    assert tomllib.loads(done.out)["bus"][0]["drive"][0]["name"] == "a"
    assert "1 drive\n" in done.err and _files(folder) == ["cell.toml", "moves.txt"]


def test_verbs_have_the_same_rule(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["send", URL, "/upload -", "/params backup -"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("PG 1\nLB SU\n") and "[parameters]" in out
    assert main(["send", URL, "/log -"]) == 2
    assert capsys.readouterr().err == "/log -: standard output has the replies; name a file\n"
    assert _files(folder) == ["cell.toml", "moves.txt"]


def test_a_report_is_shown_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "-o", "-"]) == 0
    assert capsys.readouterr().out.count("== packages") == 1 and _files(folder) == ["cell.toml", "moves.txt"]


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("none/r.xml", "none/r.xml: its folder does not exist; make the folder first\n"),
        ("-", "--junit -: standard output has the replies; name a file for the report\n"),
        (LONG, f"{LONG}: the report cannot be written: File name too long\n"),
    ],
)
def test_a_place_that_takes_no_report_is_refused_before_anything_is_sent(
    folder: Path, capsys: pytest.CaptureFixture[str], file: str, said: str
) -> None:
    assert main(["run", "moves.txt", "--on", URL, "--junit", file]) == 2
    assert capsys.readouterr() == ("", said)
    assert _files(folder) == ["cell.toml", "moves.txt"]


@for_each("name", ["", LONG, "none/f"])
def test_a_name_that_no_file_can_have_is_refused_before_a_drive_is_read(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    for command in (["program", "upload", URL], ["params", "backup", URL], ["snapshot", URL, "-o"]):
        assert main([*command, name]) == 2
        (said,) = capsys.readouterr().err.splitlines()
        assert said.partition(": ")[0] == (name or '""')


def test_a_log_of_such_a_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "show", LONG]) == 2
    assert capsys.readouterr() == ("", f"{LONG}: cannot be read: File name too long\n")


def test_an_empty_path_allows_a_cell_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "cell.toml", "--allow", ""]) == 2
    assert "name the path" in capsys.readouterr().err
