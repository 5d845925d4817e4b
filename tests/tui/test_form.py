"""A form as a dialog: defaults and limits, wrong values, a stop, and no macro that starts behind it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from textual.pilot import Pilot
from textual.widgets import Static

from multidrop.macros import Macro, Step
from multidrop.shell.macro_arguments import value_fields
from multidrop.tui.screens.dialogs import Form
from tests.support.fake_session import demo_session, make_app, settle

pytestmark = pytest.mark.tui
MACRO = Macro("m", (Step(0.0, "MR {turns:int=10,1..100}"), Step(0.0, "{mode:choice(slow|fast)} {turns}")))


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.PAUSE", 1e6)  # keys count once a test says so


@asynccontextmanager
async def asked() -> AsyncIterator[tuple[Pilot[int], Any, asyncio.Future[Mapping[str, str] | None]]]:
    """The app with an open form, whose keys count."""
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        assert session.front.fill is not None
        answer = asyncio.ensure_future(session.front.fill("macro m", value_fields(MACRO, {})))
        await settle(pilot)
        assert isinstance(app.screen, Form)
        await pilot.press(*"lost", "enter")  # typed ahead
        app.keyboard._deaf_until = 0.0
        yield pilot, session, answer
        answer.cancel()


def wrong(pilot: Pilot[int]) -> str:
    return str(pilot.app.screen.query_one("#wrong", Static).render())


async def test_the_form_begins_where_a_value_is_needed_and_gives_all_values() -> None:
    async with asked() as (pilot, session, answer):
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
    async with asked() as (pilot, session, answer):
        await pilot.press("escape")
        assert await answer is None
    async with asked() as (pilot, session, answer):
        await pilot.press("ctrl+x")
        await settle(pilot)
        assert session.stops == 1 and not isinstance(pilot.app.screen, Form)
        assert await answer is None
