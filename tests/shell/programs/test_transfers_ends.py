"""Downloads that end early or must not begin, and programs and motion that are in the way."""

from __future__ import annotations

import asyncio
import errno
import os
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, Differs, Refused, Stopped, TransportLost
from tests.support.cell_session import CellSession, bus, pmx
from tests.support.transfers import FILE, LONG, RUNNING, SLOW, kept, load, shop_with
from tests.support.until import until

pytestmark = pytest.mark.virtual


@pytest.mark.parametrize("why", [errno.ENOSPC, errno.EACCES])
async def test_without_a_backup_nothing_is_sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: int) -> None:
    def fails(*_: object) -> None:
        raise OSError(why, os.strerror(why))

    async with shop_with(tmp_path) as shop:
        monkeypatch.setattr("multidrop.base.atomic.os.fsync", fails)
        with pytest.raises(Diagnostic, match="the backup cannot be written: .*; nothing was sent"):
            await load(shop, tmp_path)
        assert b"PG" not in shop.written("line") and not kept(tmp_path)


async def test_a_locked_program_is_said_and_left_as_it_is(tmp_path: Path, shop: CellSession) -> None:
    await load(shop, tmp_path)
    await shop.session.run("@a LK=1")
    for line in (f"/download {tmp_path / 'p.mxt'} a", "/list a", f"/upload {tmp_path / 'new.mxt'} a"):
        with pytest.raises(Refused, match=r"its program is locked \(LK=1\)"):
            await shop.session.run(line)
    assert not shop.device("line:a").memory.error_flag and not (tmp_path / "new.mxt").exists()


@pytest.mark.parametrize("label", ["G1", "G2"])
async def test_a_program_that_runs_is_ended_and_its_motion_too(tmp_path: Path, label: str) -> None:
    async with shop_with(tmp_path, RUNNING) as shop:
        await load(shop, tmp_path, f"--run {label}")
        await asyncio.sleep(1.0)
        device = shop.device("line:a")
        assert device.running and bool(shop.moving()) is (label == "G1")
        told = await load(shop, tmp_path)
        assert "a: its program ran and was ended" in told and told[-1] == "a: verified, 9 lines"
        assert not device.running and not shop.moving()


async def test_a_drive_that_moves_without_a_program_is_left_alone(tmp_path: Path, shop: CellSession) -> None:
    await shop.session.run("@a SL 1000")
    with pytest.raises(Refused, match="a moves: stop it first"):
        await load(shop, tmp_path)
    assert shop.moving() == {"line:a"} and b"PG" not in shop.written("line")


async def test_a_difference_is_shown_line_by_line(tmp_path: Path, shop: CellSession) -> None:
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


async def test_a_refused_line_is_named_with_its_file_and_the_backup(tmp_path: Path) -> None:
    async with shop_with(tmp_path, "PG 1\nLB G1\nVM=2\nE\nPG\nVM=2\n") as shop:
        with pytest.raises(Refused, match=r"p.mxt:6: a refused 'VM=2': error 2\d: .*; 3 lines are stored"):
            await load(shop, tmp_path)
        assert shop.warned()[-1] == f"a: what was in it before is in {kept(tmp_path)[0]}"
        assert (shop.device("line:a").programming, shop.device("line:a").memory.echo_mode) == (None, 1)


@pytest.mark.parametrize("address", ["*", "^"])
async def test_a_transfer_is_with_one_drive(tmp_path: Path, shop: CellSession, address: str) -> None:
    for line in (f"/download {tmp_path / 'p.mxt'} {address}", f"/list {address}", f"/upload x.mxt {address}"):
        with pytest.raises(Diagnostic, match="programs are those of one drive"):
            await shop.session.run(line)
    assert shop.written("line") == b"" and not kept(tmp_path)


async def test_settings_alone_end_no_program(tmp_path: Path) -> None:
    async with shop_with(tmp_path, RUNNING) as shop:
        await load(shop, tmp_path, "--run G2")
        (tmp_path / "p.mxt").write_text("VM=400000\n")
        await load(shop, tmp_path)
        assert shop.device("line:a").running and kept(tmp_path)[-1].exists()


@pytest.mark.slow
async def test_a_second_download_to_a_drive_waits_for_nothing_and_is_refused(tmp_path: Path) -> None:
    async with shop_with(tmp_path, LONG, SLOW) as shop:
        first = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.mxt'} a"))
        await until(lambda: shop.device("line:a").programming)
        with pytest.raises(Refused, match="a: a download to it is under way"):
            await shop.session.run(f"/download {tmp_path / 'p.mxt'} a")
        await shop.session.run(f"/download {tmp_path / 'p.mxt'} b")
        await first
        listings = [shop.device(f"line:{name}").program.listing() for name in "ab"]
        assert listings[0] == listings[1] and len(listings[0]) == 82


@pytest.mark.parametrize("how", ["stop", "interrupt", "cancel"])
async def test_an_interrupted_download_leaves_a_drive_that_listens(tmp_path: Path, how: str) -> None:
    async with shop_with(tmp_path, LONG, SLOW) as shop:
        device = shop.device("line:a")
        loading = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.mxt'} a"))
        await until(lambda: device.programming is not None and device.programming > 99)
        {"stop": shop.session.stop, "interrupt": shop.session.interrupt, "cancel": loading.cancel}[how]()
        with pytest.raises((Stopped, asyncio.CancelledError)):
            await loading
        await until(lambda: device.programming is None and device.memory.echo_mode == 1)
        assert any("lines are stored (addresses 1 to" in text for text in shop.told())
        assert f"a: what was in it before is in {kept(tmp_path)[0]}" in shop.warned()
        await shop.session.run("@a PR P")


async def test_a_line_that_is_unplugged_names_the_backup_and_the_drive_comes_out_of_program_mode(
    tmp_path: Path,
) -> None:
    async with shop_with(tmp_path, LONG, SLOW, reconnect=True) as shop:
        device = shop.device("line:a")
        loading = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.mxt'} a"))
        await until(lambda: device.programming is not None and device.programming > 99)
        shop.world("/sim unplug line")
        with pytest.raises(TransportLost):
            await loading
        assert f"a: what was in it before is in {kept(tmp_path)[0]}" in shop.warned()
        shop.world("/sim plug line")
        await until(lambda: device.programming is None and device.memory.echo_mode == 1)


async def test_a_controller_whose_download_is_interrupted_is_said_to_be_incomplete(tmp_path: Path) -> None:
    async with shop_with(tmp_path, FILE, bus("pmx", pmx("07"))) as shop:
        (tmp_path / "p.prg").write_text("V1=1\n" * 20 + "END\n")
        loading = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'p.prg'} 07"))
        await until(lambda: b"SA9=" in shop.written("pmx"))
        shop.session.stop()
        with pytest.raises(Stopped):
            await loading
        await until(
            lambda: any("of 61 lines are stored: the program in 07 is incomplete" in text for text in shop.told())
        )
        assert f"07: what was in it before is in {kept(tmp_path)[0]}" in shop.warned()
