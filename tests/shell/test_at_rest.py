"""At rest, by the rule of each family: one false zero between readings of motion ends no wait and confirms no rest."""

from __future__ import annotations

import asyncio
from collections.abc import Container, Iterator
from dataclasses import replace
from typing import Any

import pytest

from multidrop.base.errors import NoAnswer
from multidrop.dialects import Motion, Priority
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.motions import Motions, Outcome
from multidrop.drives.drive import Drive, still
from multidrop.drives.events import Sample
from multidrop.drives.stopping import Fate
from multidrop.shell.at_rest import at_rest_after_error, excused
from multidrop.shell.events import OnBus
from multidrop.shell.origin import PERSON
from multidrop.shell.waits import standings, wait
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual

ENDS = 5.0
"""When the drive comes to rest, s."""
SPEED = 5000
FAMILY_NAMES = ["mcode", "modbus", "pmx", "tmcl"]
MODULE = 'personality = "TMCM"'


class Moving:
    """A drive of any family that moves until ENDS; its readings of velocity by these numbers are a false zero.

    Those of `lost` get no reply.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, family: str, *false: int, lost: Container[int] = ()) -> None:
        self.false, self.lost = set(false), lost
        self.read = 0
        mover = self

        class Own(FAMILIES[family]):  # type: ignore[misc]
            def motion(self, priority: Priority) -> Iterator[Any]:
                return mover.motion(self.state, priority)

            def moving(self) -> Iterator[Any]:
                return mover.moving(self.state)

            def busy(self) -> Iterator[Any]:
                return mover.busy(self.state)

            @property
            def motions(self) -> Motions:
                return Motions(self.state)

        monkeypatch.setattr(
            Drive, "family", property(lambda drive: Own(drive.state), lambda drive, found: None), raising=False
        )

    def _velocity(self) -> int:
        self.read += 1
        if self.read in self.lost:
            raise NoAnswer("a does not reply")
        return SPEED if asyncio.get_running_loop().time() < ENDS and self.read not in self.false else 0

    def motion(self, state: Any, priority: Priority) -> Iterator[Any]:
        yield replace(state.codec.request(state.address, "PR V"), priority=priority)
        return (Motion(int(SPEED * min(asyncio.get_running_loop().time(), ENDS)), self._velocity()),)

    def moving(self, state: Any) -> Iterator[Any]:
        yield state.codec.request(state.address, "PR MV")
        return self._velocity() != 0

    def busy(self, state: Any) -> Iterator[Any]:
        yield state.codec.request(state.address, "PR BY")
        return False


@pytest.mark.parametrize("family", FAMILY_NAMES)
@pytest.mark.parametrize("false", [1, 2, 3])
async def test_one_false_zero_ends_no_wait(family, false, tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        Moving(monkeypatch, family, false)
        await shop.session.run("/wait stopped 20")
        assert asyncio.get_running_loop().time() >= ENDS


@pytest.mark.parametrize("family", FAMILY_NAMES)
@pytest.mark.parametrize("lost", [1, 2, 3])
async def test_a_lost_reading_is_no_rest(family, lost, tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        drive, now = shop.session.selected, asyncio.get_running_loop().time
        for line in ("/wait stopped 20", "/wait idle 20"):
            Moving(monkeypatch, family, lost=[lost])
            with pytest.raises(NoAnswer):
                await shop.session.run(line)
            assert now() < ENDS
        Moving(monkeypatch, family, lost=[lost])
        watch = await wait(shop.session, PERSON, 20, idle=False, ended=True)  # asks again
        assert now() >= ENDS and Outcome.UNKNOWN not in [each.outcome for each in watch.endings[drive]]


@pytest.mark.parametrize("family", FAMILY_NAMES)
async def test_after_three_lost_readings_the_end_is_not_known(family, tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        Moving(monkeypatch, family, lost=range(100))
        watch = await wait(shop.session, PERSON, 20, idle=False, ended=True)
        assert asyncio.get_running_loop().time() < ENDS
        assert [each.outcome for each in watch.endings[shop.session.selected]] == [Outcome.UNKNOWN]


@pytest.mark.parametrize("family", FAMILY_NAMES)
async def test_silence_after_the_end_of_a_motion_confirms_no_rest(family, tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        drive = shop.session.selected
        await asyncio.sleep(ENDS)
        moving = Moving(monkeypatch, family, lost=range(100))
        halt = shop.session.buses["press"].stop()
        await asyncio.sleep(2.0)
        assert halt.fate(drive) is Fate.NOT_KNOWN
        (found,) = await standings(shop.session, [drive])
        assert found.text == "a not known (a does not reply)"
        moving.read, moving.lost = 0, [1, 3]
        for _ in range(2):  # the first reading is lost, then the second one
            with pytest.raises(NoAnswer):
                await still(drive)
        assert await still(drive)


async def test_a_silent_drive_is_excused_from_no_stop(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        drive = shop.session.selected
        for power, rests in (("on", True), ("off", False)):
            shop.world(f"/sim power a {power}")
            assert await excused(drive) is await at_rest_after_error(drive) is rests


@pytest.mark.parametrize("family", FAMILY_NAMES)
@pytest.mark.parametrize("false", [1, 2, 3])
async def test_one_false_zero_confirms_no_stop_and_no_rest(family, false, tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        drive, now = shop.session.selected, asyncio.get_running_loop().time
        moving = Moving(monkeypatch, family, false)
        bus_ = shop.session.buses["press"]
        halt = bus_.stop()
        while now() < ENDS:
            assert halt.fate(drive) is not Fate.STANDING
            await asyncio.sleep(0.03)
        await asyncio.sleep(2.0)
        assert halt.fate(drive) is Fate.STANDING
        monkeypatch.setattr(f"{__name__}.ENDS", now() + 1.0)
        moving.false = {moving.read + 1}
        (found,) = await standings(shop.session, [drive])
        assert "stands" not in found.text


async def test_a_module_that_reads_velocity_0_in_motion_is_at_rest_in_one_place_only(tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("slide", MODULE)) as shop:
        module = shop.session.selected
        motor = shop.device("slide:1").motors[0]
        read = motor.read
        monkeypatch.setattr(motor, "read", lambda number, t: 0 if number == 3 else read(number, t))
        await shop.session.run("MVP ABS, 0, 200000")
        polling = shop.session.buses["slide"].telemetry.subscribe(("1",), 0.1)
        await asyncio.sleep(2.0)
        polling.close()
        samples = [each.event for each in shop.events if isinstance(each, OnBus) and isinstance(each.event, Sample)]
        assert len(samples) > 10 and all(each.velocity > 0 for each in samples[1:]), "rows say that it moves"
        await asyncio.sleep(2.0)
        (found,) = await standings(shop.session, [module])
        assert found.text.startswith("1 had velocity 0 once, but not twice at one position")
        await shop.session.run("/wait stopped")
        assert await module.send("GAP 1, 0") == ("200000",)
        (found,) = await standings(shop.session, [module])
        assert found.text == "1 is at rest at 200000"


@pytest.mark.parametrize(("false", "at_rest"), [((), False), ((1,), False), ((1, 2), True)])
async def test_a_drive_is_read_twice_after_an_error(false, at_rest, tmp_path, monkeypatch):
    """A routine for errors may start it between the two."""
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        Moving(monkeypatch, "mcode", *false)
        assert await at_rest_after_error(shop.session.drive()) is at_rest
