"""Plots of drives beside their twins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Sample
from multidrop.features.plot_files.plot import attach
from multidrop.features.plot_files.rerun_calls import DIFFERS
from multidrop.shell.events import Predicted
from multidrop.shell.plots.batch import TWIN
from multidrop.shell.plots.series import parse_series, read_first
from multidrop.shell.roles import DIFFERENCE, Series
from tests.support.cell_session import CellSession, bus, party


class Kept:
    """A plot that only remembers what twins say."""

    def __init__(self) -> None:
        self.samples: list[float] = []
        self.predictions: list[tuple[float, bool]] = []
        self.states: list[str] = []
        self.texts: list[str] = []
        self.ended: list[str] = []

    def label(self, bus: str, address: str, label: str) -> None: ...

    def on_failure(self, callback: Any) -> None: ...

    def sample(self, bus: str, sample: Sample) -> None:
        self.samples.append(sample.at)

    def predicted(self, bus: str, twin: Predicted, *, alone: bool) -> None:
        self.predictions.append((twin.at, alone))

    def twin_ended(self, bus: str, address: str, at: float) -> None:
        self.ended.append(address)

    def state(self, bus: str, address: str, axis: str, name: str, at: float, text: str) -> None:
        if name == TWIN:
            self.states.append(f"{address} {text}")

    def text(self, bus: str, address: str, at: float, text: str, level: str) -> None:
        self.texts.append(f"{level} {text}")


@pytest.mark.virtual
async def test_a_stall_beside_a_twin_is_plotted_with_its_causes(tmp_path: Path) -> None:
    stalls = party("a", EE=1, VM=8000, A=40000, D=40000, MT=50) + "\n[bus.drive.world]\nstall_at = 20000"
    async with CellSession(tmp_path, bus("press", stalls, party("b"))) as cell:
        await cell.session.run("/twin on")
        plot, alone, other = Kept(), Kept(), Kept()
        for each, series in ((plot, Series("press", "a")), (alone, Series("press", "a", DIFFERENCE))):
            attach(cell.session, each, [series])  # type: ignore[arg-type]
        attach(cell.session, other, [Series("press", "b", "VM")])  # type: ignore[arg-type]
        for line in ("MR 16000", "/sleep 3", "/twin off"):
            await cell.session.run(line)
        assert plot.samples and {at for at, _ in plot.predictions} <= set(plot.samples)
        assert {each for _, each in plot.predictions} == {False} and {each for _, each in alone.predictions} == {True}
        assert alone.samples == [] == other.predictions
        assert plot.states[0] == f"a {DIFFERS}" and plot.ended == ["a"]
        assert any("from its twin" in each and "stall" in each for each in plot.texts)


@pytest.mark.virtual
async def test_a_difference_from_no_twin_is_refused(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        with pytest.raises(Diagnostic, match=r"no twin runs that it could differ from; /twin on begins one"):
            await cell.session.run(f"/plot a.difference --to {tmp_path / 'a.rrd'}")
        assert not (tmp_path / "a.rrd").exists()
        await cell.session.run("/twin on")
        series = [Series("press", "a", DIFFERENCE)]
        assert list(parse_series(cell.session, ["press:a.DIFFERENCE"])) == series
        await read_first(cell.session, series)
