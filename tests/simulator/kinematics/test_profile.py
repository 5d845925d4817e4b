"""Motion in closed form: the manual's own figures, and what must hold for any move."""

from math import copysign, inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.simulator.kinematics import MotionPace, Profile, halt, move, slew

speeds = st.floats(0, 2_560_000, allow_subnormal=False).map(lambda v: v if v > 1e-3 else 0.0)
velocities = st.tuples(speeds, st.sampled_from((-1, 1))).map(lambda pair: pair[0] * pair[1])
positions = st.integers(-50_000_000, 50_000_000).map(float)
rates = st.floats(91, 1.1e9)
times = st.floats(0, 1000)


@st.composite
def dynamics(draw: st.DrawFn) -> dict[str, float]:
    vi, vm = sorted((draw(st.floats(1, 2_560_000)), draw(st.floats(1, 2_560_000))))
    return {"vi": vi, "vm": vm, "a": draw(rates), "d": draw(rates)}


@st.composite
def moves(draw: st.DrawFn) -> tuple[Profile, float, dict[str, float]]:
    v0, how = draw(st.one_of(st.just(0.0), velocities)), draw(dynamics())
    profile = move(draw(times), draw(positions), v0, draw(positions), MotionPace(**how))
    return profile, v0, how


def joints(profile: Profile) -> list[float]:
    return [segment.start for segment in profile.segments] + [profile.end]


def inside(profile: Profile, part: float) -> float:
    return profile.start + part * (profile.end - profile.start)


def slack(profile: Profile) -> float:
    """Steps that rounding of positions and of times may make."""
    fastest = max((abs(profile.velocity(t)) for t in joints(profile)), default=0.0)
    return 1e-6 + 1e-9 * (abs(profile.origin) + abs(profile.target)) + 1e-11 * fastest * (1 + profile.start)


def test_the_manuals_long_move_has_its_figures() -> None:
    profile = move(0, 0, 0, 3_840_000, MotionPace(vi=1000, vm=768_000, a=1e6, d=1e6))
    up, level, down = profile.segments
    assert up.duration == down.duration == pytest.approx(0.767, abs=1e-12)
    assert 2 * level.position == pytest.approx(2 * 294_911.5, abs=1e-6)
    assert level.velocity == 768_000
    assert profile.end == pytest.approx(5.7660013, abs=1e-7)


def test_a_move_too_short_for_vm_is_a_triangle() -> None:
    profile = move(0, 0, 0, 512_000, MotionPace(vi=200_000, vm=2_500_000, a=1e6, d=1e6))
    assert len(profile.segments) == 2
    assert profile.velocity(profile.end / 2) == pytest.approx(742_967.0, abs=0.1)
    assert profile.position(profile.end) == 512_000


def test_the_velocity_is_vi_at_the_start_and_nothing_at_the_end() -> None:
    profile = move(2, 10, 0, -5000, MotionPace(vi=300, vm=1000, a=1e5, d=1e5))
    assert profile.velocity(1.999) == 0
    assert profile.velocity(2) == -300
    assert profile.velocity(profile.end - 1e-9) == pytest.approx(-300, abs=1)
    assert profile.velocity(profile.end) == 0
    assert profile.acceleration(2) == -1e5 and profile.acceleration(profile.end) == 0
    assert profile.moving(2) and not profile.moving(1.999) and not profile.moving(profile.end)


def test_a_move_to_where_it_stands_is_over_at_once() -> None:
    assert move(4, 7, 0, 7, MotionPace(vi=1, vm=2, a=1, d=1)) == halt(4, 7)


def test_too_fast_to_stop_in_time_it_overshoots_and_comes_back() -> None:
    profile = move(0, 0, 50_000, 100, MotionPace(vi=1000, vm=80_000, a=1e6, d=1e6))
    furthest = max(profile.position(inside(profile, n / 1000)) for n in range(1001))
    assert furthest == pytest.approx((50_000**2 - 1000**2) / 2e6, rel=1e-3)
    turn = profile.segments[1]
    assert turn.velocity == -1000, "it starts the other way at VI"
    assert profile.position(profile.end) == 100


def test_above_a_vm_that_was_lowered_it_slows_down_to_it() -> None:
    profile = move(0, 0, 9000, 100_000, MotionPace(vi=100, vm=4000, a=1e4, d=1e4))
    assert [segment.velocity for segment in profile.segments] == [9000, 4000, 4000]
    assert [copysign(1, segment.acceleration) for segment in profile.segments] == [-1, 1, -1]


def test_a_target_behind_is_reached_by_way_of_a_stop() -> None:
    profile = move(0, 0, -2000, 3000, MotionPace(vi=1000, vm=5000, a=1e4, d=1e4))
    assert profile.position(profile.segments[1].start) == pytest.approx(-150)
    assert profile.segments[1].velocity == 1000
    assert profile.target == 3000


def test_a_slew_goes_on_for_ever() -> None:
    profile = slew(1, 5, 0, -8000, MotionPace(vi=1000, vm=inf, a=7000, d=1))
    assert profile.end == inf and profile.target == -inf
    assert profile.velocity(2) == profile.velocity(1e6) == -8000
    assert profile.position(3) - profile.position(4) == pytest.approx(8000)


def test_a_slew_to_nothing_slows_down_to_vi_and_stops() -> None:
    profile = slew(0, 0, 5000, 0, MotionPace(vi=1000, vm=inf, a=1, d=2000))
    assert profile.end == pytest.approx(2)
    assert profile.target == profile.position(99) == pytest.approx((5000**2 - 1000**2) / 4000)


@pytest.mark.parametrize(
    ("v0", "velocity", "starts"),
    [
        (0, 500, [500]),  # below VI: at once
        (0, 3000, [1000, 3000]),
        (500, 3000, [1000, 3000]),
        (2000, 3000, [2000, 3000]),
        (3000, 2000, [3000, 2000]),
        (3000, 300, [3000, 300]),
        (300, 500, [500]),
        (3000, -2000, [3000, -1000, -2000]),
        (-3000, 300, [-3000, 300]),
        (400, -300, [-300]),
        (400, 0, []),
        (0, 0, []),
    ],
)
def test_a_slew_passes_through_these_velocities(v0: float, velocity: float, starts: list[float]) -> None:
    profile = slew(0, 0, v0, velocity, MotionPace(vi=1000, vm=inf, a=1e4, d=1e4))
    assert [segment.velocity for segment in profile.segments] == starts


def test_a_crossing_is_found_on_the_way_out_and_on_the_way_back() -> None:
    profile = move(0, 0, 50_000, 100, MotionPace(vi=1000, vm=80_000, a=1e6, d=1e6))
    out = profile.crossing(1000, 0)
    assert profile.velocity(out) > 0
    back = profile.crossing(1000, out + 1e-6)
    assert profile.velocity(back) < 0
    assert profile.crossing(1000, back + 1e-6) == inf
    assert profile.crossing(100, profile.end - 1e-6) == pytest.approx(profile.end)


def test_standing_at_the_mark_is_no_crossing_and_leaving_it_is_one() -> None:
    assert halt(0, 5).crossing(5, 0) == inf
    profile = move(1, 5, 0, 500, MotionPace(vi=10, vm=100, a=1e3, d=1e3))
    assert profile.crossing(5, 0) == 1
    assert profile.crossing(500, profile.end) == inf
    assert slew(0, 0, 0, -10, MotionPace(vi=10, vm=inf, a=1, d=1)).crossing(-600, 3) == pytest.approx(60)


@given(moves())
def test_a_move_ends_on_its_target_and_stands_before_and_after(
    made: tuple[Profile, float, dict[str, float]],
) -> None:
    profile, _, _ = made
    assert profile.position(profile.end) == profile.position(profile.end + 1e6) == profile.target
    assert profile.position(profile.start - 1) == profile.origin
    assert profile.velocity(profile.start - 1e-6) == profile.velocity(profile.end) == 0
    assert profile.end < inf


@given(moves())
def test_the_position_has_no_jumps(made: tuple[Profile, float, dict[str, float]]) -> None:
    profile, _, _ = made
    at = profile.origin
    for segment in profile.segments:
        assert segment.position == pytest.approx(at, abs=slack(profile))
        at = segment.position_at(segment.start + segment.duration)
    assert profile.target == pytest.approx(at, abs=slack(profile))


@given(moves(), st.floats(0, 1))
def test_the_velocity_stays_in_its_bounds(made: tuple[Profile, float, dict[str, float]], part: float) -> None:
    profile, v0, how = made
    most = max(how["vm"], abs(v0)) * (1 + 1e-9)
    assert abs(profile.velocity(inside(profile, part))) <= most
    for segment in profile.segments:
        assert abs(segment.velocity) <= most
        assert abs(segment.velocity) >= min(how["vi"], abs(v0) or inf) * (1 - 1e-6)


@given(moves())
def test_the_rates_are_a_and_d(made: tuple[Profile, float, dict[str, float]]) -> None:
    profile, _, how = made
    for segment in profile.segments[:-1]:  # the last ramp makes good for rounding
        rate = segment.acceleration * copysign(1, segment.velocity)
        assert any(rate == pytest.approx(each) for each in (how["a"], 0.0, -how["d"]))


@given(moves(), st.floats(0, 1))
def test_a_crossing_is_where_the_position_says(made: tuple[Profile, float, dict[str, float]], part: float) -> None:
    profile, _, _ = made
    t = inside(profile, part)
    mark = profile.position(t)
    found = profile.crossing(mark, profile.start)
    if profile.start < t < profile.end:
        assert found <= t + 1e-6
    if found < inf:
        assert profile.position(found) == pytest.approx(mark, abs=slack(profile))


@given(moves(), positions, st.floats(0, 1))
def test_nothing_is_passed_before_its_crossing(
    made: tuple[Profile, float, dict[str, float]], mark: float, part: float
) -> None:
    profile, _, _ = made
    found = profile.crossing(mark, profile.start)
    until = min(found, profile.end)
    side = mark - profile.origin
    here = mark - profile.position(profile.start + part * (until - profile.start))
    assert side * here >= 0 or abs(here) <= slack(profile)


@given(moves(), positions)
def test_at_a_crossing_the_mark_is_reached(made: tuple[Profile, float, dict[str, float]], mark: float) -> None:
    profile, _, _ = made
    found = profile.crossing(mark, profile.start)
    if found < inf and mark != profile.origin:
        assert (profile.position(found) - mark) * (mark - profile.origin) >= 0, "not short of it by rounding"


@given(positions, positions, dynamics(), st.floats(0, 1))
def test_a_move_backwards_in_time_is_the_move_back(
    p0: float, target: float, how: dict[str, float], part: float
) -> None:
    there = move(0, p0, 0, target, MotionPace(**how))
    back = move(0, target, 0, p0, MotionPace(**{**how, "a": how["d"], "d": how["a"]}))
    assert back.end == pytest.approx(there.end, rel=1e-6, abs=1e-9)
    t = inside(there, part)
    assert there.position(t) == pytest.approx(back.position(there.end - t), abs=1e-3 + 1e-6 * abs(target - p0))


@given(moves(), st.floats(0.01, 0.99))
def test_a_move_taken_up_on_the_way_ends_when_it_would_have(
    made: tuple[Profile, float, dict[str, float]], part: float
) -> None:
    profile, _, how = made
    t = inside(profile, part)
    again = move(t, profile.position(t), profile.velocity(t), profile.target, MotionPace(**how))
    assert again.target == profile.target
    if profile.velocity(t) and len(profile.segments) <= 3 and abs(profile.velocity(t)) >= how["vi"]:
        assert again.end == pytest.approx(profile.end, rel=1e-3, abs=1e-3)


@given(times, positions, velocities, velocities, dynamics(), st.floats(0, 100))
def test_a_slew_gets_to_its_velocity_without_a_jump_in_position(
    at: float, p0: float, v0: float, velocity: float, how: dict[str, float], later: float
) -> None:
    profile = slew(at, p0, v0, velocity, MotionPace(vi=how["vi"], vm=inf, a=how["a"], d=how["d"]))
    ends = [segment.position_at(segment.start + segment.duration) for segment in profile.segments[:-1]]
    for segment, before in zip(profile.segments[1:], ends, strict=True):
        assert segment.position == pytest.approx(before, abs=slack(profile) if profile.end < inf else 1.0)
    settled = profile.segments[-1].start if velocity else profile.end
    assert profile.velocity(settled + later) == velocity
    if not velocity:
        assert profile.position(settled + later) == profile.target
