"""An early end stops a drive that replies by its own stop, and looks at a drive that may have run its error routine."""

import asyncio

import pytest

from multidrop.base.errors import DriveError
from tests.shell.test_refused import ROUTINE, press, sent, stops, typed
from tests.support.cell_session import CellSession

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
