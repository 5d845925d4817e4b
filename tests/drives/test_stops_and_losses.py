"""Stops while a line is lost, what of them is sent once it is back, and what a reserved or closed line says."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

from multidrop.dialects import Hints
from multidrop.dialects.families import FAMILIES
from multidrop.drives.bus import Bus
from multidrop.drives.events import Changed, Traffic
from multidrop.drives.halts import Halt
from multidrop.drives.stopping import Fate
from multidrop.simulator.serving.in_process import SimPipe
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus
from tests.support.until import until

pytestmark = pytest.mark.virtual


@pytest.fixture
async def desk() -> AsyncIterator[SimulatedBus]:
    made = await SimulatedBus(party("a"), party("b"), timeout=0.5).open("a", "b", checksum=1, em=1)
    await asyncio.sleep(1)
    made.events.clear()
    yield made
    await made.bus.close()


async def lose(desk: SimulatedBus) -> None:
    desk.floor.command("/sim unplug w")
    await until(lambda: desk.bus.lost)
    await asyncio.sleep(0.05)
    desk.events.clear()


def back(desk: SimulatedBus) -> Halt | None:
    desk.floor.command("/sim plug w")
    return desk.bus.resume(desk.pipe("sim:#w", desk.floor, "w", lambda: None))


def stops(desk: SimulatedBus) -> list[bytes]:
    return [each.data for each in desk.events if isinstance(each, Traffic) and each.outgoing and each.stop]


async def found_again(desk: SimulatedBus) -> None:
    await desk.bus.find_again(Hints(drives=("a", "b"), party=True, checksum=1, em=1))


async def test_each_stop_has_a_higher_number_and_only_one_of_the_whole_line_is_its_last(desk: SimulatedBus) -> None:
    bus, drives = desk.bus, desk.bus.drives
    assert bus.last_stop is None
    one = bus.stop()
    two = bus.stop([drives["a"]])
    three = bus.stop()
    assert one.number < two.number < three.number
    assert (one.whole, two.whole, three.whole) == (True, False, True)
    assert bus.last_stop is three and two.drives == (drives["a"],) and set(three.drives) == set(drives.values())
    await bus.stopped()
    assert [three.fate(each) for each in drives.values()] == [Fate.STANDING, Fate.STANDING]
    assert stops(desk)[0] == one.data and all(each.trouble == [] for each in (one, two, three))


async def test_a_stop_on_a_lost_line_writes_nothing_and_is_the_first_to_be_written_on_its_return(
    desk: SimulatedBus,
) -> None:
    await desk.send("a", "SL 50000")
    await lose(desk)
    halt = desk.bus.stop()
    assert (halt.data, halt.written, halt.trouble, halt.delivered) == (b"", (), ["lost"], False)
    assert halt.fate(desk.bus.drives["a"]) is Fate.NOT_REACHED
    assert desk.bus.link.stops == halt.number + 1 and stops(desk) == [] == desk.sent
    again = back(desk)
    assert again is not None and again.whole and again.number > halt.number and again is desk.bus.last_stop
    assert stops(desk) == [again.data] == list(again.written) and desk.sent[0] == again.data
    assert desk.told == []  # nothing was read yet
    await found_again(desk)
    await desk.bus.stopped()
    assert not desk.moving("a")
    assert [text.partition(" at ")[0] for text in desk.told if "velocity 0" in text] == [
        "a: stopped, velocity 0",
        "b: stopped, velocity 0",
    ]
    assert again.fate(desk.bus.drives["a"]) is Fate.STANDING


async def test_a_key_that_found_the_line_lost_is_written_first_although_the_loop_has_not_come_to_it_yet(
    desk: SimulatedBus,
) -> None:
    await desk.send("a", "SL 50000")
    await lose(desk)
    desk.bus.stop_ahead()  # in the thread of the keys; the loop opens the port again before it hears of that
    again = back(desk)
    assert again is not None and again.whole and stops(desk) == [again.data] and desk.sent[0] == again.data
    desk.bus.stop()
    await found_again(desk)
    await desk.bus.stopped()
    assert not desk.moving("a")
    await lose(desk)
    assert back(desk) is None, "the loop has followed the key: nothing is owed"


async def test_a_stop_of_one_drive_that_a_loss_kept_back_is_that_of_this_drive(desk: SimulatedBus) -> None:
    for name in ("a", "b"):
        await desk.send(name, "SL 50000")
    await lose(desk)
    desk.bus.stop([desk.bus.drives["b"]])
    again = back(desk)
    assert again is not None and not again.whole and again.drives == (desk.bus.drives["b"],)
    await found_again(desk)
    await desk.bus.stopped()
    assert not desk.moving("b") and (desk.moving("a") != (desk.bus.drives["a"] in again.others))


async def test_a_stop_that_was_seen_to_work_is_not_written_again_after_a_loss(desk: SimulatedBus) -> None:
    desk.bus.stop()
    await desk.bus.stopped()
    await lose(desk)
    assert back(desk) is None and stops(desk) == []
    await found_again(desk)
    assert desk.bus.lost is None


async def test_a_stop_that_a_loss_kept_from_being_confirmed_is_written_again(desk: SimulatedBus) -> None:
    await desk.send("b", "SL 50000")
    first = desk.bus.stop()
    await lose(desk)
    await asyncio.sleep(1)
    again = back(desk)
    assert again is not None and again.whole and again.number > first.number
    await lose(desk)  # and once more, before its confirmation
    third = back(desk)
    assert third is not None and third.number > again.number
    await found_again(desk)
    await desk.bus.stopped()
    await lose(desk)
    assert back(desk) is None


async def test_of_a_drive_that_a_person_has_started_since_a_stop_nothing_is_stopped_after_a_loss(
    desk: SimulatedBus,
) -> None:
    desk.bus.stop([desk.bus.drives["a"]])
    await asyncio.sleep(0.001)
    for name in ("a", "b"):  # the bytes of its stop have stopped b as well
        await desk.send(name, "SL 50000")
    await lose(desk)
    assert back(desk) is None and stops(desk) == []


async def test_a_stop_of_the_whole_line_in_a_reserved_one_is_written_and_counts_as_done(desk: SimulatedBus) -> None:
    await desk.send("b", "SL 50000")
    desk.events.clear()
    await desk.bus.reserve()
    assert str(desk.bus.link.reserved) == "w is raw: typed text goes to the port; /raw off finds its drives"
    assert any(isinstance(each, Changed) for each in desk.events)
    desk.events.clear()
    halt = desk.bus.stop()
    await asyncio.sleep(2)
    assert stops(desk)[0] == halt.data and not desk.moving("b") and desk.told == []
    await lose(desk)
    assert back(desk) is None
    desk.events.clear()
    await desk.bus.find_again(Hints())
    assert desk.bus.lost is None and desk.bus.link.reserved is not None and desk.sent == []
    assert [type(each) for each in desk.events] == [Changed]
    await desk.bus.find_again(Hints(drives=("a", "b"), party=True), release=True)
    assert desk.bus.link.reserved is None and await desk.send("b", "PR V") == ("0",)


async def test_a_line_is_reserved_only_after_what_is_under_way(desk: SimulatedBus) -> None:
    asked = [asyncio.ensure_future(desk.send("a", "PR IS")) for _ in range(3)]
    await asyncio.sleep(0)
    await desk.bus.reserve()
    assert all(each.done() for each in asked)
    asyncio.ensure_future(desk.bus.find_again(Hints(drives=("a", "b"), party=True), release=True))
    await until(lambda: desk.bus.link.reserved is None)


async def test_a_line_on_which_no_drive_replies_is_gone_on_with(desk: SimulatedBus) -> None:
    await lose(desk)
    desk.bus.stop()
    assert back(desk) is not None
    desk.events.clear()
    desk.bus.unanswered("nobody is there")
    assert desk.bus.silent == "nobody is there" and desk.bus.lost is None
    assert any(isinstance(each, Changed) for each in desk.events)
    await lose(desk)
    assert back(desk) is None


@pytest.mark.parametrize("baud, byte", [(19200, 10 / 19200), (0, 0.0)])
async def test_another_baud_rate_changes_what_a_byte_takes(desk: SimulatedBus, baud: int, byte: float) -> None:
    desk.bus.set_baud(baud)
    assert (desk.bus.line.baud, desk.bus.line.byte_time, desk.bus.keeper.baud) == (baud, byte, baud)


async def test_nothing_is_confirmed_or_read_after_the_end_of_a_bus() -> None:
    desk = await SimulatedBus(party("a"), timeout=0.5).open("a")
    ends: list[Any] = []
    halt = desk.bus.halt()
    desk.bus.halted(halt, confirm=False)
    await asyncio.wait_for(desk.bus.stopped(), 0.001)
    desk.bus.stop()
    asked = asyncio.ensure_future(desk.send("a", "PR P"))
    asked.add_done_callback(ends.append)
    await desk.bus.close()
    assert ends == [asked] and asked.exception() is not None
    assert asyncio.all_tasks() == {asyncio.current_task()}


def modbus() -> Bus:
    desk = SimulatedBus('personality = "LMDCE"', pipe=SimPipe)
    return Bus("m", desk.transport, baud=0, family="modbus")


async def test_a_line_is_strange_until_one_device_on_it_has_said_what_it_is() -> None:
    roster = modbus().roster
    assert roster.strange
    codec = FAMILIES["modbus"].codec
    stranger = FAMILIES["modbus"].new_state(codec, "")
    roster.found(stranger)
    assert roster.strange
    stranger.identified("LMDCE", "1.0")
    assert not roster.strange
