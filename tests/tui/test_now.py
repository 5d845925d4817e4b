"""The line below the tabs, on every page: the worst thing on all lines with the key that helps, or what moves."""

from __future__ import annotations

from dataclasses import replace

import pytest

from multidrop.dialects.values import UNREAD, Conditions, Lamp
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.shell.events import OnBus
from multidrop.tui.panels.drive_columns import ALL_DRIVES
from multidrop.tui.panels.drive_table import drives_rows
from multidrop.tui.panels.machine import summary, worst_first
from multidrop.tui.panels.now import now_row
from multidrop.tui.panels.view import View
from multidrop.tui.screens.page import PAGES, Framed
from multidrop.tui.widgets.lines import width_of
from tests.support.fake_session import FakeBus, FakeDrive, FakeSession, emit, on_screen, press, settle
from tests.support.panel_rows import own_keys, plain, view

AT_LIMIT = Conditions(error=UNREAD, cause="limit+ is active", lamps=(Lamp("2", "lim+", True),))


def machine(**buses: str) -> FakeSession:
    """A session with lines of these drives."""
    return FakeSession(*(FakeBus(name, {each: FakeDrive(each) for each in drives}) for name, drives in buses.items()))


def shown(session: FakeSession, *events: OnBus) -> View:
    return replace(view(session, *events), keys=own_keys())


def rests(session: FakeSession, bus: str, *addresses: str) -> list[OnBus]:
    return [OnBus(bus, Sample(session.time, address, 500, 0)) for address in addresses]


def moves(session: FakeSession, bus: str, *addresses: str) -> list[OnBus]:
    return [OnBus(bus, Sample(session.time, address, 500, 70)) for address in addresses]


def limit(session: FakeSession, bus: str, address: str) -> OnBus:
    return OnBus(bus, Conditioned(session.time, address, (AT_LIMIT,)))


def test_the_line_is_empty_while_every_drive_is_at_rest_without_trouble() -> None:
    session = machine(press="ab", eth="c")
    assert now_row(shown(session, *rests(session, "press", "a", "b"), *rests(session, "eth", "c")), 80) == ()


def test_the_line_names_the_drives_that_move_and_counts_the_rest() -> None:
    session = machine(press="ab", eth="cd")
    some = shown(session, *moves(session, "press", "b"), *moves(session, "eth", "c"))
    assert plain(now_row(some, 80)).strip() == "▶ moving: press:b, eth:c"
    every = shown(session, *moves(session, "press", "a", "b"), *moves(session, "eth", "c", "d"))
    assert plain(now_row(every, 80)).strip() == "▶ moving: press:a, press:b, eth:c and 1 more"


def test_trouble_on_any_line_comes_before_motion_and_names_the_key_that_helps() -> None:
    session = machine(press="ab", eth="c")
    found = shown(session, *moves(session, "press", "a"), *rests(session, "eth", "c"), limit(session, "eth", "c"))
    assert plain(now_row(found, 80)).strip() == "✗ eth:c  lim+   ^A Enter why"


def test_a_drive_that_does_not_reply_is_worse_than_an_error() -> None:
    session = machine(press="ab", eth="c")
    session.time += 5
    silent = OnBus("eth", Silent(session.time, "c"))
    found = shown(session, limit(session, "press", "b"), silent)
    text = plain(now_row(found, 80)).strip()
    assert text.startswith("? eth:c  silent ") and text.endswith("1 more   ^A Enter why")


def test_a_line_on_which_no_drive_replies_offers_the_search() -> None:
    session = machine(press="a", line12="")
    session.buses["line12"].silent = "no drive replied at 9600 baud"
    found = shown(session, *rests(session, "press", "a"))
    assert (
        plain(now_row(found, 80)).strip() == "? silent line12: no drive replies   /scan line12 searches for its drives"
    )
    session.selected_bus = "line12"
    assert plain(now_row(shown(session), 80)).strip().endswith("Enter searches for its drives")


@pytest.mark.parametrize("width", [30, 60, 80, 120])
def test_the_line_fits_any_screen(width: int) -> None:
    session = machine(**{"a-line-with-a-long-name": "abcdefgh"})
    for events in (
        moves(session, "a-line-with-a-long-name", *"abcdefgh"),
        [limit(session, "a-line-with-a-long-name", "h")],
    ):
        assert width_of(now_row(shown(session, *events), width)) <= width


@pytest.mark.tui
async def test_every_page_has_the_line() -> None:
    async with on_screen(machine(press="ab"), 80, 24) as (pilot, app, session):
        await emit(pilot, *rests(session, "press", "a", "b"), limit(session, "press", "b"))
        for page in ("", *(entry.name for entry in PAGES)):
            if page:
                await app.run_action(f"act.page({page!r})")
                await settle(pilot)
            await emit(pilot, *rests(session, "press", "a"))
            framed = [screen for screen in app.screen_stack if isinstance(screen, Framed)][-1]
            assert "✗ press:b  lim+" in framed.lines("now").plain, page
            if page:
                await press(pilot, "escape", "escape")


# The table of drives


def test_the_table_has_a_row_for_each_axis_of_each_drive_of_each_line() -> None:
    session = machine(press="ab", eth="")
    session.buses["eth"].silent = "no drive replied"
    both = [OnBus("press", Sample(session.time, "b", position, 0, axis)) for axis, position in (("x", 5), ("y", -7))]
    rows = [plain(row) for row in drives_rows(shown(session, *rests(session, "press", "a"), *both), 75, 20)]
    assert rows[0].split() == ["drive", "state", "position", "error", "program", "last", "sent"]
    assert [row.split()[:1] for row in rows[1:]] == [["▸a"], ["b"], ["y"], ["eth"]]
    assert "■ at rest" in rows[1] and " 500" in rows[1] and "x 5" in rows[2] and "y -7" in rows[3]
    assert "? silent" in rows[4] and "no drive replies" in rows[4]
    assert len({row.index("■") for row in rows[1:4]}) == 1


def test_a_table_without_enough_room_leaves_out_what_matters_least_and_counts_it() -> None:
    session = machine(press="abcdefghijkl")
    events = [*rests(session, "press", *"abcdefghijkl"), limit(session, "press", "k")]
    rows = [plain(row) for row in drives_rows(shown(session, *events), 75, 6)]
    assert [row.split()[0] for row in rows[1:]] == ["▸a", "b", "c", "k", "8"]
    assert rows[-1].strip() == "8 more, all at rest   ^A shows them"
    worse = [
        plain(row)
        for row in drives_rows(shown(session, *events, *(limit(session, "press", each) for each in "efghij")), 75, 6)
    ]
    assert worse[-1].strip() == "8 more, 4 in trouble   ^A shows them"


def test_all_drives_have_a_row_for_a_line_without_drives_that_is_lost_or_silent() -> None:
    session = machine(press="a", eth="", usb="")
    session.buses["eth"].silent = "no drive replied"
    session.buses["usb"].lost = OSError("unplugged")
    found = worst_first(shown(session, *rests(session, "press", "a")), "")
    assert [place.name for place in found] == ["usb", "eth", "press:a"]
    assert summary(found) == "1 lost · 1 silent · 1 at rest"
    rows = [plain(ALL_DRIVES.row(place, shown(session), 120, False)) for place in found[:2]]
    assert "✗ lost" in rows[0] and "unplugged" in rows[0] and "? silent" in rows[1] and "no drive replies" in rows[1]
