"""The pages of macros and of traffic: what they show, and the lines that their keys send."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from textual.pilot import Pilot

from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus
from multidrop.tui.frame_scheduler import Frames
from multidrop.tui.screens.macros import Listed, MacrosPage, macro_row, step_rows
from multidrop.tui.screens.program import ProgramPage
from multidrop.tui.screens.traffic import TrafficPage
from tests.support.fake_session import FakeMacro, demo_session, make_app, settle
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui


async def until(pilot: Pilot[int], true: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not true():
            await pilot.pause(0.01)
            pilot.app.tick()  # type: ignore[attr-defined]


def text(row: tuple[tuple[str, str], ...]) -> str:
    return "".join(part for part, _ in row)


def test_a_macro_shows_its_key_with_the_page_and_a_broken_file_its_reason() -> None:
    row = text(macro_row(Listed("lift", FakeMacro("lift", "F3", "up", "2")), None, 80, True))  # type: ignore[arg-type]
    assert row.startswith("▸lift") and "F3.2" in row and row.rstrip().endswith("up")
    assert "✗ no name" in text(macro_row(Listed("bad", None, "no name"), None, 80, False))


def test_the_step_of_a_macro_that_plays_is_marked_and_kept_in_view() -> None:
    each = Listed("long", FakeMacro("long", lines=tuple(f"MR {n}" for n in range(50))))  # type: ignore[arg-type]
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
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await pilot.press("down", "enter")
        await until(pilot, lambda: [line for line, _ in session.lines] == ["/play shuttle"])
        await pilot.press("k", "backspace", "backspace", *"f4.2", "enter")
        await until(pilot, lambda: session.lines[-1][0] == "/key F4 shuttle --page 2")
        await pilot.press("delete", "enter")
        await settle(pilot)
        assert len(session.lines) == 2 and isinstance(app.screen, MacrosPage)
        await pilot.press("e")
        await until(pilot, lambda: isinstance(app.screen, ProgramPage) and bool(app.screen.findings.problems))
        assert isinstance(app.screen, ProgramPage) and "after" in app.screen.findings.problems[0].what


async def test_a_name_that_is_typed_on_the_page_plays_no_other_macro() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await pilot.press(*"go", "enter")
        await settle(pilot)
        assert session.lines == [] and "▸" not in app.screen.lines("macros").plain  # type: ignore[attr-defined]
        assert "nothing plays" in app.screen.lines("heading").plain  # type: ignore[attr-defined]
        await pilot.press("down", "enter")
        await until(pilot, lambda: len(session.lines) == 1)


async def test_a_held_enter_plays_once_and_the_end_of_a_macro_waits_for_no_line_before_it() -> None:
    session = demo_session()
    session.gate = asyncio.Event()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "shuttle" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        await pilot.press("down", *["enter"] * 20, "s")
        await until(pilot, lambda: [line for line, _ in session.lines] == ["/play shuttle", "/play stop shuttle"])
        session.time += 1
        await pilot.press("enter")  # the session says that it plays
        await until(pilot, lambda: len(session.lines) == 3)
        session.gate.set()


async def test_traffic_can_be_paused_looked_back_and_shown_with_polls() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        for number in range(60):
            session.emit(OnBus("press", Traffic(session.time, True, f"aPR {number}\n".encode())))
        await app.run_action("act.page('traffic')")
        await settle(pilot)
        page = app.screen
        assert isinstance(page, TrafficPage)
        assert "aPR 59·" in page.lines("traffic").plain and "61 50 52 20 35 39 0A" in page.lines("traffic").plain
        await pilot.press("space")
        session.emit(OnBus("press", Traffic(session.time, True, b"aMR 5\n")))
        await settle(pilot)
        assert "aMR 5" not in page.lines("traffic").plain and "1 pieces came" in page.lines("heading").plain
        await pilot.press("home", "h")
        await settle(pilot)
        assert "aPR 0\\n" in page.lines("traffic").plain and "61 50" not in page.lines("traffic").plain
        await pilot.press("end")
        await settle(pilot)
        assert "aMR 5" in page.lines("traffic").plain
