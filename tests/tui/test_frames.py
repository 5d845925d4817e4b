"""What is painted between two frames: the reply to a typed line, at once or as soon as the terminal takes it."""

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.shell.events import Printed
from multidrop.tui.boundary import Boundary
from multidrop.tui.frame_scheduler import FRAMES, Frames
from multidrop.tui.presenter import FLOOD, FLOOD_PERIOD, Presenter
from tests.support.fake_session import demo_session, driver_of, make_app

pytestmark = pytest.mark.tui


@pytest.fixture(autouse=True)
def no_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Frames, "wake", lambda self, panels=True: None)


async def test_a_reply_is_painted_once_the_terminal_has_swallowed_the_frame_before() -> None:
    session = demo_session()
    app, painted = make_app(session), []
    async with app.run_test(size=(80, 24)) as pilot:
        app.presenter.paint = lambda main, now, panels, page: painted.append(panels)  # type: ignore[method-assign]
        driver = driver_of(app)
        session.gate, driver.ready = asyncio.Event(), lambda: False
        await pilot.press(*"PR P", "enter")
        session.emit(Printed(session.time, "press", "a", "384112"))
        await pilot.pause()
        app.terminal_ready()
        assert painted == []
        driver.ready = lambda: True
        app.terminal_ready()
        assert len(painted) == 1
        app.terminal_ready()
        session.emit(Printed(session.time, "press", "a", "384113"))  # the next frame shows what else comes
        await pilot.pause()
        assert len(painted) == 1
        session.gate.set()


async def test_a_line_that_is_typed_and_sent_changes_no_layout() -> None:
    app, layouts = make_app(), list[object]()
    async with app.run_test(size=(80, 24)) as pilot:
        app.tick()
        await pilot.press(*"MR 5")  # with a list of completions at first, which does
        await pilot.pause()
        app.main.screen_layout_refresh_signal.subscribe(app.main, layouts.append, immediate=True)
        await pilot.press(*"12", "enter")
        app.tick()
        await pilot.pause()
        assert not layouts and "MR 512" in app.main.page("press").plain


def paints(*lines: int) -> list[int]:
    """The frames in which a transcript is painted that gets so many lines in each."""
    shown: list[int] = []
    facts, page = SimpleNamespace(fresh=[]), SimpleNamespace(take=lambda fresh: None, show_new=lambda: shown.append(n))
    beside = SimpleNamespace(take=lambda *_: None, transcript=SimpleNamespace(show_new=lambda: None))
    main: Any = SimpleNamespace(pages={"press": page}, current="press", page=lambda name: page, beside=beside)
    anything: Any = None
    model: Any = SimpleNamespace(buses={"press": facts})
    presenter = Presenter(anything, model, anything, anything, anything, Boundary(Path()))
    for n, count in enumerate(lines):  # noqa: B007
        facts.fresh += ["x"] * count
        presenter.take_records(main)
        presenter.paint(main, n / FRAMES, panels=False)
    return shown


def test_few_lines_and_the_first_of_many_are_painted_in_their_frame() -> None:
    assert paints(1, 2, FLOOD - 1, 1) == [0, 1, 2, 3]
    assert paints(0, 1, 20, 0) == [0, 1, 2, 3]


def test_more_lines_than_anyone_reads_are_painted_ten_times_a_second_and_the_last_at_once() -> None:
    shown = paints(*[1, *[FLOOD] * FRAMES, 0])
    assert shown[:2] == [0, 1] and shown[-1] == FRAMES + 1
    assert len(shown) <= 3 + 1 / FLOOD_PERIOD
