"""`multidrop program check|list|upload|download` from outside, for both languages."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from multidrop.__main__ import main
from multidrop.dialects.pmx.manual.script_compiler import LINES
from tests.support.pmx_programs import STEP_PER_EDGE, TEN_TIMES, plain
from tests.support.processes import Running

MCODE = "VA Q1=7\nPG 1\nLB SU\n  MR Q1  ' far\n  H\n  BR SU,Q1<9\nE\nPG\nS\n"
CELL = """
[[bus]]
name = "line"
serve = ["tcp://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCM"
name = "a"
[[bus]]
name = "pmx"
serve = ["tcp://127.0.0.1:0"]
[[bus.drive]]
personality = "PMX"
name = "07"
"""


@dataclass
class Done:
    code: int
    out: str
    err: str


Program = Callable[..., Done]


@pytest.fixture
def program(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Program:
    files = {"a.mxt": MCODE, "a.prg": TEN_TIMES, "longer.asc": STEP_PER_EDGE}
    for name, text in {**files, "cell.toml": CELL}.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Done:
        return Done(main(["program", *arguments]), *capsys.readouterr())

    return run


@pytest.fixture
def served(tmp_path: Path, program: Program) -> Iterator[dict[str, str]]:
    """The cell's buses, served in a process of their own, so that what is stored outlives a command."""
    running = Running("sim", "cell.toml", "--json", folder=tmp_path)
    try:
        lines = running.until('{"ready": true}')
        found = [json.loads(line) for line in lines]
        yield {each["bus"]: each["endpoint"] for each in found if "bus" in each}
    finally:
        running.process.terminate()
        running.end()


def test_files_that_are_right_are_exit_0_and_say_how_much_memory_they_take(program: Program) -> None:
    done = program("check", "a.mxt", "a.prg")
    assert done.code == 0 and done.err == ""
    assert done.out.splitlines() == [
        "a.mxt: nothing wrong, 5 lines of program",
        f"a.prg: nothing wrong, 23 of {LINES} compiled lines",
    ]


def test_every_problem_is_a_line_with_file_line_and_column(program: Program, tmp_path: Path) -> None:
    (tmp_path / "b.prg").write_text("PRG 0\n  FROB\nWHILE 1=1\nEND\n")
    (tmp_path / "b.mxt").write_text("PG 1\nLB K1\n  BR K2\n  MR (\nE\nPG\n")
    done = program("check", "b.prg", "b.mxt")
    assert done.code == 1 and done.out == ""
    places = [line.split(" ")[0] for line in done.err.splitlines()]
    assert places == ["b.prg:2:3:", "b.prg:3:1:", "b.mxt:3:6:", "b.mxt:4:6:"]
    (first, *_, last) = [json.loads(line) for line in program("check", "--json", "b.prg").out.splitlines()]
    assert (first["line"], first["column"], last["errors"]) == (2, 3, 2) and "FROB" in first["error"]


def test_what_only_the_drive_refuses_is_found_too(program: Program, tmp_path: Path) -> None:
    (tmp_path / "c.mxt").write_text("MS=7\nPG 1\nE\nPG\n")
    done = program("check", "c.mxt")
    assert done.code == 1 and done.err.startswith("c.mxt:1:1: MS=7: error 21, ")


def test_the_language_can_be_said(program: Program, tmp_path: Path) -> None:
    (tmp_path / "a.text").write_text(TEN_TIMES)
    assert program("check", "a.text").code == 1
    assert program("check", "a.text", "--language", "pmx").code == 0


def test_a_file_that_cannot_be_read_is_exit_2(program: Program) -> None:
    done = program("check", "gone.prg", "a.prg")
    assert done.code == 2 and done.err.startswith("gone.prg: cannot be read")


@pytest.mark.process
def test_a_script_goes_to_the_simulated_controller_and_comes_back(
    program: Program, served: dict[str, str], tmp_path: Path
) -> None:
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "longer.asc").code == 0
    assert program("download", url, "a.prg").code == 0
    listed = program("list", url)
    assert listed.code == 0 and plain(listed.out) == plain(TEN_TIMES)
    assert program("upload", url, "raw.prg", "--raw", "--drive", "07").code == 0
    raw = (tmp_path / "raw.prg").read_text().splitlines()
    assert raw[0] == "SA0=&HSPD=$20000" and raw[-1] == "SA22=XX"
    assert program("upload", url, "raw.prg").code == 2
    assert program("download", url, "raw.prg").code == 0
    assert program("upload", url, "text.prg").code == 0
    assert program("check", "text.prg").code == 0 and plain((tmp_path / "text.prg").read_text()) == plain(TEN_TIMES)


@pytest.mark.process
def test_lines_of_a_unit_are_listed_as_they_are(program: Program, served: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "unit.prg").write_text("SA0=PS0\nSA1=CV5\nSA2=&1038$0\nSA3=XX\n")
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "unit.prg").code == 0
    listed = program("list", url).out.splitlines()
    assert listed[0].startswith("; compiled lines") and "line 2" in listed[0]
    assert listed[1:] == ["SA0=PS0", "SA1=CV5", "SA2=&1038$0", "SA3=XX"]
    assert program("upload", url, "kept.prg").code == 0 and program("download", url, "kept.prg").code == 0


@pytest.mark.process
def test_bare_lines_are_checked_run_downloaded_and_come_back_as_the_program(
    program: Program, served: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "bare.prg").write_text("; V10=V1*10, until it is 1000\nPS0\nCV1\nVR10\nAM\nVR10\nCV1000\nJW2$2\nJR6\n"
                                       "CV10\nVR10\nVR10\nOX3\nJM-6\nXX\n")  # fmt: skip
    assert program("check", "bare.prg").out == f"bare.prg: nothing wrong, 14 of {LINES} compiled lines\n"
    assert program("test", "bare.prg").code == 0
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "bare.prg").code == 0
    assert plain(program("list", url).out) == ["PRG 0", "V10=1", "WHILE V10<1000", "V10=V10*10", "ENDWHILE", "END"]
    assert program("upload", url, "kept.prg").code == 0 and program("download", url, "kept.prg").code == 0


@pytest.mark.process
def test_a_line_that_only_a_unit_knows_warns_is_put_into_a_drive_and_fails_by_name(
    program: Program, served: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "unit.prg").write_text("PS0\nEI0\n&84$250000\nXX\n")
    done = program("check", "unit.prg")
    assert done.code == 0 and done.err.startswith("unit.prg:3:1: warning: the simulated controller ends in an error at")
    done = program("test", "unit.prg")
    assert done.code == 1 and done.err.startswith("unit.prg:3: program 0 at ") and "'&84$250000'" in done.err
    assert program("download", served["pmx"] + "?dialect=pmx&drives=07", "unit.prg").code == 0


@pytest.mark.process
def test_a_program_of_mcode_comes_back_as_a_file_that_loads(
    program: Program, served: dict[str, str], tmp_path: Path
) -> None:
    url = served["line"]
    assert program("upload", url, "none.mxt").code == 1
    assert program("download", url, "a.mxt").code == 0
    assert program("list", url).out.splitlines()[0].endswith("LB SU")
    assert program("upload", url, "kept.mxt", "--raw").code == 0
    kept = (tmp_path / "kept.mxt").read_text().splitlines()
    assert kept == ["VA Q1=7", "PG 1", "LB SU", "MR Q1", "H", "BR SU,Q1<9", "E", "PG", "S"]
    assert program("check", "kept.mxt").code == 0
    assert program("upload", url, "remarked.mxt").code == 0
    assert (tmp_path / "remarked.mxt").read_text() == MCODE


@pytest.mark.process
def test_a_backup_may_have_any_name(program: Program, served: dict[str, str]) -> None:
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "a.prg").code == 0
    assert program("upload", url, "kept.txt", "--raw").code == 0
    assert program("download", url, "kept.txt").code == 0


@pytest.mark.process
def test_a_program_in_another_language_is_told_as_that(program: Program, served: dict[str, str]) -> None:
    done = program("download", served["line"], "a.prg")
    assert done.code == 2 and "a.prg: is A-SCRIPT, and" in done.err
    done = program("download", served["pmx"] + "?dialect=pmx&drives=07", "a.mxt")
    assert done.code == 2 and "a.mxt: is MCode, and 07 runs A-SCRIPT" in done.err


@pytest.mark.parametrize("arguments", [("download", "gone.prg"), ("download", "bad.prg")])
def test_a_file_that_is_wrong_is_found_before_anything_is_opened(
    program: Program, tmp_path: Path, arguments: tuple[str, str]
) -> None:
    (tmp_path / "bad.prg").write_text("FROB\n")
    done = program(arguments[0], "tcp://127.0.0.1:1", arguments[1])
    assert done.code == 2 and len(done.err.splitlines()) == 1 and arguments[1] in done.err
