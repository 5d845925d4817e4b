"""A stop that goes from drive to drive: each has its turn, whatever the loop does, and while the key is held down.

The threads beside the loop are timers of the virtual loop here: they go on while the loop "is held up", which takes
over no stop and writes nothing meanwhile.
"""

import asyncio
from itertools import pairwise
from random import Random
from types import SimpleNamespace

import pytest

from multidrop.dialects import Hints, StopPiece
from multidrop.drives import pacing
from multidrop.drives.bus import Bus
from multidrop.drives.events import Traffic
from multidrop.drives.line import LONG_QUIET, Line, Write, merged
from multidrop.drives.stop_ahead import StopAhead
from multidrop.drives.stop_forms import StopForms, stop_forms
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.pmx.host.codec import STOP_PIECE_QUIET, Pmx
from multidrop.simulator.serving.in_process import SimPipe
from tests.families.pmx.test_line import BYTE, Wire
from tests.support.cell_session import CellSession, bus, drive, party, pmx
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual

REPEAT = 1 / 30
"""The time between two keys of one that is held down, s."""
NUMBERS = ("01", "02", "03")


class VirtualPacer:
    """The thread of the pieces, in the time of the test."""

    def __init__(self):
        self.due = {}

    def begin(self):
        pass

    def after(self, owner, seconds, work):
        if owner in self.due:
            self.due.pop(owner).cancel()
        self.due[owner] = asyncio.get_running_loop().call_later(seconds, self.call, owner, work)

    def call(self, owner, work):
        del self.due[owner]
        work()


@pytest.fixture(autouse=True)
def pacer(monkeypatch):
    made = VirtualPacer()
    monkeypatch.setattr(pacing, "PACER", made)
    return made


class Shared:
    """What a pipe adds that other threads write to."""

    preemptible = True
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


class SharedWire(Shared, Wire):
    pass


class SharedPipe(Shared, SimPipe):
    pass


async def opened(*numbers):
    wire = SharedWire(asyncio.get_running_loop(), *numbers)
    bus = Bus("cell", wire, baud=9600, family="pmx")
    bus.start()
    await bus.identify(Hints(drives=numbers))
    wire.written.clear()
    return bus, wire


def held_up(bus, monkeypatch):
    """Hold the loop up for this bus: it handles no byte and no timer; what it is asked to call waits."""
    waiting = []
    monkeypatch.setattr(bus.link, "advance", lambda: None)
    monkeypatch.setattr(bus.link, "call_soon", waiting.append)
    monkeypatch.setattr(bus.line, "receive", lambda data, now: None)
    return waiting


def first(wire, begin):
    """By controller, how long after a time its first stop was written."""
    found = {}
    for at, data in wire.written:
        if data[3:] == b"ABORT\r" and at >= begin:
            found.setdefault(data[1:3].decode(), at - begin)
    return found


async def hold_key_down(bus, keys, rng, late=0.03):
    """Press the key so often; the loop follows each one a little later, as it has more to do."""
    loop = asyncio.get_running_loop()
    for number in range(keys):
        at = loop.time() + number * REPEAT
        loop.call_at(at, bus.stop_ahead)
        loop.call_at(at + rng.random() * late, bus.stop)
    await asyncio.sleep(keys * REPEAT + late)


@pytest.mark.parametrize("run", range(24))
async def test_each_controller_has_its_turn_at_once_while_the_key_is_held_down(run):
    rng = Random(run)
    bus, wire = await opened(*NUMBERS)
    await asyncio.sleep(rng.random())
    begin = bus.now()
    await hold_key_down(bus, 30 + run, rng)
    stopped = first(wire, begin)
    assert list(stopped) == ["01", "02", "03"], "in their order"
    assert stopped["01"] == 0.0 and max(stopped.values()) < 0.15
    assert wire.collisions == []
    held = [data for at, data in wire.written if at - begin < 30 * REPEAT]
    assert {data[3:] for data in held} == {b"ABORT\r", b"SR0=0\r", b"SR1=0\r"}, "programs are ended, too"
    for number in NUMBERS:  # and again and again, none more seldom than the others
        times = [at for at, data in wire.written if data[1:3] == number.encode() and at - begin < 30 * REPEAT]
        assert max(later - earlier for earlier, later in pairwise(times)) < 0.5
    await bus.stopped()
    commands = [data for _, data in wire.written]
    for number in NUMBERS:
        own = b"".join(data[3:] for data in commands if data[1:3] == number.encode() and data[3:5] in (b"AB", b"SR"))
        assert b"SR0=0\rSR1=0\rABORT\r" in own, "the last word is for what a program has begun"
    await bus.close()


async def test_a_piece_that_a_key_keeps_from_the_wire_is_the_next_one_after_it():
    bus, wire = await opened(*NUMBERS)
    bus.stop()
    at_02 = bus.line.deadline
    await asyncio.sleep(at_02 - bus.now() - 1e-6)
    wire.held += 1  # a key's thread has the pipe, and the loop writes to it
    await asyncio.sleep(0.001)
    wire.held -= 1
    await asyncio.sleep(0.2)
    commands = [data for _, data in wire.written]
    assert commands[:4] == [b"@01ABORT\r", b"@02ABORT\r", b"@03ABORT\r", b"@01ABORT\r"]
    await bus.close()


@pytest.mark.parametrize("keys", [1, 2, 36, 120])
async def test_the_whole_stop_is_written_while_the_loop_is_held_up_from_before_the_key(keys, monkeypatch):
    bus, wire = await opened(*NUMBERS)
    waiting = held_up(bus, monkeypatch)
    begin = bus.now()
    for number in range(keys):
        asyncio.get_running_loop().call_at(begin + number * REPEAT, bus.stop_ahead)
    await asyncio.sleep(4.0)
    assert list(first(wire, begin)) == ["01", "02", "03"] and max(first(wire, begin).values()) < 0.15
    whole = [stop_forms(bus.roster).immediate, *(each.data for each in stop_forms(bus.roster).repeats)]
    assert sorted({data for _, data in wire.written}) == sorted({*whole})
    if keys == 1:
        assert [data for _, data in wire.written] == whole, "once, and no piece more"
    for (at, data), (after, _) in pairwise(wire.written):
        assert after - at >= len(data) * BYTE + STOP_PIECE_QUIET, "the reply fits between"
    assert wire.collisions == []
    monkeypatch.undo()
    sent = []
    bus.watch(lambda event: sent.append(event.data) if isinstance(event, Traffic) and event.stop else None)
    before = len(wire.written)
    for _ in range(keys):
        bus.stop()
    assert sent == [data for _, data in wire.written], "what the thread has written is published once"
    await bus.stopped()
    if keys == 1:
        again = [data for _, data in wire.written[before:] if data[3:5] in (b"AB", b"SR")]
        assert again == [], "the loop repeats nothing of it"
    assert not waiting and not wire.held and wire.collisions == []
    await bus.close()


@pytest.mark.parametrize("after", [0.001, 0.045, 0.1])
async def test_the_whole_stop_is_written_where_the_loop_is_held_up_after_it_has_taken_it_over(after, monkeypatch):
    bus, wire = await opened(*NUMBERS)
    begin = bus.now()
    bus.stop_ahead()
    bus.stop()
    await asyncio.sleep(after)
    waiting = held_up(bus, monkeypatch)
    await asyncio.sleep(4.0)
    assert list(first(wire, begin)) == ["01", "02", "03"] and max(first(wire, begin).values()) < 0.25
    whole = [stop_forms(bus.roster).immediate, *(each.data for each in stop_forms(bus.roster).repeats)]
    assert [data for _, data in wire.written] == whole
    assert wire.collisions == []
    assert wire.held == 1, "the loop writes nothing before it knows of that"
    monkeypatch.undo()
    for work in waiting:
        work()
    await bus.stopped()
    assert not wire.held and wire.collisions == []
    assert not bus.last_stop.doubts
    await bus.close()


async def test_so_is_one_that_the_loop_has_begun_as_by_a_typed_line(monkeypatch):
    bus, wire = await opened(*NUMBERS)
    begin = bus.now()
    bus.stop()
    waiting = held_up(bus, monkeypatch)
    await asyncio.sleep(4.0)
    assert list(first(wire, begin)) == ["01", "02", "03"] and max(first(wire, begin).values()) < 0.25
    whole = [stop_forms(bus.roster).immediate, *(each.data for each in stop_forms(bus.roster).repeats)]
    assert [data for _, data in wire.written] == whole and wire.collisions == []
    monkeypatch.undo()
    for work in waiting:
        work()
    await bus.stopped()
    await bus.close()


async def test_a_loop_that_is_held_up_again_and_again_leaves_no_piece_behind(monkeypatch, pacer):
    bus, wire = await opened(*NUMBERS)
    bus.stop_ahead()
    bus.stop()
    whole = [stop_forms(bus.roster).immediate, *(each.data for each in stop_forms(bus.roster).repeats)]
    for pieces in range(2, len(whole) + 1):
        with monkeypatch.context() as held:
            held.setattr(pacing, "PACER", pacer)
            waiting = held_up(bus, held)
            async with asyncio.timeout(2.0):
                while len(wire.written) < pieces or not wire.held:
                    await asyncio.sleep(0.001)
        for work in waiting:
            work()
    await bus.stopped()
    sent = [data for _, data in wire.written if data[3:5] in (b"AB", b"SR")]
    assert sent == whole and wire.collisions == []
    await bus.close()


async def test_a_loop_that_is_not_held_up_writes_the_pieces_itself():
    bus, wire = await opened(*NUMBERS)
    bus.stop_ahead()
    bus.stop()
    taken = wire.held
    await bus.stopped()
    whole = [stop_forms(bus.roster).immediate, *(each.data for each in stop_forms(bus.roster).repeats)]
    assert [data for _, data in wire.written if data[3:5] in (b"AB", b"SR")] == whole
    assert (taken, wire.held) == (0, 0)
    await bus.close()


async def test_the_thread_of_a_lone_drive_has_nothing_left_to_do_once_its_stop_is_repeated(pacer):
    shop = await SimulatedBus('personality = "LMDCM"\nset = { EM = 1 }', pipe=SharedPipe).open()
    shop.bus.stop_ahead()
    shop.bus.stop()
    await shop.bus.stopped()
    await asyncio.sleep(1.0)
    assert not pacer.due


async def test_names_are_stopped_by_one_write_and_a_held_key_cuts_off_none_of_them():
    """ES=2 on a slow line: the stop of ten drives takes longer than the key repeats."""
    names = "abcdefghij"
    drives = [drive("LMDCM", name, party=True, EM=1, CK=1, ES=2, BD=48) for name in names]
    shop = await SimulatedBus(*drives, baud=4800, pipe=SharedPipe).open(*names)
    for name in names:
        await shop.send(name, "SL 50000")
    for _ in range(30):
        shop.bus.stop_ahead()
        shop.bus.stop()
        await asyncio.sleep(REPEAT)
    assert not [name for name in names if shop.moving(name) and shop.devices[name].velocity(shop.floor.now()) > 49_000]
    await shop.bus.stopped()
    assert not any(map(shop.moving, names))


@pytest.mark.parametrize("after", [0.0, 0.05, 0.2])
async def test_a_line_that_is_closed_within_a_stop_has_the_rest_of_it_written_with_its_gaps(after):
    bus, wire = await opened(*NUMBERS)
    bus.stop()
    await asyncio.sleep(after)
    await bus.close()
    whole = [stop_forms(bus.roster).immediate, *(each.data for each in stop_forms(bus.roster).repeats)]
    assert [data for _, data in wire.written] == whole
    assert wire.collisions == []


def piece(name, quiet=0.03):
    return StopPiece(name.encode(), quiet)


def test_stops_go_round_and_do_not_begin_again():
    one, two, three = map(piece, ("one", "two", "three"))
    assert merged([], [one, two, three]) == [one, two, three]
    assert merged([two, three], [one, two, three]) == [two, three, one]
    assert merged([three, one], [one, two, three]) == [three, one, two]
    assert merged([two], [one, three]) == [one, three], "what the new stop does not have is over"
    assert merged([two], [one, three], keep=True) == [two, one, three], "it is for some drives alone"


def test_a_stop_in_the_pause_of_the_one_before_waits_for_no_pause():
    one, two, again, last = piece("one"), piece("two"), piece("one", 1.0), piece("two")
    assert merged([again, last], [one, two, again, last]) == [one, two, again, last]
    assert merged([two, again, last], [one, two, again, last]) == [two, one, again, last]


def test_a_piece_that_no_transport_accepted_is_the_next_one_also_where_a_stop_has_come_meanwhile():
    line = Line(MCode(party=True))
    one, two, three = pieces = [*map(piece, ("one", "two", "three"))]
    line.stop(0.0, *pieces)
    assert [each.data for each in line.events(0.04) if isinstance(each, Write)] == [b"one"]
    assert line.owed_pieces() == pieces
    line.put_back()
    assert line.owed_pieces() == pieces
    assert [each.data for each in line.events(0.08) if isinstance(each, Write)] == [b"one"]
    line.stop(0.09, *pieces)
    line.put_back()
    assert line.owed_pieces() == [one, two, three]
    line.put_back()
    assert line.owed_pieces() == [one, two, three], "once"
    line.events(0.2)
    line.accepted()
    line.put_back()
    assert line.owed_pieces() == [two, three]


async def test_two_stops_of_single_controllers_cut_each_other_off_neither_do_their_replies_meet():
    bus, wire = await opened(*NUMBERS)
    dropped = []
    wire.discard = lambda whole=False: dropped.append(whole) or 0
    bus.stop([bus.drives["01"]])
    bus.stop([bus.drives["03"]])
    await bus.stopped()
    assert len(dropped) == 1, "the first stop, which is still leaving, is not taken back"
    assert {*first(wire, 0.0)} == {"01", "03"}
    assert wire.collisions == []
    await bus.close()


class Counted:
    """A transport of which `waiting` bytes have not left."""

    preemptible, waiting = True, 0

    def __init__(self):
        self.out = []

    def preempt(self, whole, make):
        self.out.append(make(0))
        return True

    def follow(self, make, key=False):
        data = make(self.waiting)
        self.out += [data] if data else []
        return data is not None


def ahead_of(wire, now, gap=0.02):
    """A stop in the pieces A, B and C, and its repetition; the time in which a piece leaves and its reply comes."""
    forms = StopForms(
        *(b"A\r", b"A\r", (StopPiece(b"B\r", gap), StopPiece(b"C\r", gap), StopPiece(b"A\r", 2 * LONG_QUIET))),
        *(b"", False),
        gap=gap,
    )
    line = Line(Pmx(), baud=9600)
    link = SimpleNamespace(now=now, line=line, transport=wire, name="w", call_soon=lambda work: None)
    return StopAhead(link, lambda: forms, lambda: None), gap + 4 * line.byte_time


async def test_a_key_moves_the_stop_on_once_all_bytes_have_left_and_their_replies_have_come():
    now, wire = [1.0], Counted()
    ahead, clear = ahead_of(wire, lambda: now[0])

    def pressed(after):
        wire.out.clear()
        now[0] += after
        ahead.press()
        return wire.out

    assert pressed(0.0) == [b"A\r"]
    assert pressed(clear / 2) == []
    wire.waiting = 1
    assert pressed(clear) == [], "bytes wait"
    wire.waiting = 0
    assert pressed(0.0) == [b"B\r"]
    assert pressed(clear * 0.99) == []
    assert pressed(clear * 0.01 + 1e-9) == [b"C\r"]


async def test_a_stop_begins_again_once_each_piece_has_had_its_turn_and_the_last_reply_has_come():
    wire = Counted()
    ahead, clear = ahead_of(wire, asyncio.get_running_loop().time)
    ahead.press()
    while wire.out[-1:] != [b"C\r"]:
        await asyncio.sleep(0.001)
    assert wire.out == [b"A\r", b"B\r", b"C\r"]
    ahead.press()
    assert wire.out[3:] == [], "its reply is on its way"

    other = Counted()
    ahead, clear = ahead_of(other, asyncio.get_running_loop().time)
    ahead.press()
    while other.out[-1:] != [b"C\r"]:
        await asyncio.sleep(0.001)
    await asyncio.sleep(clear)
    ahead.press()
    assert other.out[3:] == [b"A\r"]


async def test_a_stop_takes_back_the_rest_of_a_line_and_not_of_a_frame(tmp_path):
    floor = {"press": party("a"), "stages": pmx("00"), "slide": drive("TMCM")}
    async with CellSession(tmp_path, *(bus(name, each) for name, each in floor.items())) as shop:
        dropped = {}
        for name, each in shop.session.buses.items():
            each.link.transport.discard = lambda whole=False, name=name: dropped.setdefault(name, whole) and 0
            assert stop_forms(each.roster).framed is (name == "slide")
        shop.session.stop()
        assert dropped == {"press": False, "stages": False, "slide": True}


async def test_modules_in_download_mode_do_not_wait_for_the_repetition_of_the_others():
    bus, _ = await opened(*NUMBERS)
    bus.drives["03"].state.settings_may_have_changed()  # a group of its own
    aborts = [each.data for each in stop_forms(bus.roster).pieces if each.data.endswith(b"ABORT\r")]
    assert {*aborts[:4]} == {b"@01ABORT\r", b"@02ABORT\r", b"@03ABORT\r"}
    await bus.close()
