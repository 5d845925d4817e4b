"""The screens as pictures, at 80x24 and 120x40. `make snapshots` renews them; look at them before you commit."""

from collections.abc import Awaitable, Callable

import pytest
from textual.pilot import Pilot

from multidrop.dialects.values import Conditions
from multidrop.drives.events import Conditioned, Sample
from multidrop.drives.stopping import Fate
from multidrop.shell.events import OnBus
from multidrop.transports import TransportLost
from multidrop.tui.app import MultidropApp
from multidrop.tui.widgets.theme import Signs
from tests.support.fake_session import FakeBus, FakeDrive, FakeSession, a_move, a_talk, demo_session, make_app, settle

pytestmark = pytest.mark.tui

Compare = Callable[..., bool]
KEYS = {
    "main": (),
    "plot": ("ctrl+t",),
    "stopped": ("ctrl+x",),
    "completing": ("M", "tab"),
    "selector": ("ctrl+o",),
    "help": ("f1",),
    "lost": ("alt+3",),
    "drives": ("ctrl+a",),
    "palette": ("ctrl+p",),
    "split": ("ctrl+l", "down", "enter"),
}
SIZES = {"80x24": (80, 24), "120x40": (120, 40)}


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)


def acting(session: FakeSession, *keys: str, later: float = 0.0) -> Callable[[Pilot[int]], Awaitable[None]]:
    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        if session.buses:
            session.emit(*a_talk(session), *a_move(session))
        await settle(pilot)
        await pilot.press(*keys)
        session.time += later
        await settle(pilot)

    return act


def drawn(snap_compare: Compare, size: str, *keys: str, later: float = 0.0, theme: str = "multidrop-dark") -> bool:
    session = demo_session()
    app = make_app(session, theme=theme)
    return snap_compare(app, terminal_size=SIZES[size], run_before=acting(session, *keys, later=later))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", KEYS)
def test_snapshot(snap_compare: Compare, size: str, name: str) -> None:
    assert drawn(snap_compare, size, *KEYS[name])


@pytest.mark.parametrize("page", ["main", "drives"])
@pytest.mark.parametrize("size", SIZES)
def test_snapshot_of_a_stop_that_a_program_survives(snap_compare: Compare, size: str, page: str) -> None:
    """`a` runs its program on, `b` has ended its own, `c` was not read since: its row is dim and of the past."""
    session = demo_session()
    app = make_app(session)
    fates = {"a": Fate.RUNNING, "b": Fate.STANDING, "c": Fate.NOT_KNOWN}
    runs = (Conditions(program="running", runs=True),)

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        for name in fates:
            session.emit(OnBus("press", Sample(session.time - 0.2, name, 100, 0)))
            session.emit(OnBus("press", Conditioned(session.time - 1.0, name, runs)))
        await settle(pilot)
        await pilot.press("ctrl+x", *KEYS[page])
        session.time += 2.0
        session.fates = {f"press:{name}": fate for name, fate in fates.items()} | {"eth:": Fate.STANDING}
        for name in "ab":
            session.emit(OnBus("press", Sample(session.time - 0.1, name, 200, 0, program=name == "a")))
        await settle(pilot)

    assert snap_compare(app, terminal_size=SIZES[size], run_before=act)


def test_snapshot_of_values_that_have_grown_old(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "120x40", later=3.0)


@pytest.mark.parametrize("theme", ["multidrop-ansi", "multidrop-light"])
def test_snapshot_in_other_colours(snap_compare: Compare, theme: str) -> None:
    assert drawn(snap_compare, "80x24", "ctrl+x", "M", "tab", theme=theme)


def test_snapshot_without_colours(snap_compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert drawn(snap_compare, "80x24", "ctrl+x", "ctrl+o", theme="")


def test_snapshot_of_the_first_screen(snap_compare: Compare) -> None:
    session = FakeSession()
    app: MultidropApp = make_app(session)
    assert snap_compare(app, terminal_size=(80, 24), run_before=acting(session))


def test_snapshot_of_the_start_page_where_there_is_room(snap_compare: Compare) -> None:
    session = FakeSession()
    assert snap_compare(make_app(session), terminal_size=(120, 40), run_before=acting(session))


def test_snapshot_of_the_tour(snap_compare: Compare) -> None:
    session = demo_session()
    app = make_app(session)

    async def act(pilot: Pilot[int]) -> None:
        app.tour.begin_on("press")
        await acting(session)(pilot)

    assert snap_compare(app, terminal_size=(80, 24), run_before=act)


def test_snapshot_of_many_lines_in_ascii(snap_compare: Compare) -> None:
    buses = [FakeBus(f"line{n}", {"a": FakeDrive("a")}) for n in range(1, 33)]
    buses[19].lost = TransportLost("unplugged")
    session = FakeSession(*buses)
    app = make_app(session)
    app.view.show_signs(Signs.ASCII)
    assert snap_compare(app, terminal_size=(80, 24), run_before=acting(session, "ctrl+t"))
