"""What of a transcript is in view: bounds, filters, searches, selections, without a screen."""

from collections.abc import Iterable

from hypothesis import given
from hypothesis import strategies as st

from multidrop.shell.roles import EVERYTHING, Filter
from multidrop.tui.screen_model import Record
from multidrop.tui.widgets.viewport import (
    MOST_BETWEEN,
    Index,
    Picked,
    RecordFilter,
    Records,
    RecordSearch,
    VisibleRecords,
)
from tests.support.cases import for_each

TALK = [
    Record(1.0, "a", ">", "MR 5"),
    Record(1.1, "b", "»", "PR P", mine=False),
    Record(1.2, "b", "", "384112", mine=False),
    Record(1.3, "", "<", "at home", mine=False),
    Record(1.4, "b", ">", "@b PR VX"),
    Record(1.5, "b", "x", "b: 20 unknown variable or flag: VX"),
    Record(1.6, "", "!", "limit+ reached"),
    Record(1.7, "", ">", "/help VX"),
    Record(1.8, "", "", "VX is no word"),
    Record(1.9, "*", ">", "@* SL 0"),
]


def taken(records: Iterable[Record], **bounds: int) -> Records:
    kept = Records(**bounds)
    kept.take(list(records))
    return kept


def numbered(count: int) -> list[Record]:
    return [Record(float(n), "a", "", f"line {n}") for n in range(count)]


@for_each(
    ("wanted", "shown"),
    [
        (EVERYTHING, range(10)),
        (Filter(mine=True), [0, 4, 5, 6, 7, 8, 9]),
        (Filter(address="b"), [1, 2, 4, 5, 6, 7, 8, 9]),
        (Filter(address="b", mine=True), [4, 5, 6, 7, 8, 9]),
        (Filter(errors=True), [4, 5, 6]),
        (Filter(text="vx"), [4, 5, 7, 8]),
        (Filter(address="a", text="VX"), [7, 8]),
    ],
)
def test_a_filter_keeps_what_was_asked_with_its_answers_and_warnings(wanted: Filter, shown: Iterable[int]) -> None:
    sight = VisibleRecords(taken(TALK))
    sight.choose(wanted)
    assert list(sight.numbers) == list(shown)


def test_the_line_of_a_failure_is_shown_though_others_came_between() -> None:
    records = taken([Record(1, "a", ">", "BAD"), Record(2, "b", ">", "PR P"), Record(3, "b", "x", "b: no")])
    index = Index(records, RecordFilter(Filter(errors=True)))
    assert list(index.numbers) == [1, 2]
    records.take([Record(4, "a", "x", "a: 20 unknown")])
    assert list(index.numbers) == [0, 1, 2, 3]


def test_what_is_typed_under_a_filter_is_shown_with_its_replies() -> None:
    sight = VisibleRecords(taken(TALK))
    sight.choose(Filter(address="b", errors=True), typed=True)
    before = list(sight.numbers)
    sight.records.take([Record(2, "a", ">", "PR P"), Record(2, "a", "", "0"), Record(2, "a", "»", "PR V", mine=False)])
    assert list(sight.numbers) == [*before, 10, 11]
    search = RecordSearch(sight)
    search.find("PR")
    assert search.place == (2, 2)


def test_text_is_bounded_and_the_newest_record_stays_however_long_it_is() -> None:
    records = taken([Record(1, "a", "", "x" * 400)] * 5, most=100, text=1000)
    assert (len(records), records.first, records.dropped) == (2, 3, 3)
    records.take([Record(2, "a", "", "y" * 5000)])
    assert [record.text[0] for record in records] == ["y"]
    records.clear()
    records.take([Record(3, "a", "", "z" * 900)])
    assert (len(records), records.dropped) == (1, 0)


@given(
    st.lists(st.tuples(st.sampled_from(" ><x!"), st.booleans(), st.sampled_from(["vm", "VX", "p"])), max_size=40),
    st.integers(1, 30),
    st.builds(Filter, errors=st.booleans(), mine=st.booleans(), text=st.sampled_from(["", "v", "p"])),
)
def test_an_index_that_grows_is_the_index_of_all(lines: list[tuple[str, bool, str]], most: int, wanted: Filter) -> None:
    made = [Record(0, "a", mark.strip(), text, mine=mine) for mark, mine, text in lines]
    records, whole = Records(most=most), Records()
    index, all_of_it = Index(records, RecordFilter(wanted)), Index(whole, RecordFilter(wanted))
    for record in made:
        records.take([record])
        assert all(records.first <= number < records.taken for number in index.numbers)
    whole.take(made)
    assert list(index.numbers) == [number for number in all_of_it.numbers if number >= records.first]
    assert list(index.numbers) == sorted(set(index.numbers))


def test_a_paused_view_stays_until_it_is_let_go_on() -> None:
    sight = VisibleRecords(taken(numbered(100)))
    sight.height = 10
    sight.pause()
    sight.records.take(numbered(50))
    sight.look(500)
    assert (sight.paused, sight.following, sight.below) == (True, False, 0)
    sight.records.take(numbered(7))
    assert sight.below == 7, "the newest line does not pull it along"
    sight.pause()
    assert (sight.paused, sight.following) == (False, True)


def test_a_search_begins_at_the_bottom_and_goes_up() -> None:
    sight = VisibleRecords(taken(numbered(100)))
    sight.height = 10
    search = RecordSearch(sight)
    search.find("line 4")
    assert (search.at, search.place) == (49, (11, 11))
    search.step(-1)
    assert (search.at, search.place) == (48, (10, 11))
    search.find("line 47")
    assert (search.at, search.place) == (47, (1, 1))
    search.step(-5)
    assert search.at == 47
    search.find("nothing like it")
    assert (search.at, search.place) == (None, (0, 0))
    assert not sight.following, "it stays where the last match was"


def test_a_search_that_finds_nothing_leaves_the_view_following() -> None:
    sight = VisibleRecords(taken(numbered(20)))
    search = RecordSearch(sight)
    search.find("z")
    search.end()
    assert sight.following


def test_a_search_counts_what_arrives_and_only_what_is_shown() -> None:
    sight = VisibleRecords(taken(TALK))
    sight.choose(Filter(mine=True))
    search = RecordSearch(sight)
    search.find("pr")
    assert search.place == (1, 1)
    sight.records.take([Record(2, "a", ">", "PR P"), Record(2, "a", "»", "PR V", mine=False)])
    assert search.place == (1, 2)


def test_lines_are_picked_upwards_from_the_newest_one() -> None:
    sight = VisibleRecords(taken(numbered(20)))
    sight.height = 5
    picked = Picked(sight)
    picked.move(-1, extend=True)
    picked.move(-1, extend=True)
    assert [record.text for record in picked.records] == ["line 17", "line 18", "line 19"]
    picked.move(-3, extend=False)
    assert [record.text for record in picked.records] == ["line 14"]
    picked.move(100, extend=True)
    assert len(picked.records) == 6
    picked.end()
    assert sight.following


def test_nothing_is_picked_of_an_empty_transcript() -> None:
    sight = VisibleRecords(Records())
    picked = Picked(sight)
    picked.move(-1, extend=True)
    assert picked.records == []


def test_a_record_replaces_the_earlier_one_that_it_joins_and_only_among_the_last_ones() -> None:
    records = Records()
    first = Record(1.0, "", "■", "1 of 2", joins=7)
    assert records.take([first, Record(1.1, "", ".", "between")]) == []
    assert records.take([first._replace(text="2 of 2")]) == [0]
    assert [record.text for record in records] == ["2 of 2", "between"] and records.taken == 2
    records.take([Record(2.0, "", ".", "later")] * MOST_BETWEEN)
    assert records.take([first._replace(text="again")]) == [] and records[records.taken - 1].text == "again"
