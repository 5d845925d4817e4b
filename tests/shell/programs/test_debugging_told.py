"""All that a debugger says at each turn of a program: at its break point, after a stop, a loss, a restart, a close."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.base.errors import Stopped
from tests.support.debugged import cell, ethernet, serial
from tests.support.said import said, texts

pytestmark = pytest.mark.virtual

WAYS = "/step executes one line, /continue all the rest"
LEFT = "the break point at K1 stays in the drive until /break off or power-off"
MAY_WAIT = "! line: its program may go on waiting for /step or /continue; a stop ends it"
AROUND = [
    "    1  LB G1",
    "    6  VA Q1=0",
    "   14  LB K1",
    "-> 19  MR 51200",
    "   26  H",
    "   28  IC Q1",
    "   33  BR K1,Q1<3",
]


async def waits(it, *, broken=False):
    """Have the program wait: before its first line, or at a break point."""
    if not broken:
        await said(it, "/step G1")
    else:
        await said(it, "/break K1")
        await said(it, "/trace")
    it.events.clear()


async def test_a_trace_to_a_break_point_and_on(tmp_path):
    async with cell(tmp_path, ethernet()) as it:
        assert await said(it, "/break K1") == [
            "- line: break point at K1, for /trace; it stays in the drive until /break off or power-off"
        ]
        assert await said(it, "/break") == [f"- line: {LEFT}"]
        await said(it, "/watch P")
        lines = await said(it, "/trace")
        assert lines[-8:] == [*AROUND, f"- line: the program waits at the break point K1: {WAYS}"]
        assert await said(it, "/continue") == [
            "- line: its program runs on at normal speed, and shows no lines: /break now breaks it where it is"
        ]
        assert await said(it, "/step") != []
        assert await said(it, "/break off") == ["- line: no break point"]
        assert await said(it, "/break") == ["- line: no break point of this session"]


@pytest.mark.parametrize("broken", [False, True])
async def test_after_a_stop_single_step_is_over_and_what_is_left_is_said(tmp_path, broken):
    async with cell(tmp_path, ethernet()) as it:
        await waits(it, broken=broken)
        it.session.stop()
        await asyncio.sleep(2)
        left = f"; {LEFT}" if broken else ""
        assert f"- line: stopped: no program runs, and single step is over{left}" in texts(it)
        assert not it.device("line:!").thread.stepping
        it.session.resume()
        assert (await said(it, "/step"))[-1].startswith("x the drive: it is not known that it waits for a key")


@pytest.mark.parametrize("broken", [False, True])
async def test_a_close_says_what_is_left_in_the_drive(tmp_path, broken):
    async with cell(tmp_path, ethernet()) as it:
        await waits(it, broken=broken)
        left = [f"! line: {LEFT}"] if broken else []
        assert await said(it, "/close line") == [MAY_WAIT, *left, "- line is closed"]


async def test_a_close_says_nothing_where_nothing_is_left(tmp_path):
    async with cell(tmp_path, ethernet()) as it:
        await said(it, "/trace")
        assert await said(it, "/close line") == ["- line is closed"]


@pytest.mark.parametrize("broken", [False, True])
async def test_a_loss_says_what_is_left_in_the_drive(tmp_path, broken):
    async with cell(tmp_path, ethernet()) as it:
        await waits(it, broken=broken)
        it.world("/sim unplug line")
        await asyncio.sleep(3)
        left = [f"! line: {LEFT}"] if broken else []
        assert [each for each in texts(it) if each in (MAY_WAIT, f"! line: {LEFT}")] == [MAY_WAIT, *left]


async def test_a_stop_during_a_trace_ends_it(tmp_path):
    async with cell(tmp_path, ethernet()) as it:
        asyncio.get_running_loop().call_later(1.0, it.session.stop)
        with pytest.raises(Stopped):
            await it.session.run("/trace K2")
        await asyncio.sleep(2)
        assert "- line: stopped: no program runs, and single step is over" in texts(it)
        assert it.moving() == set()


async def test_watched_values_are_shown_as_they_change_and_those_that_are_not_there_named(tmp_path):
    async with cell(tmp_path, ethernet()) as it:
        assert await said(it, "/watch q1 p Q1") == ["P=0   not there now: Q1"]
        await said(it, "/step G1")
        assert await said(it, "/step") == ["6  VA Q1=0   Q1=0"]
        assert (await said(it, "/step"))[0].startswith("19  MR 51200")
        await said(it, "/wait stopped")
        assert await said(it, "/step") == ["26  H   P=51200"]
        assert await said(it, "/step") == ["28  IC Q1   Q1=1"]
        assert await said(it, "/watch off") == []
        assert await said(it, "/step") == ["33  BR K1,Q1<3"]


async def test_a_drive_that_was_switched_off_and_on_has_no_break_point_and_waits_for_no_key(tmp_path):
    async with cell(tmp_path, serial("!", party=False)) as it:
        await waits(it, broken=True)
        it.world("/sim power ! off")
        it.world("/sim power ! on")
        await asyncio.sleep(3)
        assert MAY_WAIT not in texts(it)
        assert await said(it, "/break") == ["- line: no break point of this session"]
