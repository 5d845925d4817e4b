"""Plots beside the screen: the target that they need, and how much of the wire they take."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Sample
from multidrop.features.plot_files.plot import attach
from multidrop.shell.events import OnBus
from multidrop.shell.prompt.complete import complete
from multidrop.shell.roles import Series
from tests.support.cell_session import ETHERNET, CellSession, bus, party

pytestmark = pytest.mark.virtual


def two_lines(folder: Path) -> CellSession:
    return CellSession(folder, bus("press", party("a", VM=51200), party("b")), bus("eth", ETHERNET))


@pytest.mark.parametrize(
    ("text", "offered"), [("/plot --s", ["--serve"]), ("/plot a b --t", ["--to"]), ("/plot --to r", ["run.rrd"])]
)
async def test_the_words_of_a_line_are_offered(
    text: str, offered: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with two_lines(tmp_path) as cell:
        (tmp_path / "run.rrd").touch()
        monkeypatch.chdir(tmp_path)
        assert [each.text for each in complete(cell.session, text)] == offered


async def test_without_a_screen_a_plot_needs_a_target(tmp_path: Path) -> None:
    async with two_lines(tmp_path) as cell:
        with pytest.raises(Diagnostic, match="no screen to plot on; valid here: --to FILE.rrd"):
            await cell.session.run("/plot b")
        assert cell.session.plotted == ()


async def test_where_the_most_is_asked_for_states_take_little_of_the_wire(tmp_path: Path) -> None:
    names = "abcd"
    async with CellSession(tmp_path, bus("line", *(party(each, CK=0) for each in names), baud=115200)) as cell:
        telemetry = cell.session.buses["line"].telemetry

        async def samples(seconds: float) -> int:
            before = sum(isinstance(each, OnBus) and isinstance(each.event, Sample) for each in cell.events)
            await asyncio.sleep(seconds)
            return sum(isinstance(each, OnBus) and isinstance(each.event, Sample) for each in cell.events) - before

        bare = telemetry.subscribe(list(names), 0.0)
        alone = await samples(1.5)
        bare.close()
        detach = attach(cell.session, Taken(), [Series("line", each) for each in names], 0.0)  # type: ignore[arg-type]
        assert await samples(1.5) > 0.97 * alone
        detach()
        assert await samples(0.5) <= 1


class Taken:
    """A plot that takes everything."""

    def __getattr__(self, name: str) -> Any:
        return lambda *given: None
