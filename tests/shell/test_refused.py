"""An early end stops what its automation started and nothing else: a refused line has started nothing."""

import asyncio
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Refused, TransportLost
from multidrop.drives import stopping
from multidrop.drives.stop_readings import read_activity
from multidrop.drives.stopping import Fate
from multidrop.shell.events import By
from multidrop.shell.prompt.terminal_input import run_lines
from tests.support.automated import automated
from tests.support.cell_session import ETHERNET, CellSession, bus, drive, party, pmx

pytestmark = pytest.mark.virtual

SINGLE = 'personality = "LMDCM"'
PROGRAM = ("PG 1", "LB G1", "SL 20000", "LB G2", "H 100", "BR G2", "E", "PG")
"""A program that moves and does not end."""
ROUTINE = ("PG 1", "LB OO", "SL 30000", "RT", "E", "PG", "OE OO")
"""A routine for errors that moves."""


async def sent(session, *lines):
    async with automated(session):
        await run_lines(session, lines)


async def typed(session, *lines):
    for line in lines:
        await session.run(line)


def press(*, name="press", **settings):
    return bus(name, party("a", **settings), party("b", **settings), party("c", **settings))


def stops(shop):
    return [text for text in shop.warned() if "stop" in text or "program" in text]


REFUSED = {
    "a typo": "@press:a STATUS",
    "a value": "@press:a VM=99999999",
    "a print": "@press:a PR STATUS",
    "a label": "@press:a EX G9",
    "a setting that can start": "@press:a JE=7",
}


@pytest.mark.slow
@pytest.mark.parametrize("line", REFUSED.values(), ids=REFUSED)
@pytest.mark.parametrize("em", [0, 1, 2, 3])
@pytest.mark.parametrize("ck", [0, 1])
async def test_a_refused_line_stops_no_drive_of_an_mcode_line(line, em, ck, tmp_path):
    async with CellSession(tmp_path, press(EM=em, CK=ck)) as shop:
        await typed(shop.session, "@press:a SL 50000", "@press:b SL 50000")
        await asyncio.sleep(1)
        shop.events.clear()
        with pytest.raises(DriveError):
            await sent(shop.session, line)
        await asyncio.sleep(1)
        assert shop.moving() == {"press:a", "press:b"}
        assert stops(shop) == [] and b"\x1b" not in shop.written("press")


@pytest.mark.parametrize("personality", [pytest.param("LMDCM", id="Lexium"), pytest.param("MDI", id="MDrivePlus")])
async def test_a_refused_line_ends_no_program(personality, tmp_path):
    async with CellSession(tmp_path, bus("press", drive(personality))) as shop:
        await typed(shop.session, *PROGRAM, "EX G1")
        await asyncio.sleep(1)
        for line in ("STATUS", "VM=99999999", "PR STATUS"):
            with pytest.raises(Refused):
                await sent(shop.session, line)
        await asyncio.sleep(1)
        assert shop.moving() == {"press:!"}
        await shop.session.run("PR BY")
        assert shop.printed()[-1] == "1" and stops(shop) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "line", ["RC=200", "/register 0x67 =70000", "/register 0x67 =200", "VM=0", "STATUS", "PR ER,XX"]
)
async def test_a_refused_write_over_modbus_ends_no_program(line, tmp_path):
    async with CellSession(tmp_path, bus("eth", ETHERNET, baud=0, serve=["tcp://127.0.0.1:0"])) as shop:
        await shop.session.run("SL 30000")
        await asyncio.sleep(1)
        shop.events.clear()
        with pytest.raises((Diagnostic, DriveError)):
            await sent(shop.session, line)
        await asyncio.sleep(1)
        assert shop.moving() == {"eth:!"} and stops(shop) == []


# Tables of what an automation sends, and the drives that move a second after its end.


async def test_an_accepted_move_and_then_a_typo_stops_that_drive_alone_by_its_own_stop(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await shop.session.run("@press:b SL -50000")
        shop.events.clear()
        with pytest.raises(Refused):
            await sent(shop.session, "@press:a SL 50000", "/sleep 1", "@press:c STATUS")
        assert shop.moving() == {"press:b"}
        assert b"\x1b" not in shop.written("press") and b"aE" in shop.written("press")
        assert [text for text in shop.warned() if "stopped" in text] == ["stopped a: velocity 0 was read from a"]


@pytest.mark.slow
@pytest.mark.parametrize("em", [0, 1, 2, 3])
@pytest.mark.parametrize("ck", [0, 1, 2])
async def test_the_stop_of_one_drive_leaves_the_line_as_it_was(em, ck, tmp_path):
    async with CellSession(tmp_path, press(EM=em, CK=ck)) as shop:
        await typed(shop.session, "@press:b SL 40000")
        with pytest.raises(Refused):
            await sent(shop.session, "@press:a SL 50000", "/sleep 1", "@press:c PR STATUS")
        await asyncio.sleep(2)
        assert shop.moving() == {"press:b"}
        shop.events.clear()
        await typed(shop.session, "@press:a R1=7", "@press:a PR R1", "@press:b PR V", "@press:a PR EF")
        assert shop.printed() == ["7", "40000", "0"] and shop.warned() == []


async def test_a_drive_that_does_not_obey_its_own_stop_gets_that_of_the_line(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await shop.session.run("@press:b SL -50000")
        await shop.session.run("@press:a SL 50000")
        drive = shop.session.buses["press"].drives["a"]
        type(drive.codec).stop_started, kept = lambda *_: kept(drive.codec, "c", None), type(drive.codec).stop_started
        try:
            with pytest.raises(Refused):
                await sent(shop.session, "@press:a SL 50001", "/sleep 1", "@press:c STATUS")
        finally:
            type(drive.codec).stop_started = kept
        assert shop.moving() == set()
        assert "their line has only one stop, so these stopped too: b, c" in shop.warned()
        assert [text for text in shop.warned() if text.startswith("stop sent to a and any other drive on this line: ")]


async def test_a_line_that_waited_for_a_silent_drive_was_not_sent_and_stops_nothing(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await typed(shop.session, "@press:b SL 50000", "@press:a PR P")
        shop.world("/sim power a off")
        shop.events.clear()
        with pytest.raises(NoAnswer, match="'SL 50000' was not sent"):
            await sent(shop.session, "@press:a SL 50000")
        assert b"SL 50000" not in shop.written("press") and b"\x1b" not in shop.written("press")
        assert shop.moving() == {"press:b"}


async def test_a_line_without_a_reply_may_have_started_its_drive_which_is_stopped(tmp_path, monkeypatch):
    """Its fate is unknown: it was executed, and only the reply got lost."""
    async with CellSession(tmp_path, press(EM=1, CK=1)) as shop:
        await typed(shop.session, "@press:a PR P")
        line = type(shop.session.buses["press"].link.line)
        receive = line.receive

        def lossy(line, data, now):
            if b"SL 50001" not in shop.written("press"):
                receive(line, data, now)

        with pytest.raises(NoAnswer, match="not known whether"):
            async with automated(shop.session):
                with monkeypatch.context() as lost:
                    lost.setattr(line, "receive", lossy)
                    await shop.session.run("@press:a SL 50001")
        await asyncio.sleep(3)
        assert "press:a" not in shop.moving()  # a drive that did not reply gets the stop of its line
        assert any("stopped a" in text for text in shop.warned()), shop.warned()


async def test_a_routine_for_errors_that_moves_the_drive_is_stopped(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await typed(shop.session, *(f"@press:a {line}" for line in ROUTINE), "@press:b SL 40000")
        shop.events.clear()
        with pytest.raises(DriveError):
            await sent(shop.session, "@press:a STATUS")
        await asyncio.sleep(1)
        assert shop.moving() == {"press:b"}
        assert "a: its OE routine may have started" in shop.warned()


async def test_a_routine_for_errors_of_a_drive_that_moved_before_is_left_alone(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await typed(shop.session, *(f"@press:a {line}" for line in ROUTINE), "@press:a SL 40000")
        await asyncio.sleep(3)
        with pytest.raises(DriveError):
            await sent(shop.session, "@press:a STATUS")
        await asyncio.sleep(1)
        assert shop.moving() == {"press:a"}


async def test_a_drive_that_was_read_at_rest_since_needs_no_stop(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        with pytest.raises(Refused):
            await sent(shop.session, "@press:a MR 100", "/wait stopped", "@press:b STATUS")
        assert stops(shop) == [] and b"aE" not in shop.written("press") and b"\x1b" not in shop.written("press")


@pytest.mark.slow
@pytest.mark.parametrize("lines", [("TI 1,OO", "TE=1"), ("JE=1",)], ids=["trips", "an input that moves it"])
async def test_a_drive_at_rest_that_may_move_again_is_stopped(lines, tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await typed(shop.session, *(f"@press:a {line}" for line in ROUTINE[:-1]))
        with pytest.raises(Refused):
            await sent(
                shop.session,
                *(f"@press:a {line}" for line in lines),
                *("@press:a MR 100", "/wait stopped", "@press:b STATUS"),
            )
        assert stops(shop)


async def test_a_loss_during_a_setting_raises_no_alarm(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        with pytest.raises(TransportLost):
            async with automated(shop.session):
                line, line_text = asyncio.create_task(shop.session.run("@press:a VM=700000")), b"VM=700000"
                while line_text not in shop.written("press"):
                    await asyncio.sleep(0.001)
                await asyncio.sleep(0.008)
                shop.world("/sim unplug press")
                await line
        assert not [text for text in shop.warned() if "E-stop" in text]


async def test_a_loss_during_a_start_raises_the_alarm(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        with pytest.raises(TransportLost):
            async with automated(shop.session):
                line, line_text = asyncio.create_task(shop.session.run("@press:a SL 700")), b"SL 700"
                while line_text not in shop.written("press"):
                    await asyncio.sleep(0.001)
                await asyncio.sleep(0.008)
                shop.world("/sim unplug press")
                await line
        assert [text for text in shop.warned() if "E-stop" in text]


RETURNS = {
    "a controller": (bus("line", pmx("00"), pmx("01")), ["@line:00 JX+"], b"ABORT"),
    "a module": (bus("line", drive("TMCM-3110", "1"), drive("TMCM-3110", "2")), ["@line:1 ROR 0, 500"], b"\x01\x03"),
    "a drive of a party line": (press(name="line"), ["@line:a SL 50000"], b"\x1b"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "lines", "stop"), RETURNS.values(), ids=RETURNS)
async def test_the_stop_that_a_loss_kept_from_a_drive_is_sent_once_the_line_is_back(cell, lines, stop, tmp_path):
    async with CellSession(tmp_path, cell, reconnect=True) as shop:
        with pytest.raises((TransportLost, DriveError)):
            async with automated(shop.session):
                for line in lines:
                    await shop.session.run(line)
                await asyncio.sleep(0.5)
                shop.world("/sim unplug line")
                await shop.session.run(lines[0].partition(" ")[0] + " " + "STATUS")
        shop.events.clear()
        shop.world("/sim plug line")
        await asyncio.sleep(30)
        assert shop.written("line").find(stop) in range(20) and not shop.moving()
        assert not [text for text in shop.warned() if "failed" in text]


SHUTTLE = ["PRG {0}", "WHILE 1=1", "{1}1000", "WAIT{1}", "{1}0", "WAIT{1}", "ENDWHILE", "END"]


async def programs(shop):
    """Both programs of a controller run, and each moves an axis."""
    from multidrop.families.pmx.manual import program_file

    text = "\n".join(line.format(n, axis) for n, axis in enumerate("XY") for line in SHUTTLE)
    await shop.session.buses["stages"].drives["00"].download(program_file.read(text, "two.prg"))
    await typed(shop.session, "@stages:00 SR0=1", "@stages:00 SR1=1")
    await asyncio.sleep(0.5)
    shop.events.clear()


async def running(shop):
    await typed(shop.session, "@stages:00 SASTAT0", "@stages:00 SASTAT1")
    return shop.printed()[-2:]


@pytest.mark.slow
@pytest.mark.parametrize("line", ["STATUS", "X9", "HSPDX=-4", "@* STATUS"])
async def test_a_refused_line_ends_no_program_of_a_controller(line, tmp_path):
    async with CellSession(tmp_path, bus("stages", pmx("00"), pmx("01"))) as shop:
        await programs(shop)
        target = "@stages:* STATUS" if line.startswith("@") else f"@stages:00 {line}"
        with pytest.raises(DriveError):
            await sent(shop.session, target, "@stages:01 NONSENSE")
        if line != "X9":
            assert stops(shop) == [] and b"ABORT" not in shop.written("stages")
        assert await running(shop) == ["1", "1"]


async def test_an_axis_of_a_controller_is_stopped_and_its_programs_go_on(tmp_path):
    async with CellSession(tmp_path, bus("stages", pmx("00"), pmx("01"))) as shop:
        await typed(shop.session, "@stages:00 JY+")
        shop.events.clear()
        with pytest.raises(Refused):
            await sent(shop.session, "@stages:00 JX+", "/sleep 1", "@stages:00 STATUS")
        await asyncio.sleep(1)
        assert b"ABORTX\r" in shop.written("stages") and b"ABORT\r" not in shop.written("stages")
        assert b"SR0" not in shop.written("stages")
        assert shop.warned()[-1] == "stopped 00 X: velocity 0 was read from 00 X"
        await typed(shop.session, "@stages:00 PSX", "@stages:00 PSY")
        assert shop.printed()[-2] == "0" and shop.printed()[-1] != "0"


async def test_a_program_of_a_controller_that_was_started_is_ended_and_named(tmp_path):
    async with CellSession(tmp_path, bus("stages", pmx("00"), pmx("01"))) as shop:
        await programs(shop)
        await typed(shop.session, "@stages:00 SR0=0", "@stages:00 ABORTX")
        with pytest.raises(Refused):
            await sent(shop.session, "@stages:00 SR0=1", "/sleep 1", "@stages:00 STATUS")
        assert await running(shop) == ["0", "0"]
        assert "program ended: 00" in shop.warned()


@pytest.mark.parametrize(
    "lines",
    [
        ("@slide:1 ROR 0, 2000", "/sleep 2", "@slide:1 SAP 5, 0, 1000"),
        ("@stages:00 JX+",),
    ],
)
async def test_a_single_stop_is_confirmed_by_two_readings_of_rest_in_a_row(lines, tmp_path, monkeypatch):
    readings = []

    async def read(drive, axes):
        found, why = await read_activity(drive, axes)
        readings.append(found.speed)
        return found, why

    monkeypatch.setattr(stopping, "read_activity", read)
    floor = bus("slide", drive("TMCM")), bus("stages", pmx("00"))
    async with CellSession(tmp_path, *floor) as shop, automated(shop.session):
        for line in (*lines, "/sleep 1"):
            await shop.session.run(line)
        shop.session.interrupt()
        (halt,) = shop.session.automations.interrupted
        seen = set()
        for _ in range(500):
            fate = halt.fate(halt.drives[0])
            at_rest = readings[-2:] == [0, 0]
            moving = bool(readings and readings[-1])
            assert not (fate is Fate.STANDING and shop.moving())
            assert fate is (Fate.STANDING if at_rest else Fate.MOVING if moving else Fate.SENT)
            seen.add(fate)
            await asyncio.sleep(0.01)
        assert Fate.STANDING in seen and (Fate.MOVING in seen) is (len(lines) > 1)
        shop.session.automations.leave(shop.session.origin)


@pytest.mark.parametrize("lines", [("SR0=1", "JY+"), ("JY+", "SR0=1")])
async def test_a_program_and_a_motion_of_one_automation_are_both_ended_in_any_order(lines, tmp_path):
    async with CellSession(tmp_path, bus("stages", pmx("00"), pmx("01"))) as shop:
        await programs(shop)
        await typed(shop.session, "@stages:00 SR0=0", "@stages:00 SR1=0", "@stages:00 ABORT")
        shop.events.clear()
        with pytest.raises(Refused, match="STATUS"):
            await sent(shop.session, *(f"@stages:00 {line}" for line in lines), "/sleep 1", "@stages:00 STATUS")
        await asyncio.sleep(1)
        assert shop.moving() == set() and await running(shop) == ["0", "0"]
        assert b"SR0=0" in shop.written("stages") and "program ended: 00" in shop.warned()


@pytest.mark.parametrize("line", ["SAP 4, 0, -99999999", "NONSENSE", "SAP 200, 0, 1", "GAP 250, 0"])
async def test_a_refused_line_stops_no_module(line, tmp_path):
    async with CellSession(tmp_path, bus("slide", drive("TMCM"), drive("TMCM", "7"))) as shop:
        await typed(shop.session, "@slide:1 ROR 0, 2000")
        shop.events.clear()
        with pytest.raises(DriveError):
            await sent(shop.session, f"@slide:1 {line}")
        await asyncio.sleep(1)
        assert shop.moving() == {"slide:1"} and stops(shop) == []


@pytest.mark.slow
@pytest.mark.parametrize("line", ["SAP 2, 0, 2000", "SAP 0, 0, 900000", "ROR 0, 500", "MVP ABS, 0, 90000"])
async def test_what_a_module_accepted_is_stopped(line, tmp_path):
    async with CellSession(tmp_path, bus("slide", drive("TMCM"), drive("TMCM", "7"))) as shop:
        await typed(shop.session, "@slide:7 ROR 0, 2000")
        with pytest.raises(DriveError):
            await sent(shop.session, f"@slide:1 {line}", "/sleep 1", "@slide:7 NONSENSE")
        await asyncio.sleep(1)
        assert shop.moving() == {"slide:7"} and len(stops(shop)) >= 1


@pytest.mark.parametrize("line", ["SLX=1", "JO", "GS0"])
async def test_settings_that_can_start_a_controller_count(line, tmp_path):
    async with CellSession(tmp_path, bus("stages", pmx("00"), pmx("01"))) as shop:
        with pytest.raises(DriveError):
            await sent(shop.session, f"@stages:00 {line}", "@stages:01 NONSENSE")
        assert b"@00ABORT" in shop.written("stages") or line == "GS0"


async def test_an_interruption_stops_one_drive_by_its_own_stop_at_once(tmp_path):
    async with CellSession(tmp_path, press()) as shop:
        await shop.session.run("@press:b SL 50000")

        async def automation():
            await sent(shop.session, "@press:a SL 50000", "/sleep 100")

        running = asyncio.create_task(automation())
        await asyncio.sleep(1)
        shop.events.clear()
        shop.session.interrupt()
        assert shop.written("press").startswith(b"aE")
        running.cancel()
        await asyncio.wait([running])
        await asyncio.sleep(2)
        assert shop.moving() == {"press:b"}


async def test_the_stop_of_a_person_is_what_it_was(tmp_path):
    async with CellSession(tmp_path, press(), bus("stages", pmx("00"), pmx("01"))) as shop:
        await typed(shop.session, "@press:a SL 50000", "@stages:00 JX+")
        shop.events.clear()
        await shop.session.run("/stop", replace(shop.session.origin, by=By.OPERATOR))
        assert (shop.written("press"), shop.written("stages")) == (b"\x1b", b"@00ABORT\r")
