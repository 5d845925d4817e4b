"""Messages on their way to a broker: in order, bounded, sent again after a loss, in virtual time."""

from __future__ import annotations

import asyncio
from collections import Counter
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.features.publishing.broker import BrokerMessage
from multidrop.features.publishing.publisher import DRAIN, LONGEST_PAUSE, REMIND, Backlog, MessagePublisher
from multidrop.transports import Unreachable
from tests.support.kept_broker import KeptBroker
from tests.support.virtual import in_virtual_time

pytestmark = pytest.mark.virtual
ONLINE, BYE = BrokerMessage("p/status", "online", True), BrokerMessage("p/status", "bye", True)


class Desk:
    """A publisher on a broker, and what it reports."""

    def __init__(self, most: int = 1000, window: int = 1000) -> None:
        self.broker = KeptBroker(window)
        self.said: list[str] = []
        self.dropped: Counter[str] = Counter()
        self.publisher = MessagePublisher(
            self.broker.connection, ONLINE, self.said.append, self.dropped.update, Backlog(most)
        )

    def put(self, *numbers: int) -> None:
        """Publish numbers."""
        for number in numbers:
            self.publisher.put(BrokerMessage("p/n", str(number), bus="press"))

    @property
    def numbers(self) -> list[int]:
        """The numbers that arrived."""
        return [int(each) for each in self.broker.texts("p/n")]


@pytest.fixture
def desk() -> Desk:
    return Desk()


async def test_the_first_message_is_online_and_the_last_is_bye(desk: Desk) -> None:
    await desk.publisher.begin()
    desk.put(1, 2)
    await desk.publisher.end(BYE)
    assert [each.text for each in desk.broker.received] == ["online", "1", "2", "bye"]
    assert desk.broker.connections[0].closed and desk.publisher.sent == 4 and desk.said == []


async def test_a_broker_that_is_not_there_at_the_start_is_a_failure(desk: Desk) -> None:
    desk.broker.refusals = ["no broker at h:1"]
    with pytest.raises(Unreachable, match="no broker at h:1"):
        await desk.publisher.begin()
    assert len(desk.broker.attempts) == 1


async def test_a_cancellation_that_is_swallowed_while_the_broker_is_lost_delays_no_end(desk: Desk) -> None:
    await desk.publisher.begin()
    connection = desk.broker.connections[0]

    async def close() -> None:
        with suppress(asyncio.CancelledError):
            await asyncio.sleep(30)

    connection.close = close  # type: ignore[method-assign]
    desk.broker.refusals = ["refused"] * 1000
    desk.broker.cut()
    await asyncio.sleep(1)
    await asyncio.wait_for(desk.publisher.end(BYE), 20)


async def test_a_lost_broker_is_tried_again_with_back_off_and_each_reason_is_said_once(desk: Desk) -> None:
    await desk.publisher.begin()
    desk.broker.refusals = ["refused"] * 7 + ["wrong password"] * 2
    begin = asyncio.get_running_loop().time()
    desk.broker.cut()
    await asyncio.sleep(400)
    gaps = [round(each - begin) for each in desk.broker.attempts[1:]]
    assert gaps == [1, 3, 7, 15, 31, 61, 91, 121, 151, 181] and LONGEST_PAUSE == 30
    assert [each.split(";")[0] for each in desk.said] == [
        "the broker is lost",
        "the broker is still lost: refused",
        "the broker is still lost: wrong password",
        "the broker is back after 181.0 s",
    ]
    await desk.publisher.end(BYE)


async def test_what_waited_arrives_in_order_and_then_the_retained_states_again(desk: Desk) -> None:
    await desk.publisher.begin()
    desk.publisher.put(BrokerMessage("p/a/state", "moving", True, "press"))
    desk.put(1)
    desk.broker.acknowledges = False
    desk.put(2, 3)  # sent, and not acknowledged
    desk.broker.cut()
    await asyncio.sleep(0)
    desk.broker.acknowledges = True
    desk.put(4)
    await asyncio.sleep(10)
    assert desk.numbers == [1, 2, 3, 4]
    assert [each.text for each in desk.broker.received[3:]] == ["online", "2", "3", "4", "moving"]
    await desk.publisher.end(BYE)


async def test_without_room_the_oldest_are_dropped_counted_and_said() -> None:
    desk = Desk(most=5)
    await desk.publisher.begin()
    desk.broker.cut()
    await asyncio.sleep(0)
    desk.put(*range(12))
    assert desk.said == ["the broker is lost; messages wait for it, and it is tried again"]
    await asyncio.sleep(10)
    assert desk.numbers == [7, 8, 9, 10, 11]
    assert desk.said[-1] == "7 messages for the broker were dropped, the oldest of those that waited"
    assert (desk.dropped, desk.publisher.lost) == (Counter(press=7), 7)
    await desk.publisher.end(BYE)


async def test_a_broker_that_is_too_slow_is_said_now_and_then() -> None:
    desk = Desk(most=5, window=2)
    desk.broker.acknowledges = False
    await desk.publisher.begin()
    for number in range(200):
        desk.put(number)
        desk.publisher.look()
        await asyncio.sleep(1)
    assert len(desk.said) == 1 + int(200 / REMIND)
    assert sum(int(each.split()[0]) for each in desk.said) == desk.publisher.lost
    begin = asyncio.get_running_loop().time()
    await desk.publisher.end(BYE)
    assert asyncio.get_running_loop().time() - begin == pytest.approx(DRAIN)
    assert desk.publisher.waiting >= 5


async def test_a_retained_message_that_was_dropped_is_sent_again_once_there_is_room() -> None:
    desk = Desk(most=5, window=2)
    desk.broker.acknowledges = False
    await desk.publisher.begin()
    desk.put(0)
    desk.publisher.put(BrokerMessage("p/a/state", "moving", True, "press"))
    desk.put(*range(1, 9))
    assert desk.broker.retained() == {}
    desk.broker.acknowledges = True
    desk.broker.connections[-1].acknowledge()
    desk.broker.connections[-1].on_room()
    assert desk.broker.retained()["p/a/state"] == "moving"
    await desk.publisher.end(BYE)


async def test_the_end_while_the_broker_is_away_waits_for_nothing(desk: Desk) -> None:
    await desk.publisher.begin()
    desk.broker.refusals = ["refused"] * 100
    desk.broker.cut()
    await asyncio.sleep(5)
    desk.put(1)
    begin = asyncio.get_running_loop().time()
    await desk.publisher.end(BYE)
    assert asyncio.get_running_loop().time() == begin
    assert desk.publisher.waiting == 2 and desk.numbers == []
    assert len(asyncio.all_tasks()) == 1


@given(st.lists(st.sampled_from(["put", "cut", "hold", "go", "wait", "refuse"]), max_size=40))
def test_nothing_is_lost_without_being_counted_and_nothing_overtakes(steps: list[str]) -> None:
    @in_virtual_time
    async def run() -> None:
        desk = Desk(most=8, window=3)
        await desk.publisher.begin()
        count = 0
        for step in steps:
            if step == "put":
                count += 1
                desk.put(count)
            elif step == "cut" and desk.publisher.connected:
                desk.broker.cut()
                await asyncio.sleep(0)
            elif step in ("hold", "go"):
                desk.broker.acknowledges = step == "go"
                desk.broker.connections[-1].acknowledge()
                desk.broker.connections[-1].on_room()
            elif step == "refuse":
                desk.broker.refusals.append("refused")
            elif step == "wait":
                await asyncio.sleep(3)
        desk.broker.acknowledges = True
        desk.broker.connections[-1].acknowledge()
        desk.broker.connections[-1].on_room()
        await asyncio.sleep(2000)
        await desk.publisher.end(BYE)
        assert desk.numbers == sorted(set(desk.numbers))
        assert len(desk.numbers) + desk.dropped["press"] == count
        assert desk.broker.retained()["p/status"] == "bye"

    run()
