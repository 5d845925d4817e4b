"""The top line: tabs that shrink, fold and are counted, and the tab under the pointer."""

import re

from hypothesis import given
from hypothesis import strategies as st

from multidrop.tui.readout import ReadoutState
from multidrop.tui.widgets.bars import TROUBLE, Tab, rule_row, tab_at, top_row
from multidrop.tui.widgets.lines import width_of
from tests.support.panel_rows import plain

states = st.sampled_from(list(ReadoutState))


def tabs_of(states: list[ReadoutState], chosen: int, name: str = "line") -> list[Tab]:
    return [Tab(n + 1, f"{name}{n + 1}", state, n == chosen) for n, state in enumerate(states)]


def shown(tabs: list[Tab], width: int) -> str:
    return plain(top_row(tabs, "", "12:41:07", width)).rstrip().removesuffix("12:41:07").rstrip()


@given(st.lists(states, min_size=1, max_size=40), st.integers(60, 200), st.booleans(), st.data())
def test_the_top_line_fits_and_shows_the_selected_tab_and_all_trouble(
    found: list[ReadoutState], width: int, log: bool, data: st.DataObject
) -> None:
    tabs = tabs_of(found, data.draw(st.integers(0, len(found) - 1)))
    row = top_row(tabs, "shuttle", "12:41:07", width, log)
    text = plain(row)
    assert width_of(row) == width
    assert ("● log" in text) is log
    chosen = next(tab for tab in tabs if tab.selected)
    assert re.search(rf" {chosen.number} {chosen.name}( |…)", text) or f" {chosen.number} {chosen.name[:9]}" in text
    own = text.split("● rec")[0]
    counted = sum(map(int, re.findall(r"✗(\d+)", own)))
    seen = len(re.findall(r"\d[✗?≠]| [✗?≠] ", re.sub(r"✗\d+", "", own)))
    assert seen + counted >= sum(tab.state in TROUBLE for tab in tabs)


def test_tabs_do_not_jump_when_a_state_changes() -> None:
    places = set()
    for state in (
        ReadoutState.MOVING,
        ReadoutState.AT_REST,
        ReadoutState.LOST,
        ReadoutState.SILENT,
        ReadoutState.UNKNOWN,
    ):
        tabs = [Tab(1, "press", state, True), Tab(2, "eth", ReadoutState.AT_REST, False)]
        places.add(plain(top_row(tabs, "", "12:41:07", 80)).index("2 eth"))
    assert len(places) == 1


def test_eight_tabs_at_80_columns_keep_as_much_of_their_names_as_there_is_room_for() -> None:
    names = ["press", "gantry", "127.0.0.1-5031", "127.0.0.1-5032", "eth", "pmx", "conveyor", "lift"]
    tabs = [Tab(number, name, ReadoutState.AT_REST, number == 1) for number, name in enumerate(names, 1)]
    assert shown(tabs, 80) == " 1 press ■  2 gant…■ 3 …5031■ 4 …5032■ 5 eth■ 6 pmx■ 7 conv…■ 8 lift■"
    assert "2 gantry■ 3 …7.0.0.1-5031■ 4 …7.0.0.1-5032■ 5 eth■" in shown(tabs, 100)
    assert "2 gantry ■  3 ….0.0.1-5031 ■  4 ….0.0.1-5032 ■  5 eth ■" in shown(tabs, 120)


def test_thirty_two_tabs_fold_at_80_columns() -> None:
    quiet = [ReadoutState.AT_REST] * 32
    assert shown(tabs_of(quiet, 0), 80) == "  1 line1 ■  2-32 ■".replace("  1", " 1", 1)
    quiet[1], quiet[20], quiet[30] = ReadoutState.MOVING, ReadoutState.LOST, ReadoutState.SILENT
    assert shown(tabs_of(quiet, 2), 80) == " 1■ 2▶ 3 line3 ■  4-20 ■ 21✗ 22-30 ■ 31? 32■"


def test_runs_of_different_states_fold_where_nothing_else_fits_and_what_moves_is_seen() -> None:
    mixed = [ReadoutState.AT_REST, ReadoutState.UNKNOWN] * 16
    mixed[10] = ReadoutState.MOVING
    assert shown(tabs_of(mixed, 0), 80) == " 1 line1 ■  2-32 ▶"


def test_more_trouble_than_fits_is_counted() -> None:
    text = shown(tabs_of([ReadoutState.LOST] * 32, 5), 60)
    assert " 6 line6 ✗" in text and int(text.rpartition("✗")[2]) + text.count("✗") - 1 == 32


def test_trouble_besides_the_state_is_marked_and_keeps_its_tab() -> None:
    tabs = tabs_of([ReadoutState.AT_REST] * 32, 0)
    tabs[9] = Tab(10, "line10", ReadoutState.MOVING, False, mark="?")
    assert shown(tabs, 80) == " 1 line1 ■  2-9 ■ 10▶? 11-32 ■"
    whole = [Tab(1, "press", ReadoutState.MOVING, True, mark=mark) for mark in ("", "!")]
    assert [plain(top_row([tab], "", "12:41:07", 80)).index("12:41") for tab in whole] == [71, 71]
    assert "▶ moving!" in plain(top_row(whole[1:], "", "12:41:07", 80))


def test_names_give_way_after_words() -> None:
    tabs = tabs_of([ReadoutState.AT_REST] * 5, 1, "gantry")
    assert "■ at rest" in shown(tabs[:3], 80) and shown(tabs[:3], 80).count("at rest") == 3
    assert shown(tabs, 83) == " 1 gantry1 ■  2 gantry2 ■ at rest  3 gantry3 ■  4 gantry4 ■  5 gantry5 ■"
    assert shown(tabs, 80) == " 1 gantry1 ■  2 gantry2 ■  3 gantry3 ■  4 gantry4 ■  5 gantry5 ■"


def test_a_click_finds_the_tab_and_nothing_beside_the_tabs() -> None:
    states = [ReadoutState.AT_REST] * 32
    states[20] = ReadoutState.LOST
    row = top_row(tabs_of(states, 2), "go", "12:41:07", 80)
    text = plain(row)
    assert tab_at(row, text.index("3 line3")) == 3
    assert tab_at(row, text.index("4-20") + 2) == 4
    assert tab_at(row, text.index("✗")) == 21
    assert tab_at(row, text.index("● rec") + 2) is None
    assert tab_at(row, text.index("12:41") + 1) is None
    assert tab_at(row, 200) is None


def test_a_rule_joins_the_side_panel() -> None:
    assert plain(rule_row(10, (4,), "┬")) == "────┬─────"
    assert plain(rule_row(10, (), "┬")) == "─" * 10
