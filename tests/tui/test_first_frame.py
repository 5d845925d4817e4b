"""The first frame: what it does not wait for."""

import subprocess
import sys

import pytest
from textual.css.stylesheet import Stylesheet

from multidrop.tui.screens.page import PAGES
from tests.support.fake_session import demo_session, make_app
from tests.support.processes import environment, names_of_packages
from tests.support.until import PATIENCE

CHILD = """
import asyncio, sys
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.launch import driver
from multidrop.shell.configuration import load
from multidrop.shell.prompt.collector import collected_at_rest
from multidrop.shell.log.writer import begin
from multidrop.shell.session import Session
from multidrop.tui.screens.start import Opener

driver()
displayed = []
display = MultidropApp._display
def displays(self, screen, renderable):
    display(self, screen, renderable)
    displayed.append(self.main.lines("footer").plain)
MultidropApp._display = displays

async def opens(self, urls):
    print(*sys.modules, flush=True)
    print(displayed[-1], flush=True)
    self._app.exit(0)
Opener.open_all = opens

async def main():
    settings = load()
    session = Session(settings)
    with collected_at_rest(lambda: True):
        app = MultidropApp(session, ["sim:"], Assist(session, settings))
        begin(session)
        await app.run_async(headless=True, size=(120, 40))
    await session.open("sim:#press")
    await app.assist.prepare()
    before = set(sys.modules)
    for text in ("M", "PR V", "/"):
        app.assist.hint(text), app.assist.complete(text)
    print(*set(sys.modules) - before)
    await session.close()
asyncio.run(main())
"""
LATER = {
    *(f"multidrop.tui.screens.{page.place.partition(':')[0]}" for page in PAGES),
    *(
        "multidrop.tui.editor",
        "multidrop.shell.prompt.complete",
    ),
    *(
        "multidrop.families.lexium.host.mcode.family",
        "multidrop.families.pmx.host.family",
        "multidrop.families.tmcl.host.family",
        "multidrop.families.lexium.host.modbus.family",
    ),
    *(
        "multidrop.simulator.floor",
        "multidrop.families.lexium.simulator",
        "serial",
        "prompt_toolkit",
        "pymodbus",
        "tomlkit",
    ),
    *("rerun", "numpy", "pyarrow", "importlib.metadata"),
}


@pytest.mark.process
def test_the_first_frame_imports_no_page_no_family_and_no_simulator_and_the_first_letter_nothing(tmp_path):
    names_of_packages(tmp_path)
    child = [sys.executable, "-c", CHILD]
    done = subprocess.run(
        child, capture_output=True, text=True, timeout=PATIENCE, cwd=tmp_path, env=environment(tmp_path)
    )
    modules, footer, *letter = done.stdout.splitlines() or [done.stderr, ""]
    imported = set(modules.split())
    assert "multidrop.tui.app" in imported, done.stderr
    assert sorted(imported & LATER) == []
    assert "STOP ALL" in footer  # all was painted before anything was opened
    assert letter == [""], done.stderr


@pytest.mark.tui
async def test_the_style_sheet_is_read_once_at_the_start_and_again_for_other_colours(monkeypatch):
    read = []
    again = Stylesheet.reparse
    monkeypatch.setattr(Stylesheet, "reparse", lambda self: (read.append(1), again(self)))
    app = make_app(demo_session())
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.pause()
        assert read == []
        app.theme = "multidrop-light"
        await pilot.pause()
        assert read == [1]


@pytest.mark.tui
async def test_what_the_first_letter_needs_is_made_ready_once_lines_are_open(monkeypatch):
    ready = []
    app = make_app(demo_session(), "sim:")

    async def opened(urls):
        ready.append("opened")

    async def prepare():
        ready.append("prepared")

    monkeypatch.setattr(app.opener, "open_all", opened)
    monkeypatch.setattr(app.assist, "prepare", prepare)
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.pause()
        await app.workers.wait_for_complete()
        assert ready == ["opened", "prepared"]
