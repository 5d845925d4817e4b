"""A plot has quantities in units beside those in steps, as long as the scale holds."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop.drives.events import Sample
from multidrop.features.plot_files.plot import attach
from multidrop.shell.roles import Series
from tests.support.cell_session import CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual
PRESS = bus("press", party("a", 'units = "5 mm/turn"'), party("b"))


class Kept:
    """A plot that keeps quantities in units."""

    def __init__(self) -> None:
        self.samples: set[str] = set()
        self.units: set[tuple[str, str, float, str]] = set()

    def __getattr__(self, name: str) -> Any:
        return lambda *values: None

    def sample(self, bus: str, sample: Sample) -> None:
        self.samples.add(sample.address)

    def in_units(self, bus: str, sample: Sample, word: str, value: float, unit: str) -> None:
        self.units.add((sample.axis or sample.address, word, value, unit))

    def not_in_units(self, bus: str, sample: Sample) -> None:
        """Take no quantity."""


async def test_a_recording_has_curves_in_units_beside_those_in_steps(tmp_path: Path) -> None:
    plot: Any = Kept()
    async with CellSession(tmp_path, PRESS) as shop:
        await shop.session.run("@a MR {10 mm}")
        await shop.session.run("/wait stopped")
        detach = attach(shop.session, plot, [Series("press", "a"), Series("press", "b")], 0.5)
        await asyncio.sleep(2)
        detach()
    assert plot.samples == {"a", "b"}
    assert plot.units == {("a", "position", 10.0, "mm"), ("a", "velocity", 0.0, "mm/s")}


async def test_a_scale_that_no_longer_holds_ends_the_curves_in_units(tmp_path: Path) -> None:
    plot: Any = Kept()
    floor = bus("press", pmx("00", 'units = { x = "0.4 um/step", y = "0.4 um/step" }'))
    async with CellSession(tmp_path, floor) as shop:
        await shop.session.run("@00 POLX=1")
        detach = attach(shop.session, plot, [Series("press", "00")], 0.5)
        await asyncio.sleep(2)
        detach()
    assert plot.samples == {"00"} and {each[0] for each in plot.units} == {"y"}
