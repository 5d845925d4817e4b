"""A question and a form as dialogs: what was typed ahead answers nothing, a stop closes them, no macro starts."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from textual.pilot import Pilot
from textual.widgets import Static

from multidrop.macros import Macro, MacroStep
from multidrop.shell.macro_arguments import value_fields
from multidrop.tui.screens.dialogs import FormDialog, GoOn
from tests.support.fake_session import FakeSession, demo_session, make_app, on_screen, press, readable, settle
from tests.support.real_screen import until

pytestmark = pytest.mark.tui
WHAT = "a: CP erases every program and every user variable"


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 1e6)  # keys count once a test says so


@asynccontextmanager
async def asked() -> AsyncIterator[tuple[Pilot[int], FakeSession, asyncio.Future[bool]]]:
    """The app with an open question, before keys count."""
    async with on_screen() as (pilot, app, session):
        assert session.front.ask is not None
        answer = asyncio.ensure_future(session.front.ask(WHAT))
        await settle(pilot)
        assert isinstance(app.screen, GoOn)
        yield pilot, session, answer
        answer.cancel()


async def test_a_letter_or_the_list_answers() -> None:
    async with asked() as (pilot, session, answer):
        for keys, expected in {"y": True, "enter": False, "escape": False, "down enter": True}.items():
            readable(pilot)
            await pilot.press(*keys.split())
            assert await answer is expected
            assert session.front.ask is not None
            answer = asyncio.ensure_future(session.front.ask(WHAT))
            await pilot.pause()
        answer.cancel()
        await pilot.pause()
        readable(pilot)
        await press(pilot, *"MR 5", "enter")
        assert session.sent == ["press:a MR 5"]


async def test_a_question_that_is_closed_before_it_is_laid_out_takes_no_room() -> None:
    async with asked() as (pilot, _, answer):
        question = pilot.app.screen
        assert isinstance(question, GoOn)
        readable(pilot)
        await pilot.press("n")
        assert not await answer
        await settle(pilot)
        question.make_room()  # what comes after a refresh comes after the box, where the machine is busy


async def test_keys_typed_ahead_answer_nothing_and_a_function_key_plays_nothing() -> None:
    async with asked() as (pilot, session, answer):
        await press(pilot, "y", "enter")
        assert not answer.done() and isinstance(pilot.app.screen, GoOn)
        readable(pilot)
        await pilot.press("f2")
        assert session.sent == [] and not answer.done()
        await pilot.press("n")
        assert await answer is False and session.sent == []


async def test_a_stop_closes_the_question() -> None:
    async with asked() as (pilot, session, answer):
        await pilot.press("ctrl+x")
        assert session.stops == 1
        await settle(pilot)
        assert await answer is False and pilot.app.screen is pilot.app.main  # type: ignore[attr-defined]


async def test_a_question_that_ends_by_itself_is_closed() -> None:
    async with asked() as (pilot, _, answer):
        answer.cancel()
        await settle(pilot)
        assert pilot.app.screen is pilot.app.main  # type: ignore[attr-defined]


def test_snapshot_of_a_question(snap_compare: Callable[..., bool]) -> None:
    session = demo_session()
    app = make_app(session)
    open_: list[Any] = []

    async def ask(pilot: Pilot[int]) -> None:
        await pilot.pause()
        assert session.front.ask is not None
        open_.append(asyncio.ensure_future(session.front.ask(WHAT)))
        await settle(pilot)

    act: Callable[[Pilot[int]], Awaitable[None]] = ask
    assert snap_compare(app, terminal_size=(80, 24), run_before=act)


async def test_the_box_holds_the_question_alone_and_covers_none_of_the_lines_that_lead_to_it() -> None:
    async with on_screen() as (pilot, app, session):
        app.show_line("/params restore kept.toml", ">")
        for number in range(20):
            app.show_line(f"a: Q{number}=1", "")
        assert session.front.ask is not None
        answer = asyncio.ensure_future(session.front.ask(WHAT))
        await settle(pilot)
        readable(pilot)
        box, transcript = app.screen.query_one(".box"), app.main.transcript
        assert len(box.children) == 3 and box.region.bottom <= transcript.region.y
        assert transcript.plain.splitlines()[-1].endswith("a: Q19=1")
        await press(pilot, *["pageup"] * 6)
        assert "/params restore kept.toml" in transcript.plain and not answer.done()
        height = transcript.size.height
        await pilot.press("y")
        assert await answer is True
        await settle(pilot)
        assert transcript.size.height > height, "the rows of the box are the transcript's again"


async def test_a_low_screen_shows_the_answers_and_the_input_line() -> None:
    async with on_screen(width=60, height=15) as (pilot, app, session):
        app.show_line("a: Q1=1", "")
        assert session.front.ask is not None
        answer = asyncio.ensure_future(session.front.ask(WHAT))
        await settle(pilot)
        assert app.screen.query_one(".keys").region.bottom < app.screen.query_one(".box").region.bottom <= 15
        answer.cancel()


async def test_a_key_that_was_too_early_is_told_in_the_box() -> None:
    async with asked() as (pilot, _, answer):
        assert isinstance(pilot.app.screen, GoOn) and pilot.app.screen.told == ""
        await press(pilot, "y")
        assert "these keys were dropped" in str(pilot.app.screen.query_one(".keys").render()) and not answer.done()
        assert "these keys were dropped" not in pilot.app.main.transcript.plain  # type: ignore[attr-defined]
        readable(pilot)
        await pilot.press("f2")
        assert str(pilot.app.screen.query_one(".keys").render()).startswith("Answer the question first: y or n")


async def test_a_note_takes_rows_of_its_own_and_gives_them_back() -> None:
    async with on_screen() as (pilot, app, _):
        await settle(pilot)
        before = [app.main.entry.region, app.main.lines("status").region]
        app.notify("word " * 30, timeout=0.5)
        await settle(pilot)
        told = app.main.lines("told")
        assert told.region.height == 2 and told.region.y == app.main.transcript.region.bottom
        assert [app.main.entry.region, app.main.lines("status").region] == before
        await until(pilot, lambda: not app.main.lines("told").display)


# A form

MACRO = Macro("m", (MacroStep(0.0, "MR {turns:int=10,1..100}"), MacroStep(0.0, "{mode:choice(slow|fast)} {turns}")))


@asynccontextmanager
async def filling() -> AsyncIterator[tuple[Pilot[int], Any, asyncio.Future[Mapping[str, str] | None]]]:
    """The app with an open form, whose keys count."""
    async with on_screen() as (pilot, app, session):
        assert session.front.fill is not None
        answer = asyncio.ensure_future(session.front.fill("macro m", value_fields(MACRO, {})))
        await settle(pilot)
        assert isinstance(app.screen, FormDialog)
        await pilot.press(*"lost", "enter")  # typed ahead
        readable(pilot)
        yield pilot, session, answer
        answer.cancel()


def wrong(pilot: Pilot[int]) -> str:
    return str(pilot.app.screen.query_one("#wrong", Static).render())


async def test_the_form_begins_where_a_value_is_needed_and_gives_all_values() -> None:
    async with filling() as (pilot, session, answer):
        await pilot.press("enter")
        assert wrong(pilot) == "mode: a value is needed" and not answer.done()
        await pilot.press(*"quick", "enter")
        assert wrong(pilot) == "macro m: invalid mode = 'quick'; valid: slow or fast"
        await pilot.press("ctrl+u", *"fast", "up", "ctrl+u", *"500", "down", "enter")
        assert wrong(pilot) == "macro m: invalid turns = '500'; valid: a whole number, 1 to 100"
        await pilot.press("f2")
        assert session.sent == [] and not answer.done()
        await pilot.press("ctrl+u", "enter", "enter")
        assert await answer == {"turns": "10", "mode": "fast"}


async def test_escape_gives_no_values_and_a_stop_closes_the_form() -> None:
    async with filling() as (pilot, session, answer):
        await pilot.press("escape")
        assert await answer is None
    async with filling() as (pilot, session, answer):
        await press(pilot, "ctrl+x")
        assert session.stops == 1 and not isinstance(pilot.app.screen, FormDialog)
        assert await answer is None
