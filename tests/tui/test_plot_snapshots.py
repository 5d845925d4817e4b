"""The page of plots as pictures. `make snapshots` renews them; look at them before you commit."""

import math
from collections.abc import Callable

import pytest
from textual.pilot import Pilot

from multidrop.drives.events import Sample, Valued
from multidrop.shell.events import OnBus
from multidrop.shell.roles import Series
from multidrop.tui.widgets.theme import Signs
from tests.support.fake_session import FakeSession, a_move, demo_session, make_app, settle

pytestmark = pytest.mark.tui

Compare = Callable[..., bool]
SIZES = {"80x24": (80, 24), "120x40": (120, 40)}
WAYS = {
    "several": (),
    "cursor": ("space", *["left"] * 12),
    "split": ("s", "minus", "minus"),
}


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)


def several(session: FakeSession) -> None:
    """`a` accelerates, `b` swings and counts a switch, `c` rests."""
    session.plotted = (*(Series("press", each) for each in "abc"), Series("press", "b", "I1"))
    session.emit(*a_move(session)[:480])
    for n in range(300):
        at, turn = session.time - 12 + n / 25, n / 20
        position, velocity = int(2_000_000 * math.sin(turn)), int(250_000 * math.cos(turn))
        session.emit(OnBus("press", Sample(at, "b", position, velocity)), OnBus("press", Sample(at, "c", 51_300, 0)))
        session.emit(OnBus("press", Valued(at, "b", "I1", float(position > 0))))


def drawn(compare: Compare, size: str, *keys: str, theme: str = "multidrop-dark", signs: Signs = Signs.FULL) -> bool:
    session = demo_session()
    app = make_app(session, theme=theme)

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        app.view.show_signs(signs)
        several(session)
        await settle(pilot)
        await pilot.press("ctrl+g", *keys)
        await settle(pilot)

    return compare(app, terminal_size=SIZES[size], run_before=act)


@pytest.mark.parametrize(
    ("way", "size"), [("several", "80x24"), ("several", "120x40"), ("cursor", "80x24"), ("split", "120x40")]
)
def test_plots(snap_compare: Compare, way: str, size: str) -> None:
    assert drawn(snap_compare, size, *WAYS[way])


def test_plots_in_ascii(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "80x24", signs=Signs.ASCII, theme="multidrop-ansi")
