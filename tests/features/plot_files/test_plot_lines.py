"""Plots beside the screen: the target that they need, and how much of the wire they take."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop.__main__ import main
from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Sample
from multidrop.features.plot_files.plot import attach
from multidrop.shell.events import OnBus
from multidrop.shell.prompt.complete import complete
from multidrop.shell.roles import Series
from tests.support.cell_session import ETHERNET, CellSession, bus, party
from tests.support.said import PLANT, compare

pytestmark = pytest.mark.virtual


def two_lines(folder: Path) -> CellSession:
    return CellSession(folder, bus("press", party("a", VM=51200), party("b")), bus("eth", ETHERNET))


SAID = Path(__file__).with_name("said.txt")


async def test_each_line_says_this_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written as the files of `tests/shell/said`."""
    monkeypatch.chdir(tmp_path)
    async with CellSession(tmp_path, *PLANT) as shop:
        await compare(shop, SAID, tmp_path)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["sim:"], "--to"),
        (["sim:", "--to", "a.rrd", "--serve", "1"], "--serve"),
        (["sim:", "--to", "a.txt"], "a.txt"),
    ],
)
def test_wrong_usage_of_the_command_is_one_line_and_exit_2(
    arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        assert main(["plot", *arguments]) == 2
    except SystemExit as ended:
        assert ended.code == 2
    done = capsys.readouterr()
    assert done.out == "" and named in done.err and done.err.count("\n") == 1


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
