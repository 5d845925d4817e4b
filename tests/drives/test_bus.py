"""A bus over simulated drives, in virtual time: stops seen to work, lost pipes, polls, names, ends."""

import asyncio
from math import inf
from typing import Any

import pytest

from multidrop.base.errors import Stopped, TransportLost
from multidrop.dialects import End
from multidrop.drives.events import Changed, Ended, Lost, Notice, Sample
from multidrop.families.lexium.host.mcode.framing import sealed
from multidrop.families.lexium.manual import program_file
from multidrop.simulator.serving.in_process import SimPipe
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus
from tests.support.until import until
from tests.support.virtual import hold_up

pytestmark = pytest.mark.virtual

LOOP = "PG 1\nLB G1\n" + "R1=R1+1\n" * 30 + "E\nPG\n"


class Deaf(SimPipe):
    """A line on which the first `stops` escapes are lost on the way."""

    stops = 0

    def write(self, data: bytes) -> bool:
        while self.stops and b"\x1b" in data:
            data, self.stops = data.replace(b"\x1b", b"", 1), self.stops - 1
        return super().write(data)


async def opened(**more: Any) -> SimulatedBus:
    """A bus with drives a and b, whose settings are known."""
    desk = await SimulatedBus(party("a"), party("b"), pipe=Deaf, timeout=0.5, **more).open("a", "b", checksum=1, em=1)
    desk.events.clear()
    return desk


async def refused(work: asyncio.Task[Any]) -> None:
    with pytest.raises(Stopped):
        await work


@pytest.fixture
async def desk():
    return await opened()


async def test_a_stop_is_written_before_it_returns_and_fails_all_that_waits(desk):
    await desk.send("a", "SL 5000")
    waiting = [asyncio.create_task(desk.send(address, "MR 51200")) for address in "abab"]
    await until(lambda: b"MR 51200" in desk.written)
    desk.events.clear()
    desk.bus.stop()
    assert desk.written.startswith(b"\x1b") and desk.bus.line.waiting == []
    ended = await asyncio.gather(*waiting, return_exceptions=True)
    assert [type(each) for each in ended] == [Stopped] * 4
    await desk.bus.stopped()
    assert b"MR" not in desk.written and not desk.moving("a") and not desk.moving("b")


async def test_stopped_is_said_only_when_the_velocity_was_read_as_0(desk):
    await desk.send("b", "SL 50000")
    desk.events.clear()
    desk.bus.stop()
    await desk.bus.stopped()
    said = [
        n for n, event in enumerate(desk.events) if isinstance(event, Notice) and event.text.startswith("b: stopped")
    ]
    read = [n for n, e in enumerate(desk.events) if isinstance(e, Ended) and e.transaction.request.address == "b"]
    assert len(said) == 1 and read[-1] < said[0]
    reply = desk.events[read[-1]].transaction.reply
    assert reply.end is End.DONE and reply.text.endswith('"b"0')


async def test_a_drive_that_still_moves_is_stopped_again(desk):
    await desk.send("b", "SL 50000")
    desk.transport.stops = 3
    desk.bus.stop()
    await desk.bus.stopped()
    assert [text.split(" at ")[0] for text in desk.told if text.startswith("b: ")] == [
        "b: still moves",
        "b: stopped, velocity 0",
    ]
    assert not desk.moving("b")


async def test_a_drive_that_no_stop_reaches_is_named_in_the_end(desk):
    await desk.send("b", "SL 50000")
    desk.transport.stops = 100
    desk.bus.stop()
    await desk.bus.stopped()
    assert desk.told[-1] == "STILL MOVING after 3 stops: b; cut the power"
    assert not any(text.startswith("b: stopped") for text in desk.told) and desk.moving("b")


async def test_a_stop_that_meets_the_loss_hides_no_reply_once_the_line_is_back():
    desk = SimulatedBus()
    desk.floor.command("/sim unplug w")
    await until(lambda: desk.bus.lost)
    desk.bus.line.overtaken = True  # by a thread that had not seen the loss
    desk.floor.command("/sim plug w")
    desk.bus.resume(desk.pipe("sim:#w", desk.floor, "w", lambda: None))
    assert not desk.bus.line.overtaken


@pytest.mark.parametrize("text", ["MR 51200", ""])
async def test_a_line_that_a_loss_cut_off_is_made_harmless_and_stopped_before_anything_else(desk, text):
    await asyncio.sleep(1.0)
    if text:
        moving = asyncio.create_task(desk.send("a", text))
        await until(lambda: b"MR 51200" in desk.written)
    desk.floor.command("/sim unplug w")
    await until(lambda: desk.bus.lost)
    if text:
        with pytest.raises(TransportLost):
            await moving
    desk.floor.command("/sim plug w")
    desk.events.clear()
    desk.bus.resume(desk.pipe("sim:#w", desk.floor, "w", lambda: None))
    if text:
        assert desk.sent[0].startswith(b"\x1b") and b"~" * 65 in desk.sent[0]
    else:
        assert desk.sent == []


async def test_a_lost_pipe_fails_all_that_waits_and_whatever_follows(desk):
    waiting = [asyncio.create_task(desk.send(address, "PR P")) for address in "aabb"]
    await asyncio.sleep(0.001)
    desk.floor.command("/sim unplug w")
    ended = await asyncio.gather(*waiting, return_exceptions=True)
    assert {(type(each), str(each)) for each in ended} == {(TransportLost, "sim:#w was lost: unplugged")}
    with pytest.raises(TransportLost):
        await desk.send("b", "PR P")
    desk.bus.stop()
    assert [str(each.error) for each in desk.events if isinstance(each, Lost)] == ["sim:#w was lost: unplugged"]
    assert any(isinstance(e, Changed) for e in desk.events)


async def test_drives_are_polled_only_while_somebody_looks(desk):
    await asyncio.sleep(1)
    assert desk.written == b""
    looks = [desk.bus.telemetry.subscribe(["a"], 0.1), desk.bus.telemetry.subscribe(["a", "b"], 0.5)]
    await asyncio.sleep(2)
    samples = [event.address for event in desk.events if isinstance(event, Sample)]
    assert 18 <= samples.count("a") <= 22 and 4 <= samples.count("b") <= 6
    looks[0].close()
    await asyncio.sleep(0.5)
    desk.events.clear()
    await asyncio.sleep(2)
    assert 4 <= sum(isinstance(event, Sample) and event.address == "a" for event in desk.events) <= 6
    looks[1].close()
    await asyncio.sleep(0.5)
    desk.events.clear()
    await asyncio.sleep(2)
    assert desk.events == []


async def test_a_line_is_reserved_behind_the_poll_under_way_and_polled_on_where_that_is_given_up(desk):
    desk.bus.telemetry.subscribe(("a", "b"), 0.0)
    await until(lambda: {each.address for each in desk.events if isinstance(each, Sample)} == {"a", "b"})
    given_up = asyncio.create_task(desk.bus.reserve())
    await asyncio.sleep(0)
    given_up.cancel()
    with pytest.raises(asyncio.CancelledError):
        await given_up
    assert not desk.bus.link.reserved
    await asyncio.sleep(1.0)
    desk.events.clear()
    await asyncio.sleep(1.0)
    assert {each.address for each in desk.events if isinstance(each, Sample)} == {"a", "b"}
    desk.events.clear()
    async with asyncio.timeout(1.0):
        await desk.bus.reserve()
    assert len(desk.sent) <= 1 and desk.bus.link.reserved
    desk.events.clear()
    await asyncio.sleep(1.0)
    assert desk.sent == []


async def test_the_rate_of_polls_is_known_from_the_third_on_and_for_two_seconds(desk):
    telemetry, rates = desk.bus.telemetry, []
    desk.bus.watch(lambda event: rates.append(telemetry.rate("a")) if isinstance(event, Sample) else None)
    polling = telemetry.subscribe(("a",), 0.25)
    await until(lambda: len(rates) == 6)
    assert rates[:2] == [0.0, 0.0] and rates[2:] == pytest.approx([4.0] * 4, rel=0.05)
    polling.close()
    await asyncio.sleep(1.0)
    assert telemetry.rate("a") == pytest.approx(4.0, rel=0.05)
    await asyncio.sleep(1.2)
    assert telemetry.rate("a") == 0.0


async def test_the_line_knows_how_long_a_stop_leaves_and_what_it_cut_off(desk):
    line, byte_time = desk.bus.line, 10 / 9600
    await asyncio.sleep(1.0)
    desk.bus.stop()
    (stop,) = desk.sent
    assert line.transmitted_at == pytest.approx(desk.bus.now() + len(stop) * byte_time)
    assert not line.half_sent(desk.bus.now()), "no line was cut off"
    await asyncio.sleep(3.0)
    desk.events.clear()
    moving = asyncio.create_task(desk.send("a", "MR 51200"))
    await until(lambda: b"MR 51200" in desk.written)
    desk.bus.stop()
    stop = desk.sent[-1]
    assert b"~" * 65 in stop and line.half_sent(desk.bus.now()), "until it has left whole"
    assert line.transmitted_at == pytest.approx(desk.bus.now() + len(stop) * byte_time)
    await refused(moving)
    await asyncio.sleep(0.2)
    assert not line.half_sent(desk.bus.now())


async def test_what_a_stop_leaves_on_the_wire_is_no_print(desk):
    for stops, heard in ((True, []), (False, ["~b"])):
        await asyncio.sleep(5.0)
        desk.events.clear()
        if stops:
            desk.bus.stop()
        desk.bus.line.receive(sealed(b"~b") + b"\r\n", desk.bus.now())
        desk.bus.link.advance()
        await asyncio.sleep(0.1)
        assert desk.heard == heard


async def test_the_whole_stop_is_written_on_a_line_where_no_drive_is_asked(desk):
    await desk.bus.reserve()
    desk.events.clear()
    desk.bus.stop()
    await asyncio.sleep(1.0)
    assert desk.written.startswith(b"\x1b") and desk.written.count(b"\x1b") > desk.sent[0].count(b"\x1b")


async def test_a_drive_that_is_renamed_is_found_under_its_new_name_only(desk):
    drive = desk.bus.drives["b"]
    await drive.send('DN="z"')
    assert list(desk.bus.drives) == ["a", "z"] and desk.bus.drives["z"] is drive
    assert await desk.send("z", "PR DN") == ('"z"',)
    assert any(isinstance(event, Changed) and event.address == "z" for event in desk.events)


async def test_whoever_is_cancelled_in_a_download_leaves_the_drive_as_it_was(desk):
    lines = program_file.read(LOOP, "loop.mxt")
    loading = asyncio.create_task(desk.bus.drives["b"].download(lines))
    await until(lambda: desk.written.count(b"R1=R1+1") == 5)
    loading.cancel()
    with pytest.raises(asyncio.CancelledError):
        await loading
    assert await desk.send("b", "PR EM") == ("1",)
    device, drive = desk.devices["b"], desk.bus.drives["b"]
    assert (
        device.programming is None and device.memory.echo_mode == 1 and not drive.programming and not drive.transferring
    )
    assert any("the program in it is incomplete" in text for text in desk.told)


async def test_closing_leaves_nothing_behind(desk):
    desk.bus.telemetry.subscribe(["a", "b"])
    loading = asyncio.create_task(desk.bus.drives["b"].download(program_file.read(LOOP, "loop.mxt")))
    await desk.send("a", "SL 5000")
    desk.bus.stop()
    await desk.bus.close()
    assert isinstance((await asyncio.gather(loading, return_exceptions=True))[0], Stopped | TransportLost)
    assert asyncio.all_tasks() == {asyncio.current_task()}
    assert desk.bus.telemetry.period("a") == inf
    desk.events.clear()
    await asyncio.sleep(5)
    assert desk.events == []


async def test_closing_ends_a_reading_of_conditions_that_waits_for_prints_to_end(desk):
    desk.bus.line.inbox.receive(b"tick\r\n", desk.bus.now())
    desk.bus.link.advance()
    desk.bus.telemetry.watch(["a"])
    await asyncio.sleep(0.001)
    assert len(asyncio.all_tasks()) == 2
    await desk.bus.close()
    await asyncio.sleep(0)
    assert asyncio.all_tasks() == {asyncio.current_task()}


@pytest.mark.parametrize("held_up", [0.6, 3.0])
async def test_what_arrived_while_the_loop_was_held_up_comes_before_the_time_out(desk: SimulatedBus, held_up: float):
    loop = asyncio.get_running_loop()

    def busy() -> None:
        hold_up(held_up)  # as the screen does that is laid out on a slow PC

    whole = await desk.send("a", "PR IS")
    for moment in range(60):
        loop.call_later(moment / 1000, busy)
        assert await desk.send("a", "PR IS") == whole
        await asyncio.sleep(0.2)
    assert desk.told == desk.heard == []
    await desk.bus.close()
