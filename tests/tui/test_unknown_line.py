"""An unknown line on the screen: open, see why not, search and talk with three keys, and nothing typed again."""

import os
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.configuration import Settings
from multidrop.shell.finding import scanning
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.screens.dialogs import GoOn
from multidrop.tui.screens.program import ProgramPage
from multidrop.tui.screens.start import Start
from multidrop.tui.widgets.bars import top_row
from tests.support.cell_session import bus, drive
from tests.support.fake_session import readable, settle
from tests.support.posix import pty, tty
from tests.support.real_screen import real_screen, until
from tests.support.tuned_ports import TunedPipe, lead_to

pytestmark = pytest.mark.tui


def told(app: Any) -> str:
    return "\n".join(record.text for page in app.main.pages.values() for record in page.records)


@pytest.mark.parametrize("size", [(80, 24), (120, 40)], ids=["narrow", "wide"])
async def test_open_see_why_not_search_and_talk_are_three_keys(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    floor = RunningFloor(Floor(read(bus("b", drive("LMDCM"), baud=4800), "cell.toml")))

    async def transport(connection: Any, *_: Any, **given: Any) -> Any:
        return TunedPipe(floor, "b", connection.baud or given.get("baud") or 9600, False)

    lead_to(monkeypatch, transport)
    monkeypatch.setattr(scanning, "WINDOW", 0.002)
    settings = Settings(folder=tmp_path / "config", state=tmp_path / "state", data=tmp_path / "data")
    session = Session(settings, reconnect=True)
    app: Any = MultidropApp(session, [], Assist(session, settings))
    try:
        async with app.run_test(size=size) as pilot:
            await until(pilot, lambda: isinstance(app.screen, Start))
            await pilot.press(*"/dev/ttyUSB9?baud=115200", "enter")
            await until(pilot, lambda: "Enter alone begins it" in told(app))
            await until(pilot, lambda: app.screen is app.main and "? silent" in app.main.lines("top").plain)
            assert "search (about " in told(app) and "no drive replies" in told(app)
            began, tops = session.now(), set[str]()

            def noted(*given: Any) -> Any:
                row = top_row(*given)
                tops.add("".join(text for text, _ in row))
                return row

            monkeypatch.setattr("multidrop.tui.presenter.top_row", noted)
            await pilot.press("enter")
            await until(pilot, lambda: isinstance(app.screen, GoOn) and app.screen.focused is not None)
            await settle(pilot)
            readable(pilot)
            await pilot.press("y")
            await until(pilot, lambda: session.selected is not None)
            assert tops and not any("search" in each or "✗ lost" in each for each in tops), tops
            assert session.now() - began < 30
            await pilot.press(*'PR "talks"', "enter")
            await until(pilot, lambda: "\ntalks" in told(app))
            assert [*session.buses] == ["ttyUSB9"]
    finally:
        await session.close()
        floor.close()


@pytest.mark.pty
async def test_a_line_of_garbage_on_a_terminal_says_so_in_its_tab_and_the_stop_goes_out(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        async with real_screen(tmp_path, os.ttyname(slave), reconnect=True) as pilot:
            app: Any = pilot.app
            await until(pilot, lambda: app.session.buses)
            os.write(master, b"\xff\xfe\x80" * 100)
            await until(pilot, lambda: "Enter alone begins it" in told(app))
            assert "300 bytes came, none of them readable: another baud rate?" in told(app)
            assert app.session.enter_alone() == "/scan"
            await until(pilot, lambda: "? silent" in app.main.lines("top").plain)
            os.read(master, 65536)
            await pilot.press("ctrl+x")
            assert b"\x1b" in os.read(master, 65536)
    finally:
        os.close(master)
        os.close(slave)


async def test_a_url_that_cannot_be_opened_keeps_its_tab_with_its_reason(tmp_path: Path) -> None:
    async with real_screen(tmp_path, "tcp://127.0.0.1:1", reconnect=True) as pilot:
        app: Any = pilot.app
        await until(pilot, lambda: "127.0.0.1 ✗" in app.main.lines("top").plain)
        assert app.screen is app.main
        await until(pilot, lambda: "refused" in told(app) and "trying again" in told(app))
        await pilot.press("ctrl+x")
        await until(pilot, lambda: "NOT REACHED" in app.main.query_one(".banner").plain)


@pytest.mark.parametrize("key, urls", [("ctrl+e", ["sim:#eth"]), ("enter", [])])
async def test_a_wrong_configuration_is_edited_at_its_line_with_one_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, urls: list[str]
) -> None:
    from multidrop.base import places
    from multidrop.shell import configuration

    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    file = places.config_file()
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text('[screen]\ntheme = "multidrop-dark"\n\n[log]\nfiles = "x"\nbytes = "y"\n')
    settings = configuration.load(lenient=True)
    assert len(settings.problems) == 2 and settings.problems[0].where == f"{file}:5"
    session = Session(settings)
    app: Any = MultidropApp(session, urls, Assist(session, settings))
    try:
        async with app.run_test(size=(80, 24)) as pilot:
            await until(pilot, lambda: session.selected if urls else isinstance(app.screen, Start))
            assert not urls or f"^E edits {file}:5" in told(app)
            await pilot.press(key)
            await until(pilot, lambda: isinstance(app.screen, ProgramPage))
            await until(pilot, lambda: app.screen.editor.cursor_location == (4, 0))
            await until(pilot, lambda: len(app.screen.findings.problems) == 2)
            await pilot.press("ctrl+f")
            assert app.screen.editor.cursor_location == (5, 0)
    finally:
        await session.close()


async def test_a_place_without_a_line_is_the_beginning_of_its_file(tmp_path: Path) -> None:
    from multidrop.tui.texts import Texts

    (tmp_path / "a.txt").write_text("one\ntwo\n")
    texts = Texts(None)
    assert texts.open_at(f"{tmp_path}/a.txt:2").cursor == (1, 0)
    assert texts.open_at(f"{tmp_path}/a.txt").cursor == (0, 0)
    with pytest.raises(Diagnostic):
        texts.open_at(str(tmp_path))
