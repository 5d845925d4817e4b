"""Enter: the line is on its way before the screen changes, and each key finds its binding."""

import pytest
from textual import events

from multidrop.tui.app import bindings
from tests.support.fake_session import binding_of, demo_session, make_app, on_screen

pytestmark = pytest.mark.tui


async def test_a_line_takes_its_first_step_before_the_input_line_is_emptied() -> None:
    session = demo_session()
    app, seen = make_app(session), []
    async with app.run_test(size=(80, 24)) as pilot:
        run = session.run

        async def noting(line: str, *more: object) -> None:
            seen.append((line, app.main.entry.value, app.main.entry.unsent))
            await run(line, *more)  # type: ignore[arg-type]

        session.run = noting  # type: ignore[method-assign]
        await pilot.press(*"MR 5", "enter", *"PR P")
        assert seen == [("MR 5", "MR 5", "")]
        assert (app.main.entry.value, app.main.entry.unsent) == ("PR P", "PR P")


async def test_a_line_that_is_written_as_the_stop_comes_is_not_said_to_be_unsent() -> None:
    async with on_screen() as (pilot, app, session):
        run = session.run

        async def stopping(line: str, *more: object) -> None:
            await run(line, *more)  # type: ignore[arg-type]
            for key in "PR":
                app.post_message(events.Key(key, key))
            app.stop_all()

        session.run = stopping  # type: ignore[method-assign]
        await pilot.press(*"MR 5", "enter")
        await pilot.pause()
        app.tick()
        assert ([line for line, _ in session.lines], session.stops, app.main.entry.value) == (["MR 5"], 1, "")
        assert "stopped; not sent: PR" in app.main.page("press").plain
        assert set(app.assist.history()) >= {"MR 5", "PR"}


@pytest.mark.parametrize("keys", [[], ["ctrl+e"], ["ctrl+p"], ["ctrl+f"]])
async def test_a_key_finds_the_binding_that_is_active(keys: list[str]) -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.press(*keys)
        active = app.screen.active_bindings
        assert "escape" in active
        for key in {*active, *(key for row in bindings() for key in row.key.split(","))}:
            found, expected = binding_of(app, key), active.get(key)
            assert found == (expected and (expected.binding, expected.node, expected.enabled)), key


async def test_lines_of_one_read_are_one_burst_however_slow_this_program_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.outbox.BURST", 0.0)  # the time between them is always too long
    async with on_screen() as (pilot, app, session):
        session.refuses["BAD"] = "a: 20 unknown"
        for key in (*"BAD", "enter", *"/stats", "enter"):
            app.post_message(events.Key(key, "\r" if key == "enter" else key))
        await pilot.pause()
        await pilot.pause()
        assert [line for line, _ in session.lines] == ["BAD"]
        await pilot.press(*"PR", "enter")
        assert [line for line, _ in session.lines] == ["BAD", "PR"]
