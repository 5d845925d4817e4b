"""Lines of a program file outside of its programs: settings are sent, what acts is agreed to or nothing is sent."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.families.lexium.manual import program_checker
from multidrop.shell.events import By
from tests.support.cases import for_each
from tests.support.transfers import kept, load, shop_with

pytestmark = pytest.mark.virtual

PROGRAM = "PG 1\nLB G1\nMR 100\nH\nE\nPG\n"
ACTING = ("SL 5000", "MA 200", "MR -5", "HM 1", "EX G1", 'DN="q"', "FD", "CP", "BD=96", "AS=3", "LK=1", "IP", "TE=1")
SETTING = ("VM=500000", "VA Q1=5", "Q1=7", "OE G1", "SL 0", "DE=1", "AS=1", "IS=1,16,1", "S", "TE=0")


@for_each("line", ACTING)
def test_a_check_warns_of_a_line_that_acts_and_of_no_setting(line: str) -> None:
    for text, number in ((f"{line}\n{PROGRAM}", 1), (f"{PROGRAM}{line}\n", 7)):
        warned = [each.line for each in program_checker.check(text) if "outside of PG" in each.what]
        assert warned == [number], text
    assert not any("outside of PG" in each.what for each in program_checker.check(PROGRAM.replace("MR 100", line)))


@for_each("line", SETTING)
def test_a_check_warns_of_no_setting(line: str) -> None:
    text = f"VA Q1=5\n{PROGRAM}{line}\n"
    assert not any("outside of PG" in each.what for each in program_checker.check(text)), line


async def test_nothing_is_sent_of_a_file_with_a_line_that_acts(tmp_path: Path) -> None:
    for line in ("SL 5000", "EX G1", 'DN="q"', "FD", "CP"):
        for text in (f"{line}\n{PROGRAM}", f"{PROGRAM}{line}\nS\n"):
            async with shop_with(tmp_path, text) as shop:
                await asyncio.sleep(1.0)
                shop.events.clear()
                shop.session.questions.agreed = False
                with pytest.raises(Diagnostic, match=f"line [17]: .*'{line}'.*nothing was sent"):
                    await load(shop, tmp_path)
                for by in (By.SCRIPT, By.MACRO):
                    with pytest.raises(Diagnostic, match=f"a {by.value} cannot ask, nothing was sent"):
                        await shop.session.run(f"/download {tmp_path / 'p.mxt'} a", replace(shop.session.origin, by=by))
                assert b"SL" not in shop.written("line") and b"PG" not in shop.written("line")
                assert not kept(tmp_path) and not shop.moving()


async def test_a_person_agrees_to_the_listed_lines_once(tmp_path: Path) -> None:
    async with shop_with(tmp_path, f"VM=500000\n{PROGRAM}EX G1\n") as shop:
        asked = []

        async def ask(question: str) -> bool:
            asked.append(question)
            return len(asked) > 1

        shop.session.front.ask, shop.session.questions.agreed = ask, False
        with pytest.raises(Diagnostic, match="the answer was no"):
            await load(shop, tmp_path)
        assert b"VM" not in shop.written("line") and not kept(tmp_path)
        told = await load(shop, tmp_path, "--no-verify")
        assert len(asked) == 2 and "line 8: 'EX G1' starts motion or a program" in asked[1]
        at = [next(n for n, each in enumerate(told) if word in each) for word in ("backup: ", "downloaded, 8 lines")]
        assert at == sorted(at) and told[at[1]].endswith("; executed at once: VM=500000, EX G1")
        sent = shop.written("line")
        assert sent.index(b"PG 1") < sent.index(b"EX G1") and shop.moving() == {"line:a"}


async def test_a_download_that_fails_stops_what_its_lines_have_moved(tmp_path: Path) -> None:
    async with shop_with(tmp_path, f"SL 5000\n{PROGRAM}") as shop:
        with pytest.raises(DriveError):  # a drive that moves stores no program
            await load(shop, tmp_path)
        assert b"SL 5000" in shop.written("line") and not shop.moving()


async def test_settings_and_the_closing_s_need_no_yes(tmp_path: Path) -> None:
    async with shop_with(tmp_path, f"VM=500000\n{PROGRAM}S\n") as shop:
        shop.session.questions.agreed = False
        told = await load(shop, tmp_path)
        assert "a: p.mxt downloaded, 8 lines; executed at once: VM=500000, S" in told


async def test_a_cp_that_the_download_needs_is_not_asked_about(tmp_path: Path) -> None:
    async with shop_with(tmp_path, PROGRAM) as shop:
        await load(shop, tmp_path)
        (tmp_path / "p.mxt").write_text(PROGRAM.replace("MR 100", "MR 7"))
        shop.session.questions.agreed = False
        await load(shop, tmp_path)
        assert b"CP" in shop.written("line")
