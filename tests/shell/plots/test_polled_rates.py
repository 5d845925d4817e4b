"""How often drives are read that something shows or keeps, in virtual time."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.drives.events import BusEvent, Ended, Sample, Sent
from multidrop.shell.events import OnBus
from tests.support.cell_session import CellSession, bus, party
from tests.support.virtual import in_virtual_time

PEAK = 742_967.0
"""Steps a second, where a drive is fastest that goes 512000 steps from VI=200000 with A=D=1000000."""


@in_virtual_time
async def test_a_drive_that_is_plotted_is_read_seventeen_times_a_second_and_its_peak_is_seen(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"), party("c"))) as shop:
        looking = shop.session.buses["press"].telemetry.subscribe(["b"])
        for line in ("VM=2500000", "VI=200000", "A=1000000", "D=A", "MA 512000", "/wait stopped", "MA 0"):
            await shop.session.run(line if line.startswith("/") else f"@b {line}")
        await shop.session.run("/wait stopped")
        looking.close()
        samples = [each.event for each in shop.events if isinstance(each, OnBus) and isinstance(each.event, Sample)]
    gaps = [later.at - sooner.at for sooner, later in zip(samples, samples[1:], strict=False)]
    assert (
        len(gaps) > 40 and sorted(gaps)[-4] <= 0.06
    )  # two moves are typed meanwhile, each with its question before it
    speeds = [sample.velocity for sample in samples]
    assert max(speeds) == pytest.approx(PEAK, rel=0.04)
    assert -min(speeds) == pytest.approx(PEAK, rel=0.04)
    assert max(sample.position for sample in samples) == pytest.approx(512_000, abs=20_000)
    assert samples[-1].position == 0


async def _polled(tmp_path: Path, baud: int, names: str, period: float, seconds: float) -> list[BusEvent]:
    """What happens on a line in so many virtual seconds."""
    async with CellSession(tmp_path, bus("press", *(party(name) for name in names), baud=baud)) as shop:
        begun = len(shop.events)
        looking = shop.session.buses["press"].telemetry.subscribe(list(names), period)
        await asyncio.sleep(seconds)
        looking.close()
        return [each.event for each in shop.events[begun:] if isinstance(each, OnBus)]


@pytest.mark.parametrize("names", ["a", "abc"])
@in_virtual_time
async def test_a_line_that_is_polled_as_fast_as_it_goes_is_never_idle(tmp_path: Path, names: str) -> None:
    events = await _polled(tmp_path, 115200, names, 0.0, 0.3)
    ended = [event.at for event in events if isinstance(event, Ended)]
    sent = [event for event in events if isinstance(event, Sent)]
    assert len(sent) > 100 and ended[:-1] == [event.at for event in sent[1 : len(ended)]]
    assert "".join(event.request.address for event in sent).startswith(names * 30)


@in_virtual_time
async def test_a_period_is_kept_whatever_a_reading_takes(tmp_path: Path) -> None:
    times = [event.at for event in await _polled(tmp_path, 9600, "a", 0.1, 2.0) if isinstance(event, Sample)]
    assert len(times) == 20 and times[-1] - times[0] == pytest.approx(1.9, abs=0.001)


@in_virtual_time
async def test_an_operators_line_goes_before_polls_that_fill_the_line(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", *(party(name) for name in "abcdefgh"), baud=9600)) as shop:
        looking = shop.session.buses["press"].telemetry.subscribe(list("abcdefgh"), 0.0)
        await asyncio.sleep(1.0)
        asked = shop.session.now()
        await shop.session.run("@h PR VM")
        assert shop.session.now() - asked < 0.1  # one poll in flight, one that was passed over, and its own print
        looking.close()
