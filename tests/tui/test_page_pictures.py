"""Pages as pictures, at three sizes. `make snapshots` renews them; look at them before you commit."""

from collections.abc import Callable

import pytest
from textual.pilot import Pilot

from multidrop.dialects.values import IO, VARIABLES, Reading, Readings
from multidrop.shell.events import SettingsRead
from tests.support.fake_session import a_move, a_talk, demo_session, make_app, settle

pytestmark = pytest.mark.tui
Compare = Callable[..., bool]
SIZES = {"80x24": (80, 24), "120x40": (120, 40), "200x50": (200, 50)}
KEYS = {
    "controls": ("ctrl+n", "up", "right", "right"),
    "parameters": ("d", "slash", *"e", "enter", "down", "enter"),
    "main": (),
}

FOUND = Readings(
    (
        Reading("A", 1_000_000, unit="steps/s²", default=1_000_000),
        Reading("EE", 0, default=0),
        Reading("HC", 15, unit="%", default=5),
        Reading("MS", 256, unit="microsteps", default=256),
        Reading("VM", 600_000, unit="steps/s", default=768_000),
        Reading("IS1", (1, 0), IO, default=(0, 0)),
        Reading("Q1", 7, VARIABLES),
    )
)


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", KEYS)
def test_page(snap_compare: Compare, name: str, size: str) -> None:
    if name == "main" and size != "200x50":
        pytest.skip("drawn by test_snapshots")
    session = demo_session()

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        session.emit(*a_talk(session), *a_move(session))
        await settle(pilot)
        if name == "parameters":
            session.emit(SettingsRead(session.time, "press", "a", FOUND))
            await pilot.app.run_action("act.page('parameters')")
            await settle(pilot)
        await pilot.press(*KEYS[name])
        await settle(pilot)

    assert snap_compare(make_app(session), terminal_size=SIZES[size], run_before=act)
