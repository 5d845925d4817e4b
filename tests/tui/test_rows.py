"""The lines of the main screen as functions of the facts."""

from dataclasses import replace
from datetime import datetime
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.style import Style

from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import Conditioned, Sample
from multidrop.drives.stopping import Fate
from multidrop.shell.events import OnBus, StateChanged
from multidrop.shell.stop_report import DriveFate, FateTally
from multidrop.tui.panels.drive import drive_rows
from multidrop.tui.panels.drive_table import drives_rows
from multidrop.tui.panels.drives import narrow_rows
from multidrop.tui.panels.table import PANELS, Panel, column_rows
from multidrop.tui.panels.view import Glance, View, firmware_of
from multidrop.tui.readout import Readout, ReadoutState
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.widgets.bars import STOP, Footer, banner_row, footer_row
from multidrop.tui.widgets.lines import Lines, width_of
from multidrop.tui.widgets.theme import Signs, shown_as
from tests.support.fake_session import FakeDrive, demo_session, emit, on_screen, press
from tests.support.panel_rows import plain

KEYS = [("F1", "help"), *((f"F{n}", f"macro-number-{n}") for n in range(2, 13)), ("^Q", "quit")]
states = st.sampled_from(list(ReadoutState))


def glance(address: str, *points: tuple[float, int, int], **more: bool) -> Glance:
    readout = Readout()
    for at, position, velocity in points:
        readout.take(Sample(at, address, position, velocity))
    return Glance(address, "", "LMDCM", "LMDCM 6.002, Hw: 3.2", readout, **more)


def view(*glances: Glance, now: float = 1.0, polling: bool = True) -> View:
    session = demo_session()
    return View(session, ScreenModel(lambda: "", lambda: {}), glances, now, polling)


@given(st.integers(60, 250), st.booleans(), st.booleans())
def test_the_footer_always_begins_with_the_stop_and_never_overflows(width: int, recording: bool, latched: bool) -> None:
    row = footer_row(KEYS, recording, latched, width)
    assert plain(row).strip().startswith(STOP)
    assert width_of(row) <= width


@given(st.integers(30, 250))
def test_the_footer_shows_progress_after_the_stop(width: int) -> None:
    row = footer_row(KEYS, False, False, width, "a: download: 120 of 400, 3 s left")
    assert plain(row).strip().startswith(f"{STOP}   a: downl")
    assert width_of(row) <= width


def test_the_footer_gives_way_from_the_right() -> None:
    wide, narrow = plain(footer_row(KEYS, False, False, 300)), plain(footer_row(KEYS, False, False, 60))
    assert "^Q quit" in wide
    assert wide.startswith(narrow)
    assert len(narrow) < len(wide)


def test_a_click_on_the_stop_is_one_and_beside_it_none() -> None:
    row = plain(footer_row(KEYS, False, False, 80))
    assert all(Footer.is_stop(row.index(STOP) + n) for n in range(len(STOP)))
    assert not Footer.is_stop(row.index("F1"))


def test_columns_do_not_jump_when_values_change() -> None:
    small = [glance("a", (1.0, 0, 0), selected=True), glance("b", (1.0, 5, 5))]
    large = [glance("a", (1.0, -2_147_483_648, -5_000_000), selected=True), glance("b", (1.0, 5, 0))]
    for now in (1.0, 9.0):
        one, other = view(*small, now=now), view(*large, now=now)
        for left, right in zip(
            column_rows([PANELS[:1]], one, 39, 14, True), column_rows([PANELS[:1]], other, 39, 14, True), strict=True
        ):
            assert plain(left).rstrip().rfind("steps") == plain(right).rstrip().rfind("steps")
        rows = [narrow_rows(each, 80)[0] for each in (one, other)]
        assert width_of(rows[0]) == width_of(rows[1]) == 80
        assert width_of(rows[0][:4]) == width_of(rows[1][:4])


def test_an_old_value_is_dim_and_says_its_age() -> None:
    drive = glance("a", (1.0, 512_000, 100), selected=True)
    fresh, old = (narrow_rows(view(drive, now=now), 80)[0] for now in (1.1, 4.0))
    assert ("▶ moving" in plain(fresh), "▶ 3 s ago " in plain(old)) == (True, True)
    assert [role for text, role in fresh if "512000" in text] == ["strong"]
    assert [role for text, role in old if "512000" in text] == ["dim"]


def test_a_lost_bus_says_so_of_its_drives_and_polls_nothing() -> None:
    text = "\n".join(map(plain, narrow_rows(view(glance("a", (1.0, 0, 0), selected=True, lost=True), now=1.0), 80)))
    assert "✗ lost" in text
    assert "not polled" in text
    assert "stopped" not in text


def test_polling_says_what_it_costs_and_when_it_is_off() -> None:
    drive = glance("a", *((n / 10, 0, 0) for n in range(21)), selected=True)
    assert "polls 10 Hz" in plain(narrow_rows(view(drive, now=2.0), 80)[1])
    assert "polling off" in plain(narrow_rows(view(drive, now=2.0, polling=False), 80)[1])


def test_the_firmware_is_the_number_alone() -> None:
    assert firmware_of(glance("a")) == "6.002"


@given(st.integers(0, 5), st.integers(4, 60), st.booleans(), st.lists(st.sampled_from(PANELS), unique=True))
def test_a_column_takes_exactly_its_room_and_names_what_finds_none(
    others: int, height: int, border: bool, panels: list[Panel]
) -> None:
    drives = [glance("a", (1.0, 5, 5), selected=True), *(glance(str(n)) for n in range(others))]
    rows = column_rows([[each] for each in panels], view(*drives), 39, height, border)
    assert len(rows) == height
    assert all(width_of(row) <= 39 for row in rows)
    assert not border or all(plain(row)[0] in "│├" for row in rows)
    if sum(panel.least + 1 for panel in panels) > height:
        assert "no room: " in plain(rows[-1])


STANDING, MOVING, UNKNOWN, UNREACHED = Fate.STANDING, Fate.MOVING, Fate.NOT_KNOWN, Fate.NOT_REACHED


def tally(*found: tuple[Fate, str], vain: bool = False) -> FateTally:
    """Facts about drives, by `bus:address`."""
    each = (DriveFate(fate, name, name.partition(":")[0], "lost" if fate is UNREACHED else "") for fate, name in found)
    return FateTally(datetime(2026, 11, 21, 12, 41, 9), tuple(each), vain)


NINE = [(STANDING, f"press:{name}") for name in "abcdefghi"]
GONE = [(UNREACHED, f"line:{name}") for name in "abc"]


def test_the_banner_says_stopped_only_when_every_drive_was_read_at_velocity_0() -> None:
    stood = "■ STOPPED   velocity 0 was read from all 9       /resume lets macros run"
    assert plain(banner_row(tally(*NINE), "", 100)).strip() == stood
    for fate in set(Fate) - {STANDING}:
        assert "STOPPED" not in plain(banner_row(tally(*NINE, (fate, "eth:x")), "", 100))


def test_the_banner_names_what_is_not_known_and_what_was_not_reached() -> None:
    whole = "‼ STOP SENT 12:41:09   9 at rest   1 NOT KNOWN: noisy   3 NOT REACHED: line (lost) - use the E-stop"
    known = tally(*NINE, (UNKNOWN, "noisy"), *GONE)
    assert plain(banner_row(known, "line: gone", 120)).strip() == whole
    assert plain(banner_row(known, "", 80)).strip() == (
        "‼ STOP SENT   1 NOT KNOWN: noisy   3 NOT REACHED: line (lost) - use the E-stop"
    )
    assert "1 STILL MOVING: press:x" in plain(banner_row(tally(*NINE, (MOVING, "press:x")), "", 80))
    vain = plain(banner_row(tally(*NINE, (MOVING, "press:x"), vain=True), "", 80))
    assert vain.strip().endswith("1 STILL MOVING: press:x - use the E-stop")


@given(
    st.lists(st.tuples(st.sampled_from(list(Fate)), st.sampled_from(["press:a", "line", "eth:long-name"]))), st.data()
)
def test_no_banner_of_60_columns_or_more_loses_the_emergency_stop(
    found: list[tuple[Fate, str]], data: st.DataObject
) -> None:
    text = plain(banner_row(tally(*found), "", data.draw(st.integers(60, 200))))
    urgent = {UNKNOWN, UNREACHED} & {fate for fate, _ in found}
    assert ("- use the E-stop" in text) is bool(urgent)


def test_the_banner_tells_a_lost_bus_in_front_of_drives_that_stood() -> None:
    assert plain(banner_row(None, "gone", 80)).strip() == "✗ LOST - gone"
    before = plain(banner_row(tally(*NINE), "gone", 80))
    assert before.strip() == "✗ LOST - gone; before that velocity 0 was read from all 9" and "STOPPED" not in before
    assert banner_row(None, "", 80) == ()


def test_no_banner_is_cut_before_its_advice() -> None:
    loss = plain(banner_row(tally(*NINE), "/dev/ttyUSB0: " + "unplugged " * 20 + "; trying again", 80))
    assert loss.rstrip().endswith("…; trying again") and len(loss) == 80
    one = plain(banner_row(tally((STANDING, "a-line-with-a-very-long-name-indeed")), "", 60))
    assert one.strip() == "■ STOPPED   /resume lets macros run"


def test_red_is_for_what_is_not_confirmed_and_each_alarm_has_a_sign_of_its_own() -> None:
    assert {role for _, role in banner_row(tally(*NINE), "", 80)} == {"latched"}
    red = [banner_row(tally(*NINE, (fate, "x")), "", 80) for fate in (UNREACHED, MOVING, Fate.RUNNING, UNKNOWN)]
    red.append(banner_row(None, "gone", 80))
    assert {role for row in red for _, role in row} == {"stop"}
    assert [plain(row)[1] for row in red] == ["‼", "▶", "▷", "?", "✗"]
    assert len({shown_as(plain(row), Signs.ASCII)[1] for row in red}) == 5


def two_axes(width: int = 60) -> Glance:
    readout = Readout(period=0.1)
    for at in (9.8, 9.9, 10.0):
        readout.take(Sample(at, "00", 1234, 0, "x", "minus limit error"))
        readout.take(Sample(at, "00", -77, 300, "y"))
    return Glance("00", "", "PMX-2ED-SA", "V128BL", readout, selected=True)


def test_both_axes_of_a_drive_are_shown_with_what_is_wrong_with_each() -> None:
    shown = two_axes()
    wide = "\n".join(plain(row) for row in drive_rows(view(shown, now=10.0), 44, 30))
    assert wide.index(" x ■ at rest") < wide.index("x ✗ minus limit error") < wide.index("1234")
    assert wide.index("1234") < wide.index(" y ▶ moving") < wide.index("-77")
    first, second, _ = (plain(row) for row in narrow_rows(view(shown, now=10.0), 120))
    assert "00 x" in first and "1234" in first and "✗ minus limit error" in first
    assert " y " in second and "▶ moving" in second and "-77" in second and "300/s" in second


def test_the_second_axis_alone_makes_a_drive_move() -> None:
    assert two_axes().state() is ReadoutState.MOVING


def test_a_row_from_elsewhere_acts_on_no_terminal() -> None:
    lines = Lines()
    lines.style_of = lambda role: Style()  # type: ignore[method-assign]
    strip = lines.strip((("left \x1b]0;x\x07\u202e", "text"),), 40)
    assert strip.text.rstrip() == r"left \x1b]0;x\x07\u202e"


@pytest.mark.tui
async def test_a_position_without_reference_has_its_sign_everywhere() -> None:
    session = demo_session()
    drive = cast(FakeDrive, session.buses["press"].drives["a"])
    async with on_screen(session, 120, 40) as (pilot, app, _):
        for address in "ab":
            await emit(pilot, OnBus("press", Sample(session.time - 0.05, address, 1234, 0)))
        assert "~1234" not in app.main.lines("side").plain
        drive.unreferenced = frozenset({""})
        await emit(pilot, StateChanged(session.time))
        side = app.main.lines("side").plain
        assert app.main.lines("panel").plain.count("~1234") == 1
        assert side.count("~1234") == 1 and "not referenced: home it, set it, or /referenced a" in side
        await press(pilot, "ctrl+a")
        shown = app.screen.lines("drives").plain.splitlines()  # type: ignore[attr-defined]
        marked = [row for row in shown if "~1234" in row]
        assert len(marked) == 1 and "press:a" in marked[0] and "not referenced" in marked[0]
        assert session.sent == []


def test_drives_in_trouble_that_have_no_row_are_counted() -> None:
    glances = [glance(each, (0.5, 500, 0)) for each in "abcdefgh"]
    shown = [replace(glances[0], selected=True), *glances[1:]]
    assert "+5 ^A" in plain(narrow_rows(view(*shown), 80)[-1])
    assert plain(drives_rows(view(*shown), 45, 4)[-1]).strip() == "7 more (1 ✗); ^A shows all drives", "a lost line"
    for each in shown[2:7]:
        each.readout.note(Conditioned(0.5, each.address, (Conditions(error=UNREAD, error_text="PR ER shows it"),)))
    assert "+5 (3 ✗) ^A" in plain(narrow_rows(view(*shown), 80)[-1])
    assert plain(drives_rows(view(*shown), 45, 4)[-1]).strip() == "7 more (4 ✗); ^A shows all drives"
