"""Stops and conversations of a bus on simulated drives, in virtual time: at the worst moment, twice, of strangers."""

import asyncio

import pytest

from multidrop.base.errors import NoAnswer, Refused, Stopped
from multidrop.dialects import DriveState, End, Kind, Priority, Reply, Request, StopPiece
from multidrop.dialects.codec import copy_with
from multidrop.drives.drive import confirmed_motion
from multidrop.drives.events import Ended, Sample, Sent, Silent, Unsolicited
from multidrop.drives.stopping import Fate
from multidrop.families.lexium.manual import program_file
from multidrop.simulator.serving.in_process import SimPipe
from multidrop.transports.rfc2217 import Rfc2217Pipe
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus
from tests.support.until import until

pytestmark = pytest.mark.virtual

PROGRAM = "PG 1\nLB G1\nMR 51200\nH\nE\nPG\n"


ALONE = 'personality = "LMDCM"\nset = { EM = 1 }'


async def refused_by_stop(work) -> None:
    with pytest.raises(Stopped):
        await work


class Preempted(SimPipe):
    """A pipe that a thread can take from the loop, without the thread."""

    held = 0

    def preempt(self, whole, make):
        super().write(make(self.discard(whole)))
        self.held += 1
        return True

    def follow(self, make, key=False):
        data = make(0) if key or self.held else None
        self.held += key and data is not None
        if data:
            super().write(data)
        return data is not None

    def yielded(self, note=lambda last: None):
        self.held = max(0, self.held - 1)
        note(not self.held)
        return not self.held

    def write(self, data):
        return not self.held and super().write(data)


async def test_a_stop_that_a_thread_has_written_is_not_written_again_and_nothing_goes_out_before_the_loop_knows():
    shop = await SimulatedBus(party("a"), pipe=Preempted).open("a")
    await shop.send("a", "SL 50000")
    shop.bus.stop_ahead()
    late = asyncio.ensure_future(shop.send("a", "SL 60000"))
    await asyncio.sleep(0.01)
    before = len(shop.sent)
    shop.bus.stop()
    await refused_by_stop(late)
    assert shop.sent[before].startswith(b"\x1b")
    assert not any(b"60000" in data for data in shop.sent[before:])
    assert not shop.transport.held
    await shop.bus.stopped()
    assert not shop.moving("a")
    await shop.send("a", "SL 70000")
    assert shop.moving("a")


async def test_nothing_goes_out_between_two_stop_keys_that_the_loop_sees_after_both():
    shop = await SimulatedBus(party("a"), pipe=Preempted).open("a")
    for _ in range(2):
        shop.bus.stop_ahead()
    before = len(shop.sent)
    shop.bus.halt()  # of the first key
    shop.bus.halt(follows=False)  # of a /stop between them
    late = asyncio.ensure_future(shop.send("a", "SL 60000"))
    await asyncio.sleep(1.0)
    assert not shop.sent[before:]
    shop.bus.stop()
    await refused_by_stop(late)
    await shop.bus.stopped()
    await shop.send("a", "SL 70000")
    assert shop.moving("a")


async def test_a_line_that_one_of_several_stop_keys_made_harmless_is_an_error_of_no_later_line():
    shop = await SimulatedBus(ALONE, pipe=Preempted).open()
    [drive] = shop.bus.drives.values()
    asked = asyncio.ensure_future(confirmed_motion(drive))
    await until(lambda: b"PR BY" in shop.written[-16:])
    for _ in range(3):
        shop.bus.stop_ahead()
        await asyncio.sleep(0.2)  # the last ones find no half-sent line
    for _ in range(3):
        shop.bus.halt()
    await refused_by_stop(asked)
    await drive.send("MA 5000")
    assert "an old error, now cleared: error 20" in shop.said


class AtServer(SimPipe):
    """A port of a server that may make a half-sent line harmless at a stop."""

    may_invalidate = Rfc2217Pipe.may_invalidate


async def test_an_error_that_the_server_of_a_port_makes_at_a_stop_is_no_refusal_of_the_next_line():
    shop = await SimulatedBus(ALONE, pipe=AtServer).open()
    [drive] = shop.bus.drives.values()
    await drive.send("MR 24")
    shop.bus.stop()
    await shop.bus.stopped()
    shop.devices["!"].fail(20, shop.floor.now())
    await drive.send("MA 5000")
    assert "an old error, now cleared: error 20" in shop.said


async def test_what_a_preempted_pipe_drops_is_neither_published_as_sent_nor_taken_as_sent():
    shop = await SimulatedBus(party("a"), pipe=Preempted).open("a")
    drive = shop.bus.drives["a"]
    shop.bus.stop_ahead()
    before, written = len(shop.events), len(shop.sent)
    late = asyncio.ensure_future(drive.send("SL 60000"))
    await asyncio.sleep(0.01)
    assert not [each for each in shop.events[before:] if isinstance(each, Sent)] and len(shop.sent) == written
    shop.bus.stop()
    with pytest.raises(Stopped, match="was not sent"):
        await late
    assert not any(b"60000" in data for data in shop.sent)
    ended = [each.transaction for each in shop.events if isinstance(each, Ended)]
    assert [each.sent for each in ended if each.reply.end is End.STOPPED] == [False]
    assert drive.commands == 0


async def test_a_drive_that_is_started_again_after_a_stop_is_left_to_its_operator():
    shop = await SimulatedBus(party("a"), party("b")).open("a", "b")
    await shop.send("b", "SL 50000")
    halt = shop.bus.stop()
    await asyncio.sleep(0.001)
    await shop.send("a", "SL 50000")
    await shop.bus.stopped()
    assert shop.moving("a") and not shop.moving("b")
    assert "a: still moves" not in shop.said and "b: stopped, velocity 0" in shop.said
    assert halt.fate(shop.bus.drives["a"]) is Fate.STARTED


async def test_a_drive_that_is_started_in_the_moment_of_a_stop_is_left_to_its_operator_if_it_came_after_it():
    shop = await SimulatedBus(party("a")).open("a")
    drive = shop.bus.drives["a"]
    drive.starts_now()
    halt = shop.bus.stop()
    assert drive.commanded_at < halt.at == pytest.approx(drive.link.now()) and halt.not_started == (drive,)
    drive.starts_now()
    assert halt.started_since(drive) and halt.not_started == ()
    assert shop.bus.stop().not_started == (drive,)
    await shop.bus.stopped()


async def test_a_line_that_is_refused_after_a_stop_does_not_end_its_confirmation():
    shop = await SimulatedBus(party("a"), party("b")).open("a", "b")
    await shop.send("b", "SL 50000")
    halt = shop.bus.stop()
    await asyncio.sleep(0.001)
    with pytest.raises(Refused):
        await shop.send("b", "MR 1,2,3,4,5")
    await shop.bus.stopped()
    assert "b: stopped, velocity 0" in shop.said and not shop.moving("b")
    assert halt.fate(shop.bus.drives["b"]) is Fate.STANDING


async def test_a_drive_whose_rest_a_poll_confirms_is_reported_as_stopped_like_the_others():
    shop = await SimulatedBus(*(party(name) for name in "abc")).open(*"abc")
    a = shop.bus.drives["a"]

    async def polls():
        while True:
            await a.motion(Priority.POLL)
            await asyncio.sleep(0.02)

    await a.send("SL 50000")
    task = asyncio.create_task(polls())
    shop.bus.stop()
    await shop.bus.stopped()
    task.cancel()
    assert [shop.said.count(f"{name}: stopped, velocity 0") for name in "abc"] == [1, 1, 1]


async def test_a_drive_that_is_plotted_and_started_again_after_a_stop_is_not_said_to_slow_down():
    shop = await SimulatedBus(party("a")).open("a")
    shop.bus.telemetry.subscribe(["a"])
    shop.bus.stop()
    await asyncio.sleep(0.001)
    await shop.send("a", "SL 50000")
    begun = shop.bus.now()
    await shop.bus.stopped()
    assert shop.bus.now() - begun < 1.0 and shop.moving("a")
    assert "slows down" not in shop.said and "still moves" not in shop.said
    await shop.bus.close()


async def test_a_refused_line_is_no_proof_that_a_drive_still_stands():
    shop = await SimulatedBus(party("a")).open("a")
    drive = shop.bus.drives["a"]
    halt = shop.bus.stop()
    await shop.bus.stopped()
    assert halt.fate(drive) is Fate.STANDING
    await asyncio.sleep(0.5)
    with pytest.raises(Refused):
        await drive.send("MR 1,2,3,4,5")  # it may run a routine on errors (OE) that moves
    assert halt.fate(drive) is Fate.SENT
    await confirmed_motion(drive)
    assert halt.fate(drive) is Fate.STANDING


async def test_a_conversation_begun_before_a_stop_sends_nothing_after_it():
    shop = await SimulatedBus(party("a")).open("a")
    sending = asyncio.ensure_future(shop.send("a", "SL 50000"))
    await asyncio.sleep(0)  # the call has begun; its conversation has not
    shop.bus.stop()
    await refused_by_stop(sending)
    await shop.bus.stopped()
    assert not [data for data in shop.sent if b"SL 50000" in data]


async def test_a_stop_between_an_answer_and_the_next_request_ends_the_conversation():
    shop = await SimulatedBus(party("a")).open("a")
    drive = shop.bus.drives["a"]

    def twice():
        for _ in range(2):
            yield drive.codec.request("a", "SL 50000")
        return ()

    def stop_when_answered(event):
        if isinstance(event, Ended) and event.transaction.request.text == "SL 50000":
            shop.bus.stop()

    shop.bus.watch(stop_when_answered)
    await refused_by_stop(shop.bus.run(twice(), drive.state))
    await shop.bus.stopped()
    assert len([data for data in shop.sent if b"SL 50000" in data]) == 1
    assert not shop.moving("a")


@pytest.mark.parametrize("escape", [0, 1, 2, 3])
@pytest.mark.parametrize("cell", ["alone", "party"])
async def test_a_moving_drive_stands_after_a_stop_whatever_its_escape_mode(cell, escape):
    if cell == "party":
        both = party("a", ES=escape, CK=0), party("b", ES=(escape + 1) % 4, CK=0)
        shop = await SimulatedBus(*both).open("a", "b")
    else:
        shop = await SimulatedBus(ALONE.replace("EM = 1", f"EM = 1, ES = {escape}")).open()
    for drive in shop.bus.drives.values():
        await drive.send("SL 50000")
    await asyncio.sleep(1.0)
    before = len(shop.sent)
    shop.bus.stop()
    await shop.bus.stopped()
    assert not any(shop.moving(name) for name in shop.devices)
    assert "stopped, velocity 0" in shop.said and "still moves" not in shop.said
    assert len(shop.sent[before]) <= 6
    for device in shop.devices.values():
        assert not device.memory.error_flag


@pytest.mark.parametrize("escape", [0, 1, 2, 3])
async def test_a_stop_while_drives_are_looked_for_reaches_those_that_are_called(escape):
    shop = SimulatedBus(party("a", ES=escape, CK=0))
    shop.devices["a"].execute("SL 50000", 0.0)
    opening = asyncio.ensure_future(shop.open("a", "b"))
    await asyncio.sleep(0.2)
    assert shop.moving("a")
    shop.bus.stop()
    await refused_by_stop(opening)
    await shop.bus.close()
    await asyncio.sleep(1.0)
    assert not shop.moving("a")


@pytest.mark.parametrize("cut", [0.0005, 0.0045, 0.0075, 0.0125])
@pytest.mark.parametrize("escape", [0, 1, 2, 3])
async def test_no_piece_of_a_half_sent_line_is_executed(escape, cut):
    shop = await SimulatedBus(party("a", ES=escape, CK=0), party("b", ES=3 - escape, CK=0)).open("a", "b")
    # What is known of the drive is wrong by now, so its own escape does not clear its buffer.
    shop.devices["a"].execute(f"ES={(escape + 1) % 4}", shop.floor.now())
    moves = asyncio.ensure_future(shop.send("a", "MR 51200000"))
    await asyncio.sleep(cut)
    shop.bus.stop()
    await refused_by_stop(moves)
    await shop.bus.stopped()
    assert shop.devices["a"].position(shop.floor.now()) == 0
    assert not shop.moving("a")


async def test_a_second_stop_in_the_middle_of_the_clean_up_does_not_leave_program_mode_on():
    shop = await SimulatedBus(party("a")).open("a")
    drive = shop.bus.drives["a"]
    for wait in (0.05, 0.15, 0.22, 0.3, 0.4):
        loading = asyncio.ensure_future(drive.download(program_file.read(PROGRAM, "x")))
        await until(lambda: drive.programming)
        await asyncio.sleep(0.06)
        shop.bus.stop()
        await asyncio.sleep(wait)
        shop.bus.stop()
        await refused_by_stop(loading)
        await shop.bus.stopped()
        assert shop.devices["a"].programming is None
        assert not drive.programming
        assert await drive.send("PR P") == ("0",)
        assert drive.codec.em == shop.devices["a"].memory.echo_mode
        await drive.send("CP")


async def test_many_stops_in_a_row_are_confirmed_by_the_last():
    shop = await SimulatedBus(party("a", CK=0)).open("a")
    await shop.send("a", "SL 50000")
    for _ in range(8):
        shop.bus.stop()
        await asyncio.sleep(0.07)
    await shop.bus.stopped()
    assert "a: stopped, velocity 0" in shop.said
    assert "not known" not in shop.said


async def test_what_was_read_before_a_stop_confirms_no_drive_after_it():
    """A second stop comes between the second reading of the first drive, by a poll, and the words about it."""
    shop = await SimulatedBus(*(party(name) for name in "abc")).open(*"abc")
    a = shop.bus.drives["a"]

    async def polls():
        while True:
            await a.motion(Priority.USER)
            await asyncio.sleep(0.001)

    first = len(shop.sent)
    shop.bus.stop()
    task = asyncio.create_task(polls())
    await until(lambda: shop.sent[-1].startswith(b"cPR") and b"".join(shop.sent[first:]).count(b"aPR") > 1)
    assert "stopped" not in shop.said
    task.cancel()
    second = len(shop.sent)
    shop.bus.stop()
    await until(lambda: "a: stopped" in shop.said)
    assert any(data.startswith(b"aPR") for data in shop.sent[second:]), shop.said
    await shop.bus.stopped()


async def test_what_was_read_before_a_stop_says_nothing_of_it_either_where_the_line_is_lost_in_that_moment():
    shop = await SimulatedBus(*(party(name) for name in "abc")).open(*"abc")
    await shop.send("a", "SL 50000")
    first = len(shop.sent)
    shop.bus.stop()
    await until(lambda: shop.sent[-1].startswith(b"bPR") and b"".join(shop.sent[first:]).count(b"aPR") > 1)
    known = shop.said
    second = shop.bus.stop()
    shop.floor.floor.wires["w"].unplug()
    await shop.bus.stopped()
    said = shop.said.removeprefix(known)
    assert "stopped, velocity" not in said and "stop sent again" not in said, said
    assert {second.fate(drive) for drive in shop.bus.drives.values()} == {Fate.NOT_KNOWN}


async def test_a_drive_that_a_stop_kept_from_being_read_is_said_to_move_at_no_velocity():
    shop = await SimulatedBus(party("a"), party("b")).open("a", "b")
    a = shop.bus.drives["a"]
    shop.bus.stop()
    for _ in range(3):  # stops of it alone, each before it is read
        read = shop.written.count(b"aPR")
        await until(lambda before=read: shop.written.count(b"aPR") > before)
        shop.bus.stop([a])
    await shop.bus.stopped()
    assert "a: a stop kept its velocity from being read; stop sent again" in shop.said
    assert "still moves" not in shop.said


async def test_a_drive_that_was_only_spoken_to_is_stopped_too():
    shop = await SimulatedBus(party("a", ES=3, CK=0), party("q", EM=0, ES=2, CK=0)).open("a")
    await shop.bus.at("q").send("SL 50000")
    await asyncio.sleep(0.5)
    assert shop.moving("q")
    shop.bus.stop()
    await shop.bus.stopped()
    assert not shop.moving("q")
    assert "q: stopped, velocity 0" in shop.said


async def test_a_stranger_that_is_not_there_is_not_remembered():
    shop = await SimulatedBus(party("a", CK=0)).open("a")
    with pytest.raises(NoAnswer, match="was not sent"):
        await shop.bus.at("x").send("MR 100")
    assert shop.bus.roster.unlisted == {}


async def test_a_stop_takes_the_form_of_a_drive_that_was_restarted():
    shop = await SimulatedBus(ALONE).open()
    drive = shop.bus.drives[""]
    await drive.send("ES=3")
    device = shop.devices["!"]
    shop.floor.command("/sim power ! off")
    shop.floor.command("/sim power ! on")
    await asyncio.sleep(0.5)
    assert drive.state.settings_unknown
    device.execute("SL 50000", shop.floor.now())
    shop.bus.stop()
    assert b"\x1b" in shop.sent[-1] and b"!\x1b" in shop.sent[-1]
    await shop.bus.stopped()
    assert not shop.moving("!")
    assert drive.codec.escape == 1


async def test_a_bus_that_is_closed_repeats_its_stop_first():
    shop = await SimulatedBus(party("a", CK=0)).open("a")
    before = len(shop.sent)
    written: list[bytes] = []
    write = shop.transport.write
    shop.transport.write = lambda data: (written.append(data), write(data))[1]  # type: ignore[method-assign]
    shop.bus.stop()
    await shop.bus.close()
    assert len(shop.sent) == before + 1
    assert written == [b"\x1b", b"\x1b"]


async def listing(drive):
    return await drive.run(drive.programs.listing(""))


async def test_no_poll_is_stored_in_a_program():
    shop = await SimulatedBus(party("a", CK=0), party("b", CK=0)).open("a", "b")
    looking = shop.bus.telemetry.subscribe(("a", "b"))
    for line in PROGRAM.splitlines():
        await shop.send("a", line)
        await asyncio.sleep(0.2)
    looking.close()
    listed = await listing(shop.bus.drives["a"])
    assert [line.split(None, 1)[1] for line in listed] == ["LB G1", "MR 51200", "H", "E"]
    assert any(isinstance(e, Sample) and e.address == "b" for e in shop.events)
    assert not any(isinstance(e, Silent) for e in shop.events)


async def test_no_command_to_all_is_stored_in_a_program():
    shop = await SimulatedBus(party("a", CK=0), party("b", CK=0)).open("a", "b")
    everyone, drive = shop.bus.at("*"), shop.bus.drives["a"]
    entering = asyncio.ensure_future(drive.send("PG 1"))
    outcomes = []
    while not entering.done():
        outcomes += await asyncio.gather(everyone.send("R1=5"), return_exceptions=True)
        await asyncio.sleep(0.001)
    await entering
    with pytest.raises(Refused, match="would be stored"):
        await everyone.send("R1=5")
    await drive.send("PG")
    with pytest.raises(Refused, match="name one"):
        await everyone.send("pg 5")
    assert await listing(drive) == ()
    assert any(isinstance(outcome, Refused) for outcome in outcomes)


async def test_a_setting_for_all_is_followed_with_every_drive():
    shop = await SimulatedBus(party("a", CK=0), party("b", EM=0, CK=0), party("c", EM=3, CK=0)).open("a", "b", "c")
    await shop.bus.at("*").send("EM=2")
    for name, drive in shop.bus.drives.items():
        assert await drive.send("PR EM") == ("2",), name
        assert drive.codec.em == 2


async def test_a_plot_is_not_blinded_by_a_silent_drive_and_does_not_mistake_one_for_another():
    shop = await SimulatedBus(party("a", CK=0), party("b", CK=0)).open("a", "b")
    shop.devices["b"].execute("P=77", shop.floor.now())
    looking = shop.bus.telemetry.subscribe(("a", "b"))
    await asyncio.sleep(1.0)
    shop.floor.command("/sim power a off")
    await asyncio.sleep(20.0)
    looking.close()
    samples = [e for e in shop.events if isinstance(e, Sample)]
    assert {(e.address, e.position) for e in samples} == {("a", 0), ("b", 77)}
    assert len([e for e in samples if e.at > 2.0]) > 100
    assert any(isinstance(e, Silent) and e.address == "a" for e in shop.events)


async def test_a_watcher_that_stops_keeps_back_what_was_about_to_be_written():
    shop = await SimulatedBus(party("a", CK=0), party("b", CK=0)).open("a", "b")
    a, b = shop.bus.drives["a"], shop.bus.drives["b"]

    def stop_at_once(event):
        if isinstance(event, Ended) and event.transaction.request.text == "PR A":
            shop.bus.stop()

    shop.bus.watch(stop_at_once)
    asking = asyncio.gather(a.send("PR A"), b.send("SL 50000"), return_exceptions=True)
    _, stopped = await asking
    assert isinstance(stopped, Stopped)
    await shop.bus.stopped()
    assert not any(b"SL 50000" in data for data in shop.sent)


async def test_an_answer_that_was_under_way_when_a_stop_came_is_nobodys():
    shop = await SimulatedBus(party("a", CK=0)).open("a")
    drive = shop.bus.drives["a"]
    reading = asyncio.ensure_future(drive.send("PR A"))
    await asyncio.sleep(0.001)
    shop.bus.stop()
    await refused_by_stop(reading)
    assert drive.state.reply_pending
    await shop.bus.stopped()
    assert await drive.send("PR P") == ("0",)


def test_what_was_stopped_says_whether_it_was_sent():
    from multidrop.drives.line import Finished, Line
    from multidrop.families.lexium.host.mcode.codec import MCode

    line = Line(MCode(em=1))
    request = Request("", "MR 1", Kind.COMMAND, MCode(em=1), Priority.OPERATOR)
    line.ask(request)
    line.ask(request)
    line.events(0.0)
    line.stop(0.0, StopPiece(b"\x1b"))
    ended = [event for event in line.events(0.0) if isinstance(event, Finished)]
    assert [(e.reply.end, e.transaction.sent) for e in ended] == [(End.STOPPED, True), (End.STOPPED, False)]


def test_a_reply_keeps_what_it_was_read_from():
    assert copy_with(Reply(("5",)), raw=b"5\r\n", doubtful=True) == Reply(("5",), raw=b"5\r\n", doubtful=True)
    assert DriveState.__hash__ is not None
    assert Unsolicited(0.0, ("x",)).lines == ("x",)


# Programs that run on

DWELL = 'program_text = """\nPG 1\nLB G1\nH 60000\nBR G1\nE\nPG\n"""'


def deaf(shop: SimulatedBus, name: str, times: int, then: str = "") -> list[float]:
    """Make a drive ignore this many stops, or execute a line after each of them; return their times."""
    device, heard = shop.devices[name], []
    escape = device.escape

    def hear(now: float) -> None:
        heard.append(now)
        if len(heard) > times or then:
            escape(now)
        if len(heard) <= times and then:
            device.execute(then, now)

    device.escape = hear
    return heard


@pytest.mark.parametrize("then", ["", "EX G1"])
async def test_a_drive_whose_program_runs_on_or_again_is_stopped_once_more_although_it_reads_velocity_0(then):
    shop = await SimulatedBus(f"{party('a')}\n{DWELL}", party("b")).open("a", "b")
    await shop.send("a", "EX G1")
    await asyncio.sleep(0.5)
    stops, since = deaf(shop, "a", 2, then), len(shop.sent)  # a stop is two escapes
    halt = shop.bus.stop()
    fates = []
    shop.bus.watch(lambda event: fates.append(halt.fate(shop.bus.drives["a"])))
    await shop.bus.stopped()
    assert len(stops) == 4 and not shop.devices["a"].running
    assert "a: its program still runs; stop sent again" in shop.said and "a: stopped, velocity 0 at 0" in shop.said
    assert shop.said.index("stop sent again") < shop.said.index("a: stopped") and "b: its program" not in shop.said
    assert Fate.RUNNING in fates and Fate.STANDING not in fates[: fates.index(Fate.RUNNING)]
    assert halt.fate(shop.bus.drives["a"]) is Fate.STANDING and not halt.vain
    asked = [data for data in shop.sent[since:] if data.startswith(b"aPR")]
    assert len(asked) == 2 and all(data.startswith(b"aPR BY,P,DN,V") for data in asked)


async def test_a_program_that_three_stops_do_not_end_is_named_among_twelve_drives():
    names = "abcdefghijkl"
    shop = await SimulatedBus(*(f"{party(name)}\n{DWELL}" for name in names)).open(*names)
    await shop.bus.at("*").send("EX G1")
    await asyncio.sleep(0.5)
    assert all(device.running for device in shop.devices.values())
    stops = deaf(shop, "g", 100)
    halt = shop.bus.stop()
    await asyncio.sleep(10.0)
    assert len(stops) == 6 and shop.said.count("g: its program still runs; stop sent again") == 2
    assert "STILL RUNNING after 3 stops: g; cut the power" in shop.said and "STILL MOVING" not in shop.said
    assert halt.vain and halt.fate(shop.bus.drives["g"]) is Fate.RUNNING
    assert {halt.fate(shop.bus.drives[name]) for name in names if name != "g"} == {Fate.STANDING}
    assert [name for name in names if shop.devices[name].running] == ["g"]
    await shop.bus.close()


async def test_a_program_that_a_person_starts_after_a_stop_is_left_to_them():
    shop = await SimulatedBus(f"{party('a')}\n{DWELL}").open("a")
    halt = shop.bus.stop()
    await asyncio.sleep(0.001)
    await shop.send("a", "EX G1")
    await shop.bus.stopped()
    assert shop.devices["a"].running and halt.fate(shop.bus.drives["a"]) is Fate.STARTED
    assert "still runs" not in shop.said


async def test_a_program_that_starts_by_itself_after_a_stop_takes_back_that_the_drive_is_at_rest():
    shop = await SimulatedBus(f"{party('a')}\n{DWELL}").open("a")
    drive = shop.bus.drives["a"]
    halt = shop.bus.stop()
    await shop.bus.stopped()
    assert halt.fate(drive) is Fate.STANDING
    shop.devices["a"].execute("EX G1", shop.floor.now())
    watch = shop.bus.telemetry.watch(("a",))
    await asyncio.sleep(3.0)
    assert halt.fate(drive) is Fate.RUNNING
    watch.close()
    await shop.bus.close()


async def test_a_poll_does_not_ask_for_the_program_and_a_stop_does():
    shop = await SimulatedBus(party("a")).open("a")
    with_poll = shop.bus.telemetry.subscribe(("a",))
    await asyncio.sleep(1.0)
    with_poll.close()
    assert {data[:11] for data in shop.sent if data.startswith(b"aPR P,")} == {b"aPR P,DN,V\xcd"}
    before = len(shop.events)
    shop.bus.stop()
    await shop.bus.stopped()
    samples = [event for event in shop.events[before:] if isinstance(event, Sample)]
    assert {(event.velocity, event.program) for event in samples} == {(0, False)}
