"""A program on a real Session with a simulated drive: an error is made and mended, then it runs and is stopped."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from textual import events
from textual.pilot import Pilot

from multidrop.shell.connect.settings import Settings
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.screens.dialogs import Confirm, Search
from multidrop.tui.screens.program import ProgramPage
from tests.support.until import PATIENCE

pytestmark = [pytest.mark.tui, pytest.mark.slow]

TEXT = "PG 1\nLB G1\n MA 5120000\n H\n MA 0\n H\n BR G1\n E\nPG\n"


async def until(pilot: Pilot[int], true: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not true():
            await pilot.pause(0.02)


def typed(pilot: Pilot[int], *pieces: str) -> None:
    """Keys by name, and texts as pastes, without a pause between them."""
    for piece in pieces:
        named = "+" in piece or piece in ("enter", "end", "backspace", "escape")
        pilot.app.post_message(events.Key(piece, None) if named else events.Paste(piece))


async def test_a_program_is_mended_downloaded_traced_and_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("multidrop.tui.screens.edit.PAUSE", 0.05)
    (tmp_path / "long.mxt").write_text(TEXT)
    settings = Settings(folder=tmp_path / "config", state=tmp_path / "state")
    session = Session(settings)
    app = MultidropApp(session, ["sim:#eth"], Assist(session, settings))
    try:
        async with app.run_test(size=(80, 24)) as pilot:
            await until(pilot, lambda: session.selected is not None)
            typed(pilot, "ctrl+e")
            await until(pilot, lambda: isinstance(app.screen, Search))
            typed(pilot, "long", "enter")
            await until(pilot, lambda: isinstance(app.screen, ProgramPage))
            page = app.screen
            assert isinstance(page, ProgramPage)
            typed(pilot, "end", "Z")
            await until(pilot, lambda: bool(page.findings.problems))
            typed(pilot, "backspace")
            await until(pilot, lambda: not page.findings.problems and not page.findings.pending)
            typed(pilot, "ctrl+d")
            await until(pilot, lambda: isinstance(app.screen, Confirm))
            typed(pilot, "enter")
            await until(pilot, lambda: len(page.findings.addresses) == 7)
            typed(pilot, "ctrl+r")
            await until(pilot, lambda: isinstance(app.screen, Search))
            typed(pilot, "trace g1", "enter")
            await until(pilot, lambda: "▶" in page.editor.render_line(3).text)
            await until(pilot, lambda: "executes" in page.lines("below").plain)
            await until(pilot, lambda: "▶ moving" in page.lines("top").plain)
            typed(pilot, "ctrl+x")
            await until(pilot, lambda: "velocity 0" in page.query_one(".banner").plain)  # type: ignore[attr-defined]
            await until(pilot, lambda: "▶" not in page.editor.render_line(3).text)
            assert app.screen is page and page.editor.text == TEXT
            assert next(iter((tmp_path / "state" / "backups").iterdir())).suffix == ".mxt"
    finally:
        await session.close()
