"""The pages of macros and of traffic, and a macro in the editor: what they show, and what their keys send."""

from __future__ import annotations

import asyncio
from pathlib import Path
from types import SimpleNamespace

import pytest
from textual import events

from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus
from multidrop.tui.frame_scheduler import Frames
from multidrop.tui.screens.macros import ListedMacro, MacrosPage, macro_row, step_rows
from multidrop.tui.screens.program import ProgramPage
from multidrop.tui.screens.traffic import TrafficPage
from tests.support.fake_session import FakeMacro, FakeMacros, demo_session, emit, make_app, on_screen, press, settle
from tests.support.real_screen import until
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui


def text(row: tuple[tuple[str, str], ...]) -> str:
    return "".join(part for part, _ in row)


def test_a_macro_shows_its_key_with_the_page_and_a_broken_file_its_reason() -> None:
    row = text(macro_row(ListedMacro("lift", FakeMacro("lift", "F3", "up", "2")), None, 80, True))  # type: ignore[arg-type]
    assert row.startswith("▸lift") and "F3.2" in row and row.rstrip().endswith("up")
    assert "✗ no name" in text(macro_row(ListedMacro("bad", None, "no name"), None, 80, False))


def test_the_step_of_a_macro_that_plays_is_marked_and_kept_in_view() -> None:
    each = ListedMacro("long", FakeMacro("long", lines=tuple(f"MR {n}" for n in range(50))))  # type: ignore[arg-type]
    playing = SimpleNamespace(name="long", step=40, steps=50, short="")
    rows = [text(row) for row in step_rows(each, playing, 40, 5)]
    assert len(rows) == 5 and [row for row in rows if "▶" in row] == [" ▶  40  MR 39".ljust(40)]
    assert "step 40 of 50" in text(macro_row(each, playing, 80, False))


async def test_what_was_read_is_painted_though_nothing_else_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Frames, "age", lambda self: None)
    app = make_app(demo_session())
    async with app.run_test(size=(80, 24)) as pilot:
        await app.run_action("act.page('macros')")
        assert "no macro yet" not in app.screen.lines("macros").plain  # type: ignore[attr-defined]
        async with asyncio.timeout(PATIENCE):
            while "shuttle" not in app.screen.lines("macros").plain:  # type: ignore[attr-defined]
                await pilot.pause(0.01)


async def test_macros_are_played_put_on_a_key_deleted_and_edited_by_keys(tmp_path: Path) -> None:
    session = demo_session()
    (tmp_path / "shuttle.toml").write_text('name = "shuttle"\n[[step]]\nline = "MR 5"\nafter = "soon"\n')
    session.macros.path = lambda name: tmp_path / f"{name}.toml"  # type: ignore[attr-defined]
    async with on_screen(session) as (pilot, app, _):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await until(pilot, lambda: app.keyboard.idle)
        app.model.changed = True
        await settle(pilot)
        await pilot.press("down", "enter")
        for _ in range(500):
            await pilot.pause(0.01)
            if session.lines:
                break
        else:  # the list was read again in between: an Enter for what is not shown yet plays nothing
            await pilot.press("enter")
        await until(pilot, lambda: [line for line, _ in session.lines] == ["/play shuttle"])
        await pilot.press("ctrl+k", "backspace", "backspace", *"f4.2", "enter")
        await until(pilot, lambda: session.lines[-1][0] == "/key F4 shuttle --page 2")
        await press(pilot, "delete", "enter")
        assert len(session.lines) == 2 and isinstance(app.screen, MacrosPage)
        await pilot.press("ctrl+e")
        await until(pilot, lambda: isinstance(app.screen, ProgramPage) and bool(app.screen.findings.problems))
        assert isinstance(app.screen, ProgramPage) and "after" in app.screen.findings.problems[0].what


async def test_a_name_that_is_typed_on_the_page_plays_no_other_macro() -> None:
    async with on_screen() as (pilot, app, session):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await press(pilot, *"go", "enter")
        assert session.lines == [] and "no macro has that" in app.screen.lines("macros").plain  # type: ignore[attr-defined]
        await press(pilot, "backspace", "backspace")
        for key in (*"shut", "enter"):  # in one read: the rows were not shown when Enter was typed
            app.post_message(events.Key(key, key if len(key) == 1 else None))
        await settle(pilot)
        assert session.lines == [] and "home-all" not in app.screen.lines("macros").plain  # type: ignore[attr-defined]
        await press(pilot, "enter")
        assert [line for line, _ in session.lines] == ["/play shuttle"]


async def test_a_whole_name_that_is_typed_ahead_plays_that_macro() -> None:
    async with on_screen() as (pilot, app, session):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await press(pilot, *"shuttle", "enter")
        assert [line for line, _ in session.lines] == ["/play shuttle"]


async def test_a_macro_is_played_as_often_as_was_typed_and_a_stop_closes_the_question() -> None:
    async with on_screen() as (pilot, app, session):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await press(pilot, *"shuttle", "ctrl+t", "5", "ctrl+x", "enter")
        assert isinstance(app.screen, MacrosPage) and not any("--times" in line for line, _ in session.lines)
        session.lines.clear()
        await press(pilot, "ctrl+t", "escape")
        assert session.lines == []
        await press(pilot, "ctrl+t", "5", "enter")
        assert [line for line, _ in session.lines] == ["/play shuttle --times 5"]


async def test_tab_turns_the_page_of_keys() -> None:
    session = demo_session()
    session.macros = FakeMacros(FakeMacro("a", "F3"), FakeMacro("b", "F3", page="jog"))
    async with on_screen(session) as (pilot, app, _):
        await press(pilot, "ctrl+k")
        before = app.macros.page
        await press(pilot, "tab")
        assert (before, app.macros.page) == ("1", "jog")
        await press(pilot, "escape")
        assert "^K keys jog" in app.main.lines("footer").plain


async def test_a_held_enter_plays_once_and_the_end_of_a_macro_waits_for_no_line_before_it() -> None:
    session = demo_session()
    session.gate = asyncio.Event()
    async with on_screen(session) as (pilot, app, _):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await pilot.press("down", *["enter"] * 20, "ctrl+b")
        await until(pilot, lambda: [line for line, _ in session.lines] == ["/play shuttle", "/play stop shuttle"])
        session.time += 1
        await settle(pilot)
        await pilot.press("enter")  # the session says that it plays
        await until(pilot, lambda: len(session.lines) == 3)
        session.gate.set()


async def test_traffic_can_be_paused_looked_back_and_shown_with_polls() -> None:
    async with on_screen() as (pilot, app, session):
        for number in range(60):
            session.emit(OnBus("press", Traffic(session.time, True, f"aPR {number}\n".encode())))
        await app.run_action("act.page('traffic')")
        await settle(pilot)
        page = app.screen
        assert isinstance(page, TrafficPage)
        assert "aPR 59·" in page.lines("traffic").plain and "61 50 52 20 35 39 0A" in page.lines("traffic").plain
        await pilot.press("space")
        await emit(pilot, OnBus("press", Traffic(session.time, True, b"aMR 5\n")))
        assert "aMR 5" not in page.lines("traffic").plain and "1 piece came" in page.lines("heading").plain
        await press(pilot, "home", "f")
        assert "aPR 0\\n" in page.lines("traffic").plain and "61 50" not in page.lines("traffic").plain
        await press(pilot, "end")
        assert "aMR 5" in page.lines("traffic").plain


# A macro in the editor


TEXT = "# mine\nname = 'm'\n[[step]]\nline = 'MR 1'\n"


async def test_a_wrong_macro_is_not_saved_and_a_right_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    path = tmp_path / "m.toml"
    path.write_text(TEXT)
    async with on_screen(width=100, height=30) as (pilot, app, session):
        await settle(pilot)
        assert session.front.edit is not None
        await session.front.edit(str(path))
        async with asyncio.timeout(PATIENCE):
            while not isinstance(app.screen, ProgramPage) or app.screen.text is None:
                await pilot.pause(0.01)
        page = app.screen
        page.editor.text = TEXT.replace("line", "lin")
        assert not await page.file.save()
        assert path.read_text() == TEXT
        app.tick()
        told = [record.text for record in app.last_records(10) if "not saved" in record.text]
        assert told[0].startswith(f"{path}:4:1: step 1: unknown key 'lin'")
        assert told[0].endswith("not saved: the macro is as it was, and this text stays")
        page.editor.text = TEXT.replace("1", "2")
        assert await page.file.save()
        assert path.read_text() == TEXT.replace("1", "2")
