"""The output file `-` is standard output, or refused; no command makes a file of that name, or a folder."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from multidrop.__main__ import main

CELL = """
[[bus]]
name = "press"
[[bus.drive]]
personality = "LMDCM"
name = "a"
program_text = '''
PG 1
LB SU
E
PG
'''
"""
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
    ],
)
def test_a_place_that_takes_no_report_is_refused_before_anything_is_sent(
    folder: Path, capsys: pytest.CaptureFixture[str], file: str, said: str
) -> None:
    assert main(["run", "moves.txt", "--on", URL, "--junit", file]) == 2
    assert capsys.readouterr() == ("", said)
    assert _files(folder) == ["cell.toml", "moves.txt"]
