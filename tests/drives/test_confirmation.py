"""What follows a stop: readings until the drives rest, the stop written again, and what a person is told."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import NoAnswer, Stopped, TransportLost
from multidrop.dialects import Motion, Started
from multidrop.drives import stopping
from multidrop.drives.events import Rested, Sample
from multidrop.drives.halts import Halt
from multidrop.drives.readings import MotionReading, ProgramReading
from multidrop.drives.stop_readings import ENDLESS, NOTHING, Activity, read_activity
from multidrop.drives.stopping import LONGEST_SLOWING, READING_PAUSE, Stopping

pytestmark = pytest.mark.virtual
RESTS = Activity(0, False, (("x", 7),))


class Link:
    name = "w"
    lost: Any = None
    away: Any = None
    reserved: Any = None
    stops = 0

    def __init__(self) -> None:
        self.told: list[tuple[str, bool]] = []
        self.rested: list[Rested] = []
        self.events: list[Any] = []

    def now(self) -> float:
        return asyncio.get_running_loop().time()

    def notify(self, text: str, address: str = "", warning: bool = False, rested: Rested | None = None) -> None:
        self.told.append((text, warning))
        self.rested += filter(None, (rested,))

    def publish(self, event: Any) -> None:
        self.events.append(event)


class Drive:
    """A drive whose readings are a list; the last one is read again and again."""

    programming = engaged = False
    starting = 0
    commanded_at = started_at = float("-inf")

    def __init__(self, link: Link, name: str, *readings: Any) -> None:
        self.link, self.shown, self.address = link, name, name
        self.readings, self.times = list(readings), list[float]()
        self.seen: MotionReading | None = None
        self.running: ProgramReading | None = None
        self.codec = SimpleNamespace(spares=False)
        self.family = SimpleNamespace(units=SimpleNamespace(axes=lambda: ("x", "y")))

    def reading(self) -> tuple[Activity, str]:
        found = self.readings.pop(0) if len(self.readings) > 1 else self.readings[0]
        now = self.link.now()
        self.times.append(now)
        if isinstance(found, str):
            return NOTHING, found
        if found is not ENDLESS:
            before = self.seen
            rest = before.at if before is not None and not before.velocity and not found.speed else float("-inf")
            self.seen = MotionReading(now, found.speed, (found.speed,), now, rest)
            self.running = ProgramReading(now, found.runs)
        return found, ""


class Confirmed(Stopping):
    """Confirms stops of drives without a wire, and notes each that is written again."""

    def __init__(self, link: Any) -> None:
        self.last = None
        self._link = link
        self._unconfirmed: list[Halt] = []
        self._tasks: dict[asyncio.Task[None], None] = {}
        self.again: list[tuple[str, ...]] = []

    @property
    def unconfirmed(self) -> list[Halt]:
        return self._unconfirmed

    def begin(self, halt: Halt) -> None:
        """Begin to confirm a stop that was written."""
        self._unconfirmed.append(halt)
        self.resumed()

    def _repeat(self, halt: Halt) -> None:
        halt.started, halt.single = {}, False
        self.again.append(tuple(drive.shown for drive in halt.affected))


@pytest.fixture(autouse=True)
def _readings(monkeypatch: pytest.MonkeyPatch) -> None:
    async def read(drive: Any, axes: Any) -> tuple[Activity, str]:
        drive.asked = axes
        return drive.reading()  # type: ignore[no-any-return]

    monkeypatch.setattr(stopping, "read_activity", read)


async def confirmed(*drives: Drive, link: Link, **more: Any) -> tuple[Confirmed, Halt]:
    await asyncio.sleep(0.01)
    each: Any = link
    made = Confirmed(each)
    given: Any = drives
    halt = Halt(each, link.now() - 0.001, 1, True, given, data=b"\x1b", **more)
    made.begin(halt)
    while made.tasks:
        await asyncio.wait(made.tasks)
    return made, halt


async def test_a_drive_that_is_read_at_rest_twice_is_reported_once_with_its_place():
    link = Link()
    a, b = Drive(link, "a", RESTS), Drive(link, "b", Activity(0, False, (("x", 1), ("y", 2))))
    made, halt = await confirmed(a, b, link=link)
    assert link.told == [("a: stopped, velocity 0 at 7", False), ("b: stopped, velocity 0 at 1, 2", False)]
    assert link.rested == [Rested(1, 2, "a", (("x", 7),)), Rested(1, 2, "b", (("x", 1), ("y", 2)))]
    assert [len(each.times) for each in (a, b)] == [2, 2] and a.times[1] - a.times[0] == pytest.approx(READING_PAUSE)
    assert made.unconfirmed == [] and made.again == [] and not halt.vain and made.tasks == []


async def test_without_a_known_drive_the_stop_is_sent_and_nothing_read():
    link = Link()
    made, _ = await confirmed(link=link)
    assert link.told == [("stop sent; no drive is known here, so no velocity could be read", True)]


async def test_a_drive_that_slows_down_is_left_to_it():
    link = Link()
    a = Drive(link, "a", *(Activity(speed) for speed in (300, 200, 100)), RESTS)
    made, _ = await confirmed(a, link=link)
    assert made.again == [] and link.told == [("a: stopped, velocity 0 at 7", False)]


async def test_a_drive_that_does_not_slow_down_is_stopped_again_and_said_to_move():
    link = Link()
    a, b = Drive(link, "a", Activity(300), Activity(300), RESTS), Drive(link, "b", RESTS)
    made, halt = await confirmed(a, b, link=link)
    assert made.again == [("a", "b")] and not halt.vain
    assert ("a: still moves at 300 a second; stop sent again", True) in link.told
    assert [text for text, _ in link.told if "stopped" in text] == [
        "b: stopped, velocity 0 at 7",
        "a: stopped, velocity 0 at 7",
    ]


@pytest.mark.parametrize(
    ("found", "does", "end"),
    [
        (Activity(300), "still moves at 300 a second", "STILL MOVING"),
        (Activity(0, True, (("x", 7),)), "its program still runs", "STILL RUNNING"),
        (Activity(300, True), "still moves at 300 a second", "STILL MOVING"),
    ],
)
async def test_after_three_stops_the_power_is_to_be_cut(found, does, end):
    link = Link()
    a, b = Drive(link, "a", found), Drive(link, "b", found)
    made, halt = await confirmed(a, b, link=link)
    assert halt.vain and len(made.again) == 2
    assert [text for text, _ in link.told if "STILL" in text] == [f"{end} after 3 stops: a, b; cut the power"]
    assert [text for text, _ in link.told if text.startswith("a:")] == [f"a: {does}; stop sent again"] * 2
    assert all(warning for _, warning in link.told)
    assert a.times[-1] - a.times[0] == pytest.approx(LONGEST_SLOWING, abs=2 * READING_PAUSE)


async def test_what_moves_and_what_runs_on_is_named_each_by_itself():
    link = Link()
    await confirmed(Drive(link, "a", Activity(5)), Drive(link, "b", Activity(0, True)), link=link)
    assert [text for text, _ in link.told if "STILL" in text] == [
        "STILL MOVING after 3 stops: a; cut the power",
        "STILL RUNNING after 3 stops: b; cut the power",
    ]


async def test_a_drive_that_a_stop_kept_from_being_read_is_stopped_again():
    link = Link()
    made, halt = await confirmed(Drive(link, "a", ENDLESS, RESTS), link=link)
    assert made.again == []
    link = Link()
    made, halt = await confirmed(Drive(link, "a", ENDLESS, ENDLESS, RESTS), link=link)
    assert len(made.again) == 1 and halt.doubts == {}
    assert link.told[0] == ("a: a stop kept its velocity from being read; stop sent again", True)


async def test_a_drive_that_slows_down_for_too_long_is_named():
    link = Link()
    speeds = [Activity(speed) for speed in range(1000, 1, -1)]
    made, halt = await confirmed(Drive(link, "a", *speeds), Drive(link, "b", *speeds), link=link)
    assert link.told == [("a, b: slows down for more than 30 s", True)] and made.again == [] and not halt.vain


async def test_a_drive_that_cannot_be_read_is_a_doubt_that_is_said_each_time_it_is_read():
    link = Link()
    a = Drive(link, "a", "its velocity could not be read: no reply")
    made, halt = await confirmed(a, link=link)
    assert link.told == [("a: stop sent, but its velocity could not be read: no reply", True)]
    assert list(halt.doubts.values()) == ["its velocity could not be read: no reply"]
    assert made.unconfirmed == [] and len(a.times) == 1


async def test_a_drive_that_is_started_again_is_left_to_its_operator():
    link = Link()
    a = Drive(link, "a", Activity(300))
    a.commanded_at = 1e9
    made, _ = await confirmed(a, link=link)
    assert a.times == [] and link.told == [] and made.unconfirmed == []


async def test_while_its_line_may_still_be_refused_it_is_watched():
    link = Link()
    a = Drive(link, "a", Activity(300), RESTS)
    a.commanded_at, a.starting = 1e9, 1
    asyncio.get_running_loop().call_later(1.0, setattr, a, "commanded_at", float("-inf"))
    made, _ = await confirmed(a, link=link)
    assert a.times[0] == pytest.approx(1.0, abs=2 * READING_PAUSE)
    assert link.told[-1] == ("a: stopped, velocity 0 at 7", False)


async def test_a_later_stop_of_the_whole_line_confirms_this_one():
    link = Link()
    a = Drive(link, "a", Activity(300))
    each: Any = link
    asyncio.get_running_loop().call_later(0.15, lambda: setattr(later, "last", Halt(each, 2.0, 2, True, ())))
    later = SimpleNamespace()
    await asyncio.sleep(0.01)
    made = Confirmed(each)
    later = made  # type: ignore[assignment]
    given: Any = (a,)
    halt = Halt(each, 0.0, 1, True, given, data=b"\x1b")
    made.last = halt
    made.begin(halt)
    while made.tasks:
        await asyncio.wait(made.tasks)
    assert len(a.times) <= 3 and link.told == [("a: still moves at 300 a second; stop sent again", True)]


@pytest.mark.parametrize("lost", [True, False])
async def test_a_stop_that_a_loss_keeps_from_being_confirmed_stays_to_be_written(lost):
    link = Link()
    a = Drive(link, "a", "its velocity could not be read: gone")
    link.lost = link.away = TransportLost("gone") if lost else None
    made, halt = await confirmed(a, link=link)
    assert made.unconfirmed == ([halt] if lost else []) and made.again == []


async def test_on_a_lost_line_nothing_is_written_again():
    link = Link()
    link.lost = TransportLost("gone")
    made, halt = await confirmed(Drive(link, "a", Activity(300)), link=link)
    assert made.again == [] and not halt.vain and link.told == [("a: slows down for more than 30 s", True)]


def spared(link: Link, *readings: Any) -> Drive:
    drive = Drive(link, "a", *readings)
    drive.codec.spares = True
    return drive


async def of_one_axis(drive: Drive, link: Link) -> tuple[Confirmed, Halt]:
    started: Any = {drive: Started(frozenset("x"), program=False)}
    return await confirmed(drive, link=link, started=started, single=True)


async def test_a_stop_of_one_axis_asks_for_that_axis_and_counts_its_rests():
    link = Link()
    a = spared(link, Activity(300), Activity(0, True, (("x", 7),)))
    made, halt = await of_one_axis(a, link)
    assert a.asked == frozenset("x") and list(halt.rests.values()) == [2]  # type: ignore[attr-defined]
    assert len(a.times) == 3 and made.again == [] and link.told == [("a X: stopped, velocity 0 at 7", False)]


async def test_a_stop_of_one_axis_that_cannot_be_read_is_written_again_as_the_usual_one():
    link = Link()
    a = spared(link, "its velocity could not be read: no reply", RESTS)
    made, halt = await of_one_axis(a, link)
    assert made.again == [("a",)] and halt.rests == {} and halt.doubts == {}
    assert link.told[-1] == ("a: stopped, velocity 0 at 7", False)


# What one reading shows


class Read:
    """A drive that is asked by `read_activity`."""

    address = shown = "a"
    programming = engaged = False

    def __init__(self, found: Any, runs: Any = False, velocities: tuple[int, ...] | None = None) -> None:
        self.found, self.runs, self.link, self.asked = found, runs, Link(), 0
        axes = found if isinstance(found, tuple) else ()
        self.seen: Any = SimpleNamespace(
            transmitted_at=3.0, velocities=velocities or tuple(each.velocity for each in axes)
        )

    async def motion(self) -> Any:
        if isinstance(self.found, Exception):
            raise self.found
        return self.found

    async def busy(self) -> Any:
        self.asked += 1
        if isinstance(self.runs, Exception):
            raise self.runs
        return self.runs


X, Y, YRUNS = Motion(7, 0, "x"), Motion(8, -300, "y"), Motion(8, 0, "y", "", True)
UNREAD = "velocity 0 was read, and whether a program runs was not: no reply"


@pytest.mark.parametrize(
    ("found", "runs", "axes", "activity", "why", "asked"),
    [
        ((X,), False, None, Activity(0, False, (("x", 7),)), "", 1),
        ((X,), True, None, Activity(0, True, (("x", 7),)), "", 1),
        ((X, Y), True, None, Activity(300, False, (("x", 7), ("y", 8))), "", 0),
        ((X, Y), True, frozenset("x"), Activity(0, False, (("x", 7),)), "", 0),
        ((YRUNS, X), False, None, Activity(0, True, (("y", 8), ("x", 7))), "", 0),
        ((X,), NoAnswer("no reply"), None, Activity(), UNREAD, 1),
        ((X,), TimeoutError("no reply"), None, Activity(), UNREAD, 1),
        ((X,), TransportLost("no reply"), None, Activity(), UNREAD, 1),
        ((X,), Stopped("stopped"), None, ENDLESS, "", 1),
        (Stopped("stopped"), False, None, ENDLESS, "", 0),
        (NoAnswer("no reply"), False, None, NOTHING, "its velocity could not be read: no reply", 0),
        (TransportLost("gone"), False, None, NOTHING, "its velocity could not be read: gone", 0),
    ],
)
async def test_a_reading_shows_speed_program_and_places_or_says_why_not(found, runs, axes, activity, why, asked):
    drive: Any = Read(found, runs)
    assert await read_activity(drive, axes) == (activity, why)
    assert drive.asked == asked
    if isinstance(found, tuple) and not isinstance(runs, Stopped):
        ran = found[0].program if found[0].program is not None else None
        known = ran if asked == 0 else None if why else runs
        assert drive.link.events == [
            Sample(3.0, "a", each.position, each.velocity, each.axis, each.trouble, known) for each in found
        ]
    else:
        assert drive.link.events == []


async def test_the_velocity_that_the_places_show_is_the_speed():
    drive: Any = Read((X,), velocities=(-40,))
    assert (await read_activity(drive, None))[0].speed == 40


@pytest.mark.parametrize(("engaged", "read"), [(False, False), (True, True)])
async def test_in_program_mode_only_a_drive_in_a_conversation_is_read(engaged, read):
    drive: Any = Read((X,))
    drive.programming, drive.engaged = True, engaged
    found = await read_activity(drive, None)
    assert found == ((RESTS, "") if read else (NOTHING, "its velocity cannot be read in program mode"))


@pytest.mark.parametrize(
    ("now", "before", "lessens"),
    [
        (Activity(5), None, True),
        (Activity(5), Activity(6), True),
        (Activity(5), Activity(5), False),
        (Activity(5), ENDLESS, True),
        (Activity(5, True), Activity(6), False),
        (Activity(0, True), None, False),
    ],
)
def test_a_drive_slows_down_where_two_readings_show_it_and_no_program_runs(now, before, lessens):
    assert now.lessens(before) is lessens


@pytest.mark.parametrize(
    ("activity", "none"), [(Activity(), True), (Activity(1), False), (Activity(0, True), False), (ENDLESS, False)]
)
def test_a_drive_does_nothing_where_it_neither_moves_nor_runs_a_program(activity, none):
    assert activity.none is none
