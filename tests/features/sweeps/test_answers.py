"""The answer of a sweep, from results that are made up: shares and margins, the map, its picture, the boundary."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.features.sweeps import answers
from multidrop.features.sweeps.answers import CaseTally, SweepAnswer
from multidrop.features.sweeps.trial import ALL_HELD, MARGIN, TrialResult
from tests.support.cases import for_each

Fails = Callable[..., int | None]
"""The index of the condition that does not hold for these values; None: the case passes."""
EXPECTS = ("position == 100", "at < 3", "x > 1")


def answer(
    keys: Mapping[str, Sequence[Any]],
    fails: Fails,
    cells: Callable[..., tuple[str, ...]] = lambda *_: (),
    *,
    search: str = "",
    draws: int | None = None,
    order: int = 1,
) -> SweepAnswer:
    cases = list(product(*keys.values()))
    results = {}
    for number, values in list(enumerate(cases))[::order]:
        failed = fails(*values)
        results[number] = TrialResult(number, ALL_HELD if failed is None else failed, "", cells(*values))
    columns = [f"{MARGIN}{EXPECTS[0]}", "moves", f"{MARGIN}{EXPECTS[1]}"]
    parts = [SimpleNamespace(text=name, part=name) for name in keys]
    job = SimpleNamespace(keys=parts, expects=EXPECTS)
    plan: Any = SimpleNamespace(job=job, values_of=lambda number: cases[number], asked=SimpleNamespace(draws=draws))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(answers, "bench", lambda job: SimpleNamespace(columns=[c for c in columns if c != "moves"]))
        return SweepAnswer(plan, results, search)


def where(holds: Callable[..., bool]) -> Fails:
    return lambda *values: None if holds(*values) else 1


GRID: dict[str, Sequence[Any]] = {"VM": [100, 200, 300], "A": [1, 2], "drive": ["a"]}


def test_each_value_has_its_share_and_the_smallest_margin_of_each_condition() -> None:
    found = answer(
        GRID, where(lambda vm, a, _: vm + 100 * a < 401), lambda vm, a, _: (f"{a - vm}", f"{vm * a / 7:.7f}")
    )
    assert list(found.rows()) == [
        "VM=100   100%  2 of 2  margin -99 of position == 100; 14.29 of at < 3",
        "VM=200   100%  2 of 2  margin -199 of position == 100; 28.57 of at < 3",
        "VM=300    50%  1 of 2  margin -299 of position == 100; 42.86 of at < 3",
        "A=1      100%  3 of 3  margin -299 of position == 100; 14.29 of at < 3",
        "A=2       67%  2 of 3  margin -298 of position == 100; 28.57 of at < 3",
        "drive=a   83%  5 of 6  margin -299 of position == 100; 14.29 of at < 3",
    ]


def test_what_failed_before_a_condition_decided_it_and_leaves_no_margin() -> None:
    for failed, said in ((0, ""), (1, "; 5 of at < 3"), (2, "; 5 of at < 3")):
        (row,) = answer({"A": [1]}, lambda _, failed=failed: failed, lambda _: ("-1234.56", "5")).rows()
        assert row == f"A=1    0%  0 of 1  margin -1235 of position == 100{said}"
    (row,) = answer({"A": [1]}, where(lambda _: True), lambda _: ("", "0.00012345")).rows()
    assert row == "A=1  100%  1 of 1  margin 0.0001234 of at < 3"
    assert list(answer({"A": [1]}, where(lambda _: True)).rows()) == ["A=1  100%  1 of 1"]


@for_each(
    "cases, passed, percent",
    [(0, 0, 0), (3, 3, 100), (3, 0, 0), (1000, 1, 1), (1000, 999, 99), (3, 1, 33), (3, 2, 67), (200, 1, 1)],
)
def test_only_all_is_100_per_cent_and_only_none_is_0(cases: int, passed: int, percent: int) -> None:
    assert CaseTally(cases, passed).percent == percent


def test_a_key_of_many_values_has_stretches_of_them() -> None:
    rows = list(answer({"A": range(200)}, where(lambda a: a < 100)).rows())
    assert len(rows) == 200 and rows[199] == "A=199    0%  0 of 1"
    rows = list(answer({"A": range(201)}, where(lambda a: a < 100)).rows())
    assert len(rows) == 19 and rows[0].split() == ["A=0..10", "100%", "11", "of", "11"]
    assert [row.split()[0] for row in rows[-2:]] == ["A=187..197", "A=198..200"]
    assert rows[9].split() == ["A=99..109", "9%", "1", "of", "11"]


def test_the_values_of_draws_and_of_a_search_are_in_their_order_and_those_of_a_grid_as_they_are_given() -> None:
    values: dict[str, Sequence[Any]] = {"A": [30, 4, 200]}
    names = [row.split()[0] for row in answer(values, where(lambda a: True)).rows()]
    assert names == ["A=30", "A=4", "A=200"]
    for more in ({"draws": 3}, {"search": "A"}):
        names = [row.split()[0] for row in answer(values, where(lambda a: True), **more).rows()]
        assert names == ["A=4", "A=30", "A=200"]
    texts: dict[str, Sequence[Any]] = {"A": ["30 mm", "-4 mm", "b"]}
    assert [row.split("=")[1][:2] for row in answer(texts, where(lambda a: True), draws=3).rows()] == ["30", "-4", "b "]


# The map


def test_the_map_is_of_the_two_keys_whose_values_differ_most() -> None:
    keys: dict[str, Sequence[Any]] = {"seed": [1, 2, 3], "VM": [1, 2], "N": [5, 6], "A": [7, 8]}
    found = answer(keys, where(lambda seed, vm, n, a: (vm, a) == (2, 8)))
    assert list(found.map()) == [
        "per cent that passed: VM down, A across",
        "VM    7    8",
        "1     0    0",
        "2     0  100",
    ]
    assert list(found.map(colours=True))[2:] == [
        "1  \x1b[30;41m   0\x1b[m \x1b[30;41m   0\x1b[m",
        "2  \x1b[30;41m   0\x1b[m \x1b[30;42m 100\x1b[m",
    ]
    part = answer({"VM": [1, 2], "A": [7, 8], "seed": [1, 2]}, where(lambda vm, a, seed: vm < 2 or seed < a - 6))
    assert list(part.map(colours=True))[2:] == [
        "1  \x1b[30;42m 100\x1b[m \x1b[30;42m 100\x1b[m",
        "2  \x1b[30;41m   0\x1b[m \x1b[30;43m  50\x1b[m",
    ]


def test_there_is_no_map_of_one_key_or_of_a_search() -> None:
    one: dict[str, Sequence[Any]] = {"VM": [1, 2], "A": [7]}
    assert list(answer(one, where(lambda vm, a: vm == 1)).map()) == []
    assert answer(one, where(lambda vm, a: vm == 1)).svg() == ""
    assert list(answer(GRID, where(lambda *_: True), search="A").map()) == []


def test_a_wide_map_has_stretches_across_and_what_did_not_run_is_empty() -> None:
    keys: dict[str, Sequence[Any]] = {"VM": range(3), "A": range(1000, 1040)}
    lines = list(answer(keys, where(lambda vm, a: a < 1000 + 13 * vm)).map())
    assert lines[0] == "per cent that passed: VM down, A across"
    assert max(map(len, lines)) <= 78 and len(lines) == 5
    assert lines[1].split() == ["VM", "1000..1009", "1010..1019", "1020..1029", "1030..1039"]
    assert [line.split() for line in lines[2:]] == [
        ["0", "0", "0", "0", "0"],
        ["1", "100", "30", "0", "0"],
        ["2", "100", "100", "60", "0"],
    ]
    half = list(answer(GRID, where(lambda vm, a, _: vm < 200 or a < 2), order=5).map())
    assert half[1:] == ["VM     1    2", "100  100     ", "300         0"]


PICTURE = """<svg xmlns="http://www.w3.org/2000/svg" width="400" height="118" font-family="sans-serif" font-size="12">
<rect width="400" height="118" fill="#fff"/>
<rect x="34" y="60" width="43" height="23" fill="rgb(27,120,55)"/>
<text x="56" y="77" text-anchor="middle" fill="#fff">100</text>
<rect x="78" y="60" width="43" height="23" fill="rgb(102,72,49)"/>
<text x="100" y="77" text-anchor="middle" fill="#fff">50</text>
<rect x="34" y="84" width="43" height="23" fill="rgb(102,72,49)"/>
<text x="56" y="101" text-anchor="middle" fill="#fff">50</text>
<rect x="78" y="84" width="43" height="23" fill="rgb(178,24,43)"/>
<text x="100" y="101" text-anchor="middle" fill="#fff">0</text>
<text x="10" y="20" text-anchor="start">per cent that passed: V&lt; down, A across</text>
<text x="56" y="50" text-anchor="middle">7</text>
<text x="100" y="50" text-anchor="middle">8</text>
<text x="26" y="77" text-anchor="end">1</text>
<text x="26" y="101" text-anchor="end">2</text>
</svg>
"""


def test_the_picture_of_a_map_has_its_shares_in_colours() -> None:
    keys: dict[str, Sequence[Any]] = {"V<": [1, 2], "A": [7, 8], "seed": [1, 2]}
    found = answer(keys, where(lambda v, a, seed: v + a + seed < 11 and (v, a) != (2, 8)))
    assert found.svg() == PICTURE


def test_a_picture_grows_with_its_values_and_their_names() -> None:
    keys: dict[str, Sequence[Any]] = {"VM": range(12), "a long name": [f"value {n}" for n in range(9)]}
    head = answer(keys, where(lambda vm, text: vm < 5)).svg().splitlines()[0]
    assert f'width="{34 + (12 + 7 * 7) * 9 + 10}" height="{60 + 24 * 12 + 10}"' in head


# The boundary


@for_each(
    "values, fails, words",
    [
        ([1, 2, 3], set(), "passes everywhere"),
        ([1, 2, 3], {1, 2, 3}, "fails everywhere"),
        ([1, 2, 3], {3}, "fails from A 3 up"),
        ([1, 2, 3], {2, 3}, "fails from A 2 up"),
        ([3, 2, 1], {3}, "fails from A 3 up"),
        ([1, 2, 3], {1}, "fails from A 1 down"),
        ([1, 2, 3], {1, 2}, "fails from A 2 down"),
        ([1, 2, 3], {2}, "fails for A 2"),
        ([1, 2, 3, 4, 5], {2, 3, 5}, "fails for A 2..3, 5"),
        (["x", "y", "z"], {"z"}, "fails for A z"),
        (["x", "y", "z"], {"y", "z"}, "fails for A y, z"),
        (range(1, 30), set(range(2, 22, 2)), "fails for A 2, 4, 6, 8, 10, 12, 14, 16, 18, 20"),
        (range(1, 30), set(range(2, 26, 2)), "fails for A 2, 4, 6, 8, 10, 12, 14, 16, 18, 20 and 2 more"),
        (range(1, 30), {*range(2, 26, 2), 29, 28, 27}, "fails from A 2 up in part, and above 26 always"),
    ],
)
def test_the_boundary_of_one_key_in_words(values: Sequence[Any], fails: set[Any], words: str) -> None:
    found = list(answer({"A": values}, where(lambda a: a not in fails)).boundary())
    assert found == [words]


def test_a_boundary_that_depends_on_another_key_is_named_for_its_values() -> None:
    keys: dict[str, Sequence[Any]] = {"VM": [1, 2, 3, 4], "A": [10, 20, 30, 40, 50]}
    assert list(answer(keys, where(lambda vm, a: a < 30)).boundary()) == ["fails from A 30 up"]
    assert list(answer(keys, where(lambda vm, a: vm * a < 100)).boundary()) == [
        "passes at every VM at A 10, 20",
        "fails from VM 4 at A 30 up",
        "fails from VM 3 at A 40 up",
        "fails from VM 2 at A 50 up",
    ]
    assert list(answer(keys, where(lambda vm, a: a == 50 or vm < 3)).boundary()) == [
        "fails from VM 3 at A 10..40 up",
        "passes at every VM at A 50",
    ]


def test_a_search_says_what_was_tried_of_its_key_alone() -> None:
    keys: dict[str, Sequence[Any]] = {"VM": [1, 2], "A": [10, 20]}
    assert list(answer(keys, where(lambda vm, a: True), search="A").boundary()) == [
        "passes at both ends of A; nothing between was tried"
    ]
    assert list(answer(keys, where(lambda vm, a: vm == 1 or a < 20), search="A").boundary()) == [
        "passes at both ends of A at VM 1; nothing between was tried",
        "fails from A 20 at VM 2 up",
    ]
    assert list(answer({"VM": [1], "A": [10]}, where(lambda vm, a: True), search="A").boundary()) == [
        "passes everywhere"
    ]
