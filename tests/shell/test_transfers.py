"""Downloads from a session: the backup, the check, the program that runs, saving, reading back, and how they end."""

from __future__ import annotations

import asyncio
import errno
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from dialects import Diagnostic, Refused, Stopped
from dialects.errors import Differs
from shell import backups
from shell.events import Progressed
from tests.support.cell_session import CellSession, bus, party, pmx
from tests.support.until import until
from tests.support.virtual import in_virtual_time
from transports import TransportLost

LINE = bus("line", party("a"), party("b"), baud=0)
FILE = "VA Q1=7   ' times\n' the main program\nPG 1\nLB G1\n  MR 100  ' there\n  H\nE\nPG\n"
LISTED = ["1  LB G1", "6  MR 100", "10  H", "12  E"]


@asynccontextmanager
async def shop_with(folder: Path, text: str = FILE, *buses: str, reconnect: bool = False) -> AsyncIterator[CellSession]:
    (folder / "p.mxt").write_text(text)
    async with CellSession(folder, *(buses or (LINE,)), reconnect=reconnect) as shop:
        yield shop


def kept(folder: Path) -> list[Path]:
    return sorted((folder / "state" / "backups").glob("*.*"), key=lambda each: each.stat().st_mtime_ns)


async def load(shop: CellSession, folder: Path, *options: str, drive: str = "a") -> list[str]:
    """Download the file; return what was narrated, with the file's name for its path."""
    shop.events.clear()
    await shop.session.run(" ".join((f"/download {folder / 'p.mxt'} {drive}", *options)))
    return [text.replace(f"{folder}/", "") for text in shop.told()]


@in_virtual_time
async def test_a_download_says_what_it_has_done(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        told = await load(shop, tmp_path)
        (path,) = kept(tmp_path)
        assert told == [
            f"backup: state/backups/{path.name}",
            "a: p.mxt downloaded, 7 lines",
            "a: not saved: what is not saved is lost at power-off; --save sends S",
            "a: verified, 4 lines",
        ]
        assert shop.device("line:a").program.listing() == LISTED


@in_virtual_time
async def test_the_backup_is_a_file_that_brings_back_what_was_there(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
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


@in_virtual_time
async def test_an_empty_drive_has_a_backup_too_and_none_replaces_another(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        for _ in range(3):
            await load(shop, tmp_path, "--no-verify")
        first, *others = kept(tmp_path)
        assert "holds no program" in first.read_text() and len(others) == 2
        assert all("LB G1" in each.read_text() for each in others)


def test_a_backup_never_takes_the_name_of_another(tmp_path: Path) -> None:
    from datetime import UTC, datetime

    made = backups.Backup("bus/x", "a", datetime(2026, 11, 22, 10, 5, 37, tzinfo=UTC), "LMDCM", "'", ".mxt", (), ())
    names = [backups.write(tmp_path, made).name for _ in range(3)]
    assert names == [f"2026-11-22-100537-bus%2Fx-a{more}.mxt" for more in ("", "-2", "-3")]


@pytest.mark.parametrize("why", [errno.ENOSPC, errno.EACCES])
def test_without_a_backup_nothing_is_sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: int) -> None:
    def fails(*_: object) -> None:
        raise OSError(why, os.strerror(why))

    @in_virtual_time
    async def body() -> None:
        async with shop_with(tmp_path) as shop:
            monkeypatch.setattr("shell.backups.os.fsync", fails)
            with pytest.raises(Diagnostic, match="the backup cannot be written: .*; nothing was sent"):
                await load(shop, tmp_path)
            assert b"PG" not in shop.written("line") and not kept(tmp_path)

    body()


@in_virtual_time
async def test_a_wrong_file_ends_it_before_anything_is_sent(tmp_path: Path) -> None:
    async with shop_with(tmp_path, "PG 1\nLB G1\nFROB 7\nE\nPG\n") as shop:
        with pytest.raises(Diagnostic, match=r"p.mxt:3:1: unknown name FROB"):
            await load(shop, tmp_path)
        assert shop.written("line") == b"" and not kept(tmp_path)


@in_virtual_time
async def test_a_locked_program_is_said_and_left_as_it_is(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        await load(shop, tmp_path)
        await shop.session.run("@a LK=1")
        for line in (f"/download {tmp_path / 'p.mxt'} a", "/list a", f"/upload {tmp_path / 'new.mxt'} a"):
            with pytest.raises(Refused, match=r"its program is locked \(LK=1\)"):
                await shop.session.run(line)
        assert not shop.device("line:a").error_flag and not (tmp_path / "new.mxt").exists()


RUNNING = "PG 1\nLB G1\n  MR 2000000\n  H\n  BR G1\nE\nPG\nPG 200\nLB G2\n  R1=R1+1\n  BR G2\nE\nPG\n"


@pytest.mark.parametrize("label", ["G1", "G2"])
def test_a_program_that_runs_is_ended_and_its_motion_too(tmp_path: Path, label: str) -> None:
    @in_virtual_time
    async def body() -> None:
        async with shop_with(tmp_path, RUNNING) as shop:
            await load(shop, tmp_path, f"--run {label}")
            await asyncio.sleep(1.0)
            device = shop.device("line:a")
            assert device.running and bool(shop.moving()) is (label == "G1")
            told = await load(shop, tmp_path)
            assert "a: its program ran and was ended" in told and told[-1] == "a: verified, 9 lines"
            assert not device.running and not shop.moving()

    body()


@in_virtual_time
async def test_a_drive_that_moves_without_a_program_is_left_alone(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        await shop.session.run("@a SL 1000")
        with pytest.raises(Refused, match="a moves: stop it first"):
            await load(shop, tmp_path)
        assert shop.moving() == {"line:a"} and b"PG" not in shop.written("line")


@in_virtual_time
async def test_saving_lasts_and_is_said(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        (tmp_path / "p.mxt").write_text(f"{FILE}S\n")
        assert "a: saved (S in the file)" in await load(shop, tmp_path, "--save")
        (tmp_path / "p.mxt").write_text(FILE.replace("100", "200"))
        assert "a: saved (S)" in await load(shop, tmp_path, "--save")
        shop.device("line:a").reset(shop.session.now())
        assert "6  MR 200" in shop.device("line:a").program.listing()


@in_virtual_time
async def test_a_program_is_started_after_it_was_verified(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        with pytest.raises(Diagnostic, match=r"no label G9 in the file \(nothing was sent\); labels: G1"):
            await load(shop, tmp_path, "--run G9")
        assert shop.written("line") == b""
        told = await load(shop, tmp_path, "--run g1")
        assert told[-2:] == ["a: verified, 4 lines", "a: started (EX G1)"]
        await shop.session.run("/wait idle")
        await shop.session.run("@a PR P")
        assert shop.printed()[-1] == "100"


@in_virtual_time
async def test_what_the_drive_holds_already_is_not_sent_again(tmp_path: Path) -> None:
    text = f"VM=400000\nIS=1,0,0\n{FILE}"
    async with shop_with(tmp_path, text) as shop:
        assert "is sent: line 6 differs" in (await load(shop, tmp_path, "--only-changed"))[0]
        saved = len(kept(tmp_path))
        assert await load(shop, tmp_path, "--only-changed") == ["a: holds p.mxt already; nothing was sent"]
        assert b"PG" not in shop.written("line") and len(kept(tmp_path)) == saved
        (tmp_path / "p.mxt").write_text(text.replace("' there", "' and more").replace("mr", "MR"))
        assert len(await load(shop, tmp_path, "--only-changed")) == 1
        for change in ("@a VM=300000", "@a Q1=8", "@a IS=1,0,1"):
            await shop.session.run(change)
            assert len(await load(shop, tmp_path, "--only-changed")) > 1
        for edit in ("OE G1\n", "LB G2\n"):
            (tmp_path / "p.mxt").write_text(text.replace("E\nPG\n", f"{edit}E\nPG\n"))
            assert len(await load(shop, tmp_path, "--only-changed")) > 1


@in_virtual_time
async def test_a_difference_is_shown_line_by_line(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
        device = shop.device("line:a")
        execute = device.execute

        def deaf(text: str, now: float) -> object:  # stores another number than the one received
            return execute("MR 101" if text.strip() == "MR 100" else text, now)

        device.execute = deaf
        with pytest.raises(Differs, match="a: 1 line differs from .*; download it again"):
            await load(shop, tmp_path, "--run G1")
        assert any(text.endswith("p.mxt:5: here 'MR 100', in a 'MR 101' at 6") for text in shop.warned())
        assert any("what was in it before is in" in text for text in shop.warned())
        assert not device.running


@in_virtual_time
async def test_a_refused_line_is_named_with_its_file_and_the_backup(tmp_path: Path) -> None:
    async with shop_with(tmp_path, "PG 1\nLB G1\nVM=2\nE\nPG\nVM=2\n") as shop:
        with pytest.raises(Refused, match=r"p.mxt:6: a refused 'VM=2': error 2\d: .*; 3 lines are stored"):
            await load(shop, tmp_path)
        assert shop.warned()[-1] == f"a: what was in it before is in {kept(tmp_path)[0]}"
        assert (shop.device("line:a").programming, shop.device("line:a").echo_mode) == (None, 1)


LONG = "PG 1\nLB G1\n" + "R1=R1+1\n" * 200 + "E\nPG\n"


@in_virtual_time
async def test_settings_alone_end_no_program(tmp_path: Path) -> None:
    async with shop_with(tmp_path, RUNNING) as shop:
        await load(shop, tmp_path, "--run G2")
        (tmp_path / "p.mxt").write_text("VM=400000\n")
        await load(shop, tmp_path)
        assert shop.device("line:a").running and kept(tmp_path)[-1].exists()


@in_virtual_time
async def test_a_second_download_to_a_drive_waits_for_nothing_and_is_refused(tmp_path: Path) -> None:
    async with shop_with(tmp_path, LONG, bus("line", party("a"), party("b"))) as shop:
        first = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.mxt'} a"))
        await until(lambda: shop.device("line:a").programming)
        with pytest.raises(Refused, match="a: a download to it is under way"):
            await shop.session.run(f"/download {tmp_path / 'p.mxt'} a")
        await shop.session.run(f"/download {tmp_path / 'p.mxt'} b")
        await first
        listings = [shop.device(f"line:{name}").program.listing() for name in "ab"]
        assert listings[0] == listings[1] and len(listings[0]) == 202


@pytest.mark.parametrize("personality", ["LMDOM", "LMM", "MDI", "MDIE", "MDIX"])
def test_every_product_takes_an_edited_file_again_and_again(tmp_path: Path, personality: str) -> None:
    @in_virtual_time
    async def body() -> None:
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

    body()


@pytest.mark.parametrize("how", ["stop", "interrupt", "cancel"])
def test_an_interrupted_download_leaves_a_drive_that_listens(tmp_path: Path, how: str) -> None:
    @in_virtual_time
    async def body() -> None:
        async with shop_with(tmp_path, LONG, bus("line", party("a"), party("b"))) as shop:
            device = shop.device("line:a")
            loading = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.mxt'} a"))
            await until(lambda: device.programming is not None and device.programming > 99)
            {"stop": shop.session.stop, "interrupt": shop.session.interrupt, "cancel": loading.cancel}[how]()
            with pytest.raises((Stopped, asyncio.CancelledError)):
                await loading
            await until(lambda: device.programming is None and device.echo_mode == 1)
            assert any("lines are stored (addresses 1 to" in text for text in shop.told())
            assert f"a: what was in it before is in {kept(tmp_path)[0]}" in shop.warned()
            await shop.session.run("@a PR P")

    body()


@in_virtual_time
async def test_a_line_that_is_unplugged_names_the_backup_and_the_drive_comes_out_of_program_mode(
    tmp_path: Path,
) -> None:
    async with shop_with(tmp_path, LONG, bus("line", party("a"), party("b")), reconnect=True) as shop:
        device = shop.device("line:a")
        loading = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.mxt'} a"))
        await until(lambda: device.programming is not None and device.programming > 99)
        shop.world("/sim unplug line")
        with pytest.raises(TransportLost):
            await loading
        assert f"a: what was in it before is in {kept(tmp_path)[0]}" in shop.warned()
        shop.world("/sim plug line")
        await until(lambda: device.programming is None and device.echo_mode == 1)


@in_virtual_time
async def test_remarks_and_layout_come_back_with_the_present_values(tmp_path: Path) -> None:
    async with shop_with(tmp_path) as shop:
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


@in_virtual_time
async def test_progress_ends_with_each_part(tmp_path: Path) -> None:
    async with shop_with(tmp_path, LONG, bus("line", party("a"), party("b"))) as shop:
        await load(shop, tmp_path)
        seen = [event for event in shop.events if isinstance(event, Progressed)]
        assert [event.what for event in seen if event.over] == ["a: backup", "a: download", "a: verify"]
        assert any(event.left and event.what == "a: download" for event in seen)


PMX_FILE = "; ten times\nPRG 0\n  V1=1   ; from one\n  WHILE V1<1000\n    V1=V1*10\n  ENDWHILE\nEND\n"


@in_virtual_time
async def test_a_controller_has_the_same_options_as_far_as_its_words_go(tmp_path: Path) -> None:
    async with shop_with(tmp_path, FILE, bus("pmx", pmx("07"), baud=0)) as shop:
        file = tmp_path / "p.prg"
        file.write_text(PMX_FILE)
        await shop.session.run(f"/download {file} 07 --save --run 0")
        assert "07: it keeps programs at once; --save sends nothing" in shop.told()
        assert shop.told()[-1] == "07: started (SR0=1)" and any("verified, " in text for text in shop.told())
        await shop.session.run(f"/download {file} 07 --only-changed")
        assert shop.told()[-1].endswith("already; nothing was sent")
        await shop.session.run(f"/upload {tmp_path / 'up.prg'} 07")
        assert (tmp_path / "up.prg").read_text() == PMX_FILE
        file.write_text("PRG 0\nWHILE 1=1\nV2=V2+1\nENDWHILE\nEND\n")
        with pytest.raises(Diagnostic, match=r"no program 1 in the file \(nothing was sent\); programs: 0"):
            await shop.session.run(f"/download {file} 07 --run 1")
        for _ in range(2):
            await shop.session.run(f"/download {file} 07 --run 0")
        assert "07: its program ran and was ended" in shop.warned()
        backup = kept(tmp_path)[-1].read_text()
        assert backup.startswith("; multidrop backup of pmx, drive 07, ") and "\nSA0=" in backup and "V2 = " in backup
