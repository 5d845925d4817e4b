"""The set-up of a drive: checked whole, written into the configuration with its comments, in force at once."""

from __future__ import annotations

import os
import tomllib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.dialects.units import Basis, scale
from multidrop.dialects.written_scales import preview, written
from multidrop.shell import configuration
from multidrop.shell.drive_setup import SetupChange, scale_of
from multidrop.shell.events import By, Notified, Output
from multidrop.shell.session import Session
from tests.support.cell_session import bus, party, pmx

CELL = bus("press", party("a"), party("b"), baud=0)
ARM = bus("press", pmx("00"), baud=0)
FILE = """# the shop
[connections.press]   # left
url = "sim:cell.toml"
names = { b = "clamp" }   # names
units = { b = { scale = "1 mm/turn", zero = "2 mm" } }

[log]
files = 4   # few
"""


class Desk:
    """An open session, and its configuration file."""

    def __init__(self, session: Session, file: Path) -> None:
        self.session, self.file = session, file
        self.events: list[object] = []
        session.subscribe(self.events.append)

    async def run(self, *lines: str) -> list[str]:
        """Run lines; return what they print."""
        self.events.clear()
        for line in lines:
            await self.session.run(line)
        return [each.text for each in self.events if isinstance(each, Output)]

    @property
    def connection(self) -> dict[str, object]:
        return tomllib.loads(self.file.read_text())["connections"]["press"]  # type: ignore[no-any-return]


@asynccontextmanager
async def desk(
    folder: Path, monkeypatch: pytest.MonkeyPatch, text: str = FILE, cell: str = CELL, url: str = "press"
) -> AsyncIterator[Desk]:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(folder))
    (folder / "cell.toml").write_text(cell)
    file = folder / "multidrop.toml"
    file.write_text(text)
    session = Session(replace(configuration.load(), folder=folder, state=folder / "state", data=folder / "data"))
    try:
        await session.open(url if url == "press" else f"{url}{folder / 'cell.toml'}")
        yield Desk(session, file)
    finally:
        await session.close()


virtual = pytest.mark.virtual


@virtual
async def test_a_scale_is_written_with_the_comments_kept_and_lines_take_quantities_at_once(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        printed = await shop.run("/setup a --name gantry --scale '5 mm/turn' --travel '0 to 300' --zero 12")
        assert "gantry: one turn = 5 mm = 51200 steps, 1 mm = 10240 steps" in printed
        text = shop.file.read_text()
        for comment in ("# the shop", "# left", "# names", "# few"):
            assert comment in text
        assert shop.connection["names"] == {"b": "clamp", "a": "gantry"}
        units = {"scale": "5 mm/turn", "zero": "12 mm", "travel": "0..300 mm"}
        assert shop.connection["units"] == {"b": {"scale": "1 mm/turn", "zero": "2 mm"}, "a": units}
        assert shop.session.drive("press", "gantry").address == "a"
        await shop.run("/units here a 12 mm", "@a MR {1 mm}", "/wait stopped")
        assert (await shop.session.drive("press", "a").motion())[0].position == 10240


@virtual
async def test_only_what_is_given_changes_and_an_empty_value_removes(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        await shop.run("/setup b --zero ''", "/setup b --name ''")
        assert shop.connection == {"url": "sim:cell.toml", "units": {"b": {"scale": "1 mm/turn"}}}
        await shop.run("/setup b --scale ''")
        assert shop.connection == {"url": "sim:cell.toml"}
        assert shop.session.units.of(shop.session.drive("press", "b")) is None


WRONG = [
    ("/setup a --scale '5 furlong/turn'", "no unit furlong"),
    ("/setup a --scale 0", "is no scale"),
    ("/setup a --travel '0..3 mm'", "travel needs a scale"),
    ("/setup b --travel '3..1 mm'", "ends where it begins, or before; write the lower end first"),
    ("/setup b --zero '3 deg'", "the scale is in mm"),
    ("/setup b --full-steps 1.5", "not a whole number"),
    ("/setup a --name 'x y'", "is not a name"),
    ("/setup a --name clamp", "press:b is called clamp already"),
    ("/setup a --name b", "press:b is called b already"),
    ("/setup a --guard maybe", "on"),
    ("/setup a --ask-before NOWORD", "no drive has a word NOWORD"),
    ("/setup z --name x", "no drive z"),
]


@virtual
@pytest.mark.parametrize(("line", "why"), WRONG)
async def test_a_wrong_value_is_one_line_and_changes_nothing(tmp_path, monkeypatch, line, why):
    async with desk(tmp_path, monkeypatch) as shop:
        before = shop.session.settings
        with pytest.raises(Diagnostic, match=why) as failure:
            await shop.run(line)
        assert "\n" not in str(failure.value)
        assert shop.file.read_text() == FILE and shop.session.settings == before
        assert shop.session.drive("press", "a").label == ""


@virtual
async def test_a_controller_that_reports_no_turn_takes_a_scale_by_the_step_for_each_axis(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch, '[connections.press]\nurl = "sim:cell.toml"\n', ARM) as shop:
        with pytest.raises(Diagnostic, match="give the scale by the step"):
            await shop.run("/setup 00.x --scale '5 mm/turn'")
        await shop.run("/setup 00.x --scale '0.4 um/step'", "/setup 00.y --scale '-1 mm/step'")
        assert shop.connection["units"] == {"00.x": "0.4 um/step", "00.y": "-1 mm/step"}
        await shop.run("INC", "X{2 mm}")


@virtual
async def test_a_line_that_is_not_saved_is_saved_with_the_change(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch, "# mine\n", url="sim:") as shop:
        with pytest.raises(Diagnostic, match="is not a saved connection; nothing was changed; --save-as"):
            await shop.run("/setup a --name gantry")
        assert shop.file.read_text() == "# mine\n"
        await shop.run("/setup a --name gantry --save-as press")
        assert shop.file.read_text().startswith("# mine\n") and shop.connection["names"] == {"a": "gantry"}
        await shop.run("/setup a --scale '5 mm/turn'")
        assert shop.connection["units"] == {"a": "5 mm/turn"}


@virtual
async def test_what_asks_first_is_of_every_drive_and_in_force_at_once(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        await shop.run("/setup a --guard off --ask-before s,ex")
        assert tomllib.loads(shop.file.read_text())["guards"] == {"off": ["TRAVEL"], "also": ["S", "EX"]}
        with pytest.raises(Diagnostic, match="also has EX"):
            shop.session.questions.agreed = False
            await shop.run("@a EX 5")
        await shop.run("/setup a --guard on --ask-before s")
        assert tomllib.loads(shop.file.read_text())["guards"] == {"off": [], "also": ["S"]}


@virtual
async def test_a_file_that_is_read_only_or_a_disk_that_is_full_is_reported_and_nothing_changes(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        shop.file.chmod(0o444)
        with pytest.raises(Diagnostic, match="multidrop.toml.*is read-only, so nothing was changed.*chmod u[+]w"):
            await shop.run("/setup a --name gantry")
        shop.file.chmod(0o644)

        def full(*_: object, **__: object) -> None:
            raise OSError(28, os.strerror(28))

        monkeypatch.setattr(configuration, "write_atomically", full)
        with pytest.raises(Diagnostic, match="cannot be written: .*[Nn]o space left"):
            await shop.run("/setup a --name gantry")
        assert shop.file.read_text() == FILE and shop.session.drive("press", "a").label == ""


@virtual
async def test_a_file_that_is_wrong_is_not_written(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        wrong = FILE + "nothing = 1\n"
        shop.file.write_text(wrong)
        with pytest.raises(Diagnostic, match="no key log.nothing"):
            await shop.run("/setup a --name gantry")
        assert shop.file.read_text() == wrong


@virtual
async def test_only_a_person_changes_it_and_anyone_may_look(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        macro = replace(shop.session.origin, by=By.MACRO)
        with pytest.raises(Stopped, match="only when a person types it"):
            await shop.session.run("/setup a --guard off", macro)
        await shop.session.run("/setup a", macro)
        assert shop.file.read_text() == FILE
        assert not [each for each in shop.events if isinstance(each, Notified) and each.warning]


@virtual
async def test_without_options_it_shows_every_axis(tmp_path, monkeypatch):
    async with desk(tmp_path, monkeypatch) as shop:
        printed = await shop.run("/setup a", "/setup b")
        assert printed[:2] == ["a: connection press", "a: no scale; one turn = 51200 steps (MS=256, EE=0, AS=0, RD=0)"]
        assert "clamp: one turn = 1 mm = 51200 steps, 1 mm = 51200 steps" in printed


@virtual
async def test_a_scale_under_the_name_before_stays_with_its_drive(tmp_path, monkeypatch):
    text = FILE.replace("{ b = { scale", "{ clamp = { scale")
    async with desk(tmp_path, monkeypatch, text) as shop:
        await shop.run("/setup b --name vice", "/setup b --zero '3 mm'")
        assert shop.connection["units"] == {"b": {"scale": "1 mm/turn", "zero": "3 mm"}}


# Text


TURN = Basis((("MS", "256"),), turn=51200)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("5 mm/turn", "one turn = 5 mm = 51200 steps, 1 mm = 10240 steps"),
        ("-360 deg/turn", "one turn = -360 deg = 51200 steps, 1 deg = 142.222222 steps"),
        ("0.4 um/step", "one step = 0.4 um, 1 um = 2.5 steps"),
    ],
)
def test_the_preview_of_a_scale(text, said):
    assert preview(scale(text), TURN) == said


def test_a_scale_without_a_reading_has_a_preview_too():
    assert preview(scale("5 mm/turn"), None) == "one turn = 5 mm; the steps of a turn are not read yet"


TEXTS = st.one_of(
    st.none(), st.text(max_size=12), st.sampled_from(["5 mm", "0..3", "1 to 2", "12 mm", "-3 deg/step", ""])
)


@given(st.builds(SetupChange, scale=TEXTS, zero=TEXTS, travel=TEXTS, full_steps=TEXTS))
def test_any_form_is_a_scale_that_is_read_again_or_one_clear_line(change):
    try:
        made = scale_of(None, change, ())
    except Diagnostic:
        return
    if made is not None:
        assert scale(written(made)) == made
