"""What a plot is made of: the samples of a drive that moves on a party line at 9600 baud."""

from __future__ import annotations

from pathlib import Path

import pytest

from drives.events import Sample
from shell.events import OnBus
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
    assert len(gaps) > 40 and max(gaps) <= 0.06
    speeds = [sample.velocity for sample in samples]
    assert max(speeds) == pytest.approx(PEAK, rel=0.04)
    assert -min(speeds) == pytest.approx(PEAK, rel=0.04)
    assert max(sample.position for sample in samples) == pytest.approx(512_000, abs=20_000)
    assert samples[-1].position == 0
