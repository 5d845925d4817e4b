"""The least that a family must have: it opens, is read, moves, is stopped and plotted, and says what it lacks."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.base import registry
from multidrop.base.errors import Diagnostic, DriveError
from multidrop.base.registry import FeatureEntry
from multidrop.drives.events import Sample
from multidrop.shell.events import OnBus
from tests.support import knock
from tests.support.cell_session import CellSession, bus, drive
from tests.support.paths import THERE

pytestmark = pytest.mark.virtual


@pytest.fixture
async def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[CellSession]:
    monkeypatch.setattr(registry, "_others", {"p": (FeatureEntry("knock", "dist", "1", "p"), knock.FAMILY)})
    async with CellSession(tmp_path, bus("line", drive("KNOCK", "A"), drive("KNOCK", "B"), baud=0)) as opened:
        yield opened


def position(cell: CellSession, name: str = "A") -> float:
    return float(cell.device(f"line:{name}").profile.position(asyncio.get_running_loop().time()))


async def test_it_is_opened_read_and_moved(cell: CellSession) -> None:
    await cell.session.run("@A GO 4000")
    await cell.session.run("/wait stopped")
    assert round(position(cell)) == 4000 and position(cell, "B") == 0
    await cell.session.run("@A ?")
    assert cell.printed()[-1] == "4000 0"


async def test_a_refusal_and_a_drive_that_is_not_there_are_one_line_each(cell: CellSession) -> None:
    with pytest.raises(DriveError, match="^A: 'JUMP' was refused$"):
        await cell.session.run("@A JUMP")
    with pytest.raises(DriveError, match="^C: '\\?' was sent once: no reply"):
        await cell.session.run("@C ?")


async def test_the_stop_reaches_every_drive_and_is_confirmed(cell: CellSession) -> None:
    for name in "AB":
        await cell.session.run(f"@{name} GO 90000")
    await asyncio.sleep(1.0)
    cell.session.stop()
    await asyncio.sleep(3.0)
    stood = [position(cell, name) for name in "AB"]
    assert all(0 < each < 90000 for each in stood)
    assert "line: A: stopped, velocity 0" in str(cell.told()) and "line: B: stopped, velocity 0" in str(cell.told())


async def test_it_is_plotted(cell: CellSession) -> None:
    cell.session.buses["line"].telemetry.subscribe(["A"], 0.1)
    await cell.session.run("@A GO 4000")
    await asyncio.sleep(2.0)
    places = [each.event.position for each in cell.events if isinstance(each, OnBus) and isinstance(each.event, Sample)]
    assert len(places) > 10 and places == sorted(places) and places[-1] > 1000


NO_PROGRAMS = "A: the host loads no programs into drives of this family"
LACKS = {
    "/status A": "A: drives of this family do not report their state",
    "/list A": NO_PROGRAMS,
    "/download {a.mxt} A": NO_PROGRAMS,
    "/trace G1": "A: programs of its family cannot be observed",
    "/params backup {a.toml} A": "A: no settings of such drives are known; nothing was sent",
    "/params save A": "A: such drives keep no settings, as far as is known; nothing was sent",
    "/register 5": "A: no registers; ",
    "/snapshot {s.toml}": "A: no settings of such drives are known; nothing was sent",
    "/help SPEED": "/help: no verb or command SPEED",
    "/units A 5 mm/turn": "/units: the scale 5 mm/turn is by the motor's turn: nothing tells how it counts; ",
}
OF_FEATURES = {
    "plot_files": ("/plot A.SPEED --to {x.csv}", "A: no value SPEED; valid: position, velocity"),
    "twins": ("/twin on A", "A: no settings of such drives are known; nothing was sent"),
}
LACKS |= dict(said for feature, said in OF_FEATURES.items() if feature in THERE)


@pytest.mark.parametrize("line", LACKS)
async def test_what_it_lacks_is_one_line_and_sends_nothing(cell: CellSession, line: str, tmp_path: Path) -> None:
    (tmp_path / "a.mxt").write_text("PG 1\nE\nPG\n")
    sent = cell.session.buses["line"].drives["A"].requests
    with pytest.raises((Diagnostic, DriveError)) as failure:
        await cell.session.run(line.replace("{", f"{tmp_path}/").replace("}", ""))
    assert str(failure.value).startswith(LACKS[line]) and "\n" not in str(failure.value)
    assert cell.session.buses["line"].drives["A"].requests == sent
    assert not (tmp_path / "x.csv").exists() and not (tmp_path / "a.toml").exists()
