"""The trigger of plots: samples in, states out."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.tui.curves.samples import TraceQuantity
from multidrop.tui.curves.trigger import Trigger, TriggerSetting, TriggerState

HERE = TraceQuantity("press", "a", "", "velocity")
SPAN = 10.0


def state(trigger: Trigger) -> TriggerState:
    return trigger.state


def armed(level: float = 100, rising: bool = True, before: float = 0.2, single: bool = False) -> Trigger:
    trigger = Trigger()
    trigger.arm(TriggerSetting(HERE, level, rising, before), single)
    return trigger


def test_an_edge_is_a_crossing_of_the_level_in_its_direction_and_its_time_is_between_two_samples() -> None:
    for rising, first, last in ((True, 0, 200), (False, 200, 0)):
        trigger = armed(rising=rising)
        trigger.take([(1.0, last), (1.1, first)], SPAN, 1.1)
        assert state(trigger) is TriggerState.ARMED, "the other edge"
        trigger.take([(1.2, last)], SPAN, 1.2)
        assert state(trigger) is TriggerState.TRIGGERED and trigger.at == pytest.approx(1.15)
        assert trigger.end(SPAN) == pytest.approx(9.15)


def test_a_value_that_stays_beyond_the_level_and_one_before_it_was_armed_are_no_edge() -> None:
    trigger = armed()
    trigger.take([(n / 10, 150.0) for n in range(40)], SPAN, 4.0)
    assert state(trigger) is TriggerState.ARMED


def test_it_holds_once_the_picture_is_past_also_if_no_sample_comes() -> None:
    trigger = armed()
    trigger.take([(1.0, 0), (1.1, 100)], SPAN, 1.1)
    trigger.take([], SPAN, trigger.end(SPAN) - 0.01)
    assert state(trigger) is TriggerState.TRIGGERED
    trigger.take([], SPAN, trigger.end(SPAN))
    assert state(trigger) is TriggerState.HELD


def test_a_single_shot_stands_and_the_others_take_the_next_edge_after_the_picture() -> None:
    wave = [(n / 10, 200.0 * (n % 30 >= 15)) for n in range(300)]
    single, again = armed(single=True), armed()
    for trigger in (single, again):
        trigger.take(wave, SPAN, 30.0)
    assert state(single) is TriggerState.HELD and single.at == pytest.approx(1.45)
    assert again.at == pytest.approx(28.45), "each time the first edge after the picture"
    single.arm(single.setting, True)  # type: ignore[arg-type]
    assert state(single) is TriggerState.ARMED


def test_nothing_is_joined_over_a_gap_but_slow_samples_are() -> None:
    trigger = armed()
    trigger.take([(1.0, 0), (1.1, 0), (9.0, 200)], SPAN, 9.0)
    assert state(trigger) is TriggerState.ARMED
    slow = armed()
    slow.take([(0.0, 0), (2.0, 0), (4.0, 200)], SPAN, 4.0)
    assert state(slow) is TriggerState.TRIGGERED


ALLOWED = {
    "take": {
        (TriggerState.ARMED, TriggerState.TRIGGERED),
        (TriggerState.ARMED, TriggerState.HELD),
        (TriggerState.TRIGGERED, TriggerState.HELD),
        (TriggerState.HELD, TriggerState.TRIGGERED),
    }
}
STEP = st.one_of(
    st.just("disarm"),
    st.booleans(),
    st.lists(st.tuples(st.floats(0.01, 20), st.floats(-300, 300)), max_size=6),
)


@given(st.lists(STEP, max_size=40), st.floats(0, 1))
def test_states_follow_each_other_as_the_table_says(steps: list[object], before: float) -> None:
    trigger, now = Trigger(), 0.0
    for step in steps:
        was, at = trigger.state, trigger.at
        if step == "disarm":
            trigger.disarm()
            assert trigger.state is TriggerState.OFF and not trigger.stands
        elif isinstance(step, bool):
            trigger.arm(TriggerSetting(HERE, 50, True, before), step)
            assert trigger.state is TriggerState.ARMED
        elif isinstance(step, list):
            samples = []
            for wait, value in step:
                now += wait
                samples.append((now, value))
            trigger.take(samples, SPAN, now)
            assert trigger.state is was or (was, trigger.state) in ALLOWED["take"]
            if was is TriggerState.HELD and trigger.single:
                assert (trigger.state, trigger.at) == (was, at), "a single shot stands"
            if trigger.state is TriggerState.HELD:
                assert now >= trigger.end(SPAN)
            if trigger.at != at:
                assert trigger.at <= now


@given(st.lists(st.tuples(st.floats(0.01, 0.5), st.floats(-300, 300)), max_size=60), st.integers(1, 9))
def test_it_does_not_matter_how_samples_are_grouped(points: list[tuple[float, float]], size: int) -> None:
    at, samples = 0.0, []
    for wait, value in points:
        at += wait
        samples.append((at, value))
    whole, parts = armed(50), armed(50)
    whole.take(samples, SPAN, at)
    for n in range(0, len(samples), size):
        part = samples[n : n + size]
        parts.take(part, SPAN, part[-1][0])
    assert (whole.state, whole.at) == (parts.state, parts.at)
