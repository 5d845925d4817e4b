"""Where the stop's thread cuts in: the list of points, and that a stop arrives there, or as a lock is given back."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from random import Random
from typing import Any

import pytest

from multidrop.transports.pipe import DescriptorPipe
from soak.simulation.acts.prompt import stop_cuts_in
from soak.simulation.judges.judge import broken
from soak.simulation.living import lived
from soak.simulation.story import ACTS
from soak.simulation.system.cut_ins import UP, Aim, CutIns, points
from tests.support.paths import ROOT

pytestmark = pytest.mark.fork

LIST = ROOT / "tests" / "soak" / "points.txt"


def test_the_list_of_points_is_the_one_of_the_source() -> None:
    """A new lock, queue, write, discard or await of the shared code joins the list, and is cut in at from then on."""
    assert LIST.read_text().splitlines() == list(points())


class Endpoint:
    """Takes every write."""

    name = "port"

    def __init__(self) -> None:
        self.taken: list[bytes] = []

    def fileno(self) -> int:
        return 1

    def write(self, data: bytes | memoryview) -> int:
        self.taken.append(bytes(data))
        return len(data)

    def unsent(self) -> int:
        return 0

    def drop(self) -> int:
        return 0

    def close(self) -> None:
        pass


@pytest.fixture
def passed() -> list[str]:
    """The names of the points that were hit."""
    return []


@pytest.fixture
def cut_ins(passed: list[str]) -> Iterator[CutIns]:
    made = CutIns(passed.append)
    yield made
    made.kill()


def guarded(endpoint: Any, cut_ins: CutIns) -> DescriptorPipe:
    """A pipe in whose critical sections others may cut in."""
    pipe = DescriptorPipe(endpoint)
    pipe._guard = cut_ins.lock()  # type: ignore[assignment]
    return pipe


@pytest.mark.virtual
@pytest.mark.parametrize("point", [each for each in points() if each.startswith("pipe DescriptorPipe.write")])
@pytest.mark.parametrize("further", range(0, 40, 5))
async def test_a_stop_cuts_in_at_a_point_and_waits_for_the_lock(cut_ins: CutIns, point: str, further: int) -> None:
    endpoint = Endpoint()
    pipe = guarded(endpoint, cut_ins)
    cut_ins.begin(Aim(point, 1, further), partial(pipe.preempt, False, lambda dropped: b"\x1b"))
    pipe.write(b"MR 1\r")
    pipe.write(b"MR 2\r")
    assert endpoint.taken.count(b"\x1b") == 1
    assert endpoint.taken[-1] == b"\x1b", "nothing leaves after it"


@pytest.mark.virtual
@pytest.mark.parametrize("own", range(1, 80, 3))
async def test_the_thread_of_a_stop_is_held_up_anywhere_and_nothing_leaves_after_it(
    cut_ins: CutIns, passed: list[str], own: int
) -> None:
    endpoint = Endpoint()
    pipe = guarded(endpoint, cut_ins)
    point = next(each for each in points() if each.startswith("pipe DescriptorPipe.write"))
    cut_ins.begin(Aim(point, 1, 0, own, 10_000), partial(pipe.preempt, False, lambda dropped: b"\x1b"))
    for number in range(3):
        pipe.write(b"MR %d\r" % number)
    cut_ins.hurry()
    assert UP in passed or own > 60
    assert endpoint.taken.count(b"\x1b") == 1
    assert endpoint.taken[-1] == b"\x1b"
    pipe.yielded()
    assert pipe.write(b"MR 4\r")


@pytest.mark.nightly
def test_every_point_of_the_pipe_is_passed_by_some_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stories of nothing but lines and stops that cut in; a point that no seed passes is shown."""
    acts = tuple(each for each in ACTS if each.do is stop_cuts_in or each.name in ("a line", "unplug", "kill"))
    monkeypatch.setattr("soak.simulation.story.ACTS", acts)
    passed: set[str] = set()
    made = CutIns.__init__

    def watched(self: CutIns, count: object) -> None:
        made(self, passed.add)

    monkeypatch.setattr(CutIns, "__init__", watched)
    for seed in Random(1).sample(range(100_000), 400):
        assert broken(lived(seed, range(30))) == []
    assert not {each for each in points() if each.startswith("pipe")} - passed
