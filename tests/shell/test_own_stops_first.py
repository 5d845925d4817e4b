"""An early end stops a drive that replies by its own stop, and looks at a drive that may have run its error routine."""

import asyncio

import pytest

from multidrop.base.errors import DriveError, Refused
from tests.shell.test_refused import ROUTINE, press, sent, stops, typed
from tests.support.cell_session import CellSession, bus, drive, pmx

pytestmark = pytest.mark.virtual

HOLDS = ("PG 1", "LB G1", "H 60000", "E", "PG")
"""A program that moves nothing, and lasts."""


@pytest.mark.parametrize("em", [0, 1, 2, 3])
@pytest.mark.parametrize("ck", [0, 1])
async def test_a_typo_while_the_program_of_a_script_runs_stops_no_other_drive(em, ck, tmp_path):
    """A refusal may be the program's then: the fate of the line is not known, but the drive has replied."""
    async with CellSession(tmp_path, press(EM=em, CK=ck)) as shop:
        await typed(shop.session, *(f"@press:a {line}" for line in HOLDS), "@press:b SL 5000")
        shop.events.clear()
        with pytest.raises(DriveError):
            await sent(shop.session, "@press:a EX G1", "/sleep 0.4", "@press:a STATUS")
        await asyncio.sleep(1)
        assert shop.moving() == {"press:b"} and b"\x1b" not in shop.written("press")
        shop.events.clear()
        await typed(shop.session, "@press:a PR BY")
        assert shop.printed() == ["0"]


@pytest.mark.parametrize("em", [0, 1, 2, 3])
@pytest.mark.parametrize("ck", [0, 1])
async def test_a_print_that_starts_a_routine_for_errors_leaves_nothing_moving(em, ck, tmp_path):
    """With EM=0 the prompt at the routine's end follows the refusal, so the reply looks damaged."""
    async with CellSession(tmp_path, press(EM=em, CK=ck)) as shop:
        await typed(shop.session, *(f"@press:a {line}" for line in ROUTINE), "@press:b SL 5000")
        shop.events.clear()
        with pytest.raises(DriveError):
            await sent(shop.session, "@press:a PR XQ")
        await asyncio.sleep(1)
        assert shop.moving() == {"press:b"}
        assert "a: its OE routine may have started" in shop.warned() and stops(shop)


AXES = {
    "a controller": (bus("line", pmx("00"), pmx("01")), "00", ("JY+", "JX+", "STATUS"), "00 X"),
    "a module": (bus("line", drive("TMCM-3110", "1")), "1", ("ROR 1, 500", "ROR 0, 500", "MVP ABS, 9, 5"), "1 motor 0"),
}


@pytest.mark.parametrize(("cell", "name", "lines", "said"), AXES.values(), ids=AXES)
async def test_a_stop_of_one_axis_claims_nothing_of_another_that_moves_on(cell, name, lines, said, tmp_path):
    by_hand, started, refused = (f"@line:{name} {line}" for line in lines)
    async with CellSession(tmp_path, cell) as shop:
        await shop.session.run(by_hand)
        shop.events.clear()
        with pytest.raises(Refused):
            await sent(shop.session, started, "/sleep 1", refused)
        await asyncio.sleep(1)
        assert shop.moving() == {f"line:{name}"}
        assert shop.warned()[-1] == f"stopped {said}: velocity 0 was read from {said}"
        (stopped,) = [text for text in shop.told() if ": stopped, velocity 0 at " in text]
        assert stopped.startswith(f"line: {said}: ") and "," not in stopped.partition("velocity")[2]


async def test_the_stop_of_an_axis_of_a_controller_without_an_address_is_named_by_its_line(tmp_path):
    async with CellSession(tmp_path, bus("line", pmx("00")), usb=True) as shop:
        with pytest.raises(Refused):
            await sent(shop.session, "JX+", "/sleep 1", "STATUS")
        await asyncio.sleep(1)
        assert shop.moving() == set()
        assert shop.warned()[-1] == "stopped line X: velocity 0 was read from line X"


async def test_a_drive_at_rest_with_trips_that_a_person_has_enabled_is_stopped(tmp_path):
    """A trip can move it again, whoever enabled that."""
    async with CellSession(tmp_path, press()) as shop:
        await typed(shop.session, *(f"@press:c {line}" for line in (*ROUTINE[:-1], "TI 1,OO", "TE=1")))
        lines = ("@press:c MR 100", "/wait stopped", "@press:b STATUS")
        with pytest.raises(Refused):
            await sent(shop.session, *lines)
        assert stops(shop)
        await typed(shop.session, "@press:c TE=0")
        shop.events.clear()
        with pytest.raises(Refused):
            await sent(shop.session, *lines)
        assert not stops(shop)
