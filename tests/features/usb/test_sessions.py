"""Controllers on USB in a session, in virtual time: the stop, macros, samples, settings, and a plug that is pulled."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import NoAnswer, Refused, TransportLost
from multidrop.drives.events import Sample
from multidrop.drives.stopping import Fate
from multidrop.features.usb import libusb
from multidrop.shell.connect.urls import parse
from multidrop.shell.events import OnBus
from tests.support.cell_session import CellSession, bus, pmx
from tests.support.until import until
from tests.support.usb_stand_in import UsbFaults

pytestmark = pytest.mark.virtual

FAST = "[bus.drive.world.x]\nlimit_plus = 100000"
CELL = bus("first", pmx("00", FAST)), bus("second", pmx("07"))


@pytest.fixture
async def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[CellSession]:
    monkeypatch.chdir(tmp_path)
    async with CellSession(tmp_path, *CELL, usb=True, reconnect=True) as made:
        yield made


async def say(shop: CellSession, *lines: str) -> list[str]:
    shop.events.clear()
    for line in lines:
        await shop.session.run(line)
    return shop.printed()


def sockets() -> Any:
    """The stand-ins of this machine's USB sockets."""
    return libusb.LibusbCarrier


async def lost(shop: CellSession, name: str) -> None:
    shop.world(f"/sim unplug {name}")
    await until(lambda: shop.session.buses[name].lost)


async def back(shop: CellSession, name: str) -> None:
    shop.world(f"/sim plug {name}")
    await until(lambda: not shop.session.buses[name].lost and not shop.session.reconnections.trying)


async def test_commands_bear_no_number_and_refusals_are_explained(shop: CellSession) -> None:
    assert await say(shop, "@first: V1=5", "@first: V1", "@second: V1", "@first: DN") == [
        "5", "0", "2ED00"]  # fmt: skip
    assert b"@" not in shop.written("first") and b"V1=5\r" in shop.written("first")
    with pytest.raises(Refused, match="refused 'v1': .v1: .*capitals only: V1"):
        await shop.session.run("@first: v1")


async def test_a_stop_of_the_keys_thread_stops_both_axes_of_every_controller(shop: CellSession) -> None:
    await say(shop, "@first: EO=3", "@first: JX+", "@first: JY-", "@second: EO=3", "@second: JX-")
    assert shop.moving() == {"first:00", "second:07"}
    thread = threading.Thread(target=shop.session.stop_ahead)
    thread.start()
    thread.join()
    shop.session.stop()
    for each in shop.session.buses.values():
        await each.stopped()
    assert shop.moving() == set() and not [text for text in shop.told() if "not known" in text or "NOT REACHED" in text]
    assert shop.session.tally().stand


async def test_a_program_is_stopped_for_good(shop: CellSession) -> None:
    (file := Path("p.prg")).write_text("PRG 0\nWHILE 1=1\nX1000\nWAITX\nX0\nWAITX\nENDWHILE\nEND\n")
    await say(shop, "@first: EO=3", f"/download {file} first: --run 0", "/sleep 0.2")
    assert shop.moving() == {"first:00"}
    shop.session.stop()
    await shop.session.buses["first"].stopped()
    assert await say(shop, "@first: SASTAT0", "/sleep 1", "@first: MSTX") == ["0", "0"]


async def test_a_stop_that_the_controller_does_not_take_is_not_reached(shop: CellSession) -> None:
    await say(shop, "@first: EO=3", "@first: JX+")
    sockets().plugged[0].faults = UsbFaults(held=1.0, longest_held=5.0)
    at = shop.session.now()
    thread = threading.Thread(target=shop.session.stop_ahead)
    thread.start()
    thread.join()
    shop.session.stop()
    first = shop.session.buses["first"]
    await until(lambda: first.lost)
    assert 0.2 <= shop.session.now() - at < 0.5
    halt = first.last_stop
    assert halt is not None and [halt.fate(each) for each in first.all_drives] == [Fate.NOT_REACHED]
    assert "NOT REACHED: first (lost)" in str(shop.session.tally()) or shop.session.tally().urgent
    sockets().plugged[0].faults = UsbFaults()
    await until(lambda: not first.lost and not shop.session.reconnections.trying)
    await first.stopped()
    assert "first:00" not in shop.moving()  # the stop that was owed goes first


async def test_a_macro_is_recorded_and_played(shop: CellSession) -> None:
    await say(
        shop, "/use first:", "EO=3", "/record home", "HSPDX=2000", "X300", "/wait stopped", "/record stop", "PX=0"
    )
    assert await say(shop, "/play home", "PX") == ["300"]


async def test_samples_of_both_axes_arrive(shop: CellSession) -> None:
    await say(shop, "@first: EO=3", "@first: JX+")
    subscription = shop.session.buses["first"].telemetry.subscribe([""], 0.05)
    shop.events.clear()
    await asyncio.sleep(0.5)
    subscription.close()
    seen = [each.event for each in shop.events if isinstance(each, OnBus) and isinstance(each.event, Sample)]
    assert {each.axis for each in seen} == {"x", "y"} and any(each.velocity > 0 for each in seen if each.axis == "x")


@pytest.mark.slow
async def test_settings_go_into_a_file_and_back(shop: CellSession) -> None:
    await say(shop, "/params backup kept.toml first:", "@first: HSPD=9000", "@first: V40=6")
    assert len(await say(shop, "/params diff kept.toml first:")) == 2
    await say(shop, "/params restore kept.toml first:", "/params restore kept.toml second:")
    assert await say(shop, "/params diff kept.toml first:", "/params diff --against second: first:") == []


async def test_a_late_reply_is_never_another_commands(shop: CellSession) -> None:
    await say(shop, "@first: V1=11", "@first: V2=22")
    sockets().plugged[0].faults = UsbFaults(late=1.0, latest=3.0)
    answers: dict[str, list[str]] = {"V1": [], "V2": []}
    for _ in range(40):
        for name, heard in answers.items():
            with contextlib.suppress(NoAnswer):
                heard += await say(shop, f"@first: {name}")
    assert set(answers["V1"]) == {"11"} and set(answers["V2"]) == {"22"}


async def test_a_plug_that_is_pulled_and_comes_back_is_the_same_bus(shop: CellSession) -> None:
    first, drives = shop.session.buses["first"], dict(shop.session.buses["first"].drives)
    await say(shop, "@first: V1=8")
    await lost(shop, "first")
    with pytest.raises(TransportLost, match="usb:2ED00@1-1 was lost: unplugged, or without power"):
        await shop.session.run("@first: V1")
    assert await say(shop, "@second: V1") == ["0"]
    await back(shop, "first")
    assert shop.session.buses["first"] is first and dict(first.drives) == drives
    assert await say(shop, "@first: V1") == ["8"]


async def test_a_command_in_flight_is_not_sent_again(shop: CellSession) -> None:
    sockets().plugged[0].reply_time = 0.5
    moving = asyncio.create_task(shop.session.run("@first: V1=V1+1"))
    await until(lambda: b"V1=V1+1" in shop.written("first"))
    await lost(shop, "first")
    with pytest.raises(TransportLost, match="it is not known whether 'V1=V1.1' was executed"):
        await moving
    shop.events.clear()
    await back(shop, "first")
    assert b"V1=" not in shop.written("first")


async def test_another_controller_in_its_place_is_not_taken_for_it(shop: CellSession) -> None:
    one, other = sockets().plugged
    await lost(shop, "first")
    one.place, other.place = "1-9", "1-1"  # the first one is put into another socket, another one into its own
    shop.world("/sim plug first")
    await asyncio.sleep(30)
    assert shop.session.buses["first"].lost
    assert any(
        "usb:2ED00@1-1 is not there; controllers on USB: usb:2ED00@1-9, usb:2ED07@1-1" in text for text in shop.told()
    )
    one.place, other.place = "1-1", "1-2"
    await back(shop, "first")
    assert await say(shop, "@first: DN") == ["2ED00"]


async def test_an_index_is_resolved_once_and_then_held_by_number_and_socket(tmp_path: Path) -> None:
    async with CellSession(tmp_path, *CELL, usb=True, reconnect=True) as shop:
        await shop.session.run("/close second")
        await shop.session.open("usb:1")
        name = next(name for name in shop.session.buses if name != "first")
        assert shop.session.buses[name].link.transport.name == "usb:2ED07@1-2"
        await lost_by(shop, name, "second")
        shop.world("/sim unplug first")
        shop.world("/sim plug second")
        await until(lambda: not shop.session.buses[name].lost)
        assert await say(shop, f"@{name}: DN") == ["2ED07"]  # which is the first one now


async def lost_by(shop: CellSession, name: str, plug: str) -> None:
    shop.world(f"/sim unplug {plug}")
    await until(lambda: shop.session.buses[name].lost)


def test_ports_have_one_name() -> None:
    assert parse("usbip://PC3/1-1").port_name == parse("usbip://pc3:3240/1-1?timeout=2").port_name == "pc3:3240/1-1"
    assert parse("usb:2ED01@1-1.4?timeout=2").port_name == "usb:2ED01@1-1.4"


def test_a_port_is_shown_without_its_keys() -> None:
    for url in ("usb:2ED42", "usbip://[fe80::1]:3240/1-1"):
        connection = parse(f"{url}?timeout=2")
        assert connection.scheme.shown(connection) == url
