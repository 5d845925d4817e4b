"""Numbers in engineering units: rows, plots, travel, and the key that shows the drives' own numbers."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.units import Basis, Measure, Takes, quantity, scale
from multidrop.dialects.values import Conditions, Lamp
from multidrop.drives.events import Conditioned, Sample
from multidrop.shell.events import Diverged, OnBus, Predicted, SettingsRead
from multidrop.shell.roles import Series
from multidrop.shell.units import ScaledAxis
from multidrop.tui.figures import NATIVE, figures_of
from multidrop.tui.panels.drive import drive_rows
from multidrop.tui.panels.drive_columns import ALL_DRIVES
from multidrop.tui.panels.drives import narrow_rows
from multidrop.tui.panels.machine import worst_first
from multidrop.tui.panels.plot import plot_rows
from multidrop.tui.widgets.lines import width_of
from tests.support.fake_session import FakeSession, a_move, demo_session, emit, on_screen, press
from tests.support.panel_rows import plain, view

pytestmark = pytest.mark.tui
FIVE = "5 mm/turn"


def moving(session: FakeSession, position: int, velocity: int, target: int | None = None) -> list[OnBus]:
    at = session.time - 0.1
    return [
        OnBus("press", Sample(at, "a", position, velocity)),
        OnBus("press", Conditioned(at, "a", (Conditions(target=target),))),
    ]


def scaled(given: str | dict[str, str] = FIVE, *, sure: bool = True) -> FakeSession:
    session = demo_session()
    session.units.give("a", given).sure = sure
    return session


def axis_of(text: str, turn: int = 51200) -> ScaledAxis:
    found = ScaledAxis(scale(text))
    found.accept(Basis((), Fraction(turn)))
    return found


def test_the_panel_of_a_drive_shows_each_number_with_its_unit() -> None:
    session = scaled()
    rows = plain(*drive_rows(view(session, *moving(session, 128000, 512000, 256000)), 44, 20))
    assert "50.00 mm/s" in rows and "   12.500 mm" in rows and "→ 25.000 mm" in rows
    assert "128000" not in rows and "512000" not in rows


def test_a_drive_without_a_scale_is_shown_as_before() -> None:
    session = scaled()
    moved = [OnBus("press", Sample(session.time - 0.1, "b", 128000, 0))]
    assert "128000" in plain(*narrow_rows(view(session, *moved), 80))


def test_the_drives_own_numbers_are_shown_on_demand() -> None:
    session = scaled()
    session.units.shown = False
    rows = plain(*drive_rows(view(session, *moving(session, 128000, 512000)), 44, 20))
    assert "128000" in rows and "512000" in rows and "mm" not in rows


def test_a_scale_that_is_not_confirmed_carries_a_question_mark() -> None:
    session = scaled(sure=False)
    shown = view(session, *moving(session, 128000, 512000))
    for rows in (drive_rows(shown, 44, 20), narrow_rows(shown, 80)):
        assert "12.500 mm?" in plain(*rows) and "50.00 mm/s?" in plain(*rows)


def test_rows_of_drives_have_units_in_a_narrow_screen() -> None:
    session = scaled()
    shown = view(session, *moving(session, 128000, 512000, 256000))
    rows = narrow_rows(shown, 80)
    assert "12.500 mm  50.00 mm/s → 25.000 mm" in plain(*rows)
    assert all(width_of(row) <= 80 for row in rows)
    (place,) = [each for each in worst_first(shown, "") if each.glance.address == "a"]
    assert "  12.500 mm   50.00 mm/s" in plain(ALL_DRIVES.row(place, shown, 80, False))


@pytest.mark.parametrize(
    ("given", "position", "bar", "ends"),
    [
        ("0..300 mm", 0, "├●", ("0.000 mm", "300.000 mm")),
        ("0..300 mm", 3072000, "●┤", ("0.000 mm", "300.000 mm")),
        ("0..300 mm", 3072000 + 51200, "▶┤", ("0.000 mm", "300.000 mm")),
        ("0..300 mm", -51200, "├◀", ("0.000 mm", "300.000 mm")),
    ],
)
def test_a_stated_travel_is_the_bar(given: str, position: int, bar: str, ends: tuple[str, str]) -> None:
    session = scaled({"scale": FIVE, "travel": given})
    rows = plain(*drive_rows(view(session, *moving(session, position, 0)), 44, 20))
    assert bar in rows and all(each in rows for each in ends) and " travel " in rows


def test_a_negative_scale_has_its_lower_end_at_the_left() -> None:
    session = scaled({"scale": "-5 mm/turn", "zero": "300 mm", "travel": "0..300 mm"})
    rows = plain(*drive_rows(view(session, *moving(session, 3072000 - 51200, 51200)), 44, 20)).splitlines()
    assert "5.000 mm" in rows[1] and "-5.00 mm/s" in rows[0]
    assert rows[2].startswith(" ├─●") and rows[3].startswith(" 0.000 mm")


def test_a_travel_that_does_not_count_is_not_drawn() -> None:
    session = scaled({"scale": FIVE, "travel": "0..300 mm"})
    session.buses["press"].drives["a"].unreferenced = frozenset({""})
    rows = plain(*drive_rows(view(session, *moving(session, 128000, 0)), 44, 20))
    assert "~12.500 mm" in rows and "travel" not in rows


def test_a_limit_that_is_reached_is_said_with_its_place_in_units() -> None:
    session = scaled()
    lit = Conditions(lamps=(Lamp("2", "lim+", True),))
    shown = view(
        session,
        *moving(session, 128000, 0),
        OnBus("press", Conditioned(session.time, "a", (lit,))),
    )
    assert any("12.500 mm" in each.text for each in shown.model.bus("press").fresh)


def test_a_twin_is_compared_in_units() -> None:
    session = scaled()
    at = session.time - 0.1
    shown = view(
        session,
        *moving(session, 128000, 0),
        OnBus("press", Predicted(at, "a", 133120, 0, -5120)),
        OnBus("press", Diverged(at, "a", -5120, 200, ("stall",))),
    )
    rows = plain(*drive_rows(shown, 60, 20))
    assert "13.000 twin" in rows and "-0.500 mm difference" in rows and "limit 0.020 mm" in rows


def test_a_plot_has_axes_and_values_in_units_and_its_range_is_that_of_the_values() -> None:
    session = scaled({"scale": FIVE, "travel": "-100..900 mm"})
    rows = plain(*plot_rows(view(session, *a_move(session)), 100, 30))
    assert "velocity a gantry mm/s" in rows and "position a gantry mm" in rows
    labels = [row.split("┤")[0].strip() for row in rows.split("position a gantry mm")[1].splitlines() if "┤" in row]
    assert labels == ["400", "200"], "the values go from 0 to 468"
    assert "▲ travel 900.000 mm" in rows and "▼ travel -100.000 mm" in rows
    assert "468.018 mm" in rows and "58.594 mm/s" in rows and "k ┤" not in rows


def test_drives_of_different_units_have_charts_of_their_own() -> None:
    session = scaled()
    session.units.give("b", "360 deg/turn")
    session.plotted = (Series("press", "a"), Series("press", "b"))
    moved = [OnBus("press", Sample(session.time - 5 + n, name, 1000 * n, 0)) for n in range(4) for name in ("a", "b")]
    rows = plain(*plot_rows(view(session, *moved), 100, 30))
    assert "position a gantry mm" in rows and "position b clamp deg" in rows
    session.units.shown = False
    assert "position steps" in plain(*plot_rows(view(session, *moved), 100, 30))


@given(
    st.sampled_from(["5 mm/turn", "-360 deg/turn", "0.4 um/step", "0.001 in/step", "7 turn/turn"]),
    st.sampled_from([200, 2000, 4000, 51200]),
    st.integers(-(2**31), 2**31 - 1),
)
def test_a_shown_place_typed_back_is_less_than_a_tenth_of_a_full_step_away(text: str, turn: int, counts: int) -> None:
    axis = axis_of(text, turn)
    figures = figures_of(axis, referenced=True)
    assert axis.measure is not None
    tenth = max(turn / 200 / 10, 1)
    assert axis.measure.number(quantity(figures.place(counts)), Takes.PLACE) == pytest.approx(counts, abs=tenth)


@pytest.mark.parametrize(
    ("given", "turn", "shown"),
    [
        (FIVE, 51200, "5.000 mm"),  # a full step is 0.025 mm
        ({"scale": FIVE, "full_steps": 400}, 51200, "5.000 mm"),
        ("360 deg/turn", 51200, "360.0 deg"),
        ("1 m/turn", 51200, "1.0000 m"),
        ("0.4 um/step", 51200, "20480 um"),  # a full step is 102.4 um
        ("300 mm/turn", 200, "300.0 mm"),  # a count is a full step
    ],
)
def test_a_place_has_the_decimals_of_a_tenth_of_a_full_step(
    given: str | dict[str, object], turn: int, shown: str
) -> None:
    axis = ScaledAxis(scale(given))
    axis.accept(Basis((), Fraction(turn)))
    assert figures_of(axis, referenced=True).place(turn) == shown


def test_a_scale_by_the_count_of_an_unknown_motor_has_the_decimals_of_a_count() -> None:
    axis = ScaledAxis(scale("0.4 um/step"))
    axis.accept(Basis((), None))
    assert figures_of(axis, referenced=True).place(1) == "0.4 um"


def test_velocities_in_units_of_a_chip_that_no_setting_tells_stay_as_they_are() -> None:
    axis = ScaledAxis(scale(FIVE))
    axis.accept(Basis((), Fraction(51200), None, None))
    assert isinstance(axis.measure, Measure)
    figures = figures_of(axis, referenced=True)
    assert (figures.place(51200), figures.speed(105)) == ("5.000 mm", "105")
    assert figures_of(ScaledAxis(scale(FIVE)), referenced=True) is NATIVE


async def test_the_palette_shows_the_drives_own_numbers_and_units_again() -> None:
    session = scaled()
    async with on_screen(session) as (pilot, app, _):
        await app.run_action("act.units")
        await pilot.pause()
        assert session.lines[-1][0] == "/units off"
        session.units.shown = False
        await press(pilot, "ctrl+a")
        await app.run_action("act.units")
        await pilot.pause()
        assert session.lines[-1][0] == "/units on"


async def test_rows_on_the_screen_change_with_the_switch() -> None:
    session = scaled()
    async with on_screen(session) as (pilot, app, _):
        await emit(pilot, *moving(session, 128000, 0))
        assert "12.500 mm" in app.main.lines("status").plain
        session.units.shown = False
        await emit(pilot, *moving(session, 128000, 0), SettingsRead("press", "a", session.time, None))
        assert "128000" in app.main.lines("status").plain
