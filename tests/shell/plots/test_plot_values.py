"""Values that are plotted: which words, with which bytes, at which rate, and when no longer."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.base import registry
from multidrop.base.errors import Diagnostic, Refused
from multidrop.base.feature import Feature
from multidrop.drives.events import Valued
from multidrop.drives.telemetry import DriveValue
from multidrop.shell.events import OnBus
from multidrop.shell.hooks import Predicting
from multidrop.shell.plots.series import parse_series
from multidrop.shell.roles import Series
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx
from tests.support.foreign_features import delete_features

pytestmark = pytest.mark.virtual


def read(cell: CellSession) -> list[tuple[str, str, float]]:
    """The values that were published."""
    values = [e.event for e in cell.events if isinstance(e, OnBus) and isinstance(e.event, Valued)]
    return [(each.address, each.word, each.value) for each in values]


def two_lines(folder: Path) -> CellSession:
    return CellSession(folder, bus("press", party("a", VM=51200), party("b")), bus("eth", ETHERNET))


class Screen:
    """A front end that shows pages."""

    def __init__(self, cell: CellSession) -> None:
        self.shown: list[str] = []
        cell.session.front.screen = self.show

    async def show(self, name: str) -> None:
        self.shown.append(name)


@pytest.mark.parametrize("there", [True, False])
async def test_what_predicts_positions_says_how_it_begins(
    there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with two_lines(tmp_path) as cell:
        if there:
            adds = (Predicting("no oracle speaks", "/oracle on asks it"),)
            monkeypatch.setattr(registry, "features", lambda: [Feature("oracle", "an oracle", adds)])
        else:
            delete_features(monkeypatch)
        with pytest.raises(Diagnostic) as refused:
            parse_series(cell.session, ["b.difference"])
        said = "no oracle speaks; /oracle on asks it" if there else "it prints no value"
        assert str(refused.value).partition(": ")[2].startswith(said), refused.value


async def test_words_name_drives_and_values(tmp_path: Path) -> None:
    async with two_lines(tmp_path) as cell:
        session = cell.session
        for text, found in {
            "b": [("press", "b", "")],
            "press:*": [("press", "a", ""), ("press", "b", "")],
            "vm": [("press", "a", "VM")],
            ".VM": [("press", "a", "VM")],
            "b.i1": [("press", "b", "I1")],
            "*.I1": [("press", "a", "I1"), ("press", "b", "I1")],
            "eth:.VM": [("eth", "", "VM")],
        }.items():
            assert parse_series(session, [text]) == tuple(Series(*each) for each in found), text
        assert parse_series(session, ["a", "a", "VM", "a.VM"]) == (Series("press", "a"), Series("press", "a", "VM"))
        assert len(parse_series(session, [])) == 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x.VM", "no drive x; valid on press: a, b"),
        ("nobus:a", "no drive nobus:a; open: press, eth"),
        ("a.ER", "ER cannot be polled: reading it clears it"),
        ("a.MA", "MA cannot be polled: it prints no value"),
        ("a.", "no value in 'a.'"),
        ("PR VM", "cannot be polled"),
        ("QQ", "no drive and no value QQ; valid on press: a, b; .QQ is a user's variable"),
        ("", "no value"),
    ],
)
async def test_a_wrong_word_is_refused_and_nothing_is_sent(tmp_path: Path, text: str, says: str) -> None:
    async with two_lines(tmp_path) as cell:
        with pytest.raises(Diagnostic) as caught:
            parse_series(cell.session, [text])
        assert says in str(caught.value)
        assert cell.written("press") == b""


async def test_a_plot_on_the_screen_reads_each_value_once_and_shows_the_page(tmp_path: Path) -> None:
    async with two_lines(tmp_path) as cell:
        screen = Screen(cell)
        await cell.session.run("/plot b a.VM")
        assert cell.session.plotted == (Series("press", "b"), Series("press", "a", "VM"))
        assert screen.shown == ["plot"]
        assert cell.written("press").count(b"VM") == 1 and read(cell) == []
        await cell.session.run("/plot")
        assert "plotting on the screen: press:b press:a.VM" in cell.printed()
        await cell.session.run("/plot off")
        assert cell.session.plotted == ()


@pytest.mark.parametrize("line", ["/plot --to x.csv", "/plot b --serve 9876", "/plot rerun+http://pc:9876/proxy"])
async def test_without_its_feature_a_target_is_one_line(
    tmp_path: Path, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    delete_features(monkeypatch)
    async with two_lines(tmp_path) as cell:
        with pytest.raises(Diagnostic, match="the feature plot_files is not there; install multidrop again, whole"):
            await cell.session.run(line)
        with pytest.raises(Diagnostic, match="no screen to plot on$"):
            await cell.session.run("/plot b")
        Screen(cell)
        await cell.session.run("/plot b")
        assert cell.session.plotted == (Series("press", "b"),)


async def test_a_variable_that_no_program_declares_is_not_asked_for(tmp_path: Path) -> None:
    """To ask for it would be an error, which runs a resident OE subroutine."""
    async with two_lines(tmp_path) as cell:
        Screen(cell)
        with pytest.raises(Refused, match="a has no variable QQ"):
            await cell.session.run("/plot .QQ")
        assert cell.session.plotted == () and b"PR QQ" not in cell.written("press")


async def test_values_come_at_the_rate_asked_for_behind_what_is_typed(tmp_path: Path) -> None:
    async with two_lines(tmp_path) as cell:
        reading = cell.session.buses["press"].telemetry.read([DriveValue("a", "VM"), DriveValue("b", "I1")], 0.1)
        await asyncio.sleep(2)
        await cell.session.run("PR P")
        assert 18 <= sum(each == ("a", "VM", 51200.0) for each in read(cell)) <= 21
        assert 18 <= sum(each[:2] == ("b", "I1") for each in read(cell)) <= 21
        reading.close()
        await asyncio.sleep(0.2)
        before = len(read(cell))
        await asyncio.sleep(1)
        assert len(read(cell)) == before and cell.warned() == []


async def test_values_and_positions_share_the_wire(tmp_path: Path) -> None:
    async with two_lines(tmp_path) as cell:
        telemetry = cell.session.buses["press"].telemetry
        telemetry.subscribe(["a"], 0.0)
        telemetry.read([DriveValue("b", "I1")], 0.0)
        await asyncio.sleep(4)
        values = len(read(cell)) / 4
        assert values > 15 and telemetry.rate("a") > 10


@pytest.mark.parametrize(
    ("checksum", "asked", "says"),
    [
        (1, 3, "press: a: NAK to 'QQ'; it is not read again"),
        (0, 1, "press: a refused 'PR QQ'; it is not read again"),
    ],
)
async def test_a_value_that_a_drive_has_lost_is_soon_not_asked_for(
    tmp_path: Path, checksum: int, asked: int, says: str
) -> None:
    async with CellSession(tmp_path, bus("press", party("a", CK=checksum, EM=0), party("b"))) as cell:
        cell.session.buses["press"].telemetry.read([DriveValue("a", "QQ"), DriveValue("b", "VM")], 0.1)
        await asyncio.sleep(12)
        assert cell.written("press").count(b"PR QQ") == asked and b"ER" not in cell.written("press")
        assert cell.warned() == [says]
        assert len(read(cell)) > 90


async def test_a_stop_and_program_mode_only_put_a_reading_off(tmp_path: Path) -> None:
    async with two_lines(tmp_path) as cell:
        cell.session.buses["press"].telemetry.read([DriveValue("a", "VM")], 0.1)
        await asyncio.sleep(0.55)
        cell.session.stop()
        await asyncio.sleep(3)
        before = len(read(cell))
        await asyncio.sleep(1)
        assert len(read(cell)) - before >= 9
        await cell.session.run("PG 100")
        stored = cell.written("press")
        await asyncio.sleep(1)
        assert cell.written("press") == stored
        await cell.session.run("E")
        await cell.session.run("PG")
        await asyncio.sleep(1)
        assert len(cell.written("press")) > len(stored) + 50


@pytest.mark.parametrize("unplugged", [True, False])
async def test_a_lost_line_ends_no_reading(tmp_path: Path, unplugged: bool) -> None:
    cell = CellSession(tmp_path, bus("press", party("a", VM=51200)), reconnect=True)
    async with cell:
        cell.session.buses["press"].telemetry.read([DriveValue("a", "VM")], 0.1)
        await asyncio.sleep(1)
        cell.world("unplug press" if unplugged else "power a off")
        await asyncio.sleep(3)
        cell.world("plug press" if unplugged else "power a on")
        await asyncio.sleep(8)
        before = len(read(cell))
        await asyncio.sleep(2)
        assert len(read(cell)) - before > 5


async def test_a_controller_on_usb(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", pmx("00")), usb=True) as cell:
        (address,) = cell.session.buses["line"].drives
        assert parse_series(cell.session, ["DI"]) == (Series("line", address, "DI"),)
        cell.session.buses["line"].telemetry.read([DriveValue(address, "DI")], 0.1)
        await asyncio.sleep(2)
        assert len(read(cell)) > 10 and len({each[2] for each in read(cell)}) == 1
        assert cell.warned() == []
