"""A screen with a purpose by a feature: what that decides may hold the loop up, and the stop key still works."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from multidrop.shell.configuration import Settings
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.purpose import Purpose
from tests.features.test_stop import PATIENCE, Held, key_thread, served
from tests.support.foreign_features import functions_of

CALLED = {
    "fill": lambda app: app.purpose.fill(),
    "label": lambda app: app.selection.follow(),
    "refused": lambda app: app.purpose.refused("plot"),
}


def test_every_function_of_a_purpose_is_in_the_table() -> None:
    assert set(CALLED) == functions_of(Purpose)


def holding(name: str, real: Callable[..., Any], held: dict[str, Callable[[], None]]) -> Callable[..., Any]:
    """A method of a purpose that holds the loop up once `held` has its name."""

    def hook(*given: Any) -> Any:
        held.get(name, lambda: None)()
        return real(*given)

    return hook


@pytest.mark.tui
async def test_a_purpose_that_holds_the_loop_up_delays_no_stop(tmp_path: Path) -> None:
    late = []
    async with served(tmp_path) as session:
        settings = Settings({}, tmp_path / "config", tmp_path / "state")
        purpose = Purpose(session)
        held: dict[str, Callable[[], None]] = {}
        for name in CALLED:
            setattr(purpose, name, holding(name, getattr(purpose, name), held))
        app = MultidropApp(session, [], Assist(session, settings), purpose=purpose)
        async with app.run_test(size=(80, 24)) as pilot:
            await pilot.pause()
            for name, call in CALLED.items():
                hook = held[name] = Held()
                thread, _ = key_thread(session, hook)
                call(app)
                await asyncio.to_thread(thread.join, PATIENCE)
                session.stop("Ctrl+X")
                late += [] if hook.was_written else [name]
            app.exit(0)
    assert not late
