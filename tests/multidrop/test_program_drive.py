"""`multidrop program check|list|diff|upload|download` from outside, for both languages."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest

from multidrop.families.pmx.manual.script_compiler import MEMORY_LINES
from tests.support.cell_session import TCP, bus, drive, pmx
from tests.support.front_door import Command, Home
from tests.support.pmx_programs import STEP_PER_EDGE, TEN_TIMES, plain

MCODE = "VA Q1=7\nPG 1\nLB SU\n  MR Q1  ' far\n  H\n  BR SU,Q1<9\nE\nPG\nS\n"
CELL = bus("line", drive("LMDCM", "a"), baud=0, serve=TCP) + bus("pmx", pmx("07"), baud=0, serve=TCP)


FILES = {"a.mxt": MCODE, "a.prg": TEN_TIMES, "longer.asc": STEP_PER_EDGE}


@pytest.fixture
def program(home: Home) -> Command:
    for name, text in FILES.items():
        home.file(name, text)
    return partial(home.run, "program")


@pytest.fixture
def served(home: Home) -> dict[str, str]:
    """The cell's buses, served in a process of their own, so that what is stored outlives a command."""
    return {bus: found["tcp"] for bus, found in home.serve(CELL).endpoints.items()}


def test_files_that_are_right_are_exit_0_and_say_how_much_memory_they_take(program: Command) -> None:
    done = program("check", "a.mxt", "a.prg")
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.splitlines() == [
        "a.mxt: nothing wrong, 5 lines of program",
        f"a.prg: nothing wrong, 23 of {MEMORY_LINES} compiled lines",
    ]


def test_every_problem_is_a_line_with_file_line_and_column(program: Command, tmp_path: Path) -> None:
    (tmp_path / "b.prg").write_text("PRG 0\n  FROB\nWHILE 1=1\nEND\n")
    (tmp_path / "b.mxt").write_text("PG 1\nLB K1\n  BR K2\n  MR (\nE\nPG\n")
    done = program("check", "b.prg", "b.mxt")
    assert done.returncode == 1 and done.stdout == ""
    places = [line.split(" ")[0] for line in done.stderr.splitlines()]
    assert places == ["b.prg:2:3:", "b.prg:3:1:", "b.mxt:3:6:", "b.mxt:4:6:"]
    (first, *_, last) = [json.loads(line) for line in program("check", "--json", "b.prg").stdout.splitlines()]
    assert (first["line"], first["column"], last["errors"]) == (2, 3, 2) and "FROB" in first["error"]


def test_what_only_the_drive_refuses_is_found_too(program: Command, tmp_path: Path) -> None:
    (tmp_path / "c.mxt").write_text("MS=7\nPG 1\nE\nPG\n")
    done = program("check", "c.mxt")
    assert done.returncode == 1 and done.stderr.startswith("c.mxt:1:1: MS=7: error 21, ")


def test_the_language_can_be_said(program: Command, tmp_path: Path) -> None:
    (tmp_path / "a.text").write_text(TEN_TIMES)
    assert program("check", "a.text").returncode == 1
    assert program("check", "a.text", "--language", "pmx").returncode == 0


def test_a_file_that_cannot_be_read_is_exit_2(program: Command) -> None:
    done = program("check", "gone.prg", "a.prg")
    assert done.returncode == 2 and done.stderr.startswith("gone.prg: cannot be read")


@pytest.mark.process
def test_a_script_goes_to_the_simulated_controller_and_comes_back(
    program: Command, served: dict[str, str], tmp_path: Path
) -> None:
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "longer.asc").returncode == 0
    assert program("download", url, "a.prg").returncode == 0
    listed = program("list", url)
    assert listed.returncode == 0 and plain(listed.stdout) == plain(TEN_TIMES)
    assert program("upload", url, "raw.prg", "--raw", "--drive", "07").returncode == 0
    raw = (tmp_path / "raw.prg").read_text().splitlines()
    assert raw[0] == "SA0=&HSPD=$20000" and raw[-1] == "SA22=XX"
    assert program("upload", url, "raw.prg").returncode == 2
    assert program("download", url, "raw.prg").returncode == 0
    assert program("upload", url, "text.prg").returncode == 0
    assert program("check", "text.prg").returncode == 0 and plain((tmp_path / "text.prg").read_text()) == plain(
        TEN_TIMES
    )


@pytest.mark.process
def test_lines_of_a_unit_are_listed_as_they_are(program: Command, served: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "unit.prg").write_text("SA0=PS0\nSA1=CV5\nSA2=&1038$0\nSA3=XX\n")
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "unit.prg").returncode == 0
    listed = program("list", url).stdout.splitlines()
    assert listed[0].startswith("; compiled lines") and "line 2" in listed[0]
    assert listed[1:] == ["SA0=PS0", "SA1=CV5", "SA2=&1038$0", "SA3=XX"]
    assert program("upload", url, "kept.prg").returncode == 0 and program("download", url, "kept.prg").returncode == 0


@pytest.mark.process
def test_bare_lines_are_checked_run_downloaded_and_come_back_as_the_program(
    program: Command, served: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "bare.prg").write_text("; V10=V1*10, until it is 1000\nPS0\nCV1\nVR10\nAM\nVR10\nCV1000\nJW2$2\nJR6\n"
                                       "CV10\nVR10\nVR10\nOX3\nJM-6\nXX\n")  # fmt: skip
    assert program("check", "bare.prg").stdout == f"bare.prg: nothing wrong, 14 of {MEMORY_LINES} compiled lines\n"
    assert program("test", "bare.prg").returncode == 0
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "bare.prg").returncode == 0
    assert plain(program("list", url).stdout) == ["PRG 0", "V10=1", "WHILE V10<1000", "V10=V10*10", "ENDWHILE", "END"]
    assert program("upload", url, "kept.prg").returncode == 0 and program("download", url, "kept.prg").returncode == 0


@pytest.mark.process
def test_a_line_that_only_a_unit_knows_warns_is_put_into_a_drive_and_fails_by_name(
    program: Command, served: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "unit.prg").write_text("PS0\nEI0\n&84$250000\nXX\n")
    done = program("check", "unit.prg")
    assert done.returncode == 0 and done.stderr.startswith(
        "unit.prg:3:1: warning: the simulated controller ends in an error at"
    )
    done = program("test", "unit.prg")
    assert (
        done.returncode == 1 and done.stderr.startswith("unit.prg:3: program 0 at ") and "'&84$250000'" in done.stderr
    )
    assert program("download", served["pmx"] + "?dialect=pmx&drives=07", "unit.prg").returncode == 0


@pytest.mark.process
def test_a_program_of_mcode_comes_back_as_a_file_that_loads(
    program: Command, served: dict[str, str], tmp_path: Path
) -> None:
    url = served["line"]
    assert program("upload", url, "none.mxt").returncode == 1
    assert program("download", url, "a.mxt").returncode == 0
    assert program("list", url).stdout.splitlines()[0].endswith("LB SU")
    assert program("upload", url, "kept.mxt", "--raw").returncode == 0
    kept = (tmp_path / "kept.mxt").read_text().splitlines()
    assert kept == ["VA Q1=7", "PG 1", "LB SU", "MR Q1", "H", "BR SU,Q1<9", "E", "PG", "S"]
    assert program("check", "kept.mxt").returncode == 0
    assert program("upload", url, "remarked.mxt").returncode == 0
    assert (tmp_path / "remarked.mxt").read_text() == MCODE


@pytest.mark.process
def test_a_backup_may_have_any_name(program: Command, served: dict[str, str]) -> None:
    url = served["pmx"] + "?dialect=pmx&drives=07"
    assert program("download", url, "a.prg").returncode == 0
    assert program("upload", url, "kept.txt", "--raw").returncode == 0
    assert program("download", url, "kept.txt").returncode == 0


@pytest.mark.process
def test_a_program_in_another_language_is_told_as_that(program: Command, served: dict[str, str]) -> None:
    done = program("download", served["line"], "a.prg")
    assert done.returncode == 2 and "a.prg: is A-SCRIPT, and" in done.stderr
    done = program("download", served["pmx"] + "?dialect=pmx&drives=07", "a.mxt")
    assert done.returncode == 2 and "a.mxt: is MCode, and 07 runs A-SCRIPT" in done.stderr


@pytest.mark.parametrize("arguments", [("download", "gone.prg"), ("download", "bad.prg")])
def test_a_file_that_is_wrong_is_found_before_anything_is_opened(
    program: Command, tmp_path: Path, arguments: tuple[str, str]
) -> None:
    (tmp_path / "bad.prg").write_text("FROB\n")
    done = program(arguments[0], "tcp://127.0.0.1:1", arguments[1])
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and arguments[1] in done.stderr


@pytest.mark.process
@pytest.mark.parametrize(
    ("bus", "file", "changed", "number"),
    [("line", "a.mxt", ("MR Q1", "MR 8"), 4), ("pmx", "a.prg", ("X1000", "X1001"), 0)],
)
def test_a_file_and_a_drive_are_compared_line_by_line(
    program: Command, served: dict[str, str], tmp_path: Path, bus: str, file: str, changed: tuple[str, str], number: int
) -> None:
    url = f"{served[bus]}?drives=07&dialect=pmx" if bus == "pmx" else served[bus]
    assert program("download", url, file).returncode == 0
    same = program("diff", file, url)
    assert (same.returncode, same.stdout) == (0, "") and f"holds {file}" in same.stderr
    other = "other" + Path(file).suffix
    (tmp_path / other).write_text(FILES[file].replace(*changed))
    done = program("diff", other, url)
    assert done.returncode == 1 and done.stderr == ""
    found = [json.loads(line) for line in program("diff", other, url, "--json").stdout.splitlines()]
    assert len(found) == len(done.stdout.splitlines()) > 0
    assert [*found[0]] == ["drive", "line", "here", "at", "there"]
    if number:
        assert done.stdout == f"{other}:{number}: here 'MR 8', in 127.0.0.1 'MR Q1' at {found[0]['at']}\n"
        assert (found[0]["line"], found[0]["here"], found[0]["there"]) == (number, "MR 8", "MR Q1")
    listed = [json.loads(line) for line in program("list", url, "--json").stdout.splitlines()]
    assert listed and all([*each] == ["drive", "at", "text"] for each in listed)


def test_a_wrong_file_is_told_before_anything_is_opened(program: Command, tmp_path: Path) -> None:
    (tmp_path / "c.mxt").write_text("PG 1\nMR 100\nE\n")
    done = program("diff", "c.mxt", "tcp://127.0.0.1:1")
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.startswith("c.mxt:1:1: PG is never ended")
