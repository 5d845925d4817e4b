"""What a bus has its keeper know, in virtual time: before it is changed, while it is on its way, and no longer."""

import asyncio

import pytest

from multidrop.base.errors import NoAnswer, Stopped, TransportLost
from multidrop.dialects import Hints, Owed
from multidrop.drives.port_journal import Keeper
from multidrop.families.lexium.manual import program_file
from tests.drives.test_bus import LOOP
from tests.drives.test_bus import opened as opened_with
from tests.support.until import until

pytestmark = pytest.mark.virtual


class Kept(Keeper):
    """A keeper that takes its time, and notes what had been written to the drives by then."""

    def __init__(self, seconds=0.05):
        self.seconds = seconds
        self.told = []
        self.line = ""
        self.last = None
        self.closed = False

    async def owes(self, state):
        owed = state.restore and state.restore.em
        if owed != self.last:
            await asyncio.sleep(self.seconds)
            self.last = owed
            self.told.append((state.address, owed, self.desk.written.count(b"EM=0"), self.desk.written.count(b"EM=1")))

    def remember(self, drives):
        pass

    def begun(self, line):
        self.line = line

    def ended(self):
        self.line = ""

    def close(self):
        self.closed = True


async def opened(**more):
    keeper = Kept(**more)
    keeper.desk = desk = await opened_with(keeper=keeper)
    desk.keeper = keeper
    return desk


@pytest.fixture
async def desk():
    return await opened()


async def test_the_echo_mode_is_written_down_before_it_is_changed_and_struck_out_once_it_is_back(desk):
    await desk.bus.drives["b"].download(program_file.read(LOOP, "loop.mxt"))
    assert desk.keeper.told == [("b", 1, 0, 0), ("b", None, 1, 1)]
    assert desk.devices["b"].memory.echo_mode == 1


async def test_whoever_types_pg_owes_it_until_the_program_is_left(desk):
    await desk.send("a", "PG 1")
    await desk.send("a", "R1=5")
    assert desk.keeper.told == [("a", 1, 0, 0)] and desk.devices["a"].memory.echo_mode == 0
    await desk.send("a", "PG")
    assert desk.keeper.told == [("a", 1, 0, 0), ("a", None, 1, 1)]


async def test_whoever_is_cancelled_or_stopped_while_it_is_written_down_changes_nothing():
    for way in ("cancel", "stop"):
        desk = await opened(seconds=5.0)
        loading = asyncio.create_task(desk.bus.drives["b"].download(program_file.read(LOOP, "loop.mxt")))
        await until(lambda desk=desk: desk.bus.drives["b"].state.restore is not None)
        await asyncio.sleep(1.0)
        if way == "stop":
            desk.bus.stop()
        else:
            loading.cancel()
        with pytest.raises(Stopped if way == "stop" else asyncio.CancelledError):
            await loading
        await until(lambda desk=desk: desk.keeper.last is None)
        assert b"PG" not in desk.written and desk.devices["b"].memory.echo_mode == 1


async def test_a_command_is_known_while_it_is_on_its_way_and_a_question_is_not(desk):
    assert desk.keeper.line == ""
    asking = asyncio.create_task(desk.send("a", "PR P"))
    await until(lambda: b"PR P" in desk.written)
    assert desk.keeper.line == ""
    await asking
    moving = asyncio.create_task(desk.send("a", "MR 51200"))
    await until(lambda: b"MR 51200" in desk.written)
    assert desk.keeper.line == "aMR 51200"
    await moving
    assert desk.keeper.line == ""
    everybody = asyncio.create_task(desk.bus.at("*").send("SL 0"))
    await until(lambda: b"SL 0" in desk.written)
    assert desk.keeper.line == "*SL 0"
    await everybody
    assert desk.keeper.line == ""


async def test_the_lines_of_a_program_move_nothing_and_are_not_told(desk):
    lines = []
    desk.keeper.begun = lines.append
    await desk.bus.drives["b"].download(program_file.read("VM=400000\n" + LOOP, "loop.mxt"))
    assert lines == ["bVM=400000"]


async def test_a_line_that_a_lost_pipe_cut_off_stays_known(desk):
    moving = asyncio.create_task(desk.send("a", "MR 51200"))
    await until(lambda: b"MR 51200" in desk.written)
    desk.floor.floor.wires["w"].unplug()
    with pytest.raises(TransportLost):
        await moving
    await desk.bus.close()
    assert desk.keeper.closed and desk.keeper.line == "aMR 51200"


async def test_a_line_that_was_answered_before_the_pipe_was_lost_is_not_known(desk):
    await desk.send("a", "MR 51200")
    desk.floor.floor.wires["w"].unplug()
    await until(lambda: desk.bus.lost is not None)
    await desk.bus.close()
    assert desk.keeper.closed and desk.keeper.line == ""


async def test_a_line_that_a_stop_cut_off_is_known_until_something_was_answered_after_it(desk):
    moving = asyncio.create_task(desk.send("a", "MR 51200"))
    await until(lambda: b"MR 51200" in desk.written)
    desk.bus.stop()
    assert desk.keeper.line == "aMR 51200"
    with pytest.raises(Stopped):
        await moving
    await desk.bus.stopped()
    assert desk.keeper.line == "" and not desk.moving("a")


async def test_an_orderly_end_leaves_nothing_behind(desk):
    moving = asyncio.create_task(desk.send("a", "MR 51200"))
    await until(lambda: b"MR 51200" in desk.written)
    await desk.bus.close()
    await asyncio.gather(moving, return_exceptions=True)
    assert desk.keeper.closed and desk.keeper.line == ""


async def test_a_line_that_a_process_before_left_is_struck_out_once_the_drives_are_found(desk):
    desk.keeper.line = "aMR 51200"
    await desk.bus.identify(Hints(drives=("a", "b"), party=True))
    assert desk.keeper.line == ""
    desk.keeper.line = "aMR 51200"
    desk.devices["a"].power(False, desk.floor.now())
    desk.devices["b"].power(False, desk.floor.now())
    with pytest.raises(NoAnswer):
        await desk.bus.identify(Hints(drives=("a", "b"), party=True))
    assert desk.keeper.line == "aMR 51200"


async def test_the_drives_are_remembered_as_they_are_found_and_as_they_are_left(desk):
    seen = []
    desk.keeper.remember = lambda drives: seen.append({name: each and each.em for name, each in drives.items()})
    await desk.bus.identify(Hints(drives=("a", "b"), party=True))
    await desk.send("b", "EM=0")
    desk.bus.drives["a"].state.settings_may_have_changed()
    await desk.bus.close()
    assert seen == [{"a": 1, "b": 1}, {"a": None, "b": 0}]


async def test_a_drive_that_was_silent_at_the_opening_is_given_its_echo_mode_back_after_a_loss(desk):
    drive, hints = desk.bus.drives["b"].state, Hints(drives=("a", "b"), party=True)
    desk.keeper.owed = (Owed(1, "b", drive.product, drive.version, drive.part, drive.serial),)
    desk.devices["b"].power(False, desk.floor.now())
    await desk.bus.identify(hints)
    desk.devices["b"].power(True, desk.floor.now())
    desk.devices["b"].execute("EM=0", desk.floor.now())
    await desk.bus.find_again(hints)
    assert desk.devices["b"].memory.echo_mode == 1
