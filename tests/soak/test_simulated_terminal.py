"""The terminal of the simulation: a reader who is away, a hang-up, and pastes in brackets."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from soak.simulation.judges.judge import broken
from soak.simulation.living import lived
from soak.simulation.records.climate import FAULTS, Climate
from soak.simulation.records.commands import Outcome
from soak.simulation.story import ACTS
from soak.simulation.world import World

pytestmark = pytest.mark.fork

Live = Callable[..., World]


@pytest.fixture
def live(monkeypatch: pytest.MonkeyPatch) -> Live:
    """Live a story of these acts alone, in a climate with faults of other kinds than those of bytes."""

    def lives(seed: int, *names: str) -> World:
        monkeypatch.setattr("soak.simulation.story.ACTS", tuple(each for each in ACTS if each.name in names))
        monkeypatch.setattr(Climate, "calm", False)
        return lived(seed, range(12), without=FAULTS)

    return lives


def test_lines_that_an_unread_terminal_loses_are_counted_and_no_stop_waits_for_it(live: Live) -> None:
    world = live(4, "terminal unread", "stop")
    assert b"missing here" in world.terminal.shown
    assert broken(world) == [] and world.history.stops


def test_a_hang_up_ends_the_session_in_an_orderly_way_and_another_one_begins(live: Live) -> None:
    world = live(2, "long move", "terminal hangs up")
    assert world.history.lives > 1 and not world.history.counts.get("kills")
    assert broken(world) == []


def test_the_lines_of_a_paste_wait_for_its_enter_and_a_stop_drops_them(live: Live) -> None:
    world = live(6, "paste")
    outcomes = [each.outcome for each in world.history.commands.values()]
    assert Outcome.OK in outcomes
    assert broken(world) == []
