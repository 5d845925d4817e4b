"""The values of `--vary`, and the keys that take them."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.sweeps.failures import RUNS, shrunk
from multidrop.features.sweeps.trial import ALL_HELD, REFUSED, Case, TrialResult
from multidrop.features.sweeps.variation import parse_key, parse_values, simpler, spelled


def values(text: str, *, drawn: bool = False) -> list[object]:
    found = parse_values(text, drawn=drawn)
    return [found.at(index) for index in range(found.count)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0..0.9:0.1", [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]),
        ("40000,60000", [40000, 60000]),
        ("1..4", [1, 2, 3, 4]),
        ("-2..2:2", [-2, 0, 2]),
        ("1..0:-0.5", [1, 0.5, 0]),
        ("0.5..2.5", [0.5, 1.5, 2.5]),
        ("1..2:0.75", [1, 1.75]),
        ("7..7", [7]),
        ("1..2,9, 4..5", [1, 2, 9, 4, 5]),
        ("x, y", ["x", "y"]),
        ('"1,1,0","2,2,0"', ["1,1,0", "2,2,0"]),
        ('"5"', ["5"]),
        ("[[2.0, 1, 0]],[]", [[[2.0, 1, 0]], []]),
        ("1e3,-.5", [1000, -0.5]),
        ("299..301 mm", ["299 mm", "300 mm", "301 mm"]),
        ("1..0:-0.5 mm,2 cm", ["1.0 mm", "0.5 mm", "0.0 mm", "2 cm"]),
    ],
)
def test_values_are_lists_and_inclusive_ranges(text: str, expected: list[object]) -> None:
    assert values(text) == expected


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "no values"),
        ("1,,2", "empty value"),
        ("5..1", "empty range"),
        ("0..0.9", "has no step; as in 0..0.9:0.1"),
        ("1..2:0", "step of 0"),
        ("a..b", "not a range"),
        ("1..", "not a range"),
        ('"a', "without its end"),
        ("[1", "without its end"),
        ("0..999999999999999:0.000001", "too many values"),
    ],
)
def test_wrong_values_are_one_line(text: str, what: str) -> None:
    with pytest.raises(Diagnostic, match=what) as problem:
        parse_values(text)
    assert "\n" not in str(problem.value)


PLACES = st.decimals(-1000, 1000, places=2)


@given(PLACES, PLACES, st.decimals("0.01", 500, places=2))
def test_a_range_has_every_step_up_to_its_end_and_no_rounding(low: Decimal, high: Decimal, step: Decimal) -> None:
    low, high = sorted((low, high))
    found = parse_values(f"{low}..{high}:{step}")
    listed = [Decimal(str(found.at(index))) for index in range(min(found.count, 50))]
    assert listed == [low + step * index for index in range(len(listed))]
    assert low + step * (found.count - 1) <= high < low + step * found.count


@given(
    st.one_of(
        st.integers(-(10**12), 10**12),
        st.decimals(-1000, 1000, places=6).map(float),
        st.text(st.characters(min_codepoint=32, max_codepoint=126)),
        st.lists(st.lists(st.integers(-99, 99))),
    )
)
def test_what_is_spelled_is_read_again(value: object) -> None:
    (read,) = values(spelled(value))  # type: ignore[arg-type]
    assert read == value and type(read) in (type(value), int)


def test_draws_are_of_all_values_and_repeatable() -> None:
    whole, fractions = parse_values("1..6", drawn=True), parse_values("0..0.9", drawn=True)
    rng = Random(1)
    assert {whole.draw(rng) for _ in range(200)} == {1, 2, 3, 4, 5, 6}
    drawn = [fractions.draw(rng) for _ in range(200)]
    assert len(set(drawn)) > 150 and all(0 <= each <= 0.9 for each in drawn)  # type: ignore[operator]
    assert [parse_values("1..1000").draw(Random(7)) for _ in range(2)] == [parse_values("1..1000").draw(Random(7))] * 2


@pytest.mark.parametrize(
    ("text", "value", "origin", "expected"),
    [
        ("0..0.9:0.1", 0.4, None, [0, 0.1, 0.2, 0.3]),
        ("0..0.9:0.1", 0.4, 0.7, [0.7, 0.6, 0.5]),
        ("60000,40000,90000", 60000, None, [40000]),
        ("1..3,2..4", 4, None, [1, 2, 3]),
        ("a,b,c", "c", None, ["a", "b"]),
        ("a,b,c", "a", "b", []),
        ("290..310:5 mm", "305 mm", None, ["290 mm", "295 mm", "300 mm"]),
        ("290..310:5 mm", "295 mm", "310 mm", ["310 mm", "305 mm", "300 mm"]),
    ],
)
def test_simpler_values_are_nearer_to_the_cells_own(text, value, origin, expected) -> None:
    assert list(simpler(parse_values(text), value, origin)) == expected


@pytest.mark.parametrize(
    ("text", "drive", "place"),
    [
        ("seed", "", ("seed", "", "seed")),
        ("b.load", "b", ("world", "", "load")),
        ("line:b.vm", "line:b", ("set", "", "VM")),
        ("VM", "", ("set", "", "VM")),
        ("stall_at", "", ("world", "", "stall_at")),
        ("00.y.slip", "00", ("world", "y", "slip")),
        ("x.home", "", ("world", "x", "home")),
    ],
)
def test_a_key_is_of_the_world_or_else_a_parameter(text: str, drive: str, place: tuple[str, str, str]) -> None:
    found, key = parse_key(text, {"b", "line:b", "00"})
    assert found == drive and (key.part, key.axis, key.name) == place and key.text == text


@pytest.mark.parametrize(
    ("key", "drive", "expected"),
    [
        ("load", {"world": {"home": 0}}, {"world": {"home": 0, "load": 5}}),
        ("load", {"world": {"x": {"load": 1}}}, {"world": {"x": {"load": 5}}}),
        ("x.load", {"world": {"load": 1}}, {"world": {"x": {"load": 5}}}),
        ("y.load", {}, {"world": {"y": {"load": 5}}}),
        ("vm", {"set": {"Vm": 1, "A": 2}}, {"set": {"A": 2, "VM": 5}}),
        ("seed", {"name": "b"}, {"name": "b"}),
    ],
)
def test_a_key_puts_its_value_where_the_cell_file_has_it(key: str, drive: dict, expected: dict) -> None:
    _, found = parse_key(key, ())
    assert found.put(drive, 5) == expected
    assert found.part == "seed" or found.own(expected) == 5


@pytest.mark.parametrize("text", ["c.load", ".load", "b.", "b.z.load", "b.x.y.load", ""])
def test_a_wrong_key_is_one_line(text: str) -> None:
    with pytest.raises(Diagnostic) as problem:
        parse_key(text, {"b"})
    assert "\n" not in str(problem.value)


LOAD, WALL, SPEED = parse_values("0..0.9:0.1"), parse_values("10000..90000:10000"), parse_values("1000..50000")
OWN = [None, None, 20000]


def failing(when: Callable[..., bool], runs: list[Case] | None = None) -> Callable[[Case], TrialResult]:
    """A run of a case in which the first condition fails `when` it says so of the values."""

    def run(case: Case) -> TrialResult:
        if runs is not None:
            runs.append(case)
        return TrialResult(case[0], 0 if when(*case[1]) else ALL_HELD)

    return run


@pytest.mark.parametrize(
    ("when", "world"),
    [
        (lambda load, wall, speed: True, (None, None, None)),
        (lambda load, wall, speed: wall is not None, (None, 10000, None)),
        (lambda load, wall, speed: load is not None and load >= 0.4, (0.4, None, None)),
        (lambda load, wall, speed: speed is not None and speed >= 31415, (None, None, 31415)),
        (lambda load, wall, speed: (load or 0) >= 0.3 and (wall or 0) > 35000, (0.3, 40000, None)),
        (lambda load, wall, speed: (load, wall, speed) == (0.7, 80000, 49000), (0.7, 80000, 49000)),
    ],
)
def test_the_simplest_world_is_found(when, world) -> None:
    case = (17, (0.7, 80000, 49000))
    assert shrunk(case, 0, [LOAD, WALL, SPEED], OWN, failing(when)) == world


def test_a_world_that_fails_in_another_way_is_not_taken() -> None:
    def run(case: Case) -> TrialResult:
        return TrialResult(case[0], 1 if case[1][0] is None else REFUSED if case[1][0] < 0.3 else 0)

    assert shrunk((1, (0.9,)), 0, [LOAD], [None], run) == (0.3,)


def test_the_search_is_bounded_and_ends_where_it_is_if_it_shall() -> None:
    runs: list[Case] = []
    many = [parse_values("1..1000000000")] * 9
    values = (999_999_937,) * 9
    shrunk((1, values), 0, many, [None] * 9, failing(lambda *world: world == values, runs))
    assert len(runs) == RUNS
    assert shrunk((1, (0.7, 80000)), 0, [LOAD, WALL], OWN[:2], lambda case: None) == (0.7, 80000)


def test_only_values_of_the_sweep_are_tried() -> None:
    runs: list[Case] = []
    shrunk((1, (0.7, 80000, 49000)), 0, [LOAD, WALL, SPEED], OWN, failing(lambda *world: world[0] == 0.7, runs))
    tried = {value for _, world in runs for value in world if value is not None}
    assert tried <= {each / 10 for each in range(10)} | set(range(10000, 90001, 10000)) | set(range(1000, 50001))
