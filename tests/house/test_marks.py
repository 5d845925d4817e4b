"""What an ordinary run takes of a product of parameters."""

from __future__ import annotations

from itertools import product

import pytest

from tests.support.marks import is_taken, places


@pytest.mark.parametrize("sizes", [(4, 2, 2, 2), (12, 7), (5, 3, 3), (1, 6)], ids=str)
def test_every_value_and_every_pair_of_extremes_is_taken(sizes: tuple[int, ...]) -> None:
    taken = [at for at in product(*map(range, sizes)) if is_taken(list(zip(at, sizes, strict=True)))]
    for number, size in enumerate(sizes):
        assert {at[number] for at in taken} == set(range(size))
    assert set(product(*({0, size - 1} for size in sizes))) <= set(taken)


@pytest.mark.parametrize("letter", "xyz")
@pytest.mark.parametrize(("number", "name"), [(1, "one"), (2, "two")])
def test_the_place_of_a_test_is_that_of_its_values(
    request: pytest.FixtureRequest, letter: str, number: int, name: str
) -> None:
    assert places(request.node) == [((number - 1), 2), ("xyz".index(letter), 3)]
