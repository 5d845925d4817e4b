"""When a poller reads what: its periods, silences and refusals, prints on a party line, defects, and its end."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import Inexpressible, NoAnswer, Refused, TransportLost
from multidrop.dialects import Kind, Motion, Priority, Reply, Request
from multidrop.dialects.codec import End
from multidrop.drives.events import ConversationOutcome, Sample, Silent, Transaction, Valued
from multidrop.drives.poller import AFTER_DEFECT, Due, Poller, Subscription
from multidrop.drives.readings import MotionReading
from multidrop.drives.telemetry import DriveValue, Telemetry
from multidrop.families.lexium.host.mcode.codec import MCode
from tests.drives.told_link import ToldLink
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual


class Drive:
    def __init__(self, address: str) -> None:
        self.address = self.shown = address
        self.transferring = False
        self.state = SimpleNamespace(programming=False, stranger="")
        self.seen: MotionReading | None = None


class Reads(Poller[str]):
    """Reads drives that reply after a time, or as the test says."""

    shortest, retry, after_silence = 0.1, 0.05, 1.0

    def __init__(self, *names: str, took: float = 0.01) -> None:
        self.link = ToldLink()
        self.roster = SimpleNamespace(link=self.link, drives={name: Drive(name) for name in names})
        super().__init__(self.roster)  # type: ignore[arg-type]
        self.reply_after = took
        self.fails: dict[str, Exception] = {}
        self.asked: list[tuple[float, str]] = []
        self.read: list[tuple[str, float, str]] = []
        self.silent: list[str] = []
        self.refused: list[tuple[str, int, str]] = []
        self.interrupted = 0
        self.due: dict[str, Due] = {}
        self.last: Any = None

    def _drive(self, thing: str) -> Any:
        return self.roster.drives[thing]

    def _begin(self, thing: str, due: Due, drive: Any) -> None:
        self.asked.append((round(self.link.now() - self.begun, 4), thing))
        self.due[thing] = due

        def start(over: Any) -> Any:
            failure = self.fails.get(thing)
            if isinstance(failure, ValueError):
                raise failure
            outcome = ConversationOutcome(() if failure else (f"{thing}!",), failure, self.last, self.last)
            asyncio.get_running_loop().call_later(self.reply_after, over, outcome)
            return SimpleNamespace(interrupt=self._interrupt)

        self._converse(thing, due, start, self._took)

    def _interrupt(self) -> None:
        self.interrupted += 1

    def _took(self, thing: str, at: float, read: str) -> None:
        self.read.append((thing, round(at - self.begun, 4), read))
        self._set_timer(self.link.now())

    def _silent(self, thing: str, due: Due) -> None:
        self.silent.append(thing)

    def _refused(self, thing: str, due: Due, why: str) -> None:
        self.refused.append((thing, due.refusals, why))

    async def for_(self, seconds: float) -> list[tuple[float, str]]:
        """What was asked in the next seconds, from now on."""
        self.begun = self.link.now()
        self.asked.clear()
        await asyncio.sleep(seconds)
        return self.asked

    begun = 0.0


def transaction(end: End, at: float = 5.0) -> Transaction:
    return Transaction(Request("a", "PR P", Kind.PRINT, MCode()), Reply(end=end), 1.0, 9.0, at)


async def test_a_thing_is_read_at_once_and_then_every_period():
    poller = Reads("a")
    assert poller.periods == {}
    poller.subscribe(["a"], 0.5)
    assert await poller.for_(1.2) == [(0.0, "a"), (0.5, "a"), (1.0, "a")]
    assert [(thing, read) for thing, _, read in poller.read] == [("a", "a!")] * 3


async def test_no_period_is_shorter_than_the_shortest():
    poller = Reads("a")
    assert poller.subscribe(["a"], 0.0).period == 0.1
    assert poller.subscribe(["a"], 0.2).period == 0.2
    assert await poller.for_(0.25) == [(0.0, "a"), (0.1, "a"), (0.2, "a")]


async def test_the_most_eager_subscription_counts_while_it_lasts():
    poller = Reads("a", "b")
    slow = poller.subscribe(["a", "b"], 1.0)
    fast = poller.subscribe(["a"], 0.5)
    assert poller.periods == {"a": 0.5, "b": 1.0}
    fast.close()
    fast.close()
    assert poller.periods == {"a": 1.0, "b": 1.0}
    slow.close()
    assert poller.periods == {} and await poller.for_(3) == []


async def test_a_faster_subscription_does_not_wait_for_the_slower_one():
    poller = Reads("a")
    poller.subscribe(["a"], 10.0)
    await poller.for_(1)
    poller.subscribe(["a"], 0.5)
    assert await poller.for_(1.2) == [(0.5, "a"), (1.0, "a")]


async def test_what_is_due_for_longest_is_read_first_and_one_at_a_time():
    poller = Reads("a", "b", took=0.3)
    poller.subscribe(["a"], 0.1)
    poller.subscribe(["b"], 0.1)
    assert await poller.for_(1.0) == [(0.0, "a"), (0.3, "b"), (0.6, "a"), (0.9, "b")]


async def test_the_time_of_a_reading_is_that_of_its_last_request_or_now():
    poller = Reads("a")
    poller.subscribe(["a"], 1.0)
    await poller.for_(0.5)
    assert poller.read == [("a", 0.01, "a!")]
    poller.last = transaction(End.DONE)
    poller.begun, poller.read = 0.0, []
    await asyncio.sleep(1.0)
    assert poller.read == [("a", 5.0, "a!")]


async def test_a_silent_drive_is_asked_again_after_a_pause_that_grows_up_to_a_limit():
    poller = Reads("a")
    poller.fails["a"] = NoAnswer("no reply")
    poller.subscribe(["a"], 0.1)
    times = [at for at, _ in await poller.for_(24)]
    assert [round(b - a, 2) for a, b in zip(times, times[1:], strict=False)] == [1.01, 2.01, 3.01, 4.01, 5.01, 5.01]
    assert poller.silent == ["a"] * 7
    poller.subscribe(["a"], 0.1)
    assert await poller.for_(1) == []
    poller.fails.clear()
    await asyncio.sleep(4)
    assert len(await poller.for_(1)) == 10


async def test_a_refusal_is_reported_and_the_thing_tried_again_soon():
    poller = Reads("a")
    poller.fails["a"] = Refused("a: error 21")
    poller.subscribe(["a"], 10.0)
    assert await poller.for_(0.13) == [(0.0, "a"), (0.06, "a"), (0.12, "a")]
    assert poller.refused == [("a", 0, "a: error 21")] * 3


async def test_naks_in_a_row_are_counted_until_a_reading():
    poller = Reads("a")
    poller.last, poller.fails["a"] = transaction(End.NAK), Refused("NAK")
    poller.subscribe(["a"], 10.0)
    await poller.for_(0.13)
    assert [count for _, count, _ in poller.refused] == [1, 2, 3]
    poller.last, poller.fails = transaction(End.DONE), {}
    await asyncio.sleep(0.1)
    assert poller.due["a"].refusals == 0
    poller.fails["a"] = Refused("other")
    await asyncio.sleep(12)
    assert poller.refused[3] == ("a", 0, "other")


async def test_a_thing_that_a_stop_kept_from_being_read_is_tried_again_soon_without_a_word():
    poller = Reads("a")
    poller.fails["a"] = Inexpressible("in program mode")
    poller.subscribe(["a"], 10.0)
    assert await poller.for_(0.07) == [(0.0, "a"), (0.06, "a")]
    assert poller.silent == poller.refused == [] and poller.due["a"].silences == 0


async def test_after_a_loss_the_period_counts():
    poller = Reads("a")
    poller.fails["a"] = TransportLost("gone")
    poller.subscribe(["a"], 1.0)
    assert await poller.for_(1.5) == [(0.0, "a"), (1.0, "a")]
    assert poller.silent == poller.refused == []


@pytest.mark.parametrize("how", ["programming", "transferring"])
async def test_a_drive_that_stores_lines_is_passed_over_and_read_soon_after(how):
    poller = Reads("a", "b")
    drive = poller.roster.drives["a"]
    setattr(drive.state if how == "programming" else drive, how, True)
    poller.subscribe(["a", "b"], 1.0)
    assert await poller.for_(0.52) == [(0.0, "b")]
    setattr(drive.state if how == "programming" else drive, how, False)
    assert await poller.for_(0.06) == [(0.03, "a")]


async def test_a_pause_keeps_everything_back_until_it_ends():
    poller = Reads("a")
    poller.subscribe(["a"], 0.5)
    poller.pause()
    assert await poller.for_(2.0) == []
    poller.resume()
    assert await poller.for_(0.6) == [(0.0, "a"), (0.01, "a"), (0.5, "a")]


async def test_a_line_that_is_away_is_not_polled():
    poller = Reads("a")
    poller.link.away = TransportLost("gone")  # type: ignore[assignment]
    poller.subscribe(["a"], 0.5)
    assert await poller.for_(2.0) == []


async def test_the_end_interrupts_the_reading_that_is_under_way():
    poller = Reads("a", took=1.0)
    poller.close()
    assert poller.interrupted == 0
    poller.subscribe(["a"], 0.1)
    await poller.for_(0.5)
    poller.close()
    assert poller.interrupted == 1 and poller.periods == {}
    assert await poller.for_(5) == []
    poller.close()
    assert poller.interrupted == 1


async def test_a_defect_is_reported_and_puts_the_thing_off_and_no_other():
    poller = Reads("a", "b")
    poller.fails["a"] = ValueError("no")
    poller.subscribe(["a", "b"], 20.0)
    assert await poller.for_(AFTER_DEFECT - 1) == [(0.0, "a"), (0.0, "b"), (20.0, "b"), (40.0, "b")]
    assert poller.link.told == [
        ("a: the poll failed (a defect: ValueError); it is polled again in 60 s", "a", True),
    ]
    poller.fails.clear()
    assert await poller.for_(2) == [(1.0, "a"), (1.01, "b")]


async def test_a_defect_in_the_end_of_a_poll_is_reported_too():
    poller = Reads("a")
    poller.fails["a"] = KeyError("no")
    poller.subscribe(["a"], 1.0)
    assert await poller.for_(AFTER_DEFECT - 1) == [(0.0, "a")]
    assert poller.link.told == [("a: the poll failed (a defect: KeyError); it is polled again in 60 s", "a", True)]


async def test_a_print_holds_up_the_polls_of_a_party_line_for_a_short_time():
    poller = Reads("a", "b")
    poller.link.line.printed_at = poller.link.now()
    poller.subscribe(["a"], 1.0)
    assert await poller.for_(0.5) == [(0.1, "a")]
    alone = Reads("a")
    alone.link.line.printed_at = alone.link.now()
    alone.subscribe(["a"], 1.0)
    assert await alone.for_(0.5) == [(0.0, "a")]


async def test_a_program_that_prints_without_a_pause_holds_a_poll_up_for_a_limited_time():
    poller = Reads("a", "b")
    printing = True

    async def prints() -> None:
        while printing:
            poller.link.line.printed_at = poller.link.now()
            await asyncio.sleep(0.01)

    task = asyncio.create_task(prints())
    await asyncio.sleep(0)
    poller.subscribe(["a"], 0.1)
    times = [at for at, _ in await poller.for_(0.65)]
    assert times == pytest.approx([0.2, 0.41, 0.62], abs=0.011)
    printing = False
    await task


async def test_a_subscription_ends_once():
    ended: list[Any] = []
    subscription = Subscription(["a", "b"], 0.5, ended.append)
    assert (subscription.things, subscription.period) == (("a", "b"), 0.5)
    subscription.close()
    assert ended == [subscription]


# Motion and values


def motions(*names: str) -> tuple[Telemetry, ToldLink, Any]:
    link = ToldLink()
    roster: Any = SimpleNamespace(link=link, drives={name: Drive(name) for name in names})
    roster.at = roster.drives.__getitem__
    for drive in roster.drives.values():
        drive.asked = []
        drive.start_motion = lambda priority, over, drive=drive: drive.asked.append((priority, over))
    return Telemetry(roster), link, roster


def reply(roster: Any, at: float, *axes: Motion) -> None:
    """The reply to the last poll of `a`."""
    _, over = roster.at("a").asked[-1]
    over(ConversationOutcome((axes,), None, None, transaction(End.DONE, at)))


async def test_the_rate_of_samples_is_that_of_the_last_two_seconds():
    poller, link, roster = motions("a")
    assert poller.rate("a") == 0.0
    poller.subscribe(["a"], 0.5)
    times = []
    for _ in range(4):
        await asyncio.sleep(0.5)
        reply(roster, link.now())
        times.append(poller.rate("a"))
    assert times == [0.0, 0.0, 2.0, 2.0]
    await asyncio.sleep(1.0)
    assert poller.rate("a") == 0.0


async def test_a_sample_has_what_was_read_and_the_velocity_that_the_places_show():
    poller, link, roster = motions("a")
    subscription = poller.subscribe(["a"], 0.5)
    await asyncio.sleep(0.01)
    [(priority, over)] = roster.at("a").asked
    assert priority is Priority.POLL
    axes = (Motion(5, 0, "x", "stalled", True), Motion(6, 1, "y"))
    roster.at("a").seen = MotionReading(1.0, 7, (7, 1))
    over(ConversationOutcome((axes,), None, None, transaction(End.DONE, at=3.0)))
    assert link.events == []
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert link.events == [
        Sample(3.0, "a", 5, 7, "x", "stalled", True),
        Sample(3.0, "a", 6, 1, "y", "", None),
    ]
    roster.at("a").seen = None
    await asyncio.sleep(0.5)
    reply(roster, 4.0, *axes[1:])
    subscription.close()
    await asyncio.sleep(0.01)
    assert len(link.events) == 2
    poller.subscribe(["a"], 0.5)
    await asyncio.sleep(0.5)
    reply(roster, 4.0, *axes[1:])
    await asyncio.sleep(0.01)
    assert link.events[2:] == [Sample(4.0, "a", 6, 1, "y", "", None)]


async def test_no_stranger_is_polled():
    poller, _, roster = motions("a")
    roster.at("a").state.stranger = "it said nothing"
    poller.subscribe(["a"], 0.1)
    await asyncio.sleep(1)
    assert roster.at("a").asked == []


async def test_a_drive_that_does_not_reply_to_a_poll_is_silent():
    poller, link, roster = motions("a")
    poller.subscribe(["a"], 0.5)
    await asyncio.sleep(0.01)
    now = link.now()
    roster.at("a").asked[0][1](ConversationOutcome((), NoAnswer("no reply")))
    assert link.events == [Silent(now, "a")]


def values(*names: str) -> tuple[Telemetry, ToldLink, Any]:
    link = ToldLink()
    roster: Any = SimpleNamespace(link=link, drives={name: Drive(name) for name in names})
    roster.at = roster.drives.__getitem__
    for drive in roster.drives.values():
        drive.asked = []
        drive.family = SimpleNamespace(values=SimpleNamespace(again=lambda *asked: asked))
        drive.start = lambda procedure, over, typed, drive=drive: drive.asked.append((procedure, over, typed))
    return Telemetry(roster), link, roster


async def test_a_value_is_read_by_its_word_again_and_again():
    poller, link, roster = values("a")
    poller.read([DriveValue("a", "I4")], 0.5)
    await asyncio.sleep(0.01)
    [(procedure, over, typed)] = roster.at("a").asked
    assert (procedure, typed) == (("I4", Priority.POLL), True)
    over(ConversationOutcome((2.5,), None, None, transaction(End.DONE, at=3.0)))
    assert link.events == [Valued(3.0, "a", "I4", 2.5)]
    await asyncio.sleep(0.5)
    assert len(roster.at("a").asked) == 2


async def test_a_value_that_is_refused_is_said_once_and_not_read_again():
    poller, link, roster = values("a")
    poller.read([DriveValue("a", "I4")], 0.1)
    await asyncio.sleep(0.01)
    roster.at("a").asked[0][1](ConversationOutcome((), Refused("a: error 21")))
    await asyncio.sleep(60)
    assert link.told == [("a: error 21; it is not read again", "a", True)] and len(roster.at("a").asked) == 1
    poller.read([DriveValue("a", "I4")], 0.1)
    await asyncio.sleep(1)
    assert len(roster.at("a").asked) == 1


async def test_a_subscription_that_begins_again_reads_a_refused_value_again():
    poller, link, roster = values("a")
    subscription = poller.read([DriveValue("a", "I4")], 0.1)
    await asyncio.sleep(0.01)
    roster.at("a").asked[0][1](ConversationOutcome((), Refused("a: error 21")))
    subscription.close()
    poller.read([DriveValue("a", "I4")], 0.1)
    await asyncio.sleep(0.01)
    assert len(roster.at("a").asked) == 2


async def test_a_value_that_gets_three_naks_in_a_row_counts_as_refused():
    poller, link, roster = values("a")
    poller.read([DriveValue("a", "I4")], 0.1)
    for number in range(3):
        await asyncio.sleep(4)
        assert len(roster.at("a").asked) == number + 1 and link.told == []
        roster.at("a").asked[-1][1](ConversationOutcome((), NoAnswer("NAK"), None, transaction(End.NAK)))
    await asyncio.sleep(60)
    assert link.told == [("a: NAK to 'I4'; it is not read again", "a", True)] and len(roster.at("a").asked) == 3


async def test_values_are_read_twenty_times_a_second_unless_another_period_is_asked_for():
    shop = await SimulatedBus(party("a")).open("a")
    for period, least, most in ((None, 18, 21), (0.5, 2, 3)):
        value, before = DriveValue("a", "VM"), len(shop.events)
        telemetry = shop.bus.telemetry
        reading = telemetry.read([value]) if period is None else telemetry.read([value], period)
        await asyncio.sleep(1)
        reading.close()
        assert least <= sum(isinstance(each, Valued) for each in shop.events[before:]) <= most
