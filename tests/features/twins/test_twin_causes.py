"""The causes of a difference, from pairs of what was measured and predicted; and when a difference counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.shell.comparing.differences import DIFFERENCE_LIMIT, LASTING, AxisComparison, Pair, Verdict, causes

STEP = 0.1
Motion = Callable[[float], tuple[float, float]]
"""Position and velocity at a time."""


def standing(place: float = 0.0) -> Motion:
    return lambda t: (place, 0.0)


def ramp(acceleration: float, top: float) -> Motion:
    def motion(t: float) -> tuple[float, float]:
        up = min(t, top / acceleration)
        return acceleration * up * up / 2 + top * (t - up), acceleration * up

    return motion


def stopped(motion: Motion, at: float) -> Motion:
    return lambda t: motion(t) if t < at else (motion(at)[0], 0.0)


def jumped(motion: Motion, at: float, steps: float) -> Motion:
    return lambda t: (motion(t)[0] + (steps if t >= at else 0), motion(t)[1])


def slowed(motion: Motion, at: float, share: float) -> Motion:
    def later(t: float) -> tuple[float, float]:
        if t < at:
            return motion(t)
        place, velocity = motion(at)
        return place + velocity * share * (t - at), velocity * share

    return later


def pairs(measured: Motion, predicted: Motion, until: float = 2.0) -> list[Pair]:
    times = [n * STEP for n in range(round(until / STEP))]
    return [Pair(t, *map(round, measured(t)), *map(round, predicted(t))) for t in times]


MOVE = ramp(100_000, 50_000)


@pytest.mark.parametrize(
    ("measured", "predicted", "first"),
    [
        (stopped(MOVE, 1.0), MOVE, "stall"),
        (standing(), MOVE, "load"),
        (jumped(MOVE, 1.2, -9000), MOVE, "slip"),
        (jumped(standing(), 1.2, 700), standing(), "slip"),
        (ramp(40_000, 50_000), MOVE, "settings changed"),
        (ramp(100_000, 30_000), MOVE, "settings changed"),
        (slowed(MOVE, 1.0, 0.6), MOVE, "load"),
        (MOVE, stopped(MOVE, 1.0), "a command not seen here"),
        (MOVE, standing(), "a command not seen here"),
    ],
)
def test_the_likeliest_cause_is_the_first(measured: Motion, predicted: Motion, first: str) -> None:
    assert causes(pairs(measured, predicted))[0] == first


def test_where_two_readings_are_far_apart_a_drive_that_came_less_far_may_have_stalled() -> None:
    """Typed positions in a log: no velocity, and nothing in between."""
    found = [Pair(0.0, 2000, 0, 2000, 0), Pair(2.0, 31250, 40000, 50486, 40000)]
    assert causes(found)[0] == "stall"


def test_a_limit_that_is_lit_and_a_doubtful_line_come_first() -> None:
    found = pairs(stopped(MOVE, 1.0), MOVE)
    assert causes(found, limits=("limit+",))[0] == "a limit (limit+)"
    assert causes(found, "MR 5")[:2] == ("it is not known whether 'MR 5' was executed", "stall")


def verdicts(comparison: AxisComparison, found: list[Pair]) -> Iterator[tuple[float, Verdict]]:
    for pair in found:
        if (verdict := comparison.take(pair, DIFFERENCE_LIMIT)) is not None:
            yield pair.at, verdict


def test_a_difference_is_said_once_and_its_end_once() -> None:
    comparison = AxisComparison()
    apart, together = pairs(standing(60), standing()), pairs(standing(49), standing())
    assert [each for _, each in verdicts(comparison, apart)] == [Verdict.DIVERGED]
    later = [each._replace(at=each.at + 10) for each in together]
    assert [each for _, each in verdicts(comparison, later)] == [Verdict.AGREED]


def test_a_single_reading_is_no_difference() -> None:
    found = [each._replace(position=9999) if n == 3 else each for n, each in enumerate(pairs(standing(), standing()))]
    assert list(verdicts(AxisComparison(), found)) == []


@given(st.integers(-600_000, 600_000), st.floats(-0.029, 0.029))
def test_no_move_of_any_velocity_is_a_difference_because_of_a_delay(velocity: int, late: float) -> None:
    found = [
        Pair(n / 10, round(velocity * (n / 10 - late)), velocity, round(velocity * n / 10), velocity) for n in range(9)
    ]
    assert list(verdicts(AxisComparison(), found)) == []


@given(st.lists(st.tuples(*[st.integers(-(2**31), 2**31)] * 4), min_size=2, max_size=12))
def test_any_pairs_have_a_cause(numbers: list[tuple[int, int, int, int]]) -> None:
    found = [Pair(n * LASTING, *each) for n, each in enumerate(numbers)]
    named = causes(found)
    assert named and len(set(named)) == len(named)
