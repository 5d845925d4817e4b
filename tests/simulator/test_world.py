"""The physical world around a drive: schedules, what is set by hand, switches by position, pushes."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.kinematics import MotionPace, move, slew
from multidrop.simulator.world import World

SCHEDULE = WorldSpec(inputs=((2.0, 1, 0), (2.5, 1, 1), (1.0, 3, 1)), analog=((0.5, 2048), (3.0, 100)))


def test_an_input_that_nobody_drives_has_no_level() -> None:
    world = World(WorldSpec())
    assert world.level(1, 0) is None
    assert world.analog(0) == 0
    assert world.next_change(0) == inf


def test_the_schedule_is_followed_in_the_order_of_time() -> None:
    world = World(SCHEDULE)
    world.powered_up(0)
    changes = [0.0]
    while (at := world.next_change(changes[-1])) < inf:
        changes.append(at)
    assert changes == [0, 0.5, 1, 2, 2.5, 3]
    world.powered_up(0)
    assert [world.level(1, t) for t in (0, 1.99, 2, 2.49, 2.5)] == [None, None, 0, 0, 1]
    assert world.level(3, 2.5) == 1
    assert world.analog(3) == 100


def test_the_schedule_starts_again_at_power_up() -> None:
    world = World(SCHEDULE)
    world.powered_up(0)
    assert world.level(1, 50) == 1
    world.powered_up(100)
    assert world.level(1, 100) is None
    assert world.next_change(100) == 100.5
    assert world.analog(100.5) == 2048
    assert world.level(1, 102) == 0


def test_what_is_set_by_hand_holds_until_the_schedule_changes_it() -> None:
    world = World(SCHEDULE)
    world.powered_up(0)
    world.set_input(1, 1, 1.0)
    assert [world.level(1, t) for t in (1.0, 1.9, 2.0)] == [1, 1, 0]
    world.set_input(1, None, 2.1)
    assert world.level(1, 2.2) is None
    world.set_input(0, 7, 3.5)
    assert world.analog(9) == 7


def test_what_is_set_by_hand_is_still_there_after_a_power_cycle() -> None:
    world = World(SCHEDULE)
    world.powered_up(0)
    world.set_input(2, 0, 1.0)
    world.set_input(1, 0, 1.0)
    assert world.level(1, 5) == 1, "the schedule has taken it over"
    world.powered_up(10)
    assert world.level(2, 10) == 0
    assert world.level(1, 10) is None


def test_a_change_by_hand_comes_after_the_schedule_up_to_then() -> None:
    world = World(SCHEDULE)
    world.powered_up(0)
    world.set_input(1, 0, 99.0)
    assert world.level(1, 99) == 0


def test_the_analog_input_is_no_numbered_input() -> None:
    world = World(SCHEDULE)
    assert world.analog(1) == 2048
    assert world.level(0, 1) is None


def test_switches_close_at_their_positions() -> None:
    world = World(WorldSpec(home=0, limit_plus=200, limit_minus=-200))
    closed = {p: world.switches(p) for p in (-201, -200, -199, 0, 1, 199, 200)}
    assert closed == {
        -201: (True, False, True),
        -200: (True, False, True),
        -199: (True, False, False),
        0: (True, False, False),
        1: (False, False, False),
        199: (False, False, False),
        200: (False, True, False),
    }


def test_switches_that_are_not_there_are_never_closed() -> None:
    assert World(WorldSpec()).switches(-1e9) == World(WorldSpec()).switches(1e9) == (False, False, False)


def test_pushes_add_up() -> None:
    world = World(WorldSpec())
    world.push(100, 1.0)
    world.push(-30, 2.0)
    assert world.pushed == 70


def test_every_switch_on_the_way_is_met_once() -> None:
    world = World(WorldSpec(home=0, limit_plus=2000, limit_minus=-1000))
    profile = move(5, -3000, 0, 3000, MotionPace(vi=100, vm=5000, a=1e4, d=1e4))
    seen, t = [], 0.0
    while (at := world.next_switch(profile, t)) < inf:
        assert at > t
        seen.append((round(profile.position(at)), world.switches(profile.position(at))))
        t = at
    assert seen == [
        (-1000, (True, False, False)),
        (0, (False, False, False)),
        (2000, (False, True, False)),
    ]


def test_a_switch_is_met_on_the_way_out_and_on_the_way_back() -> None:
    world = World(WorldSpec(limit_plus=1000))
    profile = move(0, 0, 50_000, 0, MotionPace(vi=1000, vm=60_000, a=1e6, d=1e6))
    first = world.next_switch(profile, 0)
    assert world.switches(profile.position(first))[1]
    second = world.next_switch(profile, first)
    assert not world.switches(profile.position(second))[1]
    assert world.next_switch(profile, second) == inf


def test_a_push_moves_the_switches_against_the_motor() -> None:
    world = World(WorldSpec(home=0))
    profile = slew(0, 500, 0, -100, MotionPace(vi=100, vm=inf, a=1, d=1))
    assert world.next_switch(profile, 0) == pytest.approx(5)
    assert world.next_switch(profile, 0, offset=-200) == pytest.approx(3)


@given(st.integers(-(10**6), 10**6), st.sampled_from((-1.0, 1.0)), st.floats(0, 1e5), st.integers(1, 10**6))
def test_the_time_of_a_switch_is_one_at_which_it_has_changed(mark: int, way: float, at: float, speed: int) -> None:
    world = World(WorldSpec(home=mark))
    profile = slew(at, mark - way * 1000, 0, way * speed, MotionPace(vi=1, vm=inf, a=1e9, d=1e9))
    before = world.switches(profile.origin)[0]
    found = world.next_switch(profile, at)
    assert found < inf
    assert world.switches(profile.position(found))[0] is not before
    assert profile.position(found) == pytest.approx(mark, abs=1.1)
    assert world.next_switch(profile, found) == inf
