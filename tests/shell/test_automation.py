"""Automation that ends early stops what it started, that alone, and says so: on simulated lines, in virtual time."""

import asyncio
from dataclasses import replace

import pytest

from multidrop.base.errors import DriveError, Refused, Stopped, TransportLost
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import By
from multidrop.shell.prompt.terminal_input import run_lines
from multidrop.shell.scripts import model
from multidrop.shell.scripts.executor import run_script
from tests.support.automated import automated
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

FLOOR = (
    bus("press", party("a"), party("b")),
    bus("gantry", party("c", ES=3), party("d", ES=3), baud=0),
    bus("eth", ETHERNET, baud=0),
    bus("stages", pmx("00"), pmx("01")),
)
GO = {
    "press:a": "@press:a SL 50000",
    "press:b": "@press:b SL -50000",
    "gantry:c": "@gantry:c SL 5000",
    "gantry:d": "@gantry:d SL 5000",
    "eth:!": "@eth: SL 30000",
    "stages:00": "@stages:00 JX+",
    "stages:01": "@stages:01 JY-",
}


async def script(session, *lines):
    """As `multidrop run` does it."""
    async with automated(session):
        body = [model.ScriptStep(model.ScriptLine("s", number, line)) for number, line in enumerate(lines, 1)]
        await run_script(session, session.origin, model.Script("s", body, {}))


async def sent(session, *lines):
    """As `multidrop send` and a piped shell do it."""
    async with automated(session):
        await run_lines(session, lines)


async def macro(session, *lines):
    """As a key does it."""
    session.macros.save(Macro("m", tuple(MacroStep(0.0, line) for line in lines)))
    await session.run("/play m")


@pytest.fixture
async def shop(tmp_path):
    async with CellSession(tmp_path, *FLOOR) as made:
        yield made


@pytest.mark.slow
@pytest.mark.parametrize("runs", [script, sent, macro])
@pytest.mark.parametrize(
    ("ending", "failure"),
    [
        ("@press:a XX 1", Refused),
        ("/wait stopped 1", DriveError),
        ("@lost:e PR P", TransportLost),
        ("/use nobody", Exception),
    ],
)
async def test_whatever_ends_it_early_stops_what_it_started_and_nothing_else(runs, ending, failure, tmp_path):
    async with CellSession(tmp_path, *FLOOR, bus("lost", party("e"))) as shop:
        for name in ("gantry:d", "stages:01"):
            await shop.session.run(GO[name])  # an operator's
        shop.world("/sim unplug lost")
        mine = [GO[name] for name in ("press:a", "gantry:c", "eth:!", "stages:00")]
        with pytest.raises(failure):
            await runs(shop.session, *mine, "/sleep 1", ending)
        assert shop.moving() == {"gantry:d", "stages:01"}
        assert not shop.session.latched
        assert [text for text in shop.warned() if text.startswith("stopped ")] == [
            "stopped press:a, gantry:c, eth, stages:00 X: velocity 0 was read from all 4",
        ]
        await shop.session.run("@gantry:c SL 100", replace(shop.session.origin, by=By.SCRIPT))


async def test_what_it_starts_behind_a_stop_and_a_resume_is_stopped_too(shop):
    with pytest.raises(Refused):
        await sent(
            shop.session,
            *(GO["press:a"], GO["gantry:c"], "/stop", "/resume", "/wait stopped 9", "/sleep 1"),
            *(GO["gantry:d"], GO["press:a"], "@press:a XX 1"),
        )
    assert shop.moving() == set()
    assert shop.warned()[-2].startswith("stopped gantry:d, press:a: ")


async def test_reads_never_count(shop):
    for line in GO.values():
        await shop.session.run(line)
    shop.events.clear()
    with pytest.raises(DriveError):
        await sent(
            shop.session, "@press:a PR P", "@eth: PR P,V", "@stages:00 PX", "@gantry:c VM=700000", "/wait stopped 1"
        )
    assert shop.moving() == set(GO)
    assert not [text for text in shop.told() if "stop" in text and "/wait" not in text]


async def test_a_drive_of_a_party_line_is_stopped_by_its_own_stop(shop):
    for name in ("press:b", "gantry:d"):
        await shop.session.run(GO[name])
    with pytest.raises(DriveError):
        await script(shop.session, GO["press:a"], GO["gantry:c"], "/sleep 1", "/wait stopped 1")
    assert shop.moving() == {"press:b", "gantry:d"}
    assert shop.warned()[-2:] == [
        "stopped press:a, gantry:c: velocity 0 was read from both",
        "program ended, if one was running: press:a, gantry:c",
    ]


async def test_a_line_to_all_is_all(shop):
    with pytest.raises(DriveError):
        await script(shop.session, "@press:* SL 50000", "@stages:* JX+", "/sleep 1", "/wait stopped 1")
    assert shop.moving() == set()
    every = "press:a, press:b, stages:00 X, stages:01 X and any other drive on this line"
    assert shop.warned()[-2] == f"stopped {every}: velocity 0 was read from all 4"


async def test_a_program_counts_when_it_is_executed_and_not_when_it_is_stored(tmp_path, shop):
    await shop.session.run(GO["press:b"])
    (tmp_path / "p.mxt").write_text("PG 1\nLB G1\nSL 20000\nH\nE\nPG\n")
    store = (f"/download {tmp_path / 'p.mxt'} press:a", "@gantry:c PG 1", "@gantry:c MR 100", "@gantry:c PG")
    with pytest.raises(Refused):
        await script(shop.session, *store, "@press:a PR XX")
    assert shop.moving() == {"press:b"}
    for line in ("@press:a EX G1", f"/download {tmp_path / 'p.mxt'} press:a --run G1"):
        with pytest.raises(Refused):
            await script(shop.session, line, "/sleep 1", "@press:a PR XX")
        assert shop.moving() == {"press:b"}
        assert shop.warned()[-2].startswith("stopped press:a: ") and shop.warned()[-1] == "program ended: press:a"


async def test_a_program_that_ends_only_after_its_motion_stops_no_other_drive(tmp_path, shop):
    """A typed E waits for the motion of the program (5.1.35), so the drive reads BY=1 while it slows down."""
    await shop.session.run(GO["press:b"])
    (tmp_path / "p.mxt").write_text("PG 1\nLB G1\nMR 900000\nH\nBR G1\nE\nPG\n")
    with pytest.raises(Refused):
        await script(
            shop.session,
            f"/download {tmp_path / 'p.mxt'} press:a",
            *("@press:a VM=300000", "@press:a D=300000", "@press:a EX G1", "/sleep 1.5", "@press:a PR XX"),
        )
    assert shop.moving() == {"press:b"} and not any("stop sent again" in text for text in shop.told())
    assert shop.warned()[-2].startswith("stopped press:a: ") and shop.warned()[-1] == "program ended: press:a"


async def test_what_could_not_be_reached_is_named(shop):
    with pytest.raises(TransportLost):
        async with automated(shop.session):
            await run_lines(shop.session, [GO["press:a"], GO["gantry:c"], "/sleep 1"])
            shop.world("/sim unplug press")
            await asyncio.sleep(1.0)
            await shop.session.run("@press:a PR P")
    assert shop.moving() == {"press:a"}
    assert shop.warned()[-3:] == [
        "stopped gantry:c: velocity 0 was read from gantry:c",
        "program ended, if one was running: gantry:c",
        "press: stop not sent (lost): a started 2 s ago and not read since - use the E-stop",
    ]


async def test_lines_do_not_end_well_where_their_bus_was_lost_in_a_pause(shop):
    asyncio.get_running_loop().call_later(1.0, shop.world, "/sim unplug press")
    with pytest.raises(TransportLost):
        await sent(shop.session, GO["press:a"], "/sleep 6")
    assert "press: stop not sent (lost)" in shop.warned()[-1]


async def test_an_automation_that_ends_well_leaves_what_it_moved(shop):
    await sent(shop.session, *GO.values())
    assert shop.moving() == set(GO) and shop.warned() == []


async def test_a_macro_within_a_script_belongs_to_it(shop):
    shop.session.macros.save(Macro("m", (MacroStep(0.0, GO["press:b"]), MacroStep(0.0, "@press:b PR XX"))))
    with pytest.raises(Refused):
        await script(shop.session, GO["gantry:c"], "/play m")
    assert shop.moving() == set()
    assert [text for text in shop.warned() if text.startswith("stopped ")] == [
        "stopped gantry:c, press:b: velocity 0 was read from both",
    ]


async def test_a_stop_of_everything_is_not_followed_by_another(shop):
    running = asyncio.create_task(macro(shop.session, GO["press:a"], "/sleep 100"))
    await asyncio.sleep(1.0)
    shop.session.stop()
    with pytest.raises(Stopped):
        await running
    await asyncio.sleep(2.0)
    assert not [text for text in shop.warned() if text.startswith("stopped")] and shop.session.latched


async def test_an_interruption_is_written_at_once_and_stops_what_was_started_alone(shop):
    await shop.session.run(GO["gantry:d"])
    running = asyncio.create_task(macro(shop.session, GO["press:a"], GO["gantry:c"], "/sleep 100"))
    await asyncio.sleep(1.0)
    shop.events.clear()
    shop.session.interrupt()
    assert (shop.written("press"), shop.written("gantry")) == (b"aE\xda\n", b"c\x1b\n")
    assert (shop.written("eth"), shop.written("stages")) == (b"", b"")
    with pytest.raises(asyncio.CancelledError):
        await running
    await asyncio.sleep(2.0)
    assert shop.moving() == {"gantry:d"} and len(shop.session.automations.interrupted) == 2 and not shop.session.latched


class Out(BaseException):
    """As KeyboardInterrupt or SystemExit, which no `except Exception` takes."""


@pytest.mark.parametrize("runs", [script, sent, macro])
async def test_a_cancelled_automation_stops_what_it_started_alone_before_its_canceller_goes_on(runs, shop):
    await shop.session.run(GO["gantry:d"])
    running = asyncio.create_task(runs(shop.session, GO["press:a"], GO["gantry:c"], "/sleep 100"))
    await asyncio.sleep(1.0)
    shop.events.clear()
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    assert shop.written("press").startswith(b"aE\xda\n") and shop.written("gantry").startswith(b"c\x1b\n")
    await asyncio.sleep(2.0)
    assert shop.moving() == {"gantry:d"} and not shop.session.latched


async def test_an_automation_that_is_left_in_any_way_stops_what_it_started(shop):
    async def started():
        async with automated(shop.session, "the test"):
            async with automated(shop.session, "a part of it"):
                await shop.session.run(GO["press:a"])
            yield

    lines = started()
    await anext(lines)
    await lines.aclose()
    await asyncio.sleep(2.0)
    assert shop.moving() == set()
    with pytest.raises(Out):
        async with automated(shop.session):
            await shop.session.run(GO["press:b"])
            raise Out
    assert shop.moving() == set()


async def test_a_cancellation_while_a_drive_at_rest_is_read_once_more_stops_that_too(shop):
    running = asyncio.create_task(
        sent(shop.session, "@press:b MR 100", "/wait @press:b P=100", "/wait stopped", GO["gantry:c"], "@press:a XX 1")
    )
    while "XX" not in shop.written("press").decode("latin-1"):
        await asyncio.sleep(0.01)
    shop.world("/sim power b off")
    await asyncio.sleep(0.5)
    assert shop.written("gantry").count(b"c\x1b\n") and b"bE" not in shop.written("press")
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    assert b"bE" in shop.written("press")


async def test_an_interruption_stops_what_every_automation_started(shop):
    each = {"press:a": script, "gantry:c": sent, "stages:00": macro}
    running = [asyncio.create_task(runs(shop.session, GO[name], "/sleep 100")) for name, runs in each.items()]
    await shop.session.run(GO["gantry:d"])
    await asyncio.sleep(1.0)
    assert shop.moving() == {*each, "gantry:d"}
    shop.session.interrupt()
    await asyncio.gather(*running, return_exceptions=True)
    await asyncio.sleep(2.0)
    assert shop.moving() == {"gantry:d"} and len(shop.session.automations.interrupted) == 3


async def test_what_is_started_again_after_an_interruption_is_stopped_by_the_next_one(shop):
    async with automated(shop.session):
        for _ in range(2):
            await shop.session.run(GO["press:a"])
            assert shop.moving() == {"press:a"}
            shop.session.interrupt()
            await asyncio.sleep(2.0)
            assert shop.moving() == set()
        shop.session.automations.leave(shop.session.origin)


async def test_an_operators_lines_go_on_beside_a_macro_that_fails(shop):
    asked = [asyncio.create_task(shop.session.run(f"@gantry:d PR {n}")) for n in range(20)]
    with pytest.raises(DriveError):
        await macro(shop.session, GO["gantry:c"], "@gantry:c PR XX")
    done = await asyncio.gather(*asked, return_exceptions=True)
    assert sum(isinstance(each, Stopped) for each in done) <= 1, "at most the one that was on the wire"
    assert shop.moving() == set()


async def test_two_stops_of_single_drives_are_both_repeated(shop):
    gantry = shop.session.buses["gantry"]
    shop.events.clear()
    gantry.stop([gantry.drives["c"]])
    gantry.stop([gantry.drives["d"]])
    await gantry.stopped()
    assert shop.written("gantry").count(b"c\x1b\n") == 2 and shop.written("gantry").count(b"d\x1b\n") == 2
