"""All that a download says: its backup, what ran at once, what is saved, and what is not as it was sent."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.cell_session import CellSession, bus, drive, party, pmx
from tests.support.said import said

pytestmark = pytest.mark.virtual

TEXT = "PG 100\nLB Ga\nR1=5\nE\nPG\n"
OLD = "program_text = '''\nPG 1\nLB Gz\nE\nPG\n'''"
NOT_SAVED = "= line:a: not saved: what is not saved is lost at power-off; --save sends S"


@pytest.fixture
async def shop(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cell = (
        bus("line", party("a", OLD), party("b"), baud=0),
        bus("pmx", pmx("00"), baud=0),
        bus("m", drive("TMCM"), baud=0),
    )
    async with CellSession(tmp_path, *cell) as made:
        yield made


async def downloaded(shop, text, options="", file="p.mxt"):
    """What a download says, without its backup."""
    Path(file).write_text(text)
    return [each for each in await said(shop, f"/download {file} {options}".strip()) if "backup: " not in each]


SAVED = {
    "not saved": (TEXT, "", [NOT_SAVED]),
    "saved by the option": (TEXT, "--save", ["= line:a: saved (S)"]),
    "saved by the file": (f"{TEXT}S\n", "--save", ["= line:a: saved (S in the file)"]),
}


@pytest.mark.parametrize(("text", "option", "says"), SAVED.values(), ids=SAVED)
async def test_what_is_saved_is_said(shop, text, option, says):
    lines = await downloaded(shop, text, f"line:a {option}")
    assert [each for each in lines if "saved" in each] == says
    assert lines[-1] == "= line:a: verified, 3 lines"


async def test_what_was_executed_at_once_is_said(shop):
    lines = await downloaded(shop, f"VA Q1=0\nVM=500000\nA=60000\n{TEXT}", "line:a")
    (sent,) = [each for each in lines if "downloaded" in each]
    assert sent == "= line:a: p.mxt downloaded, 8 lines; executed at once: VM=500000, A=60000"


async def test_the_backup_has_the_drive_its_names_and_its_program(shop):
    Path("p.mxt").write_text(TEXT)
    (line,) = [each for each in await said(shop, "/download p.mxt line:a") if "backup: " in each]
    path = Path(line.partition("backup: ")[2])
    assert re.fullmatch(r"[\d-]+-line-a\.mxt", path.name)
    text = re.sub(r"\d{4}-\d\d-\d\d \S+", "TIME", path.read_text())
    assert text == (
        "' multidrop backup of line, drive a, TIME\n"
        "' LMDCM; LMDCM 6.002, Hw: 3.2; part LMDCM571; serial 040100097\n"
        "' names in the drive:\n"
        "'   GZ = 1\n"
        "PG 1\nLB Gz\nE\nPG\nS\n"
    )


async def test_the_backup_of_an_empty_drive_says_so(shop):
    Path("p.mxt").write_text(TEXT)
    (line,) = [each for each in await said(shop, "/download p.mxt line:b") if "backup: " in each]
    text = Path(line.partition("backup: ")[2]).read_text()
    assert "' no names\n" in text and "' the drive holds no program and no variable\n" in text


async def test_only_what_changed_is_sent_and_nothing_where_it_is_the_same(shop):
    await downloaded(shop, TEXT, "line:a")
    lines = await downloaded(shop, TEXT.replace("R1=5", "R1=6"), "line:a --only-changed", "q.mxt")
    assert lines[-1] == "= line:a: verified, 3 lines" and b"R1=6" in shop.written("line")
    assert await said(shop, "/download q.mxt line:a --only-changed") == [
        "= line:a: holds q.mxt already; nothing was sent"
    ]
    assert b"R1=6" not in shop.written("line")


async def test_a_file_of_another_language_is_named_and_nothing_is_sent(shop):
    lines = await downloaded(shop, "PRG 0\nX1000\nWAITX\nEND\n", "line:a")
    assert lines == ["x p.mxt: is A-SCRIPT, and line:a runs MCode"]
    assert b"PRG" not in shop.written("line")


async def test_a_program_that_runs_is_ended_first_and_that_is_said(shop):
    await downloaded(shop, "PG 100\nLB Ga\nH 60000\nE\nPG\n", "line:a")
    await said(shop, "@line:a EX Ga")
    lines = await downloaded(shop, TEXT, "line:a")
    assert "! line:a: its program ran and was ended" in lines and lines[-1] == "= line:a: verified, 3 lines"
