"""What a session shows and hands on in units: status, help, settings, snapshots, samples."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.api.telemetry import AsyncTelemetry
from multidrop.base.errors import DriveError
from multidrop.families.tmcl.manual.commands import AxisParameter, Command, TmclCall
from multidrop.shell import setting_units, snapshots
from multidrop.shell.events import Notified, Output
from multidrop.shell.waits import standings
from multidrop.simulator import cells
from multidrop.tui.figures import NATIVE, figures_of
from tests.support.cases import for_each
from tests.support.cell_session import ETHERNET, CellSession, bus, drive, party, pmx

pytestmark = pytest.mark.virtual
PRESS = bus("press", party("a", 'units = "5 mm/turn"'), party("b"))


async def output(shop: CellSession, line: str) -> list[str]:
    shop.events.clear()
    await shop.session.run(line)
    return [each.text for each in shop.events if isinstance(each, Output)]


async def test_status_ends_with_the_place_in_units_unless_they_are_off(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        await shop.session.run("@a MR {12.5 mm}")
        await shop.session.run("/wait stopped")
        assert (await output(shop, "/status a"))[-1] == "in units: 12.5 mm, 0 mm/s"
        assert not any("units" in each for each in await output(shop, "/status b"))
        await shop.session.run("/units off")
        assert not any("units" in each for each in await output(shop, "/status a"))


async def test_each_axis_of_a_controller_has_its_line(tmp_path: Path) -> None:
    units = 'units = { x = "0.4 um/step", y = { scale = "-0.1 deg/step", zero = "90 deg" } }'
    async with CellSession(tmp_path, bus("stage", pmx("00", units))) as shop:
        await shop.session.run("ABS")
        await shop.session.run("X1000")
        await shop.session.run("/wait stopped")
        assert (await output(shop, "/status"))[-2:] == [
            "x in units: 0.4 mm".replace("0.4 mm", "400 um, 0 um/s"),
            "y in units: 90 deg, 0 deg/s",
        ]


async def test_an_unsure_scale_carries_its_sign(tmp_path: Path) -> None:
    program = 'program_text = """PG 1\nLB G1\nH 60000\nE\nPG\n"""'
    async with CellSession(tmp_path, bus("press", party("a", 'units = "5 mm/turn"', program))) as shop:
        await shop.session.run("EX G1")
        assert (await output(shop, "/status a"))[-1] == "in units: 0 mm?, 0 mm/s?"


@for_each(
    ["word", "expected"],
    [
        ("VM", "  units      a velocity without sign, as in {12.5 mm/s}; 1 mm/s is 10240 (5 mm/turn)"),
        ("MA", "  units      a position, as in {12.5 mm}; 1 mm is 10240 (5 mm/turn)"),
        ("A", "  units      an acceleration without sign, as in {12.5 mm/s2}; 1 mm/s2 is 10240 (5 mm/turn)"),
    ],
)
async def test_help_says_what_a_word_takes_in_units(word: str, expected: str, tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        assert (await output(shop, f"/help {word}"))[-1] == expected
        assert "units  " not in (await output(shop, "/help PR"))[-1]


@for_each(
    ["personality", "scale", "name", "value", "expected"],
    [
        ("LMDCM", "5 mm/turn", "VM", 512000, " (50 mm/s)"),
        ("LMDCM", "5 mm/turn", "A", 1024000, " (100 mm/s2)"),
        ("LMDCM", "5 mm/turn", "RC", 25, ""),
        ("LMDCM", "5 mm/turn", "DN", "a", ""),
        ("PMX", "0.4 um/step", "HSPDX", 25000, " (10000 um/s)"),
        ("PMX", "0.4 um/step", "SLRX", 2, ""),
        ("TMCM-1241", "5 mm/turn", "4", 51200, " (5 mm/s)"),
        ("TMCM-1241", "5 mm/turn", "6", 128, ""),
    ],
)
async def test_settings_are_shown_in_units(
    personality: str, scale: str, name: str, value: object, expected: str, tmp_path: Path
) -> None:
    named = {"LMDCM": "a", "PMX": "00"}.get(personality, "1")
    cell = bus("press", drive(personality, named, f'units = "{scale}"', party=personality == "LMDCM"))
    async with CellSession(tmp_path, cell) as shop:
        (found,) = shop.session.buses["press"].drives.values()
        assert setting_units.shown(shop.session.units, found, name, value) == expected


async def test_a_snapshot_keeps_the_scales_of_the_session(tmp_path: Path) -> None:
    given = 'units = { scale = "-5 mm/turn", zero = "120 mm", travel = "0..300 mm" }'
    async with CellSession(tmp_path, bus("press", party("a", given), party("b"))) as shop:
        await shop.session.run("/units b 360 deg/turn")
        await snapshots.save(shop.session, str(tmp_path / "kept.toml"), shop.session.units.scales)
    before = cells.load(tmp_path / "cell.toml").buses[0].drives
    kept = cells.load(tmp_path / "kept.toml").buses[0].drives
    assert dict(kept[0].units) == dict(before[0].units) and str(kept[1].units[""]) == "360 deg/turn"


async def test_where_a_drive_stands_has_its_place_in_units(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        drives = list(shop.session.buses["press"].drives.values())
        await shop.session.run("@a MR {10 mm}")
        await shop.session.run("/wait stopped")
        one, other = await standings(shop.session, drives, shop.session.units)
        assert (one.text, other.text) == ("a is at rest at 102400 (10 mm)", "b is at rest at 0")
        assert one.fact == {"position": 102400, "velocity": 0, "quantity": 10.0, "unit": "mm"}
        assert other.fact == {"position": 0, "velocity": 0}


async def test_samples_of_the_api_have_the_unit_as_a_further_field(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        await shop.session.run("@a MR {10 mm}")
        await shop.session.run("/wait stopped")
        async with AsyncTelemetry(shop.session, list(shop.session.buses["press"].drives.values()), 10.0) as telemetry:
            await asyncio.sleep(1)
            samples = await telemetry.samples()
    last, other = samples.of("a")[-1], samples.of("b")
    assert (last.position, last.velocity, last.unit, last.place, last.speed) == (102400, 0, "mm", 10.0, 0.0)
    assert (other[-1].unit, other[-1].place) == ("", None)
    assert list(samples.arrays(units=True))[-3:] == ["unit", "place", "speed"]
    assert len(last) == 6 and list(samples.arrays())[-1] == "velocity"


# A scale that no longer holds


CHANGES = {
    "mcode": (PRESS, "@a ", ("EE=1", "MS=128", "ms 128", "RD=1")),
    "module": (bus("press", drive("TMCM-1140", "1", 'units = "5 mm/turn"'), baud=0), "@1 ", ("SAP 140, 0, 5",)),
    "pmx": (bus("press", pmx("00", 'units = { x = "0.4 um/step" }'), baud=0), "@00 ", ("POLX=1",)),
}


@for_each(["floor", "to", "change"], [(floor, to, line) for floor, to, lines in CHANGES.values() for line in lines])
async def test_a_setting_that_the_scale_rests_on_ends_the_units_in_every_output(
    floor: str, to: str, change: str, tmp_path: Path
) -> None:
    async with CellSession(tmp_path, floor) as shop:
        drive, units = next(iter(shop.session.buses["press"].drives.values())), shop.session.units
        axis = drive.family.units.axes()[0]
        assert "in units" in "\n".join(await output(shop, f"/status {drive.address}"))
        await shop.session.run(to + change)
        assert any("its scale rests on that, so its own numbers are shown" in each for each in shop.told(Notified))
        assert "in units" not in "\n".join(
            each for each in await output(shop, f"/status {drive.address}") if each.startswith(axis)
        )
        assert figures_of(units.of(drive, axis), True) is NATIVE
        assert units.given(drive, axis, 1000) is None and units.words(drive, axis, 1000) == ""
        assert "not shown in units, as " in (await output(shop, "/units"))[0]
        await shop.session.run(f"/units {drive.address}{f'.{axis}' if axis else ''}")
        assert units.words(drive, axis, 1000) != ""


async def test_a_setting_of_every_drive_ends_the_units_of_each(tmp_path: Path) -> None:
    floor = bus("press", party("a", 'units = "5 mm/turn"'), party("b", 'units = "5 mm/turn"'))
    async with CellSession(tmp_path, floor) as shop:
        await shop.session.run("@* MS=128")
        shown = [*await output(shop, "/status a"), *await output(shop, "/status b")]
        assert shown and not any("units" in each for each in shown)


async def test_a_setting_that_was_sent_and_changed_nothing_leaves_the_units(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        for line in ("@a EE=0", "@a MS=256", "@a VM=300000", "@a PR MS"):
            await shop.session.run(line)
            assert (await output(shop, "/status a"))[-1] == "in units: 0 mm, 0 mm/s", line
        with pytest.raises(DriveError):
            await shop.session.run("@a MS=777")  # no such resolution
        assert (await output(shop, "/status a"))[-1] == "in units: 0 mm, 0 mm/s"


async def test_the_settings_are_read_once_for_each_thing_that_may_have_changed_them(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        await shop.session.run("@a EE=1")
        before = shop.written("press").count(b"PR MS,")
        for line in ("@a R1=5", "@a PR P", "@a VM=9000"):
            await shop.session.run(line)
        assert shop.written("press").count(b"PR MS,") == before
        await shop.session.run("@a RD=1")
        assert shop.written("press").count(b"PR MS,") == before + 1


async def test_units_come_back_with_the_setting(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        await shop.session.run("@a EE=1")
        assert not any("units" in each for each in await output(shop, "/status a"))
        await shop.session.run("@a EE=0")
        assert (await output(shop, "/status a"))[-1] == "in units: 0 mm, 0 mm/s"


async def test_a_setting_that_another_master_or_a_program_made_is_seen_by_the_polls(tmp_path: Path) -> None:
    program = 'program_text = """PG 1\nLB G1\nMS=128\nE\nPG\n"""'
    async with CellSession(tmp_path, bus("press", party("a", 'units = "5 mm/turn"', program))) as shop:
        drive, units = shop.session.drive("press", "a"), shop.session.units
        watch = shop.session.buses["press"].telemetry.watch(["a"], 1.0)
        await asyncio.sleep(8)
        assert units.given(drive, "", 51200) == (5.0, "mm")
        await shop.session.run("EX G1")
        await asyncio.sleep(8)
        watch.close()
        assert units.given(drive, "", 51200) is None
        assert [each for each in shop.told(Notified) if "MS was 256 and is 128 now" in each]


async def test_settings_that_were_read_contradict_a_scale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    async with CellSession(tmp_path, PRESS) as shop:
        drive, units = shop.session.drive("press", "a"), shop.session.units
        await shop.session.run("/params backup one.toml")
        assert units.given(drive, "", 51200) == (5.0, "mm")
        shop.device("press:a").execute("MS=128", shop.floor.now())
        await shop.session.run("/params backup two.toml")
        assert units.given(drive, "", 51200) is None


async def test_settings_of_a_second_motor_contradict_its_scale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scales = 'units = { 0 = "5 mm/turn", 1 = "5 mm/turn" }'
    async with CellSession(tmp_path, bus("feeds", drive("TMCM-6110", "1", scales))) as shop:
        module, units = shop.session.drive("feeds", "1"), shop.session.units
        await shop.session.run("/params backup one.toml")
        assert units.given(module, "0", 51200) and units.given(module, "1", 51200) == (5.0, "mm")
        shop.device("feeds:1").carry_out(TmclCall(Command.SAP, AxisParameter.MICROSTEPS, 1, 4), shop.floor.now())
        await shop.session.run("/params backup two.toml")
        assert units.given(module, "1", 51200) is None


async def test_a_drive_that_was_switched_off_and_on_is_not_shown_in_units_before_its_settings_are_read(
    tmp_path: Path,
) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        drive, units = shop.session.drive("press", "a"), shop.session.units
        await shop.session.run("@a MS=128")
        await shop.session.run("/units a")
        assert units.given(drive, "", 25600) == (5.0, "mm")
        await shop.session.run("/sim power a off")
        with pytest.raises(DriveError):
            await shop.session.run("@a PR P")
        await shop.session.run("/sim power a on")
        await asyncio.sleep(3)
        await shop.session.run("@a PR P")
        assert units.given(drive, "", 25600) is None


async def test_after_a_silence_samples_have_units_again_once_the_settings_are_read(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        drive = shop.session.drive("press", "a")
        assert shop.session.units.given(drive, "", 51200) == (5.0, "mm")
        async with AsyncTelemetry(shop.session, [drive], 10.0) as telemetry:
            await asyncio.sleep(2)
            drive.state.counts_may_have_changed()  # as after a reply that was missing, or a line that came back
            await asyncio.sleep(0.4)
            gap = [each.unit for each in (await telemetry.samples()).of("a")]
            await asyncio.sleep(2)
            later = [each.unit for each in (await telemetry.samples()).of("a")]
    assert gap[0] == "mm" and "" in gap and later[-1] == "mm"


async def test_the_advice_for_a_drive_without_an_address_is_a_line_that_is_taken(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("eth", ETHERNET + '\nunits = "5 mm/turn"')) as shop:
        drive = next(iter(shop.session.buses["eth"].drives.values()))
        await shop.session.run("EE=1")
        (said,) = (each for each in shop.told(Notified) if "accepts it as it is now" in each)
        assert "/units eth: accepts it" in said and "/units eth: accepts that" in (await output(shop, "/units"))[0]
        await shop.session.run("/units eth:")
        assert shop.session.units.given(drive, "", 4000) == (5.0, "mm")
