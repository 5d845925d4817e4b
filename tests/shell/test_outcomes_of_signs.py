"""Signs of a failure that are none: a limit that turned a homing round, a stall from before."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.shell.session import Session
from tests.shell.test_outcomes import ENCODER, noted, on, value, with_home
from tests.shell.test_outcomes_without_target import typed
from tests.support.outcomes import failed, sent

pytestmark = pytest.mark.virtual


def error(session: Session, code: int) -> None:
    """Let the drive have an error half a second from now."""
    device = next(iter(session.cells.values())).floor.drives[0].device
    assert isinstance(device, MCodeDevice)
    asyncio.get_running_loop().call_later(0.5, device.errors.set, code)


@pytest.mark.parametrize(("mode", "code", "fails"), [(1, 83, False), (4, 84, False), (2, 83, True), (1, 82, True)])
async def test_the_error_of_a_limit_that_turns_a_homing_round_is_no_failure(
    tmp_path: Path, mode: int, code: int, fails: bool
) -> None:
    """The simulated drive has no error then; a unit may."""
    async with with_home(tmp_path, LM=mode) as session:
        error(session, code)
        lines = ("HM 1", "/wait stopped", "R1=777")
        if fails:
            assert f"error {code}" in (await failed(session, *lines)).reason
        else:
            await sent(session, *lines)
            assert any("the homing met a limit and turned round" in each for each in noted(session))
        assert await value(session, "R1") == (0 if fails else 777)


@pytest.mark.parametrize("line", ["MA -3000", "SL -4000", "EX G1"])
async def test_a_stall_from_before_is_no_failure_of_the_next_motion(tmp_path: Path, line: str) -> None:
    """ST stays set until ST=0."""
    async with on(tmp_path, "[bus.drive.world]\nstall_at = 20000", **ENCODER) as session:
        await typed(session, "PG 1", "LB G1", "MA -3000", "H", "E", "PG")
        assert (await failed(session, "MA 4000", "/wait stopped")).outcome == "stall"
        stop = ("/sleep 0.5", "SL 0") if line.startswith("SL") else ()
        await sent(session, line, *stop, "/wait idle", "R1=777")
        assert await value(session, "ST") == 1 and await value(session, "R1") == 777
