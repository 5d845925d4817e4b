"""The page of a plant: the worst first, one drive followed, and a stop that says where to go."""

from __future__ import annotations

import asyncio
import json
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from multidrop.features.publishing import screen
from multidrop.features.publishing.plant import TopicPlace
from multidrop.features.publishing.screen import PlantApp, _run
from multidrop.features.publishing.watch import PlantWatch
from multidrop.shell.configuration import Settings
from multidrop.tui import boundary
from multidrop.tui.widgets.lines import Lines

pytestmark = pytest.mark.tui


class Page:
    """The page, without a broker."""

    def __init__(self, app: PlantApp, pilot: Pilot[int]) -> None:
        self.app, self.pilot = app, pilot
        self.plant = app.broker.plant

    def put(self, topic: str, fields: object, retained: bool = False) -> None:
        self.plant.take(topic, json.dumps(fields).encode(), retained, self.app.broker.now)

    async def press(self, *keys: str) -> list[str]:
        """Press keys; return what is shown."""
        await self.pilot.press(*keys)
        self.app.paint()
        await self.pilot.pause()
        return self.shown

    @property
    def shown(self) -> list[str]:
        """The rows of all parts from top to bottom."""
        parts = (part for part in self.app.query(Lines) if part.display)
        return ["".join(text for text, _ in row).rstrip() for part in parts for row in part.rows]


@asynccontextmanager
async def page(width: int = 80, state: Path | None = None) -> AsyncIterator[Page]:
    app = PlantApp("mqtt://broker/plant", Settings() if state is None else Settings(state=state))
    app.broker = PlantWatch(app.target, Settings(), app.tell)
    async with app.run_test(size=(width, 24)) as pilot:
        shown = Page(app, pilot)
        shown.put("plant/hall-1/about", {"version": "1", "host": "press-pc", "lines": {"press": "press"}})
        for drive, state in (("a", "at rest"), ("b", "moving"), ("c", "silent")):
            shown.put(f"plant/hall-1/press/{drive}/state", {"value": state}, True)
            shown.put(f"plant/hall-1/press/{drive}/position", {"value": 512})
        shown.put("plant/old/eth/!/state", {"value": "at rest"}, True)
        shown.put("plant/old/eth/!/error", {"value": 86, "text": "stalled"}, True)
        app.paint()
        yield shown


async def test_the_worst_is_first_and_what_is_typed_narrows() -> None:
    async with page() as plant:
        rows = await plant.press("down", "up")
        assert (
            rows[0].startswith(" PLANT   1 silent · 1 error · 1 moving · 1 at rest")
            and "mqtt://broker:1883/pl" in rows[0]
        )
        assert [row[:33].split() for row in rows[2:6]] == [
            ["▸hall-1", "press:c"],
            ["old", "(no", "about)", "eth"],
            ["hall-1", "press:b"],
            ["hall-1", "press:a"],
        ]
        assert rows[3].endswith("?  86 stalled") and rows[2].split()[2:4] == ["silent", "512"]
        assert rows[-2] == " 2 PCs, 1 without about · 4 drives" and "read only" in rows[-1]
        rows = await plant.press(*"moving")
        assert "press:b" in rows[2] and not any("press:a" in row for row in rows) and "moving▏" in rows[-1]
        rows = await plant.press("escape")
        assert any("press:a" in row for row in rows)


@pytest.mark.parametrize("before", [(), ("enter",), ("p", "r")])
async def test_ctrl_x_says_that_nothing_was_reached_and_where_to_go(before: tuple[str, ...]) -> None:
    async with page() as plant:
        rows = await plant.press(*before, "ctrl+x")
        [banner] = [row for row in rows if "NOT REACHED" in row]
        assert banner.startswith(" ‼ NOT REACHED: Ctrl+X at press-pc (hall-1), or the emergency stop there; this page")
        assert "STOPPED" not in "".join(rows) and banner in rows[1]
        assert not any("NOT REACHED" in row for row in await plant.press("escape"))


async def test_a_timer_that_fires_while_the_screen_is_taken_down_paints_nothing() -> None:
    async with page() as plant:
        await plant.app.query("#heading").remove()
        plant.app.paint()
        assert plant.shown[1].startswith("▸hall-1"), "what is left stands as it was"


async def test_one_drive_is_followed_with_the_age_of_each_value() -> None:
    async with page() as plant:
        await plant.press("down", "down", "down", "enter")
        assert plant.plant.followed == TopicPlace("plant/hall-1", "press", "a")
        plant.put("plant/hall-1/press/a/position", {"value": 777, "quantity": 1.5, "unit": "mm"})
        plant.put("plant/hall-1/press/b/position", {"value": 4711})
        text = "\n".join(await plant.press("x"))
        assert "hall-1  press:a  at rest   at press-pc" in text and "4711" not in text
        assert "state            at rest                                   age unknown" in text
        assert "position         1.5 mm                                    0." in text
        assert text.count("1.5 mm") == 2  # the value, and a sample
        plant.plant.drives.pop(plant.plant.followed)
        assert "the followed drive is published no more" in "\n".join(await plant.press("y"))


async def test_a_lost_broker_is_seen() -> None:
    async with page(120) as plant:
        plant.app.broker.lost = True
        plant.plant.lost(plant.app.broker.now)
        rows = await plant.press("down")
        assert rows[0].endswith("BROKER LOST") and rows[2].endswith("?")
        plant.app.tell("the broker is back")
        assert any("the broker is back · 2 PCs, 1 without about" in row for row in await plant.press("down"))
        assert not any("is back" in row for row in await plant.press("escape"))


async def test_ctrl_q_ends_it_and_ctrl_c_does_not() -> None:
    async with page() as plant:
        assert any("^Q quits" in row for row in await plant.press("ctrl+c"))
        await plant.pilot.press("ctrl+q")
    assert plant.app.return_value == 0


def boom(*_: Any, **__: Any) -> Any:
    raise ZeroDivisionError("planted")


@pytest.mark.parametrize("what", ["rows", "summary", "key", "callback"])
async def test_a_defect_is_shown_in_its_place_and_ends_nothing(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(boundary, "RAISES", False)
    async with page(state=tmp_path) as plant:
        with monkeypatch.context() as planted:
            if what == "summary":
                planted.setattr(screen, "summary", boom)
            elif what == "key":
                planted.setattr(plant.app, "action_step", boom)
            elif what == "callback":
                plant.app.call_later(boom)
            else:
                planted.setattr(plant.app.broker, what, boom)
            rows = await plant.press("down")
            while not (tmp_path / boundary.FILE).exists():
                await plant.pilot.pause(0.01)
            assert plant.app.is_running
            if what in ("rows", "summary"):
                assert rows[0].startswith(" cannot be shown: ZeroDivisionError") and not any(
                    "press:" in row for row in rows
                )
            else:
                assert any("a defect of multidrop in" in row for row in await plant.press("x", "backspace"))
        assert any("press:a" in row for row in await plant.press("up")), "once the cause is gone"
        await plant.pilot.press("ctrl+q")
    assert plant.app.return_value == 0


@pytest.mark.parametrize("connected", [True, False])
async def test_a_signal_ends_the_page_and_leaves_the_terminal_well(
    monkeypatch: pytest.MonkeyPatch, connected: bool
) -> None:
    app, ran = PlantApp("mqtt://broker/plant", Settings()), asyncio.Event()
    app.broker = PlantWatch(app.target, Settings(), app.tell)

    async def watch_broker(over: asyncio.Event) -> bool:
        if not connected:
            signal.raise_signal(signal.SIGTERM)
            await over.wait()
        return connected

    async def run_async() -> None:
        asyncio.get_running_loop().call_soon(signal.raise_signal, signal.SIGTERM)
        while app.return_value is None:
            await asyncio.sleep(0)
        ran.set()

    monkeypatch.setattr(app, "watch_broker", watch_broker)
    monkeypatch.setattr(app, "run_async", run_async)
    assert await asyncio.wait_for(_run(app), 5) == 0 and ran.is_set() == connected
