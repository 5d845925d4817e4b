"""What a bus publishes as it changes, what it counts with, and a stop that another thread has begun."""

from typing import Any

import pytest

from multidrop.dialects import DriveState, Hints, StopPiece
from multidrop.drives.events import Changed
from multidrop.drives.link import Reserved
from multidrop.drives.stop_ahead import BegunStop
from multidrop.drives.stop_forms import StopForms
from multidrop.drives.stopping import _hears, _ran
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual


def changes(shop: SimulatedBus) -> int:
    return sum(isinstance(each, Changed) for each in shop.events)


async def test_drives_that_are_found_are_listed_and_published_once():
    shop = SimulatedBus(party("a"), party("b"))
    found = await shop.bus.identify(Hints(drives=("a", "b"), party=True))
    assert [each.address for each in found] == list(shop.bus.drives) == ["a", "b"]
    assert changes(shop) == 1 and shop.bus.roster.stated == ("a", "b")


async def test_drives_that_another_search_has_found_are_added_and_end_the_silence():
    shop = SimulatedBus(party("a"))
    shop.bus.silent = "no reply"
    await shop.bus.add([MCodeState(MCode(em=1), "a", product="LMDCM")])
    assert list(shop.bus.drives) == ["a"] and shop.bus.silent == "" and changes(shop) == 1
    await shop.bus.add([])
    assert list(shop.bus.drives) == ["a"] and changes(shop) == 2


async def test_a_line_without_a_drive_goes_on_with_the_reason():
    shop = SimulatedBus(party("a"))
    shop.bus.stop()
    shop.bus.unanswered("no reply")
    assert shop.bus.silent == "no reply" and changes(shop) == 1 and shop.bus.lost is None
    assert shop.bus.resume(shop.pipe("sim:#w", shop.floor, "w", lambda: None)) is None


@pytest.mark.parametrize(("baud", "byte_time"), [(9600, 10 / 9600), (0, 0.0)])
async def test_another_baud_rate_is_counted_with(baud, byte_time):
    shop = SimulatedBus(party("a"), baud=19200)
    shop.bus.set_baud(baud)
    assert (shop.bus.line.baud, shop.bus.line.byte_time, shop.bus.keeper.baud) == (baud, byte_time, baud)


async def test_a_line_that_a_person_has_stays_so_when_it_is_back_and_is_free_when_it_is_released():
    shop = await SimulatedBus(party("a")).open("a")
    await shop.bus.reserve()
    assert isinstance(shop.bus.link.away, Reserved)
    assert str(shop.bus.link.away) == "w is raw: typed text goes to the port; /raw off finds its drives"
    before, written = changes(shop), len(shop.sent)
    await shop.bus.find_again(Hints(drives=("a",), party=True))
    assert isinstance(shop.bus.link.away, Reserved)
    assert changes(shop) == before + 1 and len(shop.sent) == written
    a = shop.bus.drives["a"]
    shop.bus.silent = "no reply"
    await shop.bus.find_again(Hints(drives=("a",), party=True), release=True)
    assert shop.bus.link.away is None and shop.bus.drives["a"] is a and shop.bus.silent == ""


async def test_the_stop_of_a_bus_is_the_last_one_and_its_end_can_be_awaited():
    shop = await SimulatedBus(party("a")).open("a")
    assert shop.bus.last_stop is None
    await shop.bus.settled()
    halt = shop.bus.stop()
    assert shop.bus.last_stop is halt
    await shop.bus.settled()
    assert [each for each in shop.told if "stopped" in each] == ["a: stopped, velocity 0 at 0"]
    some = shop.bus.stop([shop.bus.drives["a"]])
    assert shop.bus.last_stop is halt is not some


@pytest.mark.parametrize(
    ("address", "name", "data", "sure", "hears"),
    [
        ("a", "x", b"a\x1b", True, True),
        ("", "x", b"x\x1b", True, True),
        ("a", "x", b"x\x1b", True, False),
        ("a", "x", b"", False, True),
    ],
)
def test_a_drive_hears_a_stop_by_its_address_or_else_its_name(address, name, data, sure, hears):
    state: DriveState = MCodeState(MCode(em=1, escape=3), address, name)
    if not sure:
        state.settings_may_have_changed()
    else:
        state.settings_confirmed()
    assert _hears(state, data) is hears


@pytest.mark.parametrize(
    ("running", "started_at", "what", "ran"),
    [
        ((2.0, True), 1.0, None, True),
        ((2.0, False), 1.0, None, False),
        ((2.0, False), 2.0, None, None),
        (None, 1.0, None, None),
        (None, 1.0, (True, False), True),
        (None, 1.0, (True, True), None),
        (None, 1.0, (False, False), None),
        ((2.0, False), 1.0, (True, False), False),
    ],
)
def test_whether_a_program_ran_before_a_stop_follows_from_the_last_reading_or_from_what_was_started(
    running, started_at, what, ran
):
    from types import SimpleNamespace

    from multidrop.dialects import Started
    from multidrop.drives.readings import ProgramReading

    drive: Any = SimpleNamespace(running=running and ProgramReading(*running), started_at=started_at)
    started = {} if what is None else {id(drive): Started(frozenset(), *what)}
    halt: Any = SimpleNamespace(started=SimpleNamespace(get=lambda drive: started.get(id(drive))))
    assert _ran(drive, halt) is ran


# A stop that another thread has begun


def forms(gap: float = 0.0, immediate: bytes = b"ABORT") -> StopForms:
    return StopForms(immediate, b"", (), b"", False, gap=gap)


def begun(*pieces: StopPiece, gap: float = 0.0, left: float = 2.0) -> BegunStop:
    return BegunStop(forms(gap), b"ABORT", left, [*pieces])


def test_a_stop_that_was_begun_has_made_no_line_harmless():
    assert begun() == BegunStop(forms(), b"ABORT", 2.0, [], [], False, False, None)


@pytest.mark.parametrize(
    ("pieces", "gap", "clear", "due"),
    [
        ([], 0.0, 2.0, 2.0),
        ([StopPiece(b"x", 0.3)], 0.0, 2.0, 2.3),
        ([StopPiece(b"x", 0.3), StopPiece(b"y", 0.9)], 0.0, 2.0, 2.3),
        ([StopPiece(b"x", 0.3)], 0.5, 2.55, 2.55),
        ([StopPiece(b"x", 0.6)], 0.5, 2.55, 2.6),
    ],
)
def test_the_next_piece_waits_for_the_reply_and_for_its_own_quiet(pieces, gap, clear, due):
    each = begun(*pieces, gap=gap)
    assert each.clear(0.01) == pytest.approx(clear) and each.due(0.01) == pytest.approx(due)


def test_before_anything_has_left_a_piece_is_due_at_once():
    assert begun(left=float("-inf")).due(0.01) == 0.0


@pytest.mark.parametrize(("quiet", "goes_on"), [(0.1, True), (0.5, True), (0.6, False), (None, False)])
def test_a_stop_goes_on_until_every_drive_has_had_its_turn(quiet, goes_on):
    assert begun(*([] if quiet is None else [StopPiece(b"x", quiet)])).goes_on() is goes_on


def test_each_write_is_noted_with_its_time_and_has_left_after_its_bytes():
    each = begun()
    assert each.since(7.0) == 7.0
    assert each.note_written(b"abc", 3.0, 0.01) == b"abc"
    assert each.note_written(b"d", 4.0, 0.01) == b"d"
    assert each.written == [(3.0, b"abc"), (4.0, b"d")]
    assert each.left == 4.01 and each.since(7.0) == 4.0
