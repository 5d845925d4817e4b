"""A drive beside its twin as pictures. `make snapshots` renews them; look at them before you commit."""

from collections.abc import Callable

import pytest
from textual.pilot import Pilot

from multidrop.tui.widgets.theme import Signs
from tests.support.fake_session import demo_session, make_app, settle
from tests.support.fake_twin import a_stall

pytestmark = pytest.mark.tui

Compare = Callable[..., bool]
SIZES = {"80x24": (80, 24), "120x40": (120, 40)}


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)


def drawn(compare: Compare, size: str, *keys: str, theme: str = "multidrop-dark", signs: Signs = Signs.FULL) -> bool:
    session = demo_session()
    app = make_app(session, theme=theme)

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        app.view.show_signs(signs)
        session.emit(*a_stall(session))
        await settle(pilot)
        await pilot.press(*keys)
        await settle(pilot)

    return compare(app, terminal_size=SIZES[size], run_before=act)


@pytest.mark.parametrize(("size", "keys"), [("80x24", ()), ("120x40", ()), ("120x40", ("ctrl+g",))])
def test_a_drive_that_stalls_beside_its_twin(snap_compare: Compare, size: str, keys: tuple[str, ...]) -> None:
    assert drawn(snap_compare, size, *keys)


def test_the_plot_of_a_twin_in_ascii(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "80x24", "ctrl+g", signs=Signs.ASCII, theme="multidrop-ansi")
