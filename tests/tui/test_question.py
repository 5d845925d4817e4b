"""The question as a dialog: what was typed ahead answers nothing, a stop closes it, no macro starts behind it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from textual.pilot import Pilot

from multidrop.tui.screens.dialogs import GoOn
from tests.support.fake_session import FakeSession, demo_session, make_app, settle

pytestmark = pytest.mark.tui
WHAT = "a: CP erases every program and every user variable"


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.PAUSE", 1e6)  # keys count once a test says so


@asynccontextmanager
async def asked() -> AsyncIterator[tuple[Pilot[int], FakeSession, asyncio.Future[bool]]]:
    """The app with an open question, before keys count."""
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        assert session.front.ask is not None
        answer = asyncio.ensure_future(session.front.ask(WHAT))
        await settle(pilot)
        assert isinstance(app.screen, GoOn)
        yield pilot, session, answer
        answer.cancel()


def readable(pilot: Pilot[int]) -> None:
    """Keys have paused."""
    pilot.app.keyboard._deaf_until = 0.0  # type: ignore[attr-defined]


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
        await pilot.press(*"MR 5", "enter")
        await settle(pilot)
        assert session.sent == ["press:a MR 5"]


async def test_keys_typed_ahead_answer_nothing_and_a_function_key_plays_nothing() -> None:
    async with asked() as (pilot, session, answer):
        await pilot.press("y", "enter")
        await settle(pilot)
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


async def test_the_lines_that_lead_to_the_question_are_in_it_and_can_be_read_to_their_end() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        app.show_line("/params restore kept.toml", ">")
        for number in range(20):
            app.show_line(f"a: Q{number}=1", "")
        assert session.front.ask is not None
        answer = asyncio.ensure_future(session.front.ask(WHAT))
        await settle(pilot)
        assert isinstance(app.screen, GoOn) and app.screen.before == [f"a: Q{number}=1" for number in range(20)]
        readable(pilot)
        box, lines = app.screen.query_one(".box"), app.screen.query_one(".before")
        assert box.region.bottom <= 24 and app.screen.query_one(".keys").region.bottom < box.region.bottom
        assert lines.size.height == 6 and lines.scroll_y == 0
        await pilot.press("pagedown", "pagedown", "pagedown")
        await settle(pilot)
        assert lines.scroll_y == 14 and not answer.done()
        await pilot.press("y")
        assert await answer is True


async def test_a_low_screen_shows_the_answers_first() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(60, 15)) as pilot:
        app.show_line("a: Q1=1", "")
        assert session.front.ask is not None
        answer = asyncio.ensure_future(session.front.ask(WHAT))
        await settle(pilot)
        assert app.screen.query_one(".keys").region.bottom < app.screen.query_one(".box").region.bottom <= 15
        answer.cancel()
