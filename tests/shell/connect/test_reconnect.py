"""A bus that is lost and comes back, in virtual time: what is said, what is sent, what moves."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.drives.events import Sample
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import OnBus
from multidrop.shell.scripts.executor import play
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx
from tests.support.mcode_drives import Witness
from tests.support.until import until

pytestmark = pytest.mark.virtual

LINE = bus("line", party("a"), party("b"))
PROGRAM = "".join(f"R1=R1+{number}\n" for number in range(40))
WAITING = pytest.raises(TransportLost)


def opened(folder: Path, *buses: str, reconnect: bool = True) -> CellSession:
    return CellSession(folder, *(buses or (LINE,)), reconnect=reconnect)


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[CellSession]:
    async with opened(tmp_path) as shop:
        yield shop


async def lost(shop: CellSession, name: str = "line") -> None:
    shop.world(f"/sim unplug {name}")
    await until(lambda: shop.session.buses[name].lost)


async def back(shop: CellSession, name: str = "line") -> float:
    """Plug it in again; return how long it was lost then."""
    shop.world(f"/sim plug {name}")
    return await until(lambda: not shop.session.buses[name].lost and not shop.session.reconnections.trying)


@pytest.mark.slow
async def test_a_bus_comes_back_as_it_was(shop: CellSession) -> None:
    line, drives = shop.session.buses["line"], dict(shop.session.buses["line"].drives)
    shop.session.select("b")
    await shop.session.run("@b VM 300000")
    await lost(shop)
    with WAITING:
        await shop.session.run("PR P")
    await asyncio.sleep(3.0)
    assert shop.session.buses["line"].lost and list(shop.session.reconnections.trying) == ["line"]
    assert await back(shop) < 1.5
    assert shop.session.buses["line"] is line and dict(line.drives) == drives
    assert shop.session.place == ("line", "b") and not shop.session.latched
    await shop.session.run("PR VM")
    assert shop.printed() == ["300000"]
    said = [text for text in shop.warned() if "line" in text]
    assert [text.split(": ")[0] for text in said][0] == "line" and said[0].endswith("was lost: unplugged; trying again")
    assert said[1] == "line: not known whether these move, as they were not read yet: a, b"
    assert said[2].startswith("line is back after 3.")
    assert said[3:] == ["line: a is at rest at 0", "line: b is at rest at 0"]


@pytest.mark.slow
async def test_a_port_that_is_back_is_noticed_within_a_second_however_long_it_was_away(tmp_path: Path) -> None:
    async with opened(tmp_path, bus("line", ETHERNET)) as shop:
        for away in (0.01, 0.3, 5.0, 3000.0):
            await lost(shop)
            await asyncio.sleep(away)
            shop.events.clear()
            shop.world("/sim plug line")
            assert await until(lambda: shop.written("line")) < 1.0
            await back(shop)


async def test_a_command_that_was_in_flight_is_not_known_and_not_sent_again(shop: CellSession) -> None:
    witness = Witness(shop.device("line:a"))
    moving = asyncio.create_task(shop.session.run("@a MR 51200"))
    await until(lambda: b"MR 51200" in shop.written("line"))
    await lost(shop)
    with pytest.raises(TransportLost, match="it is not known whether 'MR 51200' was executed"):
        await moving
    shop.events.clear()
    await back(shop)
    assert b"MR" not in shop.written("line") and shop.written("line").startswith(b"\x1b")
    assert any("'aMR 51200' was cut off by the loss" in text for text in shop.warned())
    await asyncio.sleep(1.0)
    assert not shop.moving() and len(witness.executed("MR 51200")) <= 1
    await shop.session.run("@a PR P")


async def test_a_question_that_was_in_flight_leaves_nothing_open(shop: CellSession) -> None:
    asking = asyncio.create_task(shop.session.run("@a PR P"))
    await until(lambda: b"PR P" in shop.written("line"))
    await lost(shop)
    with pytest.raises(TransportLost) as failed:
        await asking
    shop.events.clear()
    await back(shop)
    assert "not known" not in str(failed.value) and b"\x1b" not in shop.written("line")


@pytest.mark.slow
async def test_a_download_ends_and_the_drive_is_put_right(tmp_path: Path, shop: CellSession) -> None:
    (tmp_path / "long.mxt").write_text(PROGRAM.join(("PG 1\n", "E\nPG\n")))
    device = shop.device("line:a")
    loading = asyncio.create_task(shop.session.run(f"/download {tmp_path / 'long.mxt'} a"))
    await until(lambda: device.programming is not None and device.programming > 20)
    assert device.memory.echo_mode == 0
    await lost(shop)
    with WAITING:
        await loading
    await back(shop)
    assert device.programming is None and device.memory.echo_mode == 1
    assert not shop.session.buses["line"].drives["a"].programming
    assert any("was in program mode and was taken out with PG" in text for text in shop.warned())
    await shop.session.run("@b PR P")


async def test_program_mode_that_a_person_left_open_is_ended(shop: CellSession) -> None:
    await shop.session.run("@a PG 1")
    await lost(shop)
    await back(shop)
    assert shop.device("line:a").programming is None and shop.device("line:a").memory.echo_mode == 1
    await shop.session.run("@a PR P")


async def test_a_stop_during_the_loss_is_the_first_to_leave(shop: CellSession) -> None:
    await shop.session.run("@a SL 20000")
    await lost(shop)
    shop.session.stop()
    assert shop.session.latched and any("stop not sent (lost)" in text for text in shop.warned())
    assert shop.warned()[-1] == "line: the stop is the first to be sent when the line is back"
    await asyncio.sleep(2.0)
    assert shop.moving() == {"line:a"}
    shop.events.clear()
    shop.world("/sim plug line")
    await until(lambda: shop.written("line"))
    assert shop.written("line").startswith(b"\x1b")
    await back(shop)
    await shop.session.buses["line"].stopped()
    assert not shop.moving() and shop.session.latched and shop.session.tally().stand
    assert "line: the stop of a, b was sent first (the loss kept it from the drives)" in shop.warned()


async def test_a_stop_key_during_the_loss_is_the_first_to_leave_before_the_loop_has_seen_it(shop: CellSession) -> None:
    await lost(shop)
    shop.session.stop_ahead()
    shop.events.clear()
    shop.world("/sim plug line")
    await until(lambda: shop.written("line"))
    assert shop.written("line").startswith(b"\x1b")
    shop.session.stop()
    await back(shop)


async def test_the_stop_on_return_is_for_drives_as_they_were_saved_too(tmp_path: Path) -> None:
    """A power cycle during the loss gives a drive its saved ES and name again."""
    async with opened(tmp_path, bus("line", party("a", ES=1), party("b", ES=3))) as shop:
        await shop.session.run("@a ES=3")
        await shop.session.run('@b DN="z"')
        await lost(shop)
        for name in "ab":
            shop.world(f"/sim power {name} off")
            shop.world(f"/sim power {name} on")
        for name in "ab":
            device = shop.device(f"line:{name}")
            device.execute("SL 20000", device.now)
        shop.session.stop()
        assert shop.moving() == {"line:a", "line:b"}
        shop.events.clear()
        shop.world("/sim plug line")
        await until(lambda: shop.written("line"))
        await asyncio.sleep(0.5)
        assert not shop.moving()
        await back(shop)


async def test_a_stop_that_the_loss_kept_from_being_confirmed_is_sent_again(shop: CellSession) -> None:
    await shop.session.run("@a SL 20000")
    shop.session.stop()
    shop.world("/sim unplug line")
    await until(lambda: shop.session.buses["line"].lost)
    await asyncio.sleep(1.0)
    shop.events.clear()
    await back(shop)
    await shop.session.buses["line"].stopped()
    assert shop.written("line").startswith(b"\x1b") and shop.session.tally().stand


async def test_a_line_that_the_outage_refused_takes_no_drive_from_the_stop(tmp_path: Path) -> None:
    async with opened(tmp_path, bus("line", party("a", ES=3), party("b", ES=3))) as shop:
        for name in "ab":
            await shop.session.run(f"@{name} SL 20000")
        await lost(shop)
        shop.session.stop()
        for line in ("@a MR 100", "@* MR 100"):
            with WAITING:
                await shop.session.run(line)
        shop.events.clear()
        await back(shop)
        await shop.session.buses["line"].stopped()
        assert not shop.moving() and b"MR" not in shop.written("line")


async def test_a_stop_that_was_confirmed_is_not_sent_again(shop: CellSession) -> None:
    shop.session.stop()
    await shop.session.buses["line"].stopped()
    await shop.session.run("@a SL 20000")
    await lost(shop)
    shop.events.clear()
    await back(shop)
    assert b"\x1b" not in shop.written("line") and shop.moving() == {"line:a"}


async def test_what_moved_at_the_loss_is_named_and_read_on_return(shop: CellSession) -> None:
    await shop.session.run("@a SL 20000")
    await lost(shop)
    await back(shop)
    said = shop.warned()
    assert any("cannot be stopped from here" in text and "a started 0 s ago" in text for text in said)
    assert "line: a moves at 20000 a second" in said and not any("b moves" in text for text in said)


async def test_a_bus_that_is_lost_while_its_motion_is_read_comes_back_again(shop: CellSession) -> None:
    await shop.session.run("@a SL 20000")
    await lost(shop)
    shop.world("/sim plug line")
    await until(lambda: not shop.session.buses["line"].lost)
    shop.events.clear()
    await lost(shop)
    await asyncio.sleep(2.0)
    assert list(shop.session.reconnections.trying) == ["line"]
    assert not any("could not be read" in text for text in shop.warned())
    await back(shop)
    await shop.session.run("@a PR V")
    assert shop.printed()[-1] == "20000"


async def test_a_stop_during_the_search_begins_the_search_again(shop: CellSession) -> None:
    await shop.session.run("@b SL 20000")
    await lost(shop)
    shop.events.clear()
    shop.world("/sim plug line")
    await until(lambda: b"PR VR" in shop.written("line"))
    shop.session.stop()
    assert b"\x1b" in shop.written("line").rpartition(b"PR VR")[2]
    assert not any("first to be sent" in text for text in shop.warned())  # it was sent
    await until(lambda: not shop.session.buses["line"].lost)
    await shop.session.buses["line"].stopped()
    assert not shop.moving() and shop.session.tally().stand
    await shop.session.run("@b PR P")


async def test_a_bus_that_is_lost_again_during_the_search_comes_back_later(shop: CellSession) -> None:
    await lost(shop)
    shop.events.clear()
    shop.world("/sim plug line")
    await until(lambda: b"PR VR" in shop.written("line"))
    shop.world("/sim unplug line")
    await asyncio.sleep(5.0)
    assert shop.session.buses["line"].lost
    await back(shop)
    assert sum("was lost" in text for text in shop.warned()) == 0  # one loss, said once
    await shop.session.run("@a PR P")


async def test_nothing_is_sent_between_the_return_and_the_end_of_the_search(shop: CellSession) -> None:
    telemetry = shop.session.buses["line"].telemetry.subscribe(["a", "b"], 0.02)
    await lost(shop)
    shop.events.clear()
    shop.world("/sim plug line")
    await until(lambda: shop.written("line"))
    with pytest.raises(TransportLost, match="was lost"):
        await shop.session.run("@a MR 100")
    await until(lambda: not shop.session.buses["line"].lost)
    searched = shop.written("line").rpartition(b"~b")[0]
    assert b"MR 100" not in shop.written("line") and searched and b"PR P," not in searched
    telemetry.close()


async def test_a_drive_that_was_switched_off_meanwhile_is_found_as_it_was_saved(shop: CellSession) -> None:
    await shop.session.run("@b EM=2")
    await shop.session.run("@b CK=0")
    await lost(shop)
    shop.world("/sim power b off")
    shop.world("/sim power b on")
    await asyncio.sleep(1.0)
    await back(shop)
    codec: Any = shop.session.buses["line"].drives["b"].codec
    assert (codec.em, codec.checksum, codec.party) == (1, 1, True)
    assert any("b: its settings are not those of before the loss" in text for text in shop.warned())
    await shop.session.run("@b PR P")


async def test_a_drive_that_was_renamed_is_found_by_its_present_name(shop: CellSession) -> None:
    drive = shop.session.buses["line"].drives["b"]
    await shop.session.run('@b DN="z"')
    await lost(shop)
    await back(shop)
    assert list(shop.session.buses["line"].drives) == ["a", "z"] and shop.session.buses["line"].drives["z"] is drive
    await shop.session.run("@z PR P")


async def test_another_drive_on_the_same_port_is_said_in_one_line(shop: CellSession) -> None:
    shop.session.buses["line"].drives["a"].state.identified("LMDOM", "LMDOM 5.010, Hw: 3.2")
    await lost(shop)
    await back(shop)
    (said,) = [text for text in shop.warned() if "another drive" in text]
    assert "product LMDOM before, LMDCM now" in said


@pytest.mark.slow
async def test_a_silent_line_is_said_once_and_asked_until_a_drive_replies(shop: CellSession) -> None:
    await lost(shop)
    for name in "ab":
        shop.world(f"/sim power {name} off")
    shop.world("/sim plug line")
    await asyncio.sleep(60.0)
    assert shop.session.buses["line"].lost
    assert sum("still lost: none of the drives a, b replies" in text for text in shop.warned()) == 1
    for name in "ab":
        shop.world(f"/sim power {name} on")
    await until(lambda: not shop.session.buses["line"].lost)
    await shop.session.run("@a PR P")


@pytest.mark.slow
async def test_a_bus_that_never_comes_back_is_given_up_by_close(shop: CellSession) -> None:
    before = len(asyncio.all_tasks())
    await lost(shop)
    await asyncio.sleep(3600.0)
    assert len(shop.told()) == 2 and len(asyncio.all_tasks()) <= before + 1
    await shop.session.run("/close line")
    assert not shop.session.reconnections.trying and not shop.session.buses
    shop.events.clear()
    await asyncio.sleep(10.0)
    assert not shop.told() and len(asyncio.all_tasks()) <= before


@pytest.mark.slow
async def test_plugged_out_and_in_ten_times_nothing_is_left_behind(shop: CellSession) -> None:
    line = shop.session.buses["line"]
    subscription = line.telemetry.subscribe(["a"], 0.1)
    await asyncio.sleep(1.0)
    tasks = len(asyncio.all_tasks())
    heard = shop.session.cells["line"]._listeners["line"]
    listeners = len(heard)
    for _ in range(10):
        await lost(shop)
        await asyncio.sleep(0.5)
        await back(shop)
        shop.events.clear()
        await asyncio.sleep(1.0)
        assert sum(isinstance(e, OnBus) and isinstance(e.event, Sample) for e in shop.events) >= 8
    subscription.close()
    assert len(asyncio.all_tasks()) <= tasks
    assert len(heard) == listeners


@pytest.mark.slow
async def test_several_buses_come_back_side_by_side(tmp_path: Path) -> None:
    module = 'personality = "TMCM"\nname = "1"'
    cell = [LINE, bus("eth", ETHERNET, baud=0), bus("pmx", pmx("00")), bus("tmcl", module)]
    async with opened(tmp_path, *cell) as shop:
        for name in shop.session.buses:
            shop.world(f"/sim unplug {name}")
        await until(lambda: all(each.lost for each in shop.session.buses.values()))
        for name in shop.session.buses:
            shop.world(f"/sim plug {name}")
        assert await until(lambda: not any(each.lost for each in shop.session.buses.values())) < 2.0
        for line in ("@line:a PR P", "@eth: PR P", "@pmx:00 PX", "@tmcl:1 GAP 1, 0"):
            await shop.session.run(line)


async def test_an_ethernet_drive_that_was_switched_off_comes_back_once_it_has_booted(tmp_path: Path) -> None:
    async with opened(tmp_path, bus("eth", ETHERNET, baud=0)) as shop:
        await shop.session.run("SL 20000")
        shop.world("/sim power ! off")
        await until(lambda: shop.session.buses["eth"].lost)
        shop.world("/sim power ! on")
        await until(lambda: not shop.session.buses["eth"].lost)
        await shop.session.run("PR P")
        assert not shop.moving()


@pytest.mark.slow
@pytest.mark.parametrize("polled", [False, True], ids=["quiet", "polled"])
@pytest.mark.parametrize(
    ("saved", "changed"),
    [("EM = 0, CK = 0", ["EM=1"]), ("EM = 1, CK = 1", ["CK=0"]), ("EM = 1, CK = 1", ['DN="q"', "PY=1"])],
    ids=["EM", "CK", "PY"],
)
async def test_a_drive_that_is_restarted_is_said_and_found_as_it_was_saved(
    tmp_path: Path, saved: str, changed: list[str], polled: bool
) -> None:
    async with opened(tmp_path, bus("line", f'personality = "LMDCM"\nset = {{ {saved} }}')) as shop:
        for line in changed:
            await shop.session.run(line)
        line = shop.session.buses["line"]
        if polled:
            line.telemetry.subscribe(list(line.drives), 0.05)
        await asyncio.sleep(1.0)
        shop.events.clear()
        shop.world("/sim power ! off")
        shop.world("/sim power ! on")
        await asyncio.sleep(6.0)
        await shop.session.run(f"@line:{next(iter(line.drives))} PR P")
        assert shop.printed()[-1] == "0" and not shop.moving()
        assert any("was restarted (sign-on)" in text for text in shop.warned())
        assert any("has other settings now" in text for text in shop.warned())


async def test_a_macro_ends_with_the_loss_and_its_drive_is_stopped_on_return(tmp_path: Path) -> None:
    async with opened(tmp_path, bus("line", party("a", ES=3), party("b", ES=3))) as shop:
        macro = Macro("go", (MacroStep(0.0, "@a SL 20000"), MacroStep(0.0, "/wait stopped 60")))
        playing = asyncio.create_task(play(shop.session, shop.session.origin, macro, {}))
        await asyncio.sleep(1.0)
        await shop.session.run("@b SL 10000")
        await lost(shop)
        with WAITING:
            await playing
        assert not shop.session.busy
        shop.events.clear()
        await back(shop)
        await shop.session.buses["line"].stopped()
        assert shop.moving() == {"line:b"} and not shop.session.latched
        assert any("the stop of a was sent first" in text for text in shop.warned())


async def test_without_reconnection_a_lost_bus_stays_lost(tmp_path: Path) -> None:
    async with opened(tmp_path, reconnect=False) as shop:
        await lost(shop)
        shop.world("/sim plug line")
        await asyncio.sleep(10.0)
        assert shop.session.buses["line"].lost and len(shop.told()) == 1 and not shop.warned()


async def test_a_bus_that_is_lost_while_it_is_opened_is_not_tried_again(tmp_path: Path) -> None:
    shop = CellSession(tmp_path, LINE, reconnect=True)
    opening = asyncio.create_task(shop.session.open(shop.url))
    await until(lambda: shop.session.cells)
    shop.world("/sim unplug line")
    with WAITING:
        await opening
    assert not shop.session.buses and not shop.session.reconnections.trying
    with pytest.raises(Diagnostic):
        await shop.session.run("/close line")
    await shop.session.close()


async def test_only_a_line_that_is_lost_and_tried_again_is_said_to_get_the_stop_later(tmp_path: Path) -> None:
    async with opened(tmp_path, bus("line", party("a")), bus("other", party("b"))) as cell:
        await lost(cell)
        cell.session.stop()
        later = [text for text in cell.warned() if "the first to be sent when" in text]
        assert later == ["line: the stop is the first to be sent when the line is back"]
    async with opened(tmp_path, bus("line", party("a")), reconnect=False) as cell:
        await lost(cell)
        cell.session.stop()
        assert not any("the first to be sent when" in text for text in cell.warned())
