"""The page of parameters: search, comparison, an edit that is checked and seen before it is sent."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.pilot import Pilot

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.values import IO, VARIABLES, Reading, Readings
from multidrop.shell.events import SettingsRead
from multidrop.tui.screens.parameters import ParametersPage, edit, found_in, meanings_of, parsed, rows
from tests.support.fake_session import FakeSession, demo_session, emit, on_screen, press, settle

at_screen = pytest.mark.tui
FOUND = Readings(
    (
        Reading("A", 1_000_000, unit="steps/s²", default=1_000_000),
        Reading("MS", 256, unit="", default=256),
        Reading("VI", 1000, unit="steps/s", default=1000),
        Reading("VM", 600_000, unit="steps/s", default=768_000),
        Reading("IS1", (1, 0), IO, default=(0, 0)),
        Reading("DN", "a", fixed=True),
        Reading("Q1", 7, VARIABLES),
    )
)


# The table


@pytest.mark.parametrize(
    ("text", "value"),
    [("600000", 600_000), (" -5 ", -5), ("1.5", 1.5), ("1, 1,0", (1, 1, 0)), ("[2, 0]", (2, 0)), ("b", "b")],
)
def test_a_typed_value(text: str, value: object) -> None:
    assert parsed(text) == value


@pytest.mark.parametrize("text", ["", " ", "1,,2", "ü", "\x07"])
def test_what_is_no_value(text: str) -> None:
    with pytest.raises(Diagnostic):
        parsed(text)


@given(st.text(max_size=30))
def test_any_text_is_a_value_or_one_clear_line(text: str) -> None:
    try:
        parsed(text)
    except Diagnostic as failure:
        assert "\n" not in str(failure) or "\n" in text


def test_differences_are_those_of_values_that_both_have() -> None:
    table = rows(FOUND, {"VM": 768_000, "MS": 256.0, "IS1": (1, 0), "ZZ": 1}, {})
    assert [row.reading.name for row in table if row.differs] == ["VM"]
    assert {row.reading.name: row.other for row in table}["A"] == ""
    assert not any(row.differs for row in rows(FOUND, None, {}))


def test_a_search_finds_names_first_then_values_and_meanings() -> None:
    meanings = meanings_of(FOUND, FAMILIES["mcode"].language, "LMDCM")
    table = rows(FOUND, None, meanings)
    assert found_in(table, "vm")[0].reading.name == "VM"
    assert [row.reading.name for row in found_in(table, "600000")] == ["VM"]
    assert "VI" in [row.reading.name for row in found_in(table, "velocity")]
    assert [row.reading.name for row in found_in(table, "variables")] == ["Q1"]


def test_an_edit_is_planned_by_the_family() -> None:
    family = FAMILIES["mcode"]
    state = family.new_state(family.codec, "a")
    state.identified("LMDCM", "LMDCM 6.002")
    assert edit(family(state).values.parameters, FOUND, "VM", 500_000).lines == ("VM=500000",)
    with pytest.raises(Diagnostic, match="VM"):
        edit(family(state).values.parameters, FOUND, "VM", 900)
    with pytest.raises(Diagnostic, match="already"):
        edit(family(state).values.parameters, FOUND, "VM", 600_000)
    assert "communication" in edit(family(state).values.parameters, FOUND, "DN", "b").warning


# The page


async def opened(pilot: Pilot[int], session: FakeSession, found: Readings | None = FOUND) -> ParametersPage:
    if found is not None:
        session.emit(SettingsRead(session.time, "press", "a", found))
    await pilot.app.run_action("act.page('parameters')")
    await settle(pilot)
    page = pilot.app.screen
    assert isinstance(page, ParametersPage)
    return page


DEFAULTS = ("ctrl+p", *"with the defaults", "enter")
DIFFERING = ("ctrl+p", *"only what", "enter")


def names(page: ParametersPage) -> list[str]:
    return [row.lstrip("▸ ≠").split()[0] for row in page.lines("table").plain.split("\n") if row.strip()]


@at_screen
async def test_settings_are_read_when_the_page_opens_and_again_by_name() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session, None)
        assert "not read yet" in page.lines("table").plain and session.sent == ["press:a /params read"]
        await press(pilot, "ctrl+p", *"read again", "enter")
        assert session.sent == ["press:a /params read"] * 2


@at_screen
async def test_search_compare_and_differences_only() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        assert names(page) == ["A", "MS", "VI", "VM", "IS1", "DN", "Q1"]
        await press(pilot, *DEFAULTS, *DIFFERING)
        assert names(page) == ["VM", "IS1"]
        await press(pilot, *"vm")
        assert names(page) == ["VM"] and "768000" in page.lines("table").plain
        await press(pilot, "ctrl+u", *DIFFERING, "ctrl+p", *"show the variables", "enter")
        assert names(page) == ["Q1"]
        assert session.sent == []


@at_screen
async def test_values_are_followed_by_what_they_are_in_units() -> None:
    async with on_screen() as (pilot, _, session):
        session.units.give("a", "5 mm/turn")
        page = await opened(pilot, session)
        shown = page.lines("table").plain.splitlines()
        assert [each for each in shown if " VM " in each and "600000 steps/s" in each and "58.59375 mm/s" in each]
        assert [each for each in shown if " MS " in each and "mm" not in each]


@at_screen
async def test_a_value_is_checked_then_shown_then_sent_and_read_again() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, *"vm", "enter")
        await press(pilot, *"10", "enter")
        assert "nothing was sent" in page.lines("said").plain and session.sent == []
        await press(pilot, *["backspace"] * 2, *"500000", "enter")
        assert "Enter sends VM=500000" in page.lines("said").plain and session.sent == []
        await press(pilot, "enter")
        assert session.sent == ["press:a VM=500000", "press:a /params read"]


@at_screen
async def test_an_enter_in_the_same_read_takes_the_setting_that_the_last_letter_leaves() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        page.field.value = "v"
        await settle(pilot)  # the rows of this are painted, those of the next letter are not
        page.field.value = "vm"
        await page.field.action_submit()
        assert page.said[0].startswith("VM: ")


@at_screen
async def test_escape_and_a_stop_send_nothing() -> None:
    async with on_screen() as (pilot, _, session):
        await opened(pilot, session)
        for end in ("escape", "ctrl+x"):
            await press(pilot, "enter", *["backspace"] * 7, *"70000", "enter")
            await press(pilot, end)
            assert isinstance(pilot.app.screen, ParametersPage)
        await pilot.press("escape")
        assert session.sent == []


@at_screen
@pytest.mark.slow
async def test_a_file_and_another_drive_to_compare_with(tmp_path: Path) -> None:
    session = demo_session()
    (tmp_path / "a.toml").write_text("[parameters]\nVM = 100\n")
    async with on_screen(session) as (pilot, _, _):
        page = await opened(pilot, session)
        await pilot.press("ctrl+p", *"with a file", "enter")
        page.field.value = str(tmp_path / "none.toml")
        await press(pilot, "enter")
        assert "nothing was sent" in page.lines("said").plain
        page.field.value = str(tmp_path / "a.toml")
        await press(pilot, "enter", *DIFFERING)
        assert names(page) == ["VM"] and "a.toml" in page.lines("columns").plain
        await emit(pilot, SettingsRead(session.time, "press", "b", Readings((Reading("MS", 64),))))
        await press(pilot, "ctrl+p", *"with another", "enter", "b", "enter")
        assert names(page) == ["MS"]


@at_screen
async def test_a_key_compares_with_the_defaults_a_file_or_another_drive() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, "ctrl+f", "enter")
        assert "768000" in page.lines("table").plain and "default" in page.lines("columns").plain
        await press(pilot, "ctrl+f", "enter")
        assert names(page) == ["VM", "IS1"]
        await press(pilot, "ctrl+f", *"end", "enter")
        assert len(names(page)) == 7 and "default" not in page.lines("columns").plain
        await press(pilot, "ctrl+f", *"file", "enter")
        assert "from /params backup" in page.lines("said").plain
        await press(pilot, "escape", "ctrl+f", *"another", "enter")
        assert "the address of another drive" in page.lines("said").plain
        assert session.sent == []


@at_screen
async def test_keys_back_up_and_restore_a_file_that_is_typed() -> None:
    async with on_screen() as (pilot, _, session):
        await opened(pilot, session)
        await press(pilot, "ctrl+b", *"my kept.toml", "enter")
        assert session.sent == ["press:a /params backup 'my kept.toml'"]
        await press(pilot, "ctrl+r", *"kept.toml", "enter")
        assert session.sent[1:] == ["press:a /params restore kept.toml", "press:a /params read"]


@at_screen
async def test_no_file_is_one_line_and_a_stop_or_escape_ends_the_question() -> None:
    async with on_screen() as (pilot, _, session):
        page = await opened(pilot, session)
        await press(pilot, "ctrl+r", "enter")
        assert "/params restore: a file name is needed" in page.lines("said").plain
        await press(pilot, *"kept.toml", "ctrl+x", "enter", "escape")
        await press(pilot, "ctrl+b", *"kept.toml", "escape", "enter", "escape")
        assert not any("restore" in line or "backup" in line for line in session.sent)
