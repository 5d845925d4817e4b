"""When the conditions of a drive are read: which part, how often, what keeps it back, and what is published."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import Inexpressible, NoAnswer, Refused, TransportLost
from multidrop.dialects.values import Part
from multidrop.drives.events import Conditioned
from multidrop.drives.readings import ProgramReading
from multidrop.drives.telemetry import AGED, LEAST_AGE, Telemetry
from tests.drives.told_link import ToldLink

pytestmark = pytest.mark.virtual


class Drive:
    """A drive with a quick part and a slow one."""

    programming = transferring = False
    running: ProgramReading | None = None

    def __init__(self, link: ToldLink, address: str = "a") -> None:
        self.link, self.address, self.shown, self.commands = link, address, address, 0
        self.settings: dict[str, Any] = {}
        self.state = SimpleNamespace(programming=False, settings_unknown=False, stranger="")
        self.counting = SimpleNamespace(axes=())
        self.fails: dict[str, Exception] = {}
        self.read: list[tuple[float, str]] = []
        self.parts = [
            Part("flags", lambda: self.part("flags")),
            Part("limits", lambda: self.part("limits"), True),
        ]
        self.runs: bool | None = None
        values = SimpleNamespace(parts=lambda facts: self.parts, fold=self.fold)
        self.family = SimpleNamespace(values=values)

    def part(self, name: str) -> Any:
        self.read.append((round(self.link.now() - self.begun, 3), name))
        if name in self.fails:
            raise self.fails[name]
        return {name: len(self.read)}
        yield

    begun = 0.0

    async def run(self, procedure: Any) -> Any:
        try:
            next(procedure)
        except StopIteration as done:
            return done.value

    def fold(self, facts: Any) -> Any:
        return (SimpleNamespace(runs=self.runs, facts=dict(facts)),)

    async def for_(self, seconds: float) -> list[tuple[float, str]]:
        self.begun = self.link.now()
        self.read.clear()
        await asyncio.sleep(seconds)
        return self.read


def watched(*names: str) -> tuple[Telemetry, ToldLink, list[Drive], Any]:
    link = ToldLink()
    drives = {name: Drive(link, name) for name in names}
    restarts = SimpleNamespace(counts={}, count=lambda drive: restarts.counts.get(drive.address, 0))
    roster: Any = SimpleNamespace(link=link, drives=drives, at=drives.__getitem__, restarts=restarts)
    return Telemetry(roster), link, list(drives.values()), roster


def published(link: ToldLink) -> list[dict[str, int]]:
    return [each.conditions[0].facts for each in link.events if isinstance(each, Conditioned)]


async def test_quick_parts_are_read_every_period_and_slow_ones_at_first_and_when_they_are_old():
    telemetry, link, [a], _ = watched("a")
    telemetry.watch(["a"], 1.0)
    assert await a.for_(2.5) == [(0.0, "flags"), (0.0, "limits"), (1.0, "flags"), (2.0, "flags")]
    assert published(link) == [{"flags": 1, "limits": 2}, {"flags": 3, "limits": 2}, {"flags": 4, "limits": 2}]
    assert a.settings == {"limits": ({"limits": 2}, 0)}
    times = [at for at, name in await a.for_(2 * AGED) if name == "limits"]
    assert times == [AGED + 1 - 2.5, 2 * (AGED + 1) - 2.5]


async def test_after_a_command_the_settings_are_read_again_but_not_too_often():
    telemetry, link, [a], _ = watched("a")
    telemetry.watch(["a"], 0.5)
    await a.for_(0.1)
    a.commands = 1
    assert [at for at, name in await a.for_(5) if name == "limits"] == [LEAST_AGE + 0.5 - 0.1]
    assert a.settings["limits"][1] == 1
    assert [at for at, name in await a.for_(5) if name == "limits"] == []


async def test_a_part_that_is_refused_is_not_asked_again_and_the_others_are():
    telemetry, link, [a], _ = watched("a")
    a.fails["flags"] = Refused("a: error 21")
    telemetry.watch(["a"], 1.0)
    assert await a.for_(1.5) == [(0.0, "flags"), (0.0, "limits")]
    assert published(link) == [{"limits": 2}] and link.told == []


@pytest.mark.parametrize("failure", [Inexpressible("in program mode"), TransportLost("gone")])
async def test_what_keeps_a_part_from_being_read_ends_this_turn_alone(failure):
    telemetry, link, [a], _ = watched("a")
    a.fails["flags"] = failure
    telemetry.watch(["a"], 1.0)
    assert await a.for_(1.5) == [(0.0, "flags"), (1.0, "flags")]
    assert published(link) == []


async def test_a_silent_drive_is_asked_less_and_less_until_it_replies():
    telemetry, link, [a], _ = watched("a")
    a.fails["flags"] = NoAnswer("no reply")
    telemetry.watch(["a"], 1.0)
    assert [at for at, _ in await a.for_(13)] == [0.0, 2.0, 6.0, 12.0]
    telemetry.watch(["a"], 1.0)
    assert await a.for_(1) == []
    a.fails.clear()
    assert [at for at, name in await a.for_(9) if name == "flags"] == [6.0, 7.0, 8.0]
    assert link.told == []


async def test_another_subscription_reads_at_once():
    telemetry, link, [a], _ = watched("a")
    telemetry.watch(["a"], 10.0)
    await a.for_(1)
    telemetry.watch(["a"], 10.0)
    assert await a.for_(1) == [(0.0, "flags")]


@pytest.mark.parametrize("how", ["programming", "transferring", "settings_unknown", "away"])
async def test_nothing_is_read_of_a_drive_that_stores_lines_or_whose_settings_are_to_be_found_out(how):
    telemetry, link, [a], _ = watched("a")
    where: Any = {"settings_unknown": a.state, "away": link}.get(how, a)
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    setattr(where, how, TransportLost("gone") if how == "away" else True)
    assert await a.for_(3) == []


async def test_after_a_pause_everything_is_read_again():
    telemetry, link, [a], _ = watched("a")
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    telemetry.pause()
    assert await a.for_(3) == []
    telemetry.resume()
    assert await a.for_(0.5) == [(0.0, "flags"), (0.0, "limits")]


async def test_after_a_pause_a_drive_that_was_silent_before_it_is_read_at_once():
    telemetry, link, [a], _ = watched("a")
    a.fails["flags"] = NoAnswer("no reply")
    telemetry.watch(["a"], 1.0)
    await a.for_(7)
    telemetry.pause()
    a.fails.clear()
    telemetry.resume()
    assert await a.for_(0.5) == [(0.0, "flags"), (0.0, "limits")]


async def test_after_a_restart_everything_is_read_again():
    telemetry, link, [a], roster = watched("a")
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    roster.restarts.counts["a"] = 1
    assert await a.for_(2) == [(0.5, "flags"), (0.5, "limits"), (1.5, "flags")]


async def test_another_drive_at_the_address_is_read_from_the_beginning():
    telemetry, link, [a], roster = watched("a")
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    other = roster.drives["a"] = Drive(link)
    assert await other.for_(1) == [(0.5, "flags"), (0.5, "limits")]


async def test_a_drive_that_is_not_listed_any_more_is_not_read():
    telemetry, link, [a], roster = watched("a")
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    roster.drives.clear()
    roster.at = lambda address: a
    assert await a.for_(3) == []


@pytest.mark.parametrize("runs", [True, False, None])
async def test_that_a_program_runs_is_noted_with_the_beginning_of_the_reading(runs):
    telemetry, link, [a], _ = watched("a")
    a.runs = runs
    begun = link.now()
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    assert a.running == (None if runs is None else ProgramReading(begun, runs))


async def test_the_end_of_the_last_subscription_ends_the_reading():
    telemetry, link, [a, b], _ = watched("a", "b")
    subscription = telemetry.watch(["a", "b"], 1.0)
    await a.for_(0.5)
    subscription.close()
    assert await a.for_(5) == [] and await b.for_(5) == []
    telemetry.watch(["a"], 1.0)
    telemetry.close()
    assert await a.for_(5) == []


async def test_a_print_on_a_party_line_holds_each_part_up_for_a_moment():
    telemetry, link, [a, b], _ = watched("a", "b")
    link.line.printed_at = link.now()
    telemetry.watch(["a"], 1.0)
    assert await a.for_(0.5) == [(0.1, "flags"), (0.1, "limits")]


async def test_a_defect_is_reported_with_what_was_read_and_the_drive_put_off():
    telemetry, link, [a], _ = watched("a")
    a.fails["flags"] = ValueError("no")
    telemetry.watch(["a"], 1.0)
    assert await a.for_(59) == [(0.0, "flags")]
    assert link.told == [("a: a defect: ValueError", "a", True)]
    a.fails.clear()
    assert await a.for_(2.5) == [(1.0, "flags"), (1.0, "limits"), (2.0, "flags")]


async def test_without_a_subscription_nothing_is_known_of_rate_and_period():
    telemetry, _, _, _ = watched("a")
    assert (telemetry.rate("a"), telemetry.period("a")) == (0.0, float("inf"))
    telemetry.subscribe([], 0.5)
    assert telemetry.period("a") == float("inf")


@pytest.mark.parametrize(("holds", "times"), [(True, [0.0, 5.0, 10.0]), (False, [0.0, 1.0, 2.0, 3.0])])
async def test_what_the_scales_rest_on_is_read_now_and_then_and_where_they_do_not_hold_each_time(
    holds, times, monkeypatch
):
    telemetry, link, [a], _ = watched("a")
    read: list[float] = []

    async def recount(drive: Any, priority: Any) -> None:
        read.append(round(link.now() - a.begun, 3))
        raise NoAnswer("no reply")

    monkeypatch.setattr("multidrop.drives.telemetry.recount", recount)
    a.counting.axes = ("x", "y")
    a.scale_holds = lambda axis: holds or axis == "x"  # type: ignore[attr-defined]
    telemetry.watch(["a"], 1.0)
    await a.for_(10.5 if holds else 3.5)
    assert read == times and len(published(link)) == (11 if holds else 4)


async def test_the_end_ends_a_reading_that_waits_and_only_one_is_under_way():
    telemetry, link, [a, b], _ = watched("a", "b")
    waits = asyncio.Event()

    async def run(procedure: Any) -> Any:
        read.append("begun")
        try:
            await waits.wait()
        finally:
            read.append("ended")

    read: list[str] = []
    a.run = b.run = run  # type: ignore[method-assign]
    telemetry.watch(["a", "b"], 1.0)
    await asyncio.sleep(5)
    assert read == ["begun"]
    telemetry.close()
    await asyncio.sleep(0)
    assert read == ["begun", "ended"]


async def test_a_part_that_is_not_due_keeps_none_behind_it_back():
    telemetry, link, [a], _ = watched("a")
    a.parts = [*reversed(a.parts)]
    telemetry.watch(["a"], 1.0)
    assert await a.for_(2.5) == [(0.0, "limits"), (0.0, "flags"), (1.0, "flags"), (2.0, "flags")]


@pytest.mark.parametrize("failing", ["flags", "limits"])
async def test_a_part_that_is_not_asked_for_any_more_keeps_none_behind_it_back(failing):
    telemetry, link, [a], _ = watched("a")
    a.fails[failing] = Refused("a: error 21")
    telemetry.watch(["a"], 1.0)
    await a.for_(0.5)
    times = [(1.0, "flags")] if failing == "limits" else []
    assert [(at + 0.5, name) for at, name in await a.for_(1)] == times


async def test_what_the_scales_rest_on_is_read_in_five_periods_whatever_the_period(monkeypatch):
    telemetry, link, [a], _ = watched("a")
    read: list[float] = []

    async def recount(drive: Any, priority: Any) -> None:
        read.append(round(link.now() - a.begun, 3))

    monkeypatch.setattr("multidrop.drives.telemetry.recount", recount)
    a.counting.axes = ("x",)
    a.scale_holds = lambda axis: True  # type: ignore[attr-defined]
    telemetry.watch(["a"], 0.5)
    await a.for_(5.2)
    assert read == [0.0, 2.5, 5.0]
