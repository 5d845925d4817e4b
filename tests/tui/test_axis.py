"""The panel of a drive: travel, phase, time to go, lamps, error and age, as functions of what was read."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.values import UNREAD, Conditions, Lamp, Pace
from multidrop.drives.events import Sample
from multidrop.tui.panels.drive import LEARNT, SEEN, SOFTWARE, bar, drive_rows, phase, seconds_to_go, travel_of
from multidrop.tui.panels.drives import kept, narrow_rows, spark
from multidrop.tui.panels.view import Glance, View
from multidrop.tui.readout import Readout
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.widgets.lines import Row, width_of
from multidrop.tui.widgets.theme import Signs, shown_as
from tests.support.fake_session import demo_session

PACE = Pace(1000, 100_000, 1e6, 1e6)
LAMPS = (Lamp("1", "home", True), Lamp("2", "lim+", True), Lamp("1", "", None, output=True))
FACTS = Conditions(lamps=LAMPS, target=60_000, limits=(0, 100_000), run_current=25, hold_current=5, pace=PACE)


def readout(*points: tuple[float, int, int], conditions: Conditions | None = FACTS, period: float = 0.1) -> Readout:
    made = Readout(period=period, watched=1.0)
    for at, position, velocity in points:
        made.take(Sample(at, "a", position, velocity))
        if conditions is not None:
            made.condition(at, [conditions])
    return made


def view(made: Readout, now: float) -> View:
    session = demo_session()
    model = ScreenModel(lambda: "", lambda: session.buses)
    return View(session, model, [Glance("a", "left", "LMDCM", "LMDCM 6.002", made, selected=True)], now, True)


def text(rows: list[Row]) -> str:
    return "\n".join("".join(span for span, _ in row) for row in rows)


CRUISE = [(n / 10, 10_000 + n * 5000, 50_000) for n in range(5)]


def test_a_travel_is_that_of_software_limits_else_of_switches_else_what_was_seen() -> None:
    made = readout((0.0, 0, 0), (1.0, 500, 0))
    assert travel_of(made) == (0, 100_000, SOFTWARE)
    free = replace(FACTS, limits=None, lamps=(), target=None)
    made = readout((0.0, -50, 0), (1.0, 500, 0), conditions=free)
    assert travel_of(made) == (-50, 500, SEEN)
    made.travel.learn(replace(free, lamps=(Lamp("2", "lim-", True),)), -70)
    assert travel_of(made) == (-50, 500, SEEN)
    made.travel.learn(replace(free, lamps=(Lamp("3", "lim+", True),)), 900)
    assert travel_of(made) == (-70, 900, LEARNT)
    assert travel_of(readout((0.0, 7, 0), conditions=free)) is None
    assert travel_of(readout((0.0, 7, 100), conditions=replace(free, target=900))) == (7, 900, SEEN)


def test_a_position_that_the_drive_cannot_have_moved_to_begins_a_new_travel() -> None:
    made = readout((0.0, 0, 0), (0.1, 100, 0), conditions=replace(FACTS, limits=None))
    made.travel.at_switch["lim+"] = 100
    made.take(Sample(0.2, "a", 2_000_000, 0))  # P=2000000
    assert (made.travel.low, made.travel.high, made.travel.at_switch) == (2_000_000, 2_000_000, {})


@given(st.integers(-(2**31), 2**31 - 1), st.integers(6, 60))
def test_a_bar_has_its_width_and_one_place(position: int, width: int) -> None:
    drawn = bar(readout((0.0, position, 0)), width)
    assert len(drawn) == width
    assert drawn[0] == "├" and drawn[-1] == "┤"
    assert sum(drawn.count(sign) for sign in "●◀▶") == 1
    assert ("◀" in drawn) is (position < 0) and ("▶" in drawn) is (position > 100_000)


def test_a_range_that_was_only_seen_has_no_ends_that_look_like_limits() -> None:
    drawn = bar(readout((0.0, 0, 0), (1.0, 90, 0), conditions=None), 12)
    assert "├" not in drawn and "●" in drawn
    assert set(bar(Readout(), 12)) == {"┊", "┄"}


@pytest.mark.parametrize(
    ("velocities", "said"),
    [((0, 0, 0), ""), ((5000,), ""), ((1000, 5000, 9000), "speeding up"), ((9000, 5000, 900), "slowing down")]
    + [((-9000, -9000, -9000), "cruising"), ((-100, -5000, -9000), "speeding up")],
)
def test_the_phase_of_a_move(velocities: tuple[int, ...], said: str) -> None:
    assert phase(readout(*((n / 10, 0, v) for n, v in enumerate(velocities)))) == said


def test_the_time_to_go_is_that_of_the_profile() -> None:
    moving = readout(*[(n / 10, n * 10_000, 100_000) for n in range(3)])  # at 20000 with full speed
    ramp = (100_000 - 1000) / 1e6
    slowing = (100_000**2 - 1000**2) / 2e6
    assert seconds_to_go(moving, 0.2) == pytest.approx((40_000 - slowing) / 100_000 + ramp, abs=1e-6)
    assert seconds_to_go(moving, 0.3) == pytest.approx((40_000 - slowing) / 100_000 + ramp - 0.1, abs=1e-6)


@pytest.mark.parametrize(
    "facts", [None, replace(FACTS, target=None), replace(FACTS, pace=None), replace(FACTS, target=-5)]
)
def test_no_time_to_go_without_target_profile_or_direction(facts: Conditions | None) -> None:
    assert seconds_to_go(readout(*CRUISE, conditions=facts), 0.4) is None


@given(st.integers(1, 10**6), st.integers(1, 100_000), st.integers(0, 100_000))
def test_a_time_to_go_is_never_negative(left: int, speed: int, slowest: int) -> None:
    facts = replace(FACTS, target=left, pace=Pace(slowest, 100_000, 1e6, 5e5))
    found = seconds_to_go(readout((0.0, 0, speed), conditions=facts), 0.0)
    assert found is not None and found >= 0


def test_the_panel_shows_what_the_drive_does() -> None:
    shown = text(drive_rows(view(readout(*CRUISE), 0.4), 50, 20))
    for each in ("▶ moving", "cruising", "s to go", "30000 steps", "→ 60000", "50000 steps/s", "software limits"):
        assert each in shown
    for each in ("1 home ●", "2 lim+ ●", "error none", "run 25 %", "hold 5 %"):
        assert each in shown
    assert "out" not in shown, "a lamp without a function that the drive does not report"


def test_an_error_is_below_the_state_and_its_number_is_not_invented() -> None:
    wrong = replace(FACTS, error=UNREAD, error_text="PR ER shows and clears it")
    rows = drive_rows(view(readout((0.0, 5, 0), conditions=wrong), 0.1), 50, 20)
    assert "✗ error: PR ER shows" in text(rows[1:2]) and rows[1][0][1] == "error"
    assert "✗ lim+" in text(narrow_rows(view(readout((0.0, 5, 0), conditions=wrong), 0.1), 80))


def test_an_error_that_polls_report_as_well_is_shown_once_and_not_only_as_an_old_one() -> None:
    limit = replace(FACTS, error=128, error_text="plus limit error")
    made = readout((0.0, 5, 0), conditions=limit)
    made.take(Sample(0.1, "a", 5, 0, trouble="plus limit error"))
    assert text(drive_rows(view(made, 0.2), 50, 20)).count("plus limit error") == 1
    made.take(Sample(9.0, "a", 5, 0, trouble="plus limit error"))
    rows = drive_rows(view(made, 9.0), 50, 20)
    assert rows[1] == ((" ✗ plus limit error", "error"),) and "(old)" in text(rows)
    made.take(Sample(9.1, "a", 5, 0, trouble="stalled"))
    assert "✗ stalled" in text(drive_rows(view(made, 9.1), 50, 20))


def test_old_conditions_are_dim_and_say_their_age() -> None:
    made = readout(*CRUISE)
    rows = drive_rows(view(made, 9.0), 50, 20)
    assert "read 9 s ago" in text(rows) and "to go" not in text(rows) and "→" not in text(rows)
    assert {role for row in rows for span, role in row if "●" in span} == {"dim"}


def test_a_silent_drive_shows_no_motion() -> None:
    made = readout(*CRUISE)
    made.no_answer(3.0)
    shown = text(drive_rows(view(made, 3.0), 50, 20))
    assert "? silent" in shown and "moving" not in shown and "cruising" not in shown


@given(st.integers(30, 130), st.integers(1, 30), st.floats(0, 100))
def test_a_panel_keeps_its_room(width: int, height: int, now: float) -> None:
    rows = drive_rows(view(readout(*CRUISE), now), width, height)
    assert len(rows) <= height
    assert all(width_of(row) <= max(width, 48) for row in rows)


def test_few_rows_keep_the_selected_drive_and_those_in_trouble() -> None:
    drives = [Glance(name, "", "LMDCM", "", Readout()) for name in "abcdefg"]
    drives[4] = replace(drives[4], selected=True)
    drives[6].readout.no_answer(1.0)
    assert [each.address for each in kept(drives, 3)] == ["a", "e", "g"]


def test_a_sparkline_has_its_width_and_is_empty_before_the_first_sample() -> None:
    assert spark(Readout(), 1.0, 7) == " " * 7
    drawn = spark(readout(*CRUISE), 0.4, 9)
    assert len(drawn) == 9 and drawn[-1] != " " and drawn[0] == " "


def test_every_sign_of_a_bar_has_one_for_each_font() -> None:
    known, seen = bar(readout(*CRUISE), 20), bar(readout((0.0, 0, 0), (1.0, 9, 0), conditions=None), 20)
    for signs in (Signs.BOXES, Signs.ASCII):
        assert "?" not in shown_as(known + seen + "≠−○●·", signs)
        assert shown_as(known, signs) != shown_as(seen, signs)
    assert shown_as(known, Signs.ASCII).isascii()
