"""What a stop reaches, what it says of what it did not, on simulated lines of every family, in virtual time."""

import asyncio
from datetime import datetime

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Stopped, TransportLost
from multidrop.dialects import Motion
from multidrop.drives.drive import confirmed_motion
from multidrop.drives.stopping import Fate
from multidrop.shell import stop_report
from multidrop.shell.automation import TRIAL, outcome, stop_key_trial
from multidrop.shell.events import OnBus
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

FLOOR = (bus("press", party("a"), party("b")), bus("eth", ETHERNET), bus("stages", pmx("00"), pmx("01")))
ALL = ("@press:a SL 50000", "@press:b SL -50000", "@eth:! SL 30000", "@stages:00 JX+", "@stages:01 JY-")
MOVING = {"press:a", "press:b", "eth:!", "stages:00", "stages:01"}


async def all_moving(shop):
    for line in ALL:
        await shop.session.run(line.replace("@eth:!", "@eth:"))
    assert shop.moving() == MOVING


def breaks(*_args, **_named):
    raise KeyError("a defect")


def no_transport(shop, monkeypatch):
    monkeypatch.setattr(shop.session.buses["press"].link.transport, "write", breaks)
    return {"press:a", "press:b"}


def no_taking_back(shop, monkeypatch):
    monkeypatch.setattr(shop.session.buses["press"].link.transport, "discard", breaks)
    return set()


def no_dialect(shop, monkeypatch):
    monkeypatch.setattr(type(shop.session.buses["stages"].drives["00"].codec), "stop", breaks)
    return {"stages:00", "stages:01"}


def no_line(shop, monkeypatch):
    monkeypatch.setattr(shop.session.buses["press"].line, "stop", breaks)
    return set()


def no_watcher(shop, monkeypatch):
    for each in shop.session.buses.values():
        each.watch(breaks)
    return set()


def no_front_end(shop, monkeypatch):
    shop.session.subscribe(breaks)
    return set()


@pytest.fixture
async def shop(tmp_path):
    async with CellSession(tmp_path, *FLOOR) as made:
        yield made


@pytest.mark.parametrize("defect", [no_transport, no_taking_back, no_dialect, no_line, no_watcher, no_front_end])
async def test_what_fails_on_one_line_keeps_no_other_from_its_stop(defect, monkeypatch, shop):
    await all_moving(shop)
    runs = asyncio.create_task(shop.session.run("/sleep 1000"))
    await asyncio.sleep(0.5)
    spared = defect(shop, monkeypatch)
    shop.session.stop("test")
    assert shop.session.latched
    with pytest.raises(Stopped):
        await runs
    await asyncio.sleep(2.0)
    assert shop.moving() == spared
    assert {each.name for each in shop.session.tally().of(Fate.NOT_REACHED)} == spared
    if defect is no_transport:
        await shop.session.forget(shop.session.bus("press"))  # which is about to repeat the stop
        return
    monkeypatch.undo()
    shop.session.stop("again")
    await asyncio.sleep(2.0)
    assert shop.moving() == set()


async def test_the_bytes_are_on_every_wire_before_anybody_hears_of_it(shop):
    heard = []
    written = {}
    for name, each in shop.session.buses.items():
        write = each.link.transport.write
        each.link.transport.write = lambda data, name=name, write=write: (
            written.setdefault(name, data),
            write(data),
        )
    shop.session.subscribe(lambda event: heard.append((event, set(written))))
    shop.session.stop()
    assert heard and all(reached == {"press", "eth", "stages"} for _, reached in heard)
    assert any(isinstance(event, OnBus) for event, _ in heard)


async def test_a_defect_in_a_stop_is_logged_and_not_swallowed(monkeypatch, caplog, shop):
    no_transport(shop, monkeypatch)
    shop.session.stop()
    assert "the stop of press failed" in caplog.text and "KeyError: 'a defect'" in caplog.text
    assert any(text.startswith("press: stop not sent (a defect: KeyError)") for text in shop.warned())


async def test_stopped_is_said_when_every_drive_was_read_at_velocity_0_and_not_before(shop):
    await all_moving(shop)
    await asyncio.sleep(0.5)
    shop.session.stop()
    assert stop_report.words(shop.session.tally()) == "5 not read yet"
    seen = set()
    while not shop.session.tally().stand:
        await asyncio.sleep(0.01)
        seen.add(stop_report.words(shop.session.tally()))
        standing = {each.name for each in shop.session.tally().of(Fate.STANDING)}
        assert not standing & {name.replace("eth:!", "eth") for name in shop.moving()}
    assert stop_report.words(shop.session.tally()) == "velocity 0 was read from all 5" and len(seen) > 2
    assert stop_report.headline(shop.session.tally()).startswith("■ STOPPED   velocity 0 was read from all 5")


async def test_a_lost_bus_is_named_with_how_its_drives_were_last_seen(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a")), bus("line", party("c"), party("d"))) as shop:
        await shop.session.run("@line:c SL 5000")
        await asyncio.sleep(1.0)
        for drive in shop.session.buses["line"].drives.values():
            await confirmed_motion(drive)
        shop.world("/sim unplug line")
        await asyncio.sleep(4.0)
        shop.session.stop("Ctrl+X")
        await asyncio.sleep(2.0)
        assert (
            "line: stop not sent (lost): c last seen moving at 5000 a second 4 s ago, "
            "d last seen standing 4 s ago - use the E-stop"
        ) in shop.warned()
        tally = shop.session.tally()
        assert stop_report.words(tally) == "1 at rest, 2 NOT REACHED: line (lost) - use the E-stop"
        assert "STOPPED" not in stop_report.headline(tally)
        assert "Ctrl+X: stop not sent to every drive; macros and scripts wait for /resume" in shop.told()
        assert shop.moving() == {"line:c"}


async def test_a_bus_that_is_lost_before_its_stop_was_seen_to_work_is_not_known(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a")), bus("line", party("c"))) as shop:
        await shop.session.run("@line:c SL 50000")
        shop.session.stop()
        shop.world("/sim unplug line")
        await asyncio.sleep(2.0)
        tally = shop.session.tally()
        assert stop_report.words(tally) == "1 at rest, 1 NOT KNOWN: line:c (lost) - use the E-stop"
        with pytest.raises(TransportLost):
            await shop.session.run("@line:c PR P")


async def test_a_silent_drive_and_one_in_program_mode_are_not_known(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a"), party("b"), party("c"))) as shop:
        await shop.session.run("@b PG 1")
        shop.world("/sim power c off")
        shop.session.stop()
        await asyncio.sleep(20.0)
        assert stop_report.words(shop.session.tally()) == "1 at rest, 2 NOT KNOWN: b, c - use the E-stop"


async def test_what_an_operator_starts_behind_a_stop_is_not_said_to_stand(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as shop:
        shop.session.stop()
        await asyncio.sleep(2.0)
        await shop.session.run("@b PR P")
        assert shop.session.tally().stand
        await shop.session.run("@b SL 5000")
        assert stop_report.words(shop.session.tally()) == "1 at rest, 1 started again: b"
        assert "STOPPED" not in stop_report.headline(shop.session.tally())


async def test_a_drive_that_begins_to_move_by_itself_behind_a_stop_is_told(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        shop.session.stop()
        await asyncio.sleep(2.0)
        assert shop.session.tally().stand
        placed = shop.floor.floor.drives[0]
        placed.device.execute("SL 5000", shop.floor.now())
        await asyncio.sleep(1.0)
        await shop.session.selected.motion()
        assert stop_report.words(shop.session.tally()) == "1 STILL MOVING: a"


@pytest.mark.parametrize(
    ("speeds", "said"),
    [
        ([40000, -30000, 100, 0], ["a: stopped, velocity 0 at 0"]),
        ([500, 500, 400, 0], ["a: still moves at 500 a second; stop sent again", "a: stopped, velocity 0 at 0"]),
        (
            [5] * 5 + [0],
            ["a: still moves at 5 a second; stop sent again"] * 2
            + ["STILL MOVING after 3 stops: a; cut the power", "a: stopped, velocity 0 at 0"],
        ),
    ],
)
async def test_a_drive_that_slows_down_is_waited_for_and_one_that_does_not_is_stopped_again(
    speeds, said, tmp_path, monkeypatch
):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        left = iter(speeds)

        drive = shop.session.selected

        def motion(priority):
            yield drive.codec.request(drive.address, "PR V")
            return (Motion(0, next(left, 0)),)

        monkeypatch.setattr(drive.family, "motion", motion)
        shop.session.stop()
        await asyncio.sleep(10.0)
        assert [text.removeprefix("press: ") for text in shop.told()[1:]] == said


DWELLS = 'program_text = """\nPG 1\nLB G1\nH 60000\nBR G1\nE\nPG\n"""'


async def test_a_program_that_a_stop_does_not_end_is_named_in_every_report_of_it(tmp_path):
    async with CellSession(tmp_path, bus("press", f"{party('a')}\n{DWELLS}", party("b"))) as shop:
        await shop.session.run("@a EX G1")
        await asyncio.sleep(0.5)
        shop.device("press:a").escape = lambda now: None
        shop.session.stop()
        await asyncio.sleep(10.0)
        tally = shop.session.tally()
        assert stop_report.words(tally) == "1 at rest, 1 STILL RUNNING A PROGRAM: a - use the E-stop"
        assert "STOPPED" not in stop_report.headline(tally) and stop_report.headline(tally, 60).endswith("E-stop")
        assert any(text.endswith("STILL RUNNING after 3 stops: a; cut the power") for text in shop.warned())
        drive = shop.session.buses["press"].drives["a"]
        halt = shop.session.buses["press"].stop([drive])
        await asyncio.sleep(10.0)
        assert outcome(shop.session, [halt])[0].startswith("stop sent to a and any other drive on this line: ")
        assert "1 STILL RUNNING A PROGRAM: a" in outcome(shop.session, [halt])[0]


async def test_resume_tells_what_is_known(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as shop:
        shop.session.stop()
        await asyncio.sleep(2.0)
        await shop.session.run("/resume")
        assert shop.told()[-1] == "macros and scripts may run again; velocity 0 was read from both"
        await shop.session.run("/resume")
        assert shop.told()[-1] == "macros and scripts may run again"


async def test_a_line_that_is_closed_stays_in_what_is_said_of_a_stop_until_resume(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a")), bus("line", party("c"))) as shop:
        shop.world("/sim unplug line")
        while not shop.session.buses["line"].lost:
            await asyncio.sleep(0.1)
        shop.session.stop()
        await asyncio.sleep(2.0)
        assert [(each.fate, each.name) for each in shop.session.tally().found][1:] == [(Fate.NOT_REACHED, "line:c")]
        await shop.session.run("/close line")
        assert not shop.session.tally().sure
        assert "1 NOT REACHED: line (lost, closed since)" in stop_report.headline(shop.session.tally(), 200)
        await shop.session.run("/resume")
        assert shop.session.tally().sure


async def test_a_stop_reaches_a_bus_whose_drives_are_still_being_looked_for(tmp_path):
    shop = CellSession(tmp_path, bus("press", party("a")), bus("line", party("c", ES=3)))
    opening = asyncio.create_task(shop.session.open(shop.url))
    while "line" not in shop.session.buses:
        await asyncio.sleep(0)
    placed = shop.floor.floor.drives[1]
    placed.device.execute("SL 5000", shop.floor.now())
    assert not shop.session.buses["press"].drives, "the first is being identified, the second has yet to wait"
    shop.session.stop()
    with pytest.raises(Stopped):
        await opening
    assert shop.written("line").startswith(b"\x1b")
    await shop.session.close()


@pytest.mark.parametrize("turns", range(5))
async def test_a_stop_in_the_middle_of_a_close_leaves_no_open_port_that_it_does_not_reach(turns, tmp_path):
    async with CellSession(tmp_path, bus("press", party("a")), bus("line", party("b"))) as shop:
        press = shop.session.buses["press"]
        asking = asyncio.create_task(shop.session.run("@press:a PR P"))
        await asyncio.sleep(0.01)
        closing = asyncio.create_task(shop.session.run("/close press"))
        for _ in range(turns):
            await asyncio.sleep(0)
        shop.session.stop()
        await asyncio.gather(closing, asking, return_exceptions=True)
        await asyncio.sleep(1.0)
        assert press.link.transport.write(b"") == ("press" in shop.session.buses)


@pytest.mark.parametrize("em", [0, 1, 2, 3])
async def test_the_error_of_a_line_that_a_stop_made_harmless_is_no_refusal_of_the_next(em, tmp_path):
    """The stop makes the rest of a half-sent line overflow (error 20). A later move is not said to be refused."""
    drive = f'personality = "LMDCM"\nset = {{ EM = {em}, CK = 1 }}'
    async with CellSession(tmp_path, bus("press", drive)) as shop:
        session = shop.session
        typed = asyncio.ensure_future(session.run("MR 24"))
        while b"MR 24" not in shop.written("press"):
            await asyncio.sleep(0.0005)
        session.stop("test")
        with pytest.raises(DriveError):
            await typed
        await asyncio.sleep(3.0)
        await session.run("/resume")
        assert b"~~~~" in shop.written("press"), "the line was cut"
        await session.run("MR 2700000")
        assert shop.moving()
        assert any("an old error, now cleared: error 20" in text for text in shop.told()), shop.told()
        assert not any("since the last motion began" in text for text in shop.told()), "the move was never executed"


NEW_LINE = ("MR 24000", 'PR "v",/x', "VM=1")
"""A move, a print that the drive refuses, a setting that it refuses."""


@pytest.mark.wide
@pytest.mark.parametrize("em", [0, 1, 2, 3])
@pytest.mark.parametrize("line", NEW_LINE)
async def test_a_line_that_a_stop_cuts_off_is_reported_as_it_is_and_no_later_line_is_blamed_for_it(em, line, tmp_path):
    """The stop comes at any moment of the line: of its bytes, of its reply, of what the host asks about it."""
    drive = f'personality = "LMDCM"\nset = {{ EM = {em}, CK = 1 }}'
    async with CellSession(tmp_path, bus("press", drive)) as shop:
        session, device = shop.session, shop.device("press:!")
        executed = []
        execute = device.execute

        def watched(text, *arguments, **named):
            executed.append(str(text).strip())
            return execute(text, *arguments, **named)

        device.execute = watched
        for moment in range(14):
            executed.clear()
            typed = asyncio.ensure_future(session.run(line))
            await asyncio.sleep(moment * 0.007)
            session.stop("test")
            [ended] = await asyncio.gather(typed, return_exceptions=True)
            await asyncio.sleep(3.0)
            if isinstance(ended, Stopped) and "not sent" in str(ended):
                assert line not in executed, ended
            if isinstance(ended, Stopped) and "was executed" in str(ended).replace("whether it was executed", ""):
                assert line in executed, ended
            await session.run("/resume")
            await session.run(f"MR {30000 + moment}")
            assert f"MR {30000 + moment}" in executed
            assert shop.moving()
            await session.run("/wait stopped 20")


@pytest.mark.parametrize("by", ["the key", "/resume"])
async def test_where_the_stop_key_may_be_swallowed_nothing_moves_before_it_came_or_a_person_agreed(by, tmp_path):
    async with CellSession(tmp_path, *FLOOR) as shop:
        shop.session.doubted = stop_key_trial(shop.session)
        for line in ALL[0], "@stages:00 JX+", "@press:a VM=5000", "/raw on":
            with pytest.raises(Diagnostic, match="this console may swallow Ctrl\\+X, so drives are read only"):
                await shop.session.run(line)
        await shop.session.run("@press:a PR P")
        await shop.session.run("/stop")
        with pytest.raises(Diagnostic, match="press Ctrl\\+X once"):
            await shop.session.run(ALL[0])
        await asyncio.sleep(TRIAL)
        assert [line for line in shop.told() if "did not come" in line and "`/stop` Enter stops" in line]
        if by == "/resume":
            await shop.session.run("/resume")
        else:
            shop.session.stop_ahead()
            shop.session.stop("Ctrl+X")
        await shop.session.run(ALL[0])
        assert shop.moving() == {"press:a"}


@pytest.mark.parametrize("fate", [Fate.STANDING, Fate.STARTED, Fate.NOT_KNOWN])
def test_the_banner_is_the_longest_wording_that_fits_and_at_worst_the_shortest(fate):
    fates = (fate,) if fate is Fate.STANDING else (fate, Fate.STANDING)
    tally = stop_report.FateTally(
        datetime(2026, 1, 2, 3, 4, 5),
        tuple(stop_report.DriveFate(each, f"drive {at}", "press") for at, each in enumerate(fates)),
    )
    whole = stop_report.headline(tally)
    wordings = {stop_report.headline(tally, width) for width in range(1, len(whole) + 1)}
    shortest = min(wordings, key=len)
    assert whole in wordings and stop_report.headline(tally, 1) == shortest
    for width in range(len(shortest), len(whole) + 1):
        assert len(stop_report.headline(tally, width)) == max(len(each) for each in wordings if len(each) <= width)
