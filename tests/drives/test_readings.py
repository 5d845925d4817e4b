"""Readings of motion: what counts as at rest, and the velocity of a drive whose own reads 0 on the way."""

import pytest

from multidrop.dialects import Motion
from multidrop.drives.readings import LEAST_REST, RECENT, Judged, MotionReading


def read(judged: Judged, at: float, *axes: tuple[int, int], in_place: bool = True):
    return judged.reading(at, at, [Motion(position, velocity) for position, velocity in axes], in_place)


def test_two_readings_of_one_place_confirm_the_rest_and_a_sooner_one_does_not():
    judged = Judged()
    assert not read(judged, 10.0, (5, 0)).at_rest()
    assert not read(judged, 10.0 + LEAST_REST / 2, (5, 0)).at_rest()
    assert read(judged, 10.0 + LEAST_REST, (5, 0)).at_rest()


@pytest.mark.parametrize("between", [(6, 0), (5, 3)], ids=["another place", "a velocity"])
def test_what_moved_between_two_readings_is_not_at_rest(between):
    judged = Judged()
    read(judged, 10.0, (5, 0))
    assert not read(judged, 10.1, between).at_rest()
    assert not read(judged, 10.2, (5, 0)).at_rest()


def test_a_drive_that_reads_no_velocity_on_the_way_has_that_of_its_positions():
    judged = Judged()
    read(judged, 10.0, (0, 0))
    assert read(judged, 10.5, (-200, 0)).velocity == -400
    assert read(judged, 10.9, (-200, 0)).velocity == 0


def test_the_velocity_that_a_drive_reads_is_not_replaced_by_that_of_its_positions():
    judged = Judged()
    read(judged, 10.0, (0, 500))
    assert read(judged, 10.5, (100, 500)).velocities == (500,)


def test_an_axis_that_stays_in_its_place_has_no_velocity_while_another_moves():
    judged = Judged()
    read(judged, 10.0, (0, 0), (7, 0))
    seen = read(judged, 10.5, (100, 0), (7, 0))
    assert seen.velocities == (200, 0) and seen.velocity == 200


def test_a_place_that_was_read_long_ago_says_nothing_of_the_velocity():
    judged = Judged()
    read(judged, 10.0, (0, 0))
    assert read(judged, 10.0 + RECENT, (1000, 0)).velocity == 0


def test_without_that_a_place_must_stay_only_the_velocity_counts():
    judged = Judged()
    read(judged, 10.0, (0, 0), in_place=False)
    seen = read(judged, 10.5, (3, 0), in_place=False)
    assert seen.velocity == 0 and seen.at_rest()


@pytest.mark.parametrize(
    ("confirms", "since", "at_rest"),
    [
        (9.5, None, True),
        (9.0, None, False),
        (8.9, None, False),
        (9.0, 8.9, True),
        (9.0, 9.0, False),
        (float("-inf"), None, False),
    ],
)
def test_a_rest_is_recent_or_later_than_the_time_that_is_given(confirms, since, at_rest):
    assert MotionReading(9.0 + RECENT, 0, (0,), 10.0, confirms).at_rest(since) is at_rest


@pytest.mark.parametrize(("place", "velocity"), [(1, 1), (-1, -1), (0, 0), (2, 3)])
def test_the_slowest_way_has_a_velocity(place, velocity):
    judged = Judged()
    read(judged, 10.0, (0, 0))
    assert read(judged, 10.75, (place, 0)).velocity == velocity


def test_a_second_reading_at_the_same_time_has_the_velocity_that_was_read():
    judged = Judged()
    read(judged, 10.0, (0, 0))
    assert read(judged, 10.0, (5, 0)) == MotionReading(10.0, 0, (0,), 10.0)


def test_a_drive_that_has_another_number_of_axes_is_judged_by_what_it_reads():
    judged = Judged()
    read(judged, 10.0, (0, 0))
    assert read(judged, 10.1, (5, 0), (6, 0)) == MotionReading(10.1, 0, (0, 0), 10.1)


def test_the_fastest_axis_is_that_of_the_drive():
    assert read(Judged(), 10.0, (0, 7), (0, -9)) == MotionReading(10.0, -9, (7, -9), 10.0)


def test_the_latest_reading_that_is_old_enough_confirms_a_rest():
    judged = Judged()
    for at in (10.0, 10.03, 10.06, 10.09):
        seen = read(judged, at, (5, 0))
    assert seen == MotionReading(10.09, 0, (0,), 10.09, 10.03)
    assert judged.still == [10.03, 10.06, 10.09]
    read(judged, 10.1, (5, 2))
    assert judged.still == []
