"""The simplest world that still fails: found by dropping changes, and then by values nearer to the cell's own."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from multidrop.shell.sweeps.failures import RUNS, shrunk
from multidrop.shell.sweeps.trial import HELD, REFUSED, Case, Result
from multidrop.shell.sweeps.variation import parse_values

LOAD, WALL, SPEED = parse_values("0..0.9:0.1"), parse_values("10000..90000:10000"), parse_values("1000..50000")
OWN = [None, None, 20000]


def failing(when: Callable[..., bool], runs: list[Case] | None = None) -> Callable[[Case], Result]:
    """A run of a case in which the first condition fails `when` it says so of the values."""

    def run(case: Case) -> Result:
        if runs is not None:
            runs.append(case)
        return Result(case[0], 0 if when(*case[1]) else HELD)

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
    def run(case: Case) -> Result:
        return Result(case[0], 1 if case[1][0] is None else REFUSED if case[1][0] < 0.3 else 0)

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
