"""Search, filter, pause, pick and save on the screen, by keys and by typed verbs."""

import asyncio
from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Unsolicited
from multidrop.shell.events import By, Entered, OnBus, Printed
from multidrop.shell.roles import Filter
from multidrop.tui.app import MultidropApp
from multidrop.tui.outbox import BURST
from multidrop.tui.screens.dialogs import LEAST_SIZE, Confirm
from multidrop.tui.widgets.search_bar import MOST_COPIED
from tests.support.fake_session import (
    FakeSession,
    a_talk,
    demo_session,
    emit,
    make_app,
    on_screen,
    press,
    readable,
    settle,
)

pytestmark = pytest.mark.tui


def plain(app: MultidropApp) -> str:
    return app.main.page("press").plain


async def begun(pilot: Pilot[int], session: FakeSession) -> None:
    await pilot.pause()
    await emit(pilot, *a_talk(session))


async def test_a_search_narrows_as_it_is_typed_and_steps_through_the_matches() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        await pilot.press(*"MR", "ctrl+f", *"pr")
        assert "►12:40:64" not in plain(app)
        assert [row[0] for row in plain(app).split("\n") if "PR" in row] == ["•", "►"]
        assert "2 of 2" in app.main.query_one("#find-words").plain  # type: ignore[attr-defined]
        await pilot.press("up")
        assert [row[0] for row in plain(app).split("\n") if "PR" in row] == ["►", "•"]
        await pilot.press("escape")
        assert "►" not in plain(app)
        assert app.main.entry.value == "MR", "the line that was begun is still there"
        await pilot.press(*" 5", "enter")
        assert session.lines == [("MR 5", By.OPERATOR)]


async def test_on_the_smallest_screen_there_is_room_for_the_searched_text() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=LEAST_SIZE) as pilot:
        await begun(pilot, session)
        await press(pilot, "ctrl+f", *"pr")
        assert app.main.query_one("#find").size.width >= 14
        assert "2 of 2" in app.main.query_one("#find-words").plain  # type: ignore[attr-defined]


async def test_tab_in_a_search_shows_only_what_was_found() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        await press(pilot, "ctrl+f", *"vm", "tab")
        shown = [row for row in plain(app).split("\n") if row.strip()]
        assert [row[20:] for row in shown[:-1]] == ["VM=600000"]
        assert 'only "vm"' in shown[-1] and "/filter off" in shown[-1]
        assert app.focused is app.main.entry


async def test_an_answer_is_found_among_a_thousand_prints_of_a_program() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        assert session.front.transcripts is not None
        session.front.transcripts.choose(Filter(mine=True))
        for n in range(12):
            session.emit(OnBus("press", Unsolicited(session.time, tuple(f"tick {n}" for _ in range(90)))))
            if n == 5:
                session.emit(Entered(session.time, "PR P", By.OPERATOR, "press", "a"))
                session.emit(Entered(session.time, "PR V", By.MACRO, "press", "a"))
                session.emit(Printed(session.time, "press", "a", "0", By.MACRO))
                await emit(pilot, Printed(session.time, "press", "a", "4711"))
        shown = plain(app)
        assert "PR P" in shown and "4711" in shown
        assert "tick" not in shown and "» PR V" not in shown
        assert "only mine" in shown


async def test_a_stop_closes_the_search_and_reports_no_searched_text_as_a_line() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        await press(pilot, "ctrl+f", *"pr", "ctrl+x")
        assert not app.main.reader.open
        assert app.focused is app.main.entry
        assert "not sent" not in plain(app)


async def test_a_paused_view_says_so_and_a_typed_line_ends_the_pause() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        await emit(pilot, *(Printed(session.time, "press", "a", f"{n}") for n in range(20)))
        await pilot.press("ctrl+b")
        await emit(pilot, *(Printed(session.time, "press", "a", f"{n}") for n in range(40)))
        assert "PAUSED   40 new below   Ctrl+B: go on" in plain(app)
        await press(pilot, *"PR P", "enter")
        assert "PAUSED" not in plain(app) and "› PR P" in plain(app)


async def test_lines_are_picked_and_copied_by_keys_alone() -> None:
    session = demo_session()
    app = make_app(session)
    copied: list[str] = []
    async with app.run_test(size=(80, 24)) as pilot:
        app.copy_to_clipboard = copied.append  # type: ignore[method-assign]
        await begun(pilot, session)
        await pilot.press("shift+up", "shift+up", "shift+up")
        assert "3 lines" in app.main.query_one("#pick").plain  # type: ignore[attr-defined]
        assert sum(row.startswith("▌") for row in plain(app).split("\n")) == 3
        await pilot.press("enter")
        assert copied == ["at home\x06\n@* SL 0\nno drive answers a global command"]
        await pilot.press("shift+up", "up", "space", "up", "escape")
        assert len(copied) == 1 and app.focused is app.main.entry


async def test_more_than_a_terminal_takes_is_not_copied() -> None:
    session = demo_session()
    app = make_app(session)
    copied: list[str] = []
    async with app.run_test(size=(80, 24)) as pilot:
        app.copy_to_clipboard = copied.append  # type: ignore[method-assign]
        await begun(pilot, session)
        await emit(pilot, Printed(session.time, "press", "a", "x" * (MOST_COPIED + 1)))
        await pilot.press("shift+up", "enter")
        assert copied == [] and app.main.reader.open


async def test_the_shown_lines_are_saved_with_their_times_and_replace_no_file(tmp_path: Path) -> None:
    async with on_screen() as (pilot, _, session):
        await begun(pilot, session)
        shelf = session.front.transcripts
        assert shelf is not None
        file = tmp_path / "talk.txt"
        session.now = lambda: asyncio.get_running_loop() and session.time  # type: ignore[method-assign]
        shelf.choose(Filter(errors=True))
        assert await shelf.save(str(file)) == f"2 lines, only errors, in {file}"
        assert file.read_text(encoding="utf-8").split("\n")[0] == "2026-11-21 12:41:04.000  b   › @b PR VX"
        with pytest.raises(Diagnostic, match="exists already"):
            await shelf.save(str(file))


async def test_times_are_those_that_were_asked_for_on_every_page() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        shelf = session.front.transcripts
        assert shelf is not None
        shelf.set_times("last")
        assert [row[:9].strip() for row in plain(app).split("\n")[:4]] == ["", "+0.400", "+3.600", "+0.000"]
        shelf.set_times("start")
        assert [row[:9].strip() for row in plain(app).split("\n")[:3]] == ["0.000", "0.400", "4.000"]
        shelf.set_times("off")
        assert plain(app).startswith(" gantry › VM=600000")
        assert app.main.page("eth").clocks.form == "off"


async def test_in_raw_mode_a_line_keeps_its_spaces_and_enter_alone_ends_one() -> None:
    async with on_screen() as (pilot, app, session):
        await begun(pilot, session)
        await pilot.press("enter", *"  PR P ", "enter")
        session.raw.add("press")
        await settle(pilot)
        assert "/raw off ends" in app.main.lines("label").plain
        await press(pilot, "enter", *"  PR P ", "enter")
        assert [line for line, _ in session.lines] == ["PR P", "/bytes 0D", "  PR P "]
        await pilot.press(*" /stop ", "enter")
        assert session.stops == 1, "a verb is a verb, and the stop waits for nothing"


async def test_lines_that_were_not_sent_are_offered_and_keys_typed_ahead_agree_to_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 1e6)  # keys count once the test says so
    session = demo_session()
    session.refuses["BAD"] = "a: 20 unknown"
    async with on_screen(session) as (pilot, app, _):
        await begun(pilot, session)
        app.outbox.paste(["BAD", "MR 1", "MR 2"])
        await settle(pilot)
        await pilot.pause(BURST + 0.1)
        await settle(pilot)
        assert "offers them again" in plain(app)
        assert session.front.transcripts is not None
        await session.front.transcripts.offer_unsent()
        await pilot.press("enter")
        assert isinstance(app.screen, Confirm) and [line for line, _ in session.lines] == ["BAD"]
        readable(pilot)
        await press(pilot, "enter")
        assert [line for line, _ in session.lines] == ["BAD", "MR 1", "MR 2"]
        with pytest.raises(Diagnostic, match="every line was sent"):
            await session.front.transcripts.offer_unsent()
