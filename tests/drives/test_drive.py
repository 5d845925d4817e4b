"""One drive: what a line to it notes, what is counted, what is refused before it is sent, and its readings."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped, TransportLost, Unreferenced
from multidrop.dialects import Motion
from multidrop.dialects.family import Referencing
from multidrop.drives.drive import Drive, confirmed_motion, still
from multidrop.drives.events import Changed
from multidrop.drives.readings import LEAST_REST, MotionReading, ProgramReading
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual
NEVER = float("-inf")


async def shop_of(*names: str) -> SimulatedBus:
    return await SimulatedBus(*map(party, names)).open(*names)


async def drive_a() -> tuple[SimulatedBus, Drive]:
    shop = await shop_of("a", "b")
    return shop, shop.bus.drives["a"]


async def test_nothing_is_known_of_a_drive_that_was_not_spoken_to():
    shop = SimulatedBus(party("a"))
    drive = shop.bus.roster.at("a")
    assert (drive.seen, drive.running, drive.noted, drive.rested, drive.settings) == (None, None, None, {}, {})
    assert drive.resting == (NEVER, 0, {})
    assert (drive.started_at, drive.commanded_at, drive.rested_at) == (NEVER,) * 3
    assert (drive.commands, drive.requests, drive.starting, drive.stops) == (0, 0, 0, 0)
    assert (drive.homings, drive.homed, drive.anchored, drive.hold) == ({}, {}, frozenset(), "")
    assert not (drive.transferring or drive.missing or drive.calm or drive.strict or drive.engaged or drive.stores)


async def test_a_drive_is_shown_by_its_label_its_address_or_the_name_of_its_line():
    shop, drive = await drive_a()
    assert (drive.shown, drive.label) == ("a", "")
    drive.label = "left"
    assert (drive.shown, drive.label, drive.state.label, drive.address) == ("left", "left", "left", "a")
    alone = await SimulatedBus('personality = "LMDCM"').open()
    assert alone.bus.drives[""].shown == "w"


async def test_questions_are_requests_and_commands_are_counted_too():
    shop, drive = await drive_a()
    before = drive.requests, drive.commands
    assert await drive.send("PR P") == ("0",)
    asked = drive.requests - before[0]
    assert asked >= 1 and drive.commands == before[1]
    await drive.send("VM 100000")
    assert drive.requests > before[0] + asked and drive.commands > before[1]


async def test_a_line_that_can_start_a_drive_is_noted_and_one_that_it_refuses_is_not():
    shop, drive = await drive_a()
    await drive.send("PR P")
    assert drive.started_at == drive.commanded_at == NEVER
    await drive.send("MR 100")
    began = drive.commanded_at
    assert drive.started_at == began > 0 and drive.starting == 0
    await asyncio.sleep(1)
    with pytest.raises(Refused):
        await drive.send("MA 9999999999")
    assert drive.commanded_at == began < drive.started_at and drive.starting == 0
    assert shop.bus.drives["b"].started_at == NEVER


async def test_a_line_is_under_way_until_it_is_answered():
    shop, drive = await drive_a()
    sending = asyncio.ensure_future(drive.send("MR 100"))
    await asyncio.sleep(0)
    assert drive.starting == 1 and drive.engaged
    await sending
    assert drive.starting == 0 and not drive.engaged


async def test_a_refusal_while_another_line_has_started_the_drive_does_not_undo_that():
    shop, drive = await drive_a()
    sending = asyncio.ensure_future(drive.send("MA 9999999999"))
    await asyncio.sleep(0)
    drive.starts_now()
    noted = drive.commanded_at
    with pytest.raises(Refused):
        await sending
    assert drive.commanded_at == noted


async def test_a_line_that_the_loss_may_have_kept_back_has_not_started_the_drive():
    shop, drive = await drive_a()
    sending = asyncio.ensure_future(drive.send("MR 100"))
    await asyncio.sleep(0)
    shop.transport.unplugged()
    with pytest.raises(TransportLost):
        await sending
    assert drive.commanded_at == NEVER < drive.started_at


async def test_on_a_line_that_is_away_nothing_starts():
    shop, drive = await drive_a()
    shop.transport.unplugged()
    await asyncio.sleep(0)
    drive.starts_now()
    assert drive.started_at == NEVER


async def test_a_line_to_all_starts_every_drive():
    shop, drive = await drive_a()
    await shop.bus.at("*").send("MR 100")
    other = shop.bus.drives["b"]
    assert drive.commanded_at == other.commanded_at == drive.started_at == other.started_at > 0


async def test_after_a_line_to_all_what_was_read_before_counts_no_more():
    shop, drive = await drive_a()
    await drive.motion()
    drive.settings["x"] = ({"VM": 1}, drive.commands)
    drive.calm = True
    assert drive.rested == {"": 0}
    await shop.bus.at("*").send("VM 100000")
    assert (drive.rested, drive.calm, drive.settings, drive.resting[2]) == ({}, False, {}, {})
    assert drive.resting[1] == drive.commands - 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{5 mm", "a: '{5 mm': "),
        ("bPR P", "a: 'bPR P' is not a command: write @b PR P; nothing was sent"),
    ],
)
async def test_a_line_that_cannot_be_meant_is_refused_before_it_is_sent(text, message):
    shop, drive = await drive_a()
    before = len(shop.sent)
    with pytest.raises(Inexpressible) as failure:
        await drive.send(text)
    assert str(failure.value).startswith(message)
    assert len(shop.sent) == before


@pytest.mark.parametrize("starts", [False, True])
async def test_in_program_mode_a_command_to_all_is_refused(starts):
    shop, drive = await drive_a()
    drive.label = "left"
    await drive.send("PG 100")
    before = len(shop.sent)
    with pytest.raises(Refused) as failure:
        await shop.bus.at("*").send("MR 100" if starts else "VM 100000")
    assert str(failure.value) == "left: in program mode a command to all would be stored; leave it with PG first"
    assert len(shop.sent) == before
    assert drive.programming and drive.stores and not drive.starts("MR 100") and shop.bus.drives["b"].starts("MR 100")


async def test_a_drive_that_must_not_start_without_a_reference_says_why():
    shop, drive = await drive_a()
    drive.check_start("MR 100")
    drive.hold = "it was restarted (sign-on)"
    drive.check_start("MR 100")
    drive.state.reference_lost([""])
    text = (
        "a: it was restarted (sign-on): its position is not referenced, and '{}' was not sent; home it, set its "
        "position, or accept() if it is right"
    )
    for line, shown in (("MR 100", "MR 100"), ("", "this")):
        with pytest.raises(Unreferenced) as failure:
            drive.check_start(line)
        assert str(failure.value) == text.format(shown)
    before = len(shop.sent)
    for who in (drive, shop.bus.at("*")):
        with pytest.raises(Unreferenced):
            await who.send("MR 100")
    assert len(shop.sent) == before
    for line in ("HM 1", "P 0", "SL 0"):
        drive.check_start(line)
    shop.bus.drives["b"].check_start("MR 100")


async def test_a_program_starts_where_nothing_holds_the_drive_or_its_position_is_referenced():
    """A program moves no axis by name, so it is refused where any axis is without a reference."""
    shop, drive = await drive_a()
    drive.hold = "it was restarted (sign-on)"
    drive.check_start("EX 100")
    drive.state.reference_lost([""])
    with pytest.raises(Unreferenced):
        drive.check_start("EX 100")
    drive.hold = ""
    drive.check_start("EX 100")


async def test_setting_the_position_gives_a_reference_unless_the_axis_is_anchored():
    shop, drive = await drive_a()
    drive.state.reference_lost([""])
    await drive.send("VM 100000")
    assert drive.state.unreferenced == {""}
    drive.anchored = frozenset([""])
    await drive.send("P 0")
    assert drive.state.unreferenced == {""}
    drive.anchored = frozenset()
    await drive.send("P 0")
    assert drive.state.unreferenced == frozenset()


async def test_a_drive_is_busy_with_a_transfer_until_that_ends_however_it_ends():
    shop, drive = await drive_a()
    seen: list[bool] = []
    good = SimpleNamespace(download=lambda *given: noted(seen, drive))
    drive.family = SimpleNamespace(programs=good)  # type: ignore[assignment]
    assert await drive.download([]) == ["sent"]
    bad = SimpleNamespace(download=lambda *given: fails(seen, drive))
    drive.family = SimpleNamespace(programs=bad)  # type: ignore[assignment]
    with pytest.raises(Refused):
        await drive.download([])
    assert seen == [True, True] and not drive.transferring


def noted(seen: list[bool], drive: Drive) -> Any:
    seen.append(drive.transferring)
    return ["sent"]
    yield


def fails(seen: list[bool], drive: Drive) -> Any:
    seen.append(drive.transferring)
    raise Refused("no")
    yield


async def test_a_family_without_programs_says_so():
    shop, drive = await drive_a()
    drive.family = SimpleNamespace(programs=None, no_programs="programs are not loaded", name="none")  # type: ignore[assignment]
    for ask in (lambda: drive.programs, lambda: drive.program_files):
        with pytest.raises(Inexpressible) as failure:
            ask()
        assert str(failure.value) == "a: programs are not loaded"


async def test_a_reading_at_rest_is_kept_with_what_was_sent_so_far():
    shop, drive = await drive_a()
    await drive.send("VM 100000")
    at = shop.bus.now()
    axes = await drive.motion()
    assert [(axis.position, axis.velocity) for axis in axes] == [(0, 0)]
    assert drive.seen is not None and drive.seen.at == at and drive.seen.velocity == 0
    assert drive.resting == (at, drive.commands, {"": 0})
    assert drive.rested == ({"": 0} if drive.calm else {})
    await drive.send("MR 100000")
    assert drive.rested == {}
    await asyncio.sleep(0.3)
    await drive.motion()
    assert drive.resting[2] == {} and drive.seen.velocity > 0


@pytest.mark.parametrize(("runs", "calm"), [(True, False), (False, True)])
async def test_a_drive_is_calm_where_no_program_runs(runs, calm):
    shop, drive = await drive_a()
    drive.state.program_read(error=False, running=False)  # type: ignore[attr-defined]
    drive.running = ProgramReading(0.0, runs)
    drive.family = replaced_motion(drive, Motion(0, 0))
    await drive.motion()
    assert drive.calm is calm
    drive.family = replaced_motion(drive, Motion(0, 0, program=not runs))
    await drive.motion()
    assert drive.calm is not calm and drive.running.runs is not runs


def replaced_motion(drive: Drive, *axes: Motion) -> Any:
    def motion(priority: Any) -> Any:
        yield from real(priority)
        return axes

    real = drive.family.motion
    return SimpleNamespace(motion=motion, rests_in_place=False, units=drive.family.units)


async def test_that_a_program_runs_is_noted_with_the_time_of_the_question():
    shop, drive = await drive_a()
    at = shop.bus.now()
    assert await drive.busy() is False
    assert drive.running == ProgramReading(at, False)


async def test_a_drive_that_is_silent_is_missing_until_it_replies_and_is_compared_then():
    shop, drive = await drive_a()
    looked: list[Any] = []
    shop.bus.roster.restarts.replied_again = lambda drive, sign="": looked.append(drive)  # type: ignore[method-assign]
    before = drive.state.recounts

    def silent() -> Any:
        raise NoAnswer("no reply")
        yield

    def replies() -> Any:
        return 5
        yield

    with pytest.raises(NoAnswer):
        await drive.run(silent())
    assert drive.missing and looked == []
    assert await drive.run(replies()) == 5
    assert not drive.missing and looked == [drive] and drive.state.recounts == before + 1
    assert await drive.run(replies()) == 5
    assert looked == [drive] and drive.state.recounts == before + 1


async def test_a_change_of_its_mode_is_published_once():
    shop, drive = await drive_a()
    shop.events.clear()
    await drive.send("PR P")
    assert [each for each in shop.events if isinstance(each, Changed)] == []
    await drive.send("PG 100")
    assert [each.address for each in shop.events if isinstance(each, Changed)] == ["a"]


async def test_rest_is_no_velocity_and_a_place_where_the_family_needs_one():
    shop, drive = await drive_a()
    at = shop.bus.now()
    found = await drive.rest()
    assert found == (() if not drive.family.rests_in_place else (0,)) and drive.rested_at == at
    await drive.send("MR 100000")
    await asyncio.sleep(0.3)
    assert await drive.rest() is None and drive.rested_at == at
    assert not await still(drive)
    await asyncio.sleep(60)
    assert await still(drive)


class Reads:
    """A drive that is read without a wire."""

    def __init__(self, *found: Any) -> None:
        self.found, self.times = list(found), list[float]()
        self.seen: MotionReading | None = None

    async def motion(self) -> Any:
        self.times.append(asyncio.get_running_loop().time())
        self.seen, axes = self.found.pop(0)
        return axes

    async def rest(self) -> Any:
        self.times.append(asyncio.get_running_loop().time())
        return self.found.pop(0)


RESTED, ONCE, MOVES = (
    MotionReading(1.0, 0, (0,), 1.0, 0.5),
    MotionReading(1.0, 0, (0,), 1.0),
    MotionReading(1.0, 5, (5,), 1.0),
)


@pytest.mark.parametrize(("first", "reads"), [(RESTED, 1), (ONCE, 2), (MOVES, 1), (None, 1)])
async def test_a_velocity_of_0_is_read_again_unless_it_is_confirmed(first, reads):
    drive: Any = Reads((first, "first"), (RESTED, "second"))
    assert await confirmed_motion(drive) == ("first", "second")[reads - 1]
    assert len(drive.times) == reads
    assert drive.times[-1] - drive.times[0] == pytest.approx(LEAST_REST * (reads - 1))


@pytest.mark.parametrize(
    ("found", "rests", "reads"),
    [([None], False, 1), ([(5,), (5,)], True, 2), ([(5,), (6,)], False, 2), ([(), None], False, 2)],
)
async def test_a_drive_is_still_where_two_readings_are_the_same(found, rests, reads):
    drive: Any = Reads(*found)
    assert await still(drive) is rests
    assert len(drive.times) == reads and drive.times[-1] - drive.times[0] == pytest.approx(LEAST_REST * (reads - 1))


async def test_a_language_without_a_command_to_all_gets_each_line_by_itself_and_the_first_failure_is_raised():
    shop, _ = await drive_a()
    every = shop.bus.at("*")
    sent: list[Any] = []

    class Each:
        programming, shown = False, "x"

        def __init__(self, outcome: Any) -> None:
            self.outcome = outcome

        async def send(self, text: str, check: Any) -> tuple[str, ...]:
            sent.append((text, check))
            if isinstance(self.outcome, Exception):
                raise self.outcome
            return (self.outcome,)

    async def to(*outcomes: Any) -> tuple[str, ...]:
        from multidrop.drives.drive import _to_each

        sent.clear()
        return await _to_each([Each(each) for each in outcomes], "X", None)  # type: ignore[misc]

    assert every.recipients == [every] and not every.one_by_one
    assert await to("1", "2") == ("1", "2") and sent == [("X", None)] * 2
    first, second = Refused("first"), NoAnswer("second")
    with pytest.raises(DriveError) as failure:
        await to("1", first, second, "4")
    assert failure.value is first and len(sent) == 4
    with pytest.raises(Stopped):
        await to("1", first, Stopped("stopped"), "4")
    assert len(sent) == 3


class Other:
    """A family that does some things otherwise."""

    def __init__(self, family: Any, **changes: Any) -> None:
        self._family = family
        self.__dict__.update(changes)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._family, name)


def otherwise(drive: Drive, **changes: Any) -> None:
    family: Any = Other(drive.family, **changes)
    drive.family = family


def spoken(drive: Drive, outcome: Any = ("done",), **changes: Any) -> None:
    """Have lines end so, and places of the axis `x` disturbed by each."""

    def perform(text: str) -> Any:
        if isinstance(outcome, Exception):
            raise outcome
        return outcome
        yield

    units: Any = drive.family.units
    units.disturbs = lambda text: frozenset("x")
    given = {"perform": perform, "units": units, "referencing": lambda text: None, **changes}
    otherwise(drive, **given)


@pytest.mark.parametrize(
    ("outcome", "disturbed"),
    [
        (("done",), True),
        (NoAnswer("a: no reply"), True),
        (Refused("a: error 21"), False),
        (Inexpressible("a: too long"), False),
    ],
)
async def test_a_line_that_may_have_been_executed_disturbs_the_places_of_its_axes(outcome, disturbed):
    shop, drive = await drive_a()
    spoken(drive, outcome)
    drive.anchored = frozenset(["x", "y"])
    if isinstance(outcome, DriveError):
        with pytest.raises(type(outcome)) as failure:
            await drive.send("VM 1")
        assert str(failure.value) == str(outcome)
    else:
        assert await drive.send("VM 1") == outcome
    assert drive.state.unreferenced == (frozenset("x") if disturbed else frozenset())


async def test_a_line_that_is_stored_disturbs_nothing_and_references_nothing():
    shop, drive = await drive_a()
    drive.anchored = frozenset("x")
    drive.state.reference_lost("z")
    drive.state.found_storing()
    spoken(drive, referencing=lambda text: Referencing("z", homing=False))
    assert await drive.send("MR 1") == ("done",)
    assert drive.state.unreferenced == {"z"}


async def test_a_line_to_all_disturbs_the_places_of_every_drive():
    shop, drive = await drive_a()
    drive.anchored = frozenset("x")
    spoken(drive)
    await shop.bus.at("*").send("VM 100000")
    assert drive.state.unreferenced == {"x"} and shop.bus.drives["b"].state.unreferenced == frozenset()


async def homing(shop: SimulatedBus, drive: Drive, axis: str, text: str = "HM 1") -> list[str]:
    """Send a homing; return the axes that are watched since."""
    watched: list[str] = []
    shop.bus.roster.homes = lambda drive, axis: watched.append(axis)  # type: ignore[method-assign]
    spoken(drive, referencing=lambda text: Referencing(axis, homing=True))
    await drive.send(text)
    return watched


async def test_a_homing_is_watched_where_its_axis_has_no_reference():
    shop, drive = await drive_a()
    assert await homing(shop, drive, "x") == []
    assert list(drive.homings) == ["x"]
    drive.state.reference_lost("y")
    assert await homing(shop, drive, "y") == ["y"]


@pytest.mark.parametrize("well", [True, False])
async def test_the_end_of_a_homing_is_asked_once_and_gives_a_reference_if_it_ended_well(well):
    shop, drive = await drive_a()
    asked = 0

    def homed() -> Any:
        nonlocal asked
        asked += 1
        return well
        yield

    drive.state.reference_lost("xy")
    await homing(shop, drive, "x")
    otherwise(drive, homed=homed)
    assert await drive.homing_ended("x") is well
    assert await drive.homing_ended("x") is well
    assert asked == 1 and drive.homed == {"x": well}
    assert drive.state.unreferenced == (frozenset("y") if well else frozenset("xy"))


@pytest.mark.parametrize("between", ["start", "stop", "another homing", "none"])
async def test_what_was_sent_since_a_homing_has_ended_it_unless_it_was_the_homing_of_another_axis(between):
    shop, drive = await drive_a()
    drive.state.reference_lost("xy")
    await homing(shop, drive, "x")
    if between == "start":
        drive.starts_now()
    elif between == "stop":
        shop.bus.stop([drive])
    elif between == "another homing":
        await homing(shop, drive, "y")
    otherwise(drive, homed=lambda: returns(True))
    expected = between in ("another homing", "none")
    assert await drive.homing_ended("x") is expected
    assert ("x" not in drive.state.unreferenced) is expected


def returns(value: Any) -> Any:
    return value
    yield


async def test_a_homing_that_begins_while_the_end_of_the_last_one_is_asked_has_not_ended():
    shop, drive = await drive_a()
    await homing(shop, drive, "x")

    def homed() -> Any:
        drive.homings["x"] = (99, 0.0, 0)
        return True
        yield

    otherwise(drive, homed=homed)
    assert await drive.homing_ended("x") is False
    assert drive.homed == {}


async def test_a_start_makes_the_rest_that_was_read_before_unconfirmed():
    shop, drive = await drive_a()
    await drive.motion()
    await asyncio.sleep(0.2)
    await drive.motion()
    assert drive.seen is not None and drive.seen.at_rest()
    drive.starts_now()
    await drive.motion()
    assert not drive.seen.at_rest()
