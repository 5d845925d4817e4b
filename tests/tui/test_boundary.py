"""A defect of a part of the screen ends neither the screen nor the stop: planted in each part while a drive moves."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from textual.app import ComposeResult
from textual.pilot import Pilot
from textual.screen import Screen
from textual.widget import Widget

from multidrop.base.foreign import ForeignGuard
from multidrop.drives.poller import Poller
from multidrop.drives.stopping import Fate
from multidrop.shell.channel import AskedValue
from multidrop.tui import boundary
from multidrop.tui.panels import table
from multidrop.tui.panels.table import LAYOUTS, PANELS
from multidrop.tui.screens import dialogs, start
from multidrop.tui.screens.page import PAGES
from tests.support.fake_session import painted
from tests.support.real_screen import real_screen, until

pytestmark = pytest.mark.tui
WORDS = "cannot be shown: ZeroDivisionError"


class Planted(ZeroDivisionError):
    """What is planted; the screen names its base, so that one text fits all."""


def boom(*_: Any, **__: Any) -> Any:
    raise ZeroDivisionError("planted")


def text_of(screen: Screen[Any]) -> str:
    """What a screen shows."""
    return " ".join("".join(segment.text for segment in strip) for strip in painted(screen))


class Machine:
    """The screen on a real session: its drive a moves, is stopped, and its drive b is served."""

    def __init__(self, pilot: Pilot[int], folder: Path) -> None:
        self.pilot, self.app = pilot, pilot.app
        self.session: Any = self.app.session  # type: ignore[attr-defined]
        self.file = folder / "state" / boundary.FILE

    async def until(self, true: Callable[[], object]) -> None:
        await until(self.pilot, true)

    async def begin(self) -> None:
        """Let drive a move."""
        assert await self.session.start("/resume") and await self.session.start("@a SL 5000")

    async def holds(self, place: str) -> None:
        """The stop is sent and confirmed, and another line is served."""
        stops = self.session.stops
        assert self.app.is_running and self.app.return_code is None, place
        await self.pilot.press("ctrl+x")
        assert self.session.stops == stops + 1, place
        await self.until(lambda: all(each.fate is Fate.STANDING for each in self.session.tally().found))
        assert await self.session.start("@b PR P"), place

    async def shows(self, text: str, place: str, shown: bool = True) -> None:
        try:
            await self.until(lambda: (text in text_of(self.app.screen)) is shown)
        except TimeoutError:
            raise AssertionError(f"{place}: {text_of(self.app.screen)}") from None


@asynccontextmanager
async def machine(folder: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Machine]:
    monkeypatch.setattr(boundary, "RAISES", False)
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    async with real_screen(folder, size=(210, 50)) as pilot:
        made = Machine(pilot, folder)
        await made.until(lambda: made.session.selected is not None)
        await made.until(lambda: made.app.screen is made.app.main)  # type: ignore[attr-defined]
        yield made


def alone(name: str, **changed: Any) -> tuple[table.Panel, ...]:
    """The panels, of which this one is shown and has its place for itself."""
    places = [place for layout in LAYOUTS.values() for columns in layout.values() for place in columns]
    beside = {each for place in places if name in place for each in place} - {name}
    return tuple(
        each._replace(first=True, shows=lambda view: True, **changed)
        if each.name == name
        else each._replace(shows=lambda view: False, first=each.name not in ("traffic", "log", *beside))
        if each.name in beside
        else each
        for each in PANELS
    )


async def test_a_defect_in_any_panel_is_shown_in_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        main: Any = it.app.main  # type: ignore[attr-defined]
        for panel in PANELS:
            await it.begin()
            with monkeypatch.context() as planted:
                planted.setattr(table, "PANELS", alone(panel.name, rows=boom))
                monkeypatch.setattr(main, "panels", table.ShownPanels())
                # A place is listed by its first panel, so the one under test is shown alone in the left part.
                planted.setattr(
                    table, "LAYOUTS", {key: {"panel": ((panel.name,),), "side": (("drive",),)} for key in LAYOUTS}
                )
                planted.setattr("multidrop.tui.screens.main_screen.LAYOUTS", table.LAYOUTS)
                main.make_room()
                it.app.model.changed = True  # type: ignore[attr-defined]
                await it.shows(WORDS, panel.name)
                await it.holds(panel.name)
                assert f"the panel {panel.name}" in it.file.read_text()
            main.make_room()
            it.app.model.changed = True  # type: ignore[attr-defined]
            await it.shows(WORDS, f"{panel.name}, mended", shown=False)
        records = [record.text for record in main.page("press").records if "a defect of multidrop" in record.text]
        assert len(records) == len(PANELS) and str(it.file) in records[0], f"each is said once: {it.file.read_text()}"


async def test_a_panel_whose_title_or_choice_is_defective_is_named_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        for part in ("title", "shows"):
            with monkeypatch.context() as planted:
                changed = tuple(each._replace(**{part: boom}) if each.name == "drive" else each for each in PANELS)
                planted.setattr(table, "PANELS", changed)
                await it.begin()
                await it.until(lambda: it.file.exists() and "the panel drive" in it.file.read_text())
                await it.holds(part)


@pytest.mark.parametrize("part", ["show", "content"])
async def test_a_defect_in_any_page_is_shown_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        for entry in PAGES:
            await it.begin()
            with monkeypatch.context() as planted:
                planted.setattr(entry.page(), part, boom)
                it.app.call_later(it.app.run_action, f"act.page('{entry.name}')")
                await it.until(lambda: entry.page() in map(type, it.app.screen_stack))  # noqa: B023
                await it.pilot.pause(0.1)
                if type(it.app.screen) is not entry.page():  # a page may ask at once what it shows
                    await it.pilot.press("escape")
                await it.shows(WORDS, entry.name)
                await it.holds(entry.name)
            if part == "show":
                await it.shows(WORDS, f"{entry.name}, mended", shown=False)
            await it.pilot.press("escape")
            await it.until(lambda: it.app.screen is it.app.main)  # type: ignore[attr-defined]


async def nothing(*_: Any) -> str:
    return ""


DIALOGS: dict[type[Screen[Any]], Callable[[Any], Screen[Any]]] = {
    dialogs.Ask: lambda app: dialogs.Ask("a name"),
    dialogs.Confirm: lambda app: dialogs.Confirm("Sure?", ["a line"], [("yes", "Yes"), ("no", "No")]),
    dialogs.GoOn: lambda app: dialogs.GoOn("Go on?", lambda pages: None, lambda rows: None),
    dialogs.SearchDialog: lambda app: dialogs.SearchDialog("Find", lambda typed: []),
    dialogs.Choose: lambda app: dialogs.Choose("One of", [dialogs.ListedChoice("a", "a")]),
    dialogs.TooSmall: lambda app: dialogs.TooSmall(),
    dialogs.FormDialog: lambda app: dialogs.FormDialog("Values", [AskedValue("x", "a number", "1", float)]),
    start.Start: lambda app: start.Start(nothing, app.assist, app.keyboard, only=False),
}


def subclasses(kind: type[Any]) -> Iterator[type[Any]]:
    for each in kind.__subclasses__():
        if each.__module__.startswith("multidrop.") and "compose" in dir(each):
            yield each
        yield from subclasses(each)


def test_every_dialog_is_planted() -> None:
    assert {each for each in subclasses(dialogs.Over) if each is not dialogs.Dialog} == {*DIALOGS}


@pytest.mark.parametrize("part", ["compose", "begin"])
async def test_a_defect_in_any_dialog_is_shown_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        for kind, make in DIALOGS.items():
            if part not in vars(kind):
                continue
            await it.begin()
            with monkeypatch.context() as planted:
                planted.setattr(kind, part, boom)
                screen = make(it.app)
                it.app.call_later(it.app.push_screen, screen)
                await it.until(lambda: it.app.screen is screen)  # noqa: B023
                if part == "compose":
                    await it.shows(WORDS, kind.__name__)
                await it.until(lambda: it.file.exists() and kind.__name__ in it.file.read_text())  # noqa: B023
                await it.holds(kind.__name__)
            if it.app.screen is screen:  # a stop cancels dialogs
                screen.dismiss(None)
            await it.until(lambda: it.app.screen is it.app.main)  # type: ignore[attr-defined]


class Rendered(Widget):
    """A widget whose rendering, its update or its handler is defective."""

    broken = True

    def render(self) -> str:
        return boom() if self.broken else "all is well"  # type: ignore[no-any-return]


async def test_a_widget_that_cannot_be_rendered_is_rendered_once_it_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Showing(dialogs.Over[None]):
        def compose(self) -> ComposeResult:
            yield Rendered()

    async with machine(tmp_path, monkeypatch) as it:
        await it.begin()
        it.app.call_later(it.app.push_screen, Showing())
        await it.shows(WORDS, "a widget")
        monkeypatch.setattr(Rendered, "broken", False)
        await it.shows("all is well", "a widget, mended")
        await it.holds("a widget")


TIMERS: dict[str, Callable[[Machine, pytest.MonkeyPatch], None]] = {
    "the polls": lambda it, planted: planted.setattr(it.app.purpose.polling, "update", boom),  # type: ignore[attr-defined]
    "a poll of a drive": lambda it, planted: planted.setattr(Poller, "_converse", boom),
    "the ageing": lambda it, planted: it.app.set_interval(0.01, boom) and None,
    "a timer of the loop": lambda it, planted: asyncio.get_running_loop().call_later(0.01, boom) and None,
    "a task": lambda it, planted: it.app.run_worker(asyncio.to_thread(boom)) and None,
    "an event": lambda it, planted: planted.setattr(it.app.model, "take", boom),  # type: ignore[attr-defined]
    "a key": lambda it, planted: planted.setattr(type(it.app.act), "action_help", boom),  # type: ignore[attr-defined]
    "a callback": lambda it, planted: it.app.call_later(boom) and None,
    "the top line": lambda it, planted: planted.setattr("multidrop.tui.presenter.top_row", boom),
    "the footer": lambda it, planted: planted.setattr("multidrop.tui.presenter.footer_row", boom),
    "the banner": lambda it, planted: planted.setattr("multidrop.tui.presenter.banner_row", boom),
    "the status": lambda it, planted: planted.setattr("multidrop.tui.presenter.narrow_rows", boom),
    "what is open": lambda it, planted: planted.setattr(it.app.macros, "read", boom),  # type: ignore[attr-defined]
    "a subscriber": lambda it, planted: it.session.subscribe(boom) and None,
}


@pytest.mark.parametrize("name", TIMERS)
async def test_a_defect_in_a_poll_a_timer_or_an_event_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        await it.begin()
        with monkeypatch.context() as planted:
            if name == "the status":
                await it.pilot.resize_terminal(80, 24)
            TIMERS[name](it, planted)
            if name == "a key":
                await it.pilot.press("f1")
            it.app.model.changed = True  # type: ignore[attr-defined]
            await it.session.start("@b PR P")
            await it.until(lambda: it.file.exists() and "planted" in it.file.read_text())
            await it.holds(name)


async def test_a_defect_of_a_feature_by_others_is_said_once_and_is_not_multidrops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        await it.begin()
        it.session.subscribe(ForeignGuard("gauge").function(boom))
        await it.session.start("@b PR P")
        await it.until(lambda: it.file.exists() and "the feature gauge" in it.file.read_text())
        records = [each.text for each in it.app.main.page("press").records if "a defect" in each.text]  # type: ignore[attr-defined]
        assert [each.partition(";")[0] for each in records] == ["a defect in the feature gauge: ZeroDivisionError"]
        await it.holds("the feature gauge")


async def test_a_defect_in_every_frame_is_written_once_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        monkeypatch.setattr("multidrop.tui.presenter.top_row", boom)
        for _ in range(50):
            it.app.frames.tick()  # type: ignore[attr-defined]
        assert it.file.read_text().count("Traceback") == 1
        records = [each.text for each in it.app.main.page("press").records if "a defect" in each.text]  # type: ignore[attr-defined]
        assert len(records) <= 1
        assert sum(it.app.boundary.counts.values()) >= 16  # type: ignore[attr-defined]
    assert "the top line" in it.file.read_text().splitlines()[-1] and it.file.read_text().endswith(" times\n")


async def test_a_folder_that_cannot_be_written_loses_the_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(boundary, "RAISES", False)
    (tmp_path / "file").write_text("")
    made = boundary.Boundary(tmp_path / "file" / "state", said.append)
    assert made.do("a place", boom, lambda text: text).startswith(WORDS)
    assert said[0].endswith("could not be written")


async def test_in_tests_a_defect_is_raised(tmp_path: Path) -> None:
    assert boundary.RAISES
    with pytest.raises(ZeroDivisionError), boundary.Boundary(tmp_path).at("a place"):
        boom()
