"""The verbs for the transcript: what is understood, what is refused in one line, and what the configuration keeps."""

from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell import configuration
from multidrop.shell.events import Notified
from multidrop.shell.roles import EVERYTHING, Filter
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual

CELL = bus("press", party("a"), party("b"))


class Shelf:
    """Notes what a verb asks of the screen."""

    form = "clock"
    wanted = EVERYTHING
    offered = 0

    def times(self) -> str:
        return self.form

    def set_times(self, form: str) -> None:
        self.form = form

    def choose(self, wanted: Filter) -> None:
        self.wanted = wanted

    async def save(self, path: str) -> str:
        return f"3 lines, in {path}"

    async def offer_unsent(self) -> None:
        self.offered += 1


@for_each(
    ("line", "wanted"),
    [
        ("/filter mine", Filter(mine=True)),
        ("/filter b", Filter(address="b")),
        ("/filter errors b", Filter(address="b", errors=True)),
        ("/filter b mine errors", Filter(address="b", errors=True, mine=True)),
        ("/filter text VX  or so", Filter(text="VX  or so")),
        ("/filter off", EVERYTHING),
    ],
)
async def test_a_filter_is_understood(line: str, wanted: Filter, tmp_path: Path) -> None:
    async with CellSession(tmp_path, CELL) as cell:
        shelf = cell.session.front.transcripts = Shelf()
        await cell.session.run(line)
        assert shelf.wanted == wanted


@for_each(
    ("line", "why"),
    [
        ("/filter", "usage"),
        ("/filter z", "no drive z on press; valid: a, b"),
        ("/filter a b", "usage"),
        ("/filter mine mine", "usage"),
        ("/filter text", "usage"),
        ("/filter off mine", "usage: /filter off"),
        ("/times noon", "noon is none of off, clock, start, last"),
        ("/save", "usage"),
        ("/unsent now", "usage"),
    ],
)
async def test_a_wrong_line_changes_nothing(line: str, why: str, tmp_path: Path) -> None:
    async with CellSession(tmp_path, CELL) as cell:
        shelf = cell.session.front.transcripts = Shelf()
        with pytest.raises(Diagnostic, match=why):
            await cell.session.run(line)
        assert (shelf.wanted, shelf.form, shelf.offered) == (EVERYTHING, "clock", 0)


async def test_times_go_round_and_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    file = tmp_path / "multidrop.toml"
    file.write_text('# mine\n[screen]\ntheme = "multidrop-light"\n')
    async with CellSession(tmp_path, CELL) as cell:
        shelf = cell.session.front.transcripts = Shelf()
        await cell.session.run("/times")
        assert (shelf.form, configuration.load().screen.times) == ("start", "start")
        await cell.session.run("/times last")
        assert file.read_text() == '# mine\n[screen]\ntheme = "multidrop-light"\ntimes = "last"\n'
        file.write_text("[[")
        await cell.session.run("/times off")
        assert shelf.form == "off", "a broken configuration keeps nobody from working"
        said = [each for each in cell.events if isinstance(each, Notified)][-1]
        assert said.warning and "not kept" in said.text
        assert file.read_text() == "[["


async def test_without_a_screen_they_are_refused_in_one_line(tmp_path: Path) -> None:
    async with CellSession(tmp_path, CELL) as cell:
        for line in ("/times off", "/filter mine", "/save talk.txt", "/unsent"):
            with pytest.raises(Diagnostic, match="only the screen has a transcript"):
                await cell.session.run(line)
