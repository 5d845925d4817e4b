"""Scales of a session: what is accepted, overheard, lost and reported, beyond the quantities in lines."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.base.errors import Diagnostic, Differs
from multidrop.dialects.units import Takes, scale
from tests.support.cell_session import CellSession, bus, drive, party, pmx
from tests.support.said import said

pytestmark = pytest.mark.virtual

LINE = bus("line", party("a"), party("b"), baud=0)
ANCHORED = {"scale": "5 mm/turn", "zero": "120 mm", "travel": "0..300 mm"}


def on(folder, *buses, **units):
    return CellSession(folder, *(buses or (LINE,)), units={key.replace("_", "."): each for key, each in units.items()})


NUMBERS = [
    (Takes.PLACE, 51200, (125.0, "mm"), " (125 mm)"),
    (Takes.DISTANCE, 51200, (5.0, "mm"), " (5 mm)"),
    (Takes.VELOCITY, -51200, (-5.0, "mm/s"), " (-5 mm/s)"),
    (Takes.SPEED, 51200, (5.0, "mm/s"), " (5 mm/s)"),
]


@pytest.mark.parametrize(("takes", "number", "given", "words"), NUMBERS)
async def test_a_number_of_an_axis_is_given_in_its_unit(tmp_path, takes, number, given, words):
    async with on(tmp_path, a=ANCHORED) as shop:
        units, a, b = shop.session.units, shop.session.drive("line", "a"), shop.session.drive("line", "b")
        assert units.given(a, "", number, takes) == given
        assert units.words(a, "", number, takes) == words
        assert units.given(b, "", number, takes) is None and units.words(b, "", number, takes) == ""
        units.shown = False
        assert units.given(a, "", number, takes) == given and units.words(a, "", number, takes) == ""


async def test_while_a_program_runs_and_after_it_a_unit_has_a_question_mark_until_it_is_confirmed(tmp_path):
    runs = 'program_text = """PG 1\nLB G1\nH 1000\nE\nPG\n"""'
    async with on(tmp_path, bus("line", party("a", runs), party("b"), baud=0), a=ANCHORED) as shop:
        units, a = shop.session.units, shop.session.drive("line", "a")
        await shop.session.run("@a EX G1")
        await shop.session.run("@a PR BY")
        assert units.words(a, "", 0) == " (120 mm?)" and units.given(a, "", 0) == (120.0, "mm?")
        await shop.session.run("/wait @a BY=0 5")
        await shop.session.run("/units a")
        assert units.words(a, "", 0) == " (120 mm)" and units.given(a, "", 0) == (120.0, "mm")


async def test_a_scale_that_no_longer_holds_shows_no_number_in_its_unit(tmp_path):
    async with on(tmp_path, a=ANCHORED) as shop:
        units, a = shop.session.units, shop.session.drive("line", "a")
        await shop.session.run("@a MS=128")
        assert units.words(a, "", 0) == "" and units.given(a, "", 0) is None
        axis = units.of(a)
        assert (axis.holds, axis.current, axis.measure is not None) == (False, None, True)


async def test_a_changed_setting_that_a_line_finds_takes_the_reference_of_an_anchored_scale_only(tmp_path):
    async with on(tmp_path, a=ANCHORED, b="5 mm/turn") as shop:
        units = shop.session.units
        for name, kept in (("a", False), ("b", True)):
            each = shop.session.drive("line", name)
            shop.device(f"line:{name}").execute("MS=128", shop.floor.now())
            with pytest.raises(Differs) as caught:
                await shop.session.run(f"@{name} MR {{1 mm}}")
            assert str(caught.value) == (
                f"{name}: MS was 256 and is 128 now: its scale rests on that, so 'MR 10240' was not sent; "
                f"/units {name} takes it as it is now"
            )
            assert units.referenced(each, "") is kept
            assert units.of(each).sure is False
            assert list(each.counting.changes("")) == ["MS was 256 and is 128 now"]


async def test_a_scale_that_is_given_makes_the_session_scaled_and_is_confirmed_when_it_is_needed(tmp_path):
    async with on(tmp_path) as shop:
        units, a = shop.session.units, shop.session.drive("line", "a")
        assert not shop.session.scaled and units.of(a) is None and units.axes(a) == {}
        given = scale("5 mm/turn", ())
        axis = units.set(a, "", given)
        assert shop.session.scaled and units.of(a) is axis and units.scales(a) == {"": given}
        assert (axis.basis, axis.measure, axis.problem) == (None, None, "what it rests on has not been read")
        assert (await units.measure(a, "")) is axis.measure
        assert axis.sure and axis.problem == ""


async def test_an_axis_without_a_scale_is_named_as_it_is_typed(tmp_path):
    async with on(tmp_path, bus("eth", drive("LMDCM"), baud=0), bus("pmx", pmx("00"), baud=0)) as shop:
        units = shop.session.units
        for name, axis, says in (
            ("eth", "", "eth has no scale; /units eth: 5 mm/turn gives it one"),
            ("pmx", "x", "pmx:00.x has no scale; /units pmx:00.x 5 mm/turn gives it one"),
        ):
            with pytest.raises(Diagnostic) as caught:
                await units.measure(shop.session.drive(name), axis)
            assert str(caught.value) == says


async def test_units_of_no_drive_and_those_that_cannot_be_read_are_said_when_the_line_opens(tmp_path):
    shop = on(tmp_path, bus("pmx", pmx("00"), baud=0), c="5 mm/turn", **{"00_x": "5 mm/turn", "00_q": "1 mm/step"})
    notified = []
    shop.session.subscribe(lambda event: notified.append(getattr(event, "text", "")))
    async with shop:
        told = [each for each in notified if "units has" in each or "steps of a turn" in each]
        assert told == [
            "pmx: 00: the scale 5 mm/turn is by the motor's turn: the controller does not report the steps of a turn; "
            "give the scale by the step, as in 0.4 um/step, or full_steps",
            "pmx: units has c, which no drive there is",
            "pmx: units has 00.q, which no drive there is",
        ]


OVERHEARD = [
    ("aHM 1", True),
    ("aP=5", True),
    ("aMR 5", False),
    ("HM 1", False),
    ("bHM 1", False),
]


@pytest.mark.parametrize(("printed", "lost"), OVERHEARD)
async def test_a_homing_of_another_sender_is_noticed_for_the_drive_that_it_names(tmp_path, printed, lost):
    prints = f"program_text = '''\nPG 100\nLB G1\nPR \"{printed}\"\nE\nPG\n'''"
    async with on(tmp_path, bus("line", party("a"), party("b", prints), baud=0), a=ANCHORED) as shop:
        a = shop.session.drive("line", "a")
        await shop.session.run("@b EX G1")
        await asyncio.sleep(1)
        assert shop.session.units.referenced(a, "") is not lost
        assert (f"a: '{printed[1:]}' of another sender: its places are not referenced" in shop.warned()) is lost


READINGS = [("position", "mm", 125.0), ("position", "cm", 12.5), ("velocity", "mm/s", 0.0)]


@pytest.mark.parametrize(("what", "unit", "value"), READINGS)
async def test_a_position_or_a_velocity_is_read_in_a_unit(tmp_path, what, unit, value):
    async with on(tmp_path, a=ANCHORED) as shop:
        a = shop.session.drive("line", "a")
        await said(shop, "@a MR 51200")
        await said(shop, "/wait stopped")
        assert await shop.session.units.reading(a, "", what, unit) == value
        with pytest.raises(Diagnostic):
            await shop.session.units.reading(a, "", what, "deg" if what == "position" else "mm")
        a.state.reference_lost([""])
        if what == "velocity":
            assert await shop.session.units.reading(a, "", what, unit) == value
            return
        with pytest.raises(Diagnostic, match="^the position of a is not referenced; nothing was sent; home it, or "):
            await shop.session.units.reading(a, "", what, unit)


HERE = [
    ("10 deg", "/units here: 10 deg: the scale is 5 mm/turn; use mm"),
    ("10 mm/s", "/units here: 10 mm/s: the scale is 5 mm/turn; use mm"),
]


@pytest.mark.parametrize(("text", "says"), HERE)
async def test_here_takes_a_place_of_the_kind_of_its_scale_only(tmp_path, text, says):
    async with on(tmp_path, a="5 mm/turn") as shop:
        with pytest.raises(Diagnostic) as caught:
            await shop.session.units.here(shop.session.drive("line", "a"), "", text)
        assert str(caught.value) == says


async def test_a_drive_that_does_not_reply_as_its_scale_is_read_is_said_and_the_others_are_read(tmp_path):
    async with on(tmp_path, a=ANCHORED, b="5 mm/turn") as shop:
        units, line = shop.session.units, shop.session.buses["line"]
        shop.events.clear()
        shop.world("/sim power a off")
        await units.opened(line)
        told = [each for each in shop.warned() if "scale of" in each]
        assert len(told) == 1 and told[0].startswith("line: the scale of a is not confirmed: ")
        assert units.of(shop.session.drive("line", "b")).sure


async def test_a_quantity_without_braces_is_refused_only_where_a_number_is_taken(tmp_path):
    async with on(tmp_path, a="5 mm/turn") as shop:
        a = shop.session.drive("line", "a")
        for text, meant in (("MR 5 mm", "MR {5 mm}"), ("MR 5,5mm", "MR {5.5 mm}"), (" VM=5 mm/s", "VM={5 mm/s}")):
            with pytest.raises(Diagnostic) as caught:
                await shop.session.units.line(a, text)
            assert str(caught.value).endswith(f"has a unit; nothing was sent; write {meant}")
        for text in ("PR 5 mm", "MR 5", 'PR "5 mm"', "R1=5"):
            line = await shop.session.units.line(a, text)
            assert (line.text, line.check, line.values) == (text, None, "")
