"""The order of the causes of a difference, from a few readings of a drive and its twin, at the bounds of each."""

from __future__ import annotations

from multidrop.shell.comparing.differences import Pair, causes, unmoved
from tests.support.cases import for_each

UNSEEN = ("a command not seen here", "settings changed")
PUSHED = ("slip", "a push by hand", "a command not seen here")
STALLED = ("stall", "load", "a limit")
NEVER = ("load", "stall", "a limit")
SHORT = ("stall", "load", "slip", "a limit", "settings changed")
SLIPPED = ("slip", "load", "a command not seen here")
SLOWED = ("load", "settings changed", "stall")
OTHER = ("settings changed", "load", "slip")


def rows(*each: tuple[float, int, int, int, int]) -> list[Pair]:
    """Time; position and velocity of the drive, and of its twin."""
    return [Pair(*row) for row in each]


CASES = [
    # The twin never moved.
    (rows((0, 0, 0, 0, 0), (1, 900, 0, 0, 0)), PUSHED),
    (rows((0, 0, 0, 0, 0), (1, 900, 5, 0, 0)), UNSEEN),
    (rows((0, 0, 5, 0, 0), (1, 900, 0, 0, 0)), UNSEEN),
    # The drive stands where it was, and its twin moved on.
    (rows((0, 0, 0, 0, 500), (0.1, 0, 0, 50, 500), (0.2, 0, 0, 100, 500)), NEVER),
    (rows((0, 0, 500, 0, 500), (0.1, 50, 500, 50, 500), (0.2, 60, 0, 100, 500), (0.3, 60, 0, 150, 500)), STALLED),
    # Half of the difference came since it stands; less than half is no such cause.
    (rows((0, 0, 500, 50, 500), (0.1, 50, 0, 100, 500), (0.2, 50, 0, 150, 500)), STALLED),
    (rows((0, 0, 500, 51, 500), (0.1, 50, 0, 101, 500), (0.2, 50, 0, 151, 500)), SLOWED),
    # Long times between two readings: the drive came less far.
    (rows((0, 2000, 0, 2000, 0), (2, 31250, 40000, 50486, 40000)), SHORT),
    (rows((0, 2000, 0, 2000, 0), (2, 2000, 40000, 50486, 40000), (2.1, 2100, 40000, 54486, 40000)), SHORT),
    (rows((0, 0, 9000, 0, 9000), (0.5, 3500, 9000, 4500, 9000)), SLIPPED),
    (rows((0, 0, 9000, 0, 9000), (0.51, 3500, 9000, 4500, 9000)), SHORT),
    (rows((0, 0, 9000, 0, 9000), (1, 9500, 9000, 9000, 9000)), SLIPPED),
    (rows((0, 0, 9000, 0, 9000), (1, -500, 9000, 9000, 9000)), SLIPPED),
    (rows((0, 0, -9000, 0, -9000), (1, -5000, -9000, -9000, -9000)), SHORT),
    # A jump that no velocity explains, and the largest one that it does.
    (rows((0, 0, 1000, 0, 1000), (0.1, 151, 1000, 100, 1000)), SLIPPED),
    (rows((0, 0, 1000, 0, 1000), (0.1, 150, 1000, 100, 1000)), OTHER),
    (rows((0, 0, 1000, 0, 2000), (0.1, 19, 1000, 200, 2000)), SLIPPED),
    (rows((0, 0, 1000, 0, 2000), (0.1, 20, 1000, 200, 2000)), OTHER),
    # The twin stands, and the drive moved on.
    (rows((0, 0, 500, 0, 500), (0.1, 50, 500, 40, 0), (0.2, 100, 500, 40, 0), (0.3, 150, 500, 40, 0)), UNSEEN),
    # As fast as its twin first, and slower in the end.
    (rows((0, 0, 1000, 0, 1000), (0.1, 100, 1000, 100, 1000), (0.2, 180, 800, 200, 1000)), SLOWED),
    (rows((0, 0, -1000, 0, -1000), (0.1, -100, -1000, -100, -1000), (0.2, -180, -800, -200, -1000)), SLOWED),
    (rows((0, 0, 1000, 0, 1000), (0.1, 100, 1000, 100, 1000), (0.2, 220, 1200, 200, 1000)), OTHER),
    (rows((0, 0, 800, 0, 1000), (0.1, 80, 800, 100, 1000), (0.2, 160, 800, 200, 1000)), OTHER),
    (rows((0, 0, 1000, 0, 1000), (0.1, 98, 980, 100, 1000), (0.2, 196, 980, 200, 1000)), OTHER),
]  # fmt: skip


@for_each("pairs, named", CASES)
def test_the_causes_are_named_from_the_likeliest(pairs: list[Pair], named: tuple[str, ...]) -> None:
    assert causes(pairs) == named


def test_active_limits_come_before_a_load_and_are_named() -> None:
    pairs = rows((0, 0, 0, 0, 500), (0.1, 0, 0, 50, 500), (0.2, 0, 0, 100, 500))
    assert causes(pairs, limits=["limit+", "limit-"]) == (
        "a limit (limit+, limit-)",
        "load",
        "stall",
        "settings changed",
    )
    assert causes(pairs, "MR 5") == ("it is not known whether 'MR 5' was executed", *NEVER)


@for_each(
    "pairs, still",
    [
        (rows((0, 0, 0, 7, 0), (1, 9, 5, 7, 0)), True),
        (rows((0, 0, 0, 7, 0), (1, 9, 5, 8, 0)), False),
        (rows((0, 0, 0, 7, 1), (1, 9, 5, 7, 0)), False),
        ([], True),
    ],
)
def test_a_twin_is_unmoved_that_stayed_in_one_place_at_velocity_0(pairs: list[Pair], still: bool) -> None:
    assert unmoved(pairs) is still
