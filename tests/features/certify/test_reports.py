"""Reports of one drive of several: as they are written, compared, and read, beside a drive that prints without end."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.shell.batch.virtual_loop import VirtualLoop
from tests.support.cell_session import bus, drive, party, pmx
from tests.support.front_door import Command, Done, change_before_opening

CELL = bus("line", party("a", CK=0), party("b", CK=0), baud=0)
CELL += bus("pmx", pmx("07", 'program = "p.prg"'), baud=0)
FILES = {
    "p.prg": "PRG 0\nX1000\nWAITX\nEND\n",
    "noise.mxt": 'PG 1\nLB SU\n PR "noise"\n H 1\n BR SU\nE\nPG\n',
    "cell.toml": CELL,
    "noisy.toml": CELL + bus("noisy", drive("LMDCM", "", 'program = "noise.mxt"'), baud=0),
}
URL = "sim:cell.toml"


@pytest.fixture
def run(multidrop: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run commands beside these files; time does not wait."""
    runner = asyncio.Runner
    monkeypatch.setattr(asyncio, "Runner", lambda **more: runner(**more | {"loop_factory": VirtualLoop}))
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return multidrop


def test_what_another_drive_prints_meanwhile_is_not_in_what_a_program_reads(run: Command) -> None:
    quiet, noisy = (run("certify", url, "-o", "-", "--drive", "pmx:07") for url in (URL, "sim:noisy.toml"))
    assert quiet.stdout and noisy == quiet


def test_a_report_is_of_one_drive_and_is_compared(run: Command, tmp_path: Path) -> None:
    done = run("certify", URL, "-o", "r.toml", "--drive", "pmx:07")
    assert done == Done(0, "", "pmx:07: 15 questions answered, 0 not asked in r.toml\n")
    done = run("certify", URL, "--compare", "r.toml", "--drive", "pmx:07")
    assert done == Done(0, "", "pmx:07: 15 of 15 answers of r.toml are the same\n")
    changed = (tmp_path / "r.toml").read_text().replace('["?SAP"]', '["0"]')
    (tmp_path / "r.toml").write_text(changed)
    done = run("certify", URL, "--compare", "r.toml", "--drive", "pmx:07")
    assert (done.returncode, done.stdout) == (1, "polarity-word: here ?SAP; in r.toml 0\n")
    for names in (("all",), ("pmx:07", "line:a")):
        several = run("certify", URL, "-o", "x.toml", *(word for name in names for word in ("--drive", name)))
        assert several == Done(2, "", f"certify: --drive {','.join(names)}: a report is of one drive; name one\n")


def test_answers_are_compared_with_the_report_that_was_read(
    run: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run("certify", URL, "--drive", "line:a", "-o", "r.toml", "--yes").returncode == 0
    change_before_opening(monkeypatch, tmp_path / "r.toml", "wrong\n")
    done = run("certify", "--compare", "r.toml", URL, "--drive", "line:a", "--yes")
    assert done.returncode == 0 and "are the same" in done.stderr
