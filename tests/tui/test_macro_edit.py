"""A macro in the editor of the screen: a wrong text is not saved, and nothing of it is lost."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.tui.screens.program import ProgramPage
from tests.support.fake_session import demo_session, make_app, settle
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui
TEXT = "# mine\nname = 'm'\n[[step]]\nline = 'MR 1'\n"


async def test_a_wrong_macro_is_not_saved_and_a_right_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    path = tmp_path / "m.toml"
    path.write_text(TEXT)
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(100, 30)) as pilot:
        await settle(pilot)
        assert session.front.edit is not None
        await session.front.edit(str(path))
        async with asyncio.timeout(PATIENCE):
            while not isinstance(app.screen, ProgramPage) or app.screen.text is None:
                await pilot.pause(0.01)
        page = app.screen
        page.editor.text = TEXT.replace("line", "lin")
        assert not await page.save()
        assert path.read_text() == TEXT
        app.tick()
        told = [record.text for record in app.last_records(10) if "not saved" in record.text]
        assert told[0].startswith(f"{path}:4:1: step 1: unknown key 'lin'")
        assert told[0].endswith("not saved: the macro is as it was, and this text stays")
        page.editor.text = TEXT.replace("1", "2")
        assert await page.save()
        assert path.read_text() == TEXT.replace("1", "2")
