"""The page of controls: one press is one bounded move, what comes while it moves is dropped, and each line is shown."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual import events
from textual.pilot import Pilot

from multidrop.dialects.controls import BY, NAMES, SET, SPEED, TARGET, TO
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.family import Family
from multidrop.dialects.values import Conditions
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.shell.events import OnBus
from multidrop.tui.readout import Readout, ReadoutState
from multidrop.tui.screens.controls import ControlsPage
from multidrop.tui.screens.jogging import Jog
from tests.support.fake_session import FakeSession, demo_session, emit, on_screen, press, settle

at_screen = pytest.mark.tui
UNSEEN = "nothing was sent: the drive was not shown yet"


# The rule


def at_rest(at: float) -> Readout:
    readout = Readout(period=0.1)
    readout.take(Sample(at, "a", 500, 0))
    return readout


def allows(
    jog: Jog, readout: Readout, now: float, *, idle: bool = True, state: ReadoutState = ReadoutState.AT_REST
) -> bool:
    return jog.allows(readout, readout, state, now, idle=idle)


def test_a_press_counts_at_rest_and_the_next_one_only_after_a_new_reading() -> None:
    jog, readout = Jog(), at_rest(10.0)
    assert allows(jog, readout, 10.1)
    assert not allows(jog, readout, 10.4)
    readout.take(Sample(10.5, "a", 600, 0))
    assert allows(jog, readout, 10.7)
    assert jog.dropped == 0


def test_a_held_key_moves_once_however_short_the_move_is() -> None:
    jog, readout = Jog(), at_rest(10.0)
    counted = 0
    for n in range(60):
        now = 10.1 + n * 0.033
        readout.take(Sample(now - 0.001, "a", 500, 0))
        counted += allows(jog, readout, now)
    assert (counted, jog.dropped) == (1, 59)


@pytest.mark.parametrize(
    ("state", "idle", "why"),
    [
        (ReadoutState.MOVING, True, "it moves"),
        (ReadoutState.SILENT, True, "it is silent"),
        (ReadoutState.LOST, True, "it is lost"),
        (ReadoutState.UNKNOWN, True, "it is not read yet"),
        (ReadoutState.STORING, True, "it is storing"),
        (ReadoutState.AT_REST, False, "a line is on its way"),
    ],
)
def test_a_press_is_dropped_unless_the_drive_is_known_to_rest(state: ReadoutState, idle: bool, why: str) -> None:
    jog = Jog()
    assert not allows(jog, at_rest(10.0), 10.1, idle=idle, state=state)
    assert (jog.dropped, jog.why) == (1, why)


def test_of_a_lost_drive_nobody_says_that_it_moves() -> None:
    readout = at_rest(9.0)
    readout.take(Sample(10.0, "a", 600, 50_000))
    assert Jog().obstacle(readout, readout, ReadoutState.LOST, 10.1) == "it is lost"
    assert Jog().obstacle(readout, readout, ReadoutState.MOVING, 10.1) == "it moves"


def test_an_axis_with_an_error_that_must_be_cleared_is_not_ready() -> None:
    readout = at_rest(10.0)
    readout.condition(10.0, [Conditions(error=128, error_text="plus limit error", clears="CLRX")])
    assert Jog().obstacle(readout, readout, ReadoutState.AT_REST, 10.1) == "plus limit error: CLRX clears it"
    readout.condition(10.0, [Conditions(error=86, error_text="stall")])
    assert Jog().obstacle(readout, readout, ReadoutState.AT_REST, 10.1) == ""


@given(st.lists(st.tuples(st.floats(0.001, 0.6), st.booleans()), max_size=40))
def test_between_two_moves_there_is_always_a_reading_at_rest(presses: list[tuple[float, bool]]) -> None:
    jog, readout, now, fresh = Jog(), at_rest(0.0), 0.0, True
    for gap, read in presses:
        now += gap
        if read:
            readout.take(Sample(now, "a", 1, 0))
        counted = allows(jog, readout, now)
        assert not counted or fresh or read
        fresh = read and not counted if counted else fresh or read


def test_every_family_has_every_control_or_the_reason_for_its_absence() -> None:
    for family in FAMILIES.values():
        controls = family(family.new_state(family.codec, "a")).values.controls("x" if family.name == "pmx" else "")
        assert set(controls) == set(NAMES)
        assert all(bool(each.lines) != bool(each.absent) for each in controls.values())


def test_a_controllers_moves_say_first_that_numbers_are_positions() -> None:
    family = FAMILIES["pmx"]
    controls = family(family.new_state(family.codec, "00")).values.controls("y")
    assert controls[BY].filled(by=-10, to=90) == controls[TO].filled(to=90) == ("ABS", "Y90")


# The page


async def opened(pilot: Pilot[int], session: FakeSession) -> ControlsPage:
    session.emit(OnBus("press", Sample(session.time - 0.05, "a", 1000, 0)))
    await press(pilot, "ctrl+n")
    page = pilot.app.screen
    assert isinstance(page, ControlsPage)
    return page


@at_screen
async def test_a_press_knows_the_last_reading_although_nothing_was_painted_for_it() -> None:
    """A drive at rest reports the same again and again, which is no reason to paint."""
    async with on_screen() as (pilot, _, session):
        await opened(pilot, session)
        session.time += 5
        session.emit(OnBus("press", Sample(session.time - 0.05, "a", 1000, 0)))
        await pilot.press("right")
        await settle(pilot)
        assert session.sent == ["press:a MR 100"]


@at_screen
async def test_each_press_sends_one_move_of_the_step_shown() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        assert "MR -100" in page.lines("controls").plain and "MR 100" in page.lines("controls").plain
        await press(pilot, "up", "right", "right", "left", "right")
        assert session.sent == ["press:a MR 1000"]
        assert "3 presses dropped" in page.lines("controls").plain
        session.time += 1
        await emit(pilot, OnBus("press", Sample(session.time - 0.1, "a", 2000, 0)))
        await press(pilot, "left")
        assert session.sent == ["press:a MR 1000", "press:a MR -1000"]


@at_screen
async def test_nothing_is_sent_while_it_moves_is_silent_or_a_line_runs() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await emit(pilot, OnBus("press", Sample(session.time, "a", 1500, 400)))
        await pilot.press("right")
        assert "a press is dropped now: it moves" in page.lines("controls").plain
        await emit(pilot, OnBus("press", Silent(session.time, "a")))
        session.time += 0.5
        for key in ("right", "h", "-", "enter"):
            await press(pilot, key)
        assert session.sent == []
        assert "not sent: " in page.lines("said").plain


WALK: tuple[tuple[tuple[str, ...], list[str]], ...] = (
    (("m", *"-250", "enter"), ["press:a MA -250"]),
    (("b", *"70", "enter"), ["press:a MR 70"]),
    (("l", *"12", "enter", "right"), ["press:a MR 12"]),
    (("h", "-", "enter"), ["press:a HM 1"]),
    (("h", "+", "enter"), ["press:a HM 3"]),
    (("h", "enter"), []),
    (("h", "a", "+", "enter"), []),
    (("space",), ["press:a SL 0"]),
    (("d", "enter", "enter", "e", "enter"), ["press:a DE=0", "press:a DE=1"]),
    (("h", "escape"), []),
    (("d", "space"), ["press:a SL 0"]),
    (("m", *"12x", "enter"), []),
    (("escape", "m", *"99999999999", "enter"), []),
    (("escape", "l", "0", "enter"), []),
    (("escape", "m", *"5", "escape"), []),
)


@at_screen
async def test_a_control_sends_its_line_and_a_wrong_number_sends_nothing() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        for keys, sent in WALK:
            session.time += 1
            await emit(pilot, OnBus("press", Sample(session.time - 0.05, "a", 1000, 0)))
            session.sent.clear()
            for key in keys:
                await press(pilot, key)
            assert session.sent == sent, keys
            assert sent or keys[-1] == "escape" or "nothing was sent" in page.lines("said").plain


@at_screen
async def test_a_letter_alone_neither_moves_nor_lets_go_and_a_stop_or_another_drive_drops_it() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        for letter in ("h-", "h+", "d", "e"):
            for after in ((), ("up", "enter"), ("ctrl+x", "enter"), ("escape", "enter")):
                await press(pilot, *letter, *after)
                assert session.sent == [], (letter, after)
                if not after:
                    assert "Enter sends" in page.lines("said").plain
        for keys in ("halt", "load", "/enable", "hd"):
            for key in (*keys, "enter"):  # a line that was typed to the wrong screen, in one read
                pilot.app.post_message(events.Key(key, key if len(key) == 1 else None))
            await settle(pilot)
            assert session.sent == [], keys
            await pilot.press("x")
        await press(pilot, "ctrl+o", "escape")
        assert pilot.app.screen is page
        for key in ("h", "-", "a", "enter"):
            await press(pilot, key)
        assert session.sent == [] and "nothing was sent" in page.lines("said").plain
        await pilot.press("d")
        session.select("b")
        await press(pilot, "enter")
        assert session.sent == []


@at_screen
async def test_a_disabled_axis_has_its_own_state_and_takes_no_move() -> None:
    async with on_screen() as (pilot, app, session):
        for address in "abc":
            await emit(pilot, OnBus("press", Sample(session.time - 0.05, address, 1000, 0)))
        assert "1 press ■ at rest" in app.main.lines("top").plain
        await emit(pilot, OnBus("press", Conditioned(session.time, "a", (Conditions(disabled="DE=0"),))))
        assert "1 press □ no current" in app.main.lines("top").plain
        status = app.main.lines("status").plain
        assert "a gantry □ no current" in status and "b clamp  ■ at rest" in status
        await press(pilot, "ctrl+n")
        await press(pilot, "right")
        page = app.screen
        assert isinstance(page, ControlsPage)
        assert "not sent: no current in the motor (DE=0)" in page.lines("said").plain
        assert "□ no current" in page.lines("drive").plain and "no current (DE=0)" in page.lines("drive").plain
        await press(pilot, "escape", "ctrl+a")
        shown = app.screen.lines("drives").plain  # type: ignore[attr-defined]
        assert "press:a gantry    □ no current" in shown
        assert session.sent == []


@at_screen
async def test_the_stop_of_the_drive_waits_for_no_line_and_counts_while_a_number_is_typed() -> None:
    session = demo_session()
    session.refuses["MR 100"] = "a: no answer"
    async with on_screen(session) as (pilot, _, _):
        await opened(pilot, session)
        session.gate = asyncio.Event()
        await press(pilot, "right", "m", "5", "space")
        assert session.sent == ["press:a MR 100", "press:a SL 0"]
        session.gate.set()
        await settle(pilot)
        await press(pilot, "space")
        assert session.sent[2:] == ["press:a /halt press:a"]


@pytest.mark.parametrize(
    ("key", "sent", "said"),
    [("space", ["press:a SL 0"], "SL 0"), ("b", [], UNSEEN), ("h", [], UNSEEN), ("right", [], UNSEEN)],
)
@at_screen
async def test_of_a_drive_that_is_not_shown_yet_the_stop_alone_is_sent(key: str, sent: list[str], said: str) -> None:
    async with on_screen() as (pilot, app, session):
        await settle(pilot)
        page = ControlsPage(app)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(page, "show", lambda view: None)
            await app.push_screen(page)
            await pilot.press(key)
            await pilot.pause()
        assert session.sent == sent
        assert said in page.said[0]


@at_screen
async def test_a_drive_that_is_selected_by_itself_moves_only_after_a_pause_and_stops_at_once() -> None:
    """A script closes the selected line, or `/use` of a macro selects another drive: the next press was not for it."""
    async with on_screen() as (pilot, app, session):
        page = await opened(pilot, session)
        session.select("b", "press")
        await emit(pilot, OnBus("press", Sample(session.time - 0.05, "b", 0, 0)))
        await settle(pilot)
        assert "press:b clamp" in page.lines("heading").plain, "it is shown"
        await press(pilot, "right", "m", "5", "enter", "h", "plus", "enter")
        assert session.sent == []
        await press(pilot, "space")
        assert session.sent == ["press:b SL 0"]
        app.keyboard.hear()  # a pause
        session.time += 1
        await emit(pilot, OnBus("press", Sample(session.time - 0.05, "b", 0, 0)))
        await press(pilot, "right")
        assert session.sent == ["press:b SL 0", "press:b MR 100"]


@at_screen
async def test_a_drive_that_a_person_chooses_on_the_page_takes_the_next_key() -> None:
    async with on_screen() as (pilot, app, session):
        await opened(pilot, session)
        await press(pilot, "ctrl+o", "down", "enter")
        assert session.addresses["press"] == "b"
        await emit(pilot, OnBus("press", Sample(session.time - 0.05, "b", 0, 0)))
        await press(pilot, "right")
        assert session.sent == ["press:b MR 100"]


@at_screen
async def test_a_refusal_is_shown_on_the_page() -> None:
    session = demo_session()
    session.refuses["MR 100"] = "a: error 83: plus limit reached"
    async with on_screen(session) as (pilot, _, _):
        page = await opened(pilot, session)
        await press(pilot, "right")
        assert "✗ a: error 83: plus limit reached" in page.lines("said").plain


@at_screen
async def test_a_stop_forgets_the_number_and_escape_leaves_it_then_the_page_and_stops_nothing() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, "m", "9", "ctrl+x")
        assert pilot.app.screen is page and session.stops == 1
        await press(pilot, "enter", "m", "escape")
        assert pilot.app.screen is page
        await press(pilot, "escape")
        assert not isinstance(pilot.app.screen, ControlsPage)
        assert (session.sent, session.stops) == ([], 1)


@at_screen
@pytest.mark.slow
async def test_the_simulated_drive_moves_by_one_step(tmp_path: Path) -> None:
    from tests.support.real_screen import until
    from tests.tui.test_session import app_of, press

    async with press(tmp_path) as pilot:
        readout = app_of(pilot).model.bus("press").readout("a")
        await pilot.press("ctrl+n")
        await until(pilot, lambda: isinstance(pilot.app.screen, ControlsPage))
        await until(pilot, lambda: "ready" in pilot.app.screen.lines("controls").plain)  # type: ignore[attr-defined]
        await pilot.press("up", "right")
        await until(pilot, lambda: readout.last is not None and readout.last[1:] == (1000, 0))


# Amounts in units


@at_screen
async def test_a_step_in_millimetres_is_sent_as_one_and_shown_in_steps_too() -> None:
    session = demo_session()
    session.units.give("a", "5 mm/turn")
    async with on_screen(session) as (pilot, _, _):
        page = await opened(pilot, session)
        assert "100 steps = " in page.lines("controls").plain
        await press(pilot, "l", *"1mm", "enter")
        assert page.step == "1 mm"
        assert "jog  1 mm = 10240 steps" in page.lines("controls").plain
        assert "MR {-1 mm}" in page.lines("controls").plain and "MR {1 mm}" in page.lines("controls").plain
        await press(pilot, "up", "right")
        assert session.sent == ["press:a MR {10 mm}"]
        await press(pilot, "down", "down")
        assert page.step == "0.1 mm"


@at_screen
async def test_a_target_in_millimetres_is_shown_while_it_is_typed_and_sent_as_one() -> None:
    session = demo_session()
    session.units.give("a", "5 mm/turn")
    async with on_screen(session) as (pilot, _, _):
        page = await opened(pilot, session)
        await press(pilot, "m")
        assert "move to a position: mm or steps, such as 1 mm or 10240" in page.lines("asked").plain
        await press(pilot, *"1", "space", *"mm")
        assert "→ MA {1 mm}  = 10240 steps" in page.lines("asked").plain
        assert session.sent == [], "a blank between number and unit is none of the stop's"
        await press(pilot, "enter")
        assert session.sent == ["press:a MA {1 mm}"]
        assert not page.lines("asked").display


@pytest.mark.parametrize(
    ("before", "keys"),
    [
        ((), ("m", "space")),
        ((), ("m", *"1", "space", "space")),
        ((), ("m", *"1mm", "space")),
        (("right",), ("m", *"1", "space")),
    ],
)
@at_screen
async def test_any_other_blank_in_an_entry_is_the_stop(before: tuple[str, ...], keys: tuple[str, ...]) -> None:
    session = demo_session()
    async with on_screen(session) as (pilot, _, _):
        await opened(pilot, session)
        await press(pilot, *before, *keys)
        assert session.sent[-1:] == ["press:a SL 0"]
        session.sent.clear()
        await press(pilot, *"mm", "enter")
        assert session.sent == [], "what was begun before the stop is not used"


WRONG = (
    ("1 furlong", "no unit furlong"),
    ("mm", "mm is no number with a unit"),
    ("", "nothing was typed"),
    ("99999999999", "out of range"),
    ("9000 m", "for the drive"),
    ("1 mm/s", "is a velocity"),
)


@pytest.mark.parametrize("key", ["l", "m", "b"])
@pytest.mark.parametrize(("text", "why"), WRONG)
@at_screen
async def test_a_wrong_amount_gets_one_line_and_changes_nothing(key: str, text: str, why: str) -> None:
    session = demo_session()
    session.units.give("a", "5 mm/turn")
    async with on_screen(session) as (pilot, _, _):
        page = await opened(pilot, session)
        await press(pilot, key)
        page.field.value = text  # pasted
        await press(pilot, "enter")
        said = " ".join(page.lines("said").plain.split())
        assert said.startswith("nothing was sent: ") and why in said
        assert (session.sent, page.step) == ([], "100")
        assert page.asked is not None, "it can be corrected"


@at_screen
async def test_an_axis_without_a_scale_takes_no_unit_and_a_step_in_one_ends_with_the_drive_that_had_it() -> None:
    session = demo_session()
    session.units.give("a", "5 mm/turn")
    async with on_screen(session) as (pilot, _, _):
        page = await opened(pilot, session)
        await press(pilot, "l", *"1mm", "enter")
        session.select("b", "press")
        await emit(pilot, OnBus("press", Sample(session.time - 0.05, "b", 0, 0)))
        await settle(pilot)
        assert page.step == "100"
        assert "the step is 100 again: 1 mm: the axis has no scale" in page.lines("said").plain
        assert session.sent == []


@pytest.mark.parametrize("key", ["up", "down", "tab", "escape"])
@at_screen
async def test_up_down_and_tab_leave_the_entry_and_left_and_right_stay_in_it(key: str) -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, "m", *"12", "left", "left", "left", "right", "right", "right", "left", *"5")
        assert page.field.value == "152"
        await press(pilot, key)
        assert page.asked is None and not page.field.display
        await press(pilot, "enter")
        assert (session.sent, page.step) == ([], "100")


@at_screen
async def test_a_key_that_does_nothing_names_the_keys_that_work() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        for key in ("x", "q", "7", "question_mark", "Q", "comma"):
            await press(pilot, key)
            said = " ".join(page.lines("said").plain.split())
            assert "does nothing here; " in said and "Space stop" in said, key
        await press(pilot, "plus")
        assert "h lists the homings" in page.lines("said").plain
        await press(pilot, "enter")
        assert "Enter sends a line that is shown" in page.lines("said").plain
        await press(pilot, "tab")
        assert "it has one axis" in page.lines("said").plain
        assert session.sent == []


@at_screen
async def test_an_enter_that_was_typed_before_the_line_was_shown_is_reported() -> None:
    async with on_screen() as (pilot, app, session):
        page = await opened(pilot, session)
        for key in ("d", "enter"):  # in one read
            app.post_message(events.Key(key, key if len(key) == 1 else None))
        await settle(pilot)
        assert session.sent == []
        assert "not sent: DE=0: Enter was typed before it was shown" in " ".join(page.lines("said").plain.split())
        await press(pilot, "enter")
        assert session.sent == ["press:a DE=0"]


def test_a_quantity_stands_where_every_family_takes_one() -> None:
    for family, axis in (("mcode", ""), ("modbus", ""), ("pmx", "x"), ("tmcl", "")):
        kind = FAMILIES[family]
        made = kind(kind.new_state(kind.codec, "a"))
        target = made.values.controls(axis)[TO].filled(to="{1 mm}")[-1]
        assert [target[field.start : field.stop] for field in made.units.fields(target)] == ["{1 mm}"], family
        distance = made.values.controls(axis)[BY].filled(by="{1 mm}", to=90)[-1]
        found = [distance[field.start : field.stop] for field in made.units.fields(distance)]
        assert found == (["90"] if family == "pmx" else ["{1 mm}"]), family


# Homings, errors, positions, changes on the fly


def made_of(family: str, product: str = "") -> Family:
    kind = FAMILIES[family]
    state = kind.new_state(kind.codec, "a")
    state.product = product or state.product
    return kind(state)


HOMINGS = {
    ("mcode", "", ""): [*(f"HM {n}" for n in (1, 3, 2, 4)), *(f"HI {n}" for n in (1, 3, 2, 4))],
    ("modbus", "", ""): [*(f"HM {n}" for n in (1, 3, 2, 4)), *(f"HI {n}" for n in (1, 3, 2, 4))],
    ("pmx", "x", ""): ["HX-", "HX+", "HLX-", "HLX+", "LX-", "LX+", "ZX-", "ZX+", "ZHX-", "ZHX+"],
    ("pmx", "y", ""): ["HY-", "HY+", "HLY-", "HLY+", "LY-", "LY+", "ZY-", "ZY+", "ZHY-", "ZHY+"],
    ("tmcl", "", ""): ["RFS START, 0"],
    ("tmcl", "2", "TMCM-3110"): [
        "RFS START, 2",
        *(f"SAP 193, 2, {mode}; RFS START, 2" for mode in (1, 65, 2, 66, 3, 4, 5, 6, 8, 7)),
    ],
}


@pytest.mark.parametrize(("family", "axis", "product"), HOMINGS)
def test_every_homing_of_a_family_is_listed(family: str, axis: str, product: str) -> None:
    found = made_of(family, product).values.homings(axis)
    assert ["; ".join(homing.lines) for homing in found] == HOMINGS[family, axis, product]
    assert all(homing.about for homing in found)


LINES = {
    ("mcode", ""): {SET: "P=7", SPEED: "", TARGET: ""},
    ("modbus", ""): {SET: "P=7", SPEED: "", TARGET: ""},
    ("pmx", "y"): {SET: "PY=7", SPEED: "SSPDY=7", TARGET: "TY7"},
    ("tmcl", "1"): {SET: "MST 1; SAP 1, 1, 7; SAP 0, 1, 7", SPEED: "SAP 4, 1, 7", TARGET: "MVP ABS, 1, 7"},
}


@pytest.mark.parametrize(("family", "axis"), LINES)
def test_what_changes_a_move_or_the_position_is_a_line_of_the_family_or_a_reason(family: str, axis: str) -> None:
    controls = made_of(family).values.controls(axis)
    for name, line in LINES[family, axis].items():
        assert "; ".join(controls[name].filled(to=7)) == line
        assert bool(line) != bool(controls[name].absent)


@pytest.mark.parametrize(
    ("keys", "sent"),
    [
        (("h", "down", "enter"), ["press:a HM 1"]),
        (("h", "down", "down", "down", "enter"), ["press:a HM 2"]),
        (("h", "up", "enter"), ["press:a HI 4"]),
        (("h", "+", "+", "enter"), ["press:a HM 4"]),
        (("h", "h", "enter"), ["press:a HM 1"]),
        (("h", "enter"), []),
        (("h", "down", "escape", "enter"), []),
        (("h", "down", "right", "enter"), []),
        (("h", "down", "x", "enter"), []),
        (("h", "down", "tab", "enter"), []),
        (("h", "down", "ctrl+x", "enter"), []),
        (("h", "down", "space", "enter"), ["press:a SL 0"]),
        (("r", "enter"), ["press:a PR ER"]),
        (("r", "escape", "enter"), []),
        (("p", *"0", "enter"), ["press:a P=0"]),
        (("p", "enter"), []),
        (("v",), []),
    ],
)
@at_screen
async def test_choosing_shows_the_line_and_enter_sends_it(keys: tuple[str, ...], sent: list[str]) -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        for key in keys:
            await press(pilot, key)
        assert session.sent == sent, page.said
        assert page.said[0] or keys[-1] == "escape"


@at_screen
async def test_the_list_of_homings_shows_every_line_and_the_one_that_enter_sends() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, "h")
        shown = page.lines("controls").plain
        assert all(f"{word} {n}" in shown for word in ("HM", "HI") for n in (1, 2, 3, 4))
        await press(pilot, "down", "down")
        assert "▌ home +" in page.lines("controls").plain
        assert "Enter sends HM 3 - seeks the home switch in plus" in page.lines("said").plain
        for key in ("h", "down", "enter"):  # in one read
            pilot.app.post_message(events.Key(key, key if len(key) == 1 else None))
        await settle(pilot)
        assert session.sent == []
        assert "not sent: " in page.lines("said").plain


@at_screen
async def test_a_position_is_not_set_while_the_axis_moves_and_no_target_is_changed_where_it_cannot() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, "p", *"7")
        await emit(pilot, OnBus("press", Sample(session.time, "a", 1500, 400)))
        await press(pilot, "enter")
        assert "not sent: whether the axis rests is unknown" in page.lines("said").plain
        await press(pilot, "m")
        assert "it moves, and no target here: the manual describes no change" in page.lines("said").plain
        await press(pilot, "v")
        assert "no speed here: a change of VM has no effect before the" in page.lines("said").plain
        assert (session.sent, page.asked) == ([], None)


# A second Space


@at_screen
async def test_a_second_space_within_three_seconds_is_the_hard_stop_of_the_drive() -> None:
    async with on_screen() as (pilot, _, session):
        await opened(pilot, session)
        for _ in range(2):  # in one read
            pilot.app.post_message(events.Key("space", " "))
        await settle(pilot)
        assert session.sent == ["press:a SL 0", "press:a /halt press:a"]
        for _ in range(9):  # a held key
            await press(pilot, "space")
        assert session.sent[2:] == []
        session.time += 1
        await press(pilot, "space")
        assert session.sent[2:] == ["press:a /halt press:a"]
        session.time += 4
        await press(pilot, "space")
        assert session.sent[3:] == ["press:a SL 0"]
        session.select("b", "press")
        await settle(pilot)
        await press(pilot, "space")
        assert session.sent[4:] == ["press:b SL 0"]
