"""Downloads from a session: the backup, saving, starting, reading back; uploads with remarks."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.events import ProgramRead, Progressed
from multidrop.shell.line_syntax import showing
from multidrop.shell.state.backups import write_backup
from tests.support.cell_session import CellSession, bus, pmx
from tests.support.transfers import FILE, LISTED, LONG, SLOW, kept, load, shop_with

pytestmark = pytest.mark.virtual


async def test_a_download_says_what_it_has_done(tmp_path: Path, shop: CellSession) -> None:
    told = await load(shop, tmp_path)
    (path,) = kept(tmp_path)
    assert told == [
        f"backup: data/backups/{path.name}",
        "a: p.mxt downloaded, 7 lines",
        "a: not saved: what is not saved is lost at power-off; --save sends S",
        "a: verified, 4 lines",
    ]
    assert shop.device("line:a").program.listing() == LISTED


async def test_the_backup_is_a_file_that_brings_back_what_was_there(tmp_path: Path, shop: CellSession) -> None:
    await load(shop, tmp_path)
    for line in ("@a VA Z1=5", "@a Q1=-3", "@a EX G1", "/wait idle"):
        await shop.session.run(line)
    (tmp_path / "p.mxt").write_text("PG 1\nLB G7\nE\nPG\n")
    await load(shop, tmp_path)
    path = kept(tmp_path)[-1]
    lines = path.read_text().splitlines()
    assert lines[0].startswith("' multidrop backup of line, drive a, ") and "LMDCM" in lines[1]
    assert "'   G1 = 1" in lines and "'   Q1 = G -3" in lines
    assert lines[-9:] == ["VA Q1=-3", "VA Z1=5", "PG 1", "LB G1", "MR 100", "H", "E", "PG", "S"]
    await shop.session.run("@a Q1=1")
    await shop.session.run(f"/download {path} a")
    assert shop.device("line:a").program.listing() == LISTED
    await shop.session.run("@a PR Q1")
    assert shop.printed() == ["-3"]


async def test_an_empty_drive_has_a_backup_too_and_none_replaces_another(tmp_path: Path, shop: CellSession) -> None:
    for _ in range(3):
        await load(shop, tmp_path, "--no-verify")
    first, *others = kept(tmp_path)
    assert "holds no program" in first.read_text() and len(others) == 2
    assert all("LB G1" in each.read_text() for each in others)


def test_a_backup_never_takes_the_name_of_another(tmp_path: Path) -> None:
    from datetime import UTC, datetime

    at = datetime(2026, 11, 22, 10, 5, 37, tzinfo=UTC)
    names = [write_backup(tmp_path, at, "bus/x", "a", ".mxt", "' LMDCM\n").name for _ in range(3)]
    assert names == [f"2026-11-22-100537-bus%2Fx-a{more}.mxt" for more in ("", "-2", "-3")]


async def test_a_wrong_file_ends_it_before_anything_is_sent(tmp_path: Path) -> None:
    async with shop_with(tmp_path, "PG 1\nLB G1\nFROB 7\nE\nPG\n") as shop:
        with pytest.raises(Diagnostic, match=r"p.mxt:3:1: unknown name FROB"):
            await load(shop, tmp_path)
        assert shop.written("line") == b"" and not kept(tmp_path)


async def test_saving_lasts_and_is_said(tmp_path: Path, shop: CellSession) -> None:
    (tmp_path / "p.mxt").write_text(f"{FILE}S\n")
    assert "a: saved (S in the file)" in await load(shop, tmp_path, "--save")
    (tmp_path / "p.mxt").write_text(FILE.replace("100", "200"))
    assert "a: saved (S)" in await load(shop, tmp_path, "--save")
    shop.device("line:a").reset(shop.session.now())
    assert "6  MR 200" in shop.device("line:a").program.listing()


async def test_a_program_is_started_after_it_was_verified(tmp_path: Path, shop: CellSession) -> None:
    with pytest.raises(Diagnostic, match=r"no label G9 in the file \(nothing was sent\); labels: G1"):
        await load(shop, tmp_path, "--run G9")
    assert shop.written("line") == b""
    told = await load(shop, tmp_path, "--run g1")
    assert told[-2:] == ["a: verified, 4 lines", "a: started (EX G1)"]
    await shop.session.run("/wait idle")
    await shop.session.run("@a PR P")
    assert shop.printed()[-1] == "100"


async def test_a_changed_file_is_preceded_by_a_backup_of_what_the_drive_holds(
    tmp_path: Path, shop: CellSession
) -> None:
    await load(shop, tmp_path)
    (tmp_path / "p.mxt").write_text("PG 1\nLB G7\nE\nPG\n")
    told = await load(shop, tmp_path, "--only-changed")
    assert told.index("a: p.mxt downloaded, 4 lines") > 1 and told[1].startswith("backup: ")
    assert "LB G1" in kept(tmp_path)[-1].read_text()


@pytest.mark.slow
async def test_what_the_drive_holds_already_is_not_sent_again(tmp_path: Path) -> None:
    text = f"VM=400000\nIS=1,0,0\n{FILE}"
    async with shop_with(tmp_path, text) as shop:
        assert "is sent: line 6 differs" in (await load(shop, tmp_path, "--only-changed"))[0]
        saved = len(kept(tmp_path))
        assert await load(shop, tmp_path, "--only-changed") == ["a: holds p.mxt already; nothing was sent"]
        assert b"PG" not in shop.written("line") and len(kept(tmp_path)) == saved
        (tmp_path / "p.mxt").write_text(text.replace("' there", "' and more").replace("mr", "MR"))
        assert len(await load(shop, tmp_path, "--only-changed")) == 1
        (tmp_path / "p.mxt").write_text(f"D=A\n{text}")
        assert len(await load(shop, tmp_path, "--only-changed")) == 1
        for change in ("@a D=5000", "@a VM=300000", "@a Q1=8", "@a IS=1,0,1"):
            await shop.session.run(change)
            assert len(await load(shop, tmp_path, "--only-changed")) > 1
        for edit in ("OE G1\n", "LB G2\n"):
            (tmp_path / "p.mxt").write_text(text.replace("E\nPG\n", f"{edit}E\nPG\n"))
            assert len(await load(shop, tmp_path, "--only-changed")) > 1


@pytest.mark.slow
@pytest.mark.parametrize("personality", ["LMDOM", "LMM", "MDI", "MDIE", "MDIX"])
async def test_every_product_takes_an_edited_file_again_and_again(tmp_path: Path, personality: str) -> None:
    drive = f'personality = "{personality}"\nname = "a"\nparty = true'
    async with shop_with(tmp_path, FILE, bus("line", drive, baud=0)) as shop:
        for number in (100, 200, 300):
            (tmp_path / "p.mxt").write_text(
                FILE.replace("100", str(number)).replace("H\n", "H\n" * (4 - number // 100))
            )
            told = await load(shop, tmp_path, "--save", "--run G1")
            assert told[-1] == "a: started (EX G1)" and any("a: verified, " in text for text in told)
            await shop.session.run("/wait idle")
        await shop.session.run("@a PR P")
        assert shop.printed() == ["600"]


async def test_remarks_and_layout_come_back_with_the_present_values(tmp_path: Path, shop: CellSession) -> None:
    await load(shop, tmp_path)
    await shop.session.run("@a Q1=9")
    await shop.session.run("@a VA Z1=1")
    await shop.session.run(f"/upload {tmp_path / 'up.mxt'} a")
    made = FILE.replace("VA Q1=7 ", "VA Q1=9 ").replace("PG 1\n", "VA Z1=1\nPG 1\n")
    assert (tmp_path / "up.mxt").read_text() == made
    await shop.session.run("/list a")
    assert shop.printed() == ["1   LB G1", "6     MR 100  ' there", "10    H", "12  E"]
    await shop.session.run("@a PG 10")
    await shop.session.run("@a R1=5")
    await shop.session.run("@a PG")
    await shop.session.run(f"/upload {tmp_path / 'changed.mxt'} a")
    assert (tmp_path / "changed.mxt").read_text().splitlines()[2:-2] == ["PG 1", "LB G1", "MR 100", "R1=5"]


@pytest.mark.slow
async def test_progress_ends_with_each_part(tmp_path: Path) -> None:
    async with shop_with(tmp_path, LONG, SLOW) as shop:
        await load(shop, tmp_path)
        seen = [event for event in shop.events if isinstance(event, Progressed)]
        assert [event.what for event in seen if event.over] == ["a: backup", "a: download", "a: verify"]
        assert any(event.left and event.what == "a: download" for event in seen)


async def test_what_the_drive_holds_already_is_saved_and_executed_where_that_is_wanted(
    tmp_path: Path, shop: CellSession
) -> None:
    await load(shop, tmp_path)
    assert await load(shop, tmp_path, "--only-changed --save") == [
        "a: holds p.mxt already; the program is not sent again",
        "a: saved (S)",
    ]
    assert b"PG" not in shop.written("line") and len(kept(tmp_path)) == 1
    shop.device("line:a").reset(shop.session.now())
    assert shop.device("line:a").program.listing() == LISTED
    with pytest.raises(Diagnostic, match=r"no label G9 in the file"):
        await load(shop, tmp_path, "--only-changed --run G9")
    told = await load(shop, tmp_path, "--only-changed --run G1")
    assert told[-2:] == ["a: holds p.mxt already; the program is not sent again", "a: started (EX G1)"]
    await shop.session.run("/wait idle")
    await shop.session.run("@a PR P")
    assert shop.printed()[-1] == "100"


async def test_a_held_program_that_runs_is_ended_before_it_is_executed_again(tmp_path: Path) -> None:
    async with shop_with(tmp_path, "PG 1\nLB G1\nH 100\nBR G1\nE\nPG\n") as shop:
        await load(shop, tmp_path, "--run G1")
        told = await load(shop, tmp_path, "--only-changed --save --run G1")
        assert told[-3:] == ["a: its program ran and was ended", "a: saved (S)", "a: started (EX G1)"]


PMX_FILE = "; ten times\nPRG 0\n  V1=1   ; from one\n  WHILE V1<1000\n    V1=V1*10\n  ENDWHILE\nEND\n"


@pytest.mark.slow
@pytest.mark.parametrize("usb", [False, True])
async def test_a_controller_has_the_same_options_as_far_as_its_words_go(tmp_path: Path, usb: bool) -> None:
    here, who = ("", "pmx") if usb else ("07", "07")
    async with shop_with(tmp_path, FILE, bus("pmx", pmx("07"), baud=0), usb=usb) as shop:
        file = tmp_path / "p.prg"
        file.write_text(PMX_FILE)
        await shop.session.run(f"/download {file} {here} --save --run 0")
        assert f"{who}: it keeps programs at once; --save sends nothing" in shop.told()
        assert shop.told()[-1] == f"{who}: started (SR0=1)" and any("verified, " in text for text in shop.told())
        await shop.session.run(f"/download {file} {here} --only-changed")
        assert shop.told()[-1].endswith("already; nothing was sent")
        await shop.session.run(f"/upload {tmp_path / 'up.prg'} {here}")
        assert (tmp_path / "up.prg").read_text() == PMX_FILE
        file.write_text("PRG 0\nWHILE 1=1\nV2=V2+1\nENDWHILE\nEND\n")
        with pytest.raises(Diagnostic, match=r"no program 1 in the file \(nothing was sent\); programs: 0"):
            await shop.session.run(f"/download {file} {here} --run 1")
        for _ in range(2):
            await shop.session.run(f"/download {file} {here} --run 0")
        assert f"{who}: its program ran and was ended" in shop.warned()
        backup = kept(tmp_path)[-1].read_text()
        assert (
            backup.startswith("; multidrop backup of pmx, " + ("drive 07, " if here else ""))
            and "\nSA0=" in backup
            and "V2 = " in backup
        )


# A text that was shown


async def test_a_download_of_a_text_that_was_shown_reads_no_file(tmp_path: Path, shop: CellSession) -> None:
    shown = "PG 1\nLB G1\n  MR 7\nE\nPG\n"
    for change in (lambda path: path.write_text("K9 wrong\n"), Path.unlink, Path.mkdir):
        change(tmp_path / "p.mxt")
        line = showing(f"/download {tmp_path / 'p.mxt'} a", shown)
        assert line is not None
        await shop.session.run(line)
        assert [text.split()[-1] for text in shop.device("line:a").program.listing()] == ["G1", "7", "E"]


async def test_a_wrong_text_that_was_shown_is_refused_though_the_file_is_right(
    tmp_path: Path, shop: CellSession
) -> None:
    for text, why in (
        ("K9\n", r"p\.mxt:1"),
        ("PG 1\nE\0\nPG\n", "not a text file"),
        ("\n" * 20_001, "more than 20000"),
    ):
        line = showing(f"/download {tmp_path / 'p.mxt'} a", text)
        assert line is not None
        with pytest.raises(Diagnostic, match=why):
            await shop.session.run(line)
    assert shop.device("line:a").program.listing() == []


async def test_what_was_read_of_a_program_is_not_known_once_lines_are_sent_that_change_it(
    tmp_path: Path, shop: CellSession
) -> None:
    def last() -> ProgramRead:
        return [each for each in shop.events if isinstance(each, ProgramRead)][-1]

    await load(shop, tmp_path)
    assert last().known and len(last().lines) == 4
    await shop.session.run("@a PR P")
    assert last().known  # which changes nothing
    await load(shop, tmp_path, "--no-verify")
    assert not last().known and last().lines == ()
    for line in ("@a PG 1", "@a CP"):
        await load(shop, tmp_path)
        shop.events.clear()
        shop.session.questions.agreed = True
        await shop.session.run(line)
        if line == "@a PG 1":
            assert not last().known
            await shop.session.run("@a PG")
    assert not last().known
