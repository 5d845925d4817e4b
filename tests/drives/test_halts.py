"""What is known of a drive after a stop: the fate of each, by what was written, sent and read since."""

from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.dialects import Started
from multidrop.drives.halts import Fate, Halt
from multidrop.drives.readings import MotionReading, ProgramReading
from multidrop.transports import Undelivered

AT = 10.0
LOST, UNDELIVERED = TransportLost("gone"), Undelivered("gone before it left")


class Drive(SimpleNamespace):
    """A drive as far as a stop asks about it."""

    __hash__ = object.__hash__
    __eq__ = object.__eq__


def drive(**known: Any) -> Any:
    defaults = dict(commanded_at=0.0, started_at=0.0, seen=None, running=None, codec=SimpleNamespace(spares=False))
    return Drive(**(defaults | known))


def halt(*drives: Any, lost: Any = None, data: bytes = b"\x1b", **more: Any) -> Halt:
    link: Any = SimpleNamespace(lost=lost)
    return Halt(link, AT, 1, True, drives, data=data, **more)


def seen(at: float, velocity: int = 0, confirms: float = float("-inf")) -> MotionReading:
    return MotionReading(at, velocity, (velocity,), at, confirms)


RESTS = seen(11.0, confirms=10.9)
STANDS = {"seen": RESTS, "running": ProgramReading(11.0, False)}
MOVES = seen(11.0, 300)
RUNS = ProgramReading(11.0, True)


@pytest.mark.parametrize(
    ("known", "fate"),
    [
        ({}, Fate.SENT),
        (STANDS, Fate.STANDING),
        ({"seen": RESTS}, Fate.SENT),
        ({"running": ProgramReading(11.0, False)}, Fate.SENT),
        ({"seen": seen(11.0), "running": ProgramReading(11.0, False)}, Fate.SENT),
        ({"seen": RESTS, "running": RUNS}, Fate.RUNNING),
        ({"running": RUNS}, Fate.RUNNING),
        ({"seen": MOVES}, Fate.MOVING),
        ({"seen": MOVES, "running": RUNS}, Fate.MOVING),
        ({"seen": seen(11.0, -300), "running": ProgramReading(11.0, False)}, Fate.MOVING),
        ({"seen": seen(AT, 300)}, Fate.SENT),
        ({"running": ProgramReading(AT, True)}, Fate.SENT),
        ({"seen": seen(11.0, confirms=AT), "running": ProgramReading(11.0, False)}, Fate.SENT),
        (STANDS | {"commanded_at": 10.1}, Fate.STARTED),
        (STANDS | {"commanded_at": AT, "started_at": AT}, Fate.STANDING),
        (STANDS | {"started_at": 10.95}, Fate.SENT),
        ({"seen": MOVES, "started_at": 11.0}, Fate.SENT),
        ({"running": RUNS, "started_at": 11.0}, Fate.SENT),
    ],
)
def test_the_fate_of_a_drive_follows_from_what_was_read_and_sent_after_the_stop(known, fate):
    each = drive(**known)
    assert halt(each).fate(each) is fate


@pytest.mark.parametrize("known", [{}, {"seen": MOVES, "running": RUNS}])
@pytest.mark.parametrize(
    ("more", "fate"),
    [
        ({"data": b""}, Fate.NOT_REACHED),
        ({"lost": UNDELIVERED}, Fate.NOT_REACHED),
        ({"missed": True}, Fate.NOT_REACHED),
    ],
)
def test_a_stop_that_was_not_sent_has_not_reached_a_drive_whatever_was_read(known, more, fate):
    each = drive(**known)
    made = halt(each, **{key: {each} if key == "missed" else value for key, value in more.items()})
    assert made.fate(each) is fate and not made.delivered


def test_a_drive_that_was_read_at_rest_stands_although_the_stop_was_not_sent():
    each = drive(**STANDS)
    assert halt(each, data=b"").fate(each) is Fate.STANDING


def test_on_a_line_that_is_lost_or_where_a_drive_cannot_be_read_its_fate_is_not_known():
    each, other = drive(), drive()
    assert halt(each, lost=LOST).fate(each) is Fate.NOT_KNOWN
    doubtful = halt(each, other, doubts={each: "no reply"})
    assert (doubtful.fate(each), doubtful.fate(other)) == (Fate.NOT_KNOWN, Fate.SENT)
    moves = drive(seen=MOVES)
    assert halt(moves, lost=LOST, doubts={moves: "no reply"}).fate(moves) is Fate.MOVING


@pytest.mark.parametrize(
    ("more", "delivered"), [({}, True), ({"data": b""}, False), ({"lost": LOST}, True), ({"lost": UNDELIVERED}, False)]
)
def test_a_stop_is_delivered_once_its_bytes_have_left(more, delivered):
    assert halt(drive(), **more).delivered is delivered


def test_a_stop_without_a_part_for_one_drive_is_not_delivered():
    each = drive()
    assert not halt(each, missed={each}).delivered


def test_a_stop_affects_the_drives_that_its_bytes_stop_as_well():
    first, second, started = drive(), drive(), drive(commanded_at=10.1)
    made = halt(first, others=(second, started))
    assert made.affected == (first, second, started)
    assert made.not_started == (first, second)
    assert [made.started_since(each) for each in made.affected] == [False, False, True]


@pytest.mark.parametrize(
    ("single", "spares", "program", "spared"),
    [
        (True, True, False, True),
        (False, True, False, False),
        (True, False, False, False),
        (True, True, True, False),
    ],
)
def test_only_a_stop_of_what_was_started_spares_programs_that_no_line_started(single, spares, program, spared):
    each = drive(codec=SimpleNamespace(spares=spares))
    made = halt(each, single=single, started={each: Started(frozenset({"x"}), program)})
    assert made.spares_programs(each) is spared


@pytest.mark.parametrize(("rests", "fate"), [(0, Fate.MOVING), (1, Fate.SENT), (2, Fate.STANDING), (3, Fate.STANDING)])
def test_where_other_axes_go_on_the_readings_of_the_stopped_ones_count(rests, fate):
    each = drive(codec=SimpleNamespace(spares=True), seen=MOVES, running=RUNS)
    made = halt(each, single=True, started={each: Started(frozenset({"x"}), False)}, rests={each: rests})
    assert made.fate(each) is fate


def test_before_the_first_such_reading_what_was_read_of_the_whole_drive_counts():
    each = drive(codec=SimpleNamespace(spares=True), seen=MOVES)
    made = halt(each, single=True, started={each: Started(frozenset({"x"}), False)})
    assert made.fate(each) is Fate.MOVING


def test_a_stop_reaches_unknown_drives_where_one_language_says_so():
    def spoken(unknown: bool) -> Any:
        return drive(codec=SimpleNamespace(stops_unknown=lambda data: unknown and data == b"\x1b"))

    assert halt(spoken(False), others=(spoken(True),)).reaches_unknown
    assert not halt(spoken(True), data=b"").reaches_unknown
    assert not halt(spoken(False), spoken(False)).reaches_unknown
