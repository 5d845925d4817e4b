"""`/halt`: the stop of one drive or axis, on simulated lines, in virtual time. Everything else goes on."""

import pytest

from multidrop.base.errors import Diagnostic
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

FLOOR = (bus("press", party("a"), party("b")), bus("eth", ETHERNET), bus("stages", pmx("00"), pmx("01")))
ALL = ("@press:a SL 50000", "@press:b SL -50000", "@eth: SL 30000", "@stages:00 JX+", "@stages:01 JY-")
MOVING = {"press:a", "press:b", "eth:!", "stages:00", "stages:01"}


@pytest.mark.parametrize(
    ("line", "stopped"),
    [("/halt press:a", "press:a"), ("/halt stages:00", "stages:00"), ("/halt stages:01.y", "stages:01")],
)
async def test_one_drive_stops_and_every_other_one_moves_on(line, stopped, tmp_path):
    async with CellSession(tmp_path, *FLOOR) as shop:
        for each in ALL:
            await shop.session.run(each)
        assert shop.moving() == MOVING
        await shop.session.run(line)
        assert shop.moving() == MOVING - {stopped}
        assert not shop.session.latched


@pytest.mark.parametrize("target", ["00.x", ".x", "line:00.X"])
async def test_the_other_axis_of_a_controller_moves_on(target, tmp_path):
    async with CellSession(tmp_path, bus("line", pmx("00"))) as shop:
        await shop.session.run("JX+")
        await shop.session.run("JY+")
        await shop.session.run(f"/halt {target}")
        motions = {motion.axis: motion.velocity for motion in await shop.session.drive().motion()}
        assert motions["x"] == 0 and motions["y"] != 0


@pytest.mark.parametrize("target", ["press:q", "press:a.x", "stages:00.z", "nowhere:a"])
async def test_a_wrong_target_stops_nothing_and_says_how_to_stop_everything(target, tmp_path):
    async with CellSession(tmp_path, *FLOOR) as shop:
        for each in ALL:
            await shop.session.run(each)
        with pytest.raises(Diagnostic):
            await shop.session.run(f"/halt {target}")
        assert shop.moving() == MOVING
