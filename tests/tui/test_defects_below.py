"""A defect in what carries the screen (keys, frames, the report of a defect itself) takes the stop key from nobody."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from textual import events
from textual.geometry import Size

from multidrop.tui import boundary
from multidrop.tui.screens import dialogs
from multidrop.tui.terminal.driver import Terminal
from tests.support.until import PATIENCE
from tests.tui.test_boundary import Machine, boom, machine

Case = Callable[[Machine, pytest.MonkeyPatch], Awaitable[None]]
CASES: dict[str, Case] = {}


def case(function: Case) -> Case:
    CASES[function.__name__.replace("_", " ")] = function
    return function


def tap(it: Machine, *keys: str) -> None:
    for key in keys:
        it.app.post_message(events.Key(key, {"enter": "\r"}.get(key, key if len(key) == 1 else None)))


def resize(it: Machine, width: int, height: int) -> None:
    size = Size(width, height)
    it.app.post_message(events.Resize(size, size))


async def reported(it: Machine) -> None:
    await it.until(lambda: it.file.exists() and "planted" in it.file.read_text())


@case
async def the_report_of_a_defect(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(it.app.main, "page", boom)  # type: ignore[attr-defined]
    planted.setattr("multidrop.tui.presenter.top_row", boom)
    tap(it, "P", "R")
    await reported(it)


@case
async def the_pages_of_records(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(it.app.model, "page", boom)  # type: ignore[attr-defined]
    tap(it, *"PR P", "enter")
    await reported(it)


@case
async def what_is_worth_a_frame(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(it.app.model, "quiet", boom)  # type: ignore[attr-defined]
    await it.session.start("@b PR P")
    await reported(it)


@case
async def the_question_of_a_quit(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(dialogs.Confirm, "compose", boom)
    tap(it, "ctrl+q")
    await reported(it)


@case
async def the_focus_of_that_question(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(dialogs.Confirm, "begin", boom)
    tap(it, "ctrl+q")
    await reported(it)


@case
async def what_moves_at_a_quit(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(it.session, "in_motion", boom)
    tap(it, "ctrl+q")
    await reported(it)


@case
async def the_work_on_keys(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(it.app, "run_action", boom)  # type: ignore[attr-defined]
    tap(it, "f1", "P")
    await reported(it)


@case
async def a_typed_line(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr(it.app.typist, "typed", boom)  # type: ignore[attr-defined]
    tap(it, "P", "enter")
    await reported(it)


@case
async def another_size(it: Machine, planted: pytest.MonkeyPatch) -> None:
    planted.setattr("multidrop.tui.app.TooSmall", type("Planted", (), {"__init__": boom}))
    resize(it, 20, 5)
    await reported(it)


@pytest.mark.tui
@pytest.mark.parametrize("name", CASES)
async def test_the_stop_is_sent_and_confirmed_and_keys_count_again(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with machine(tmp_path, monkeypatch) as it:
        await it.begin()
        with monkeypatch.context() as planted:
            await CASES[name](it, planted)
            await it.holds(name)
        resize(it, 120, 40)
        await it.until(lambda: it.app.size.width == 120)
        while it.app.screen is not it.app.main:  # type: ignore[attr-defined]
            await it.pilot.press("escape")
            await it.pilot.pause(0.05)
        it.app.main.entry.value = ""  # type: ignore[attr-defined]
        tap(it, "Q", "W")
        await it.until(lambda: it.app.main.entry.value == "QW")  # type: ignore[attr-defined]


def test_what_is_said_of_a_defect_may_be_defective_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boundary, "RAISES", False)
    made = boundary.Boundary(tmp_path, boom)
    assert made.do("a place", boom, lambda text: text).startswith("cannot be shown: ZeroDivisionError")
    assert "a place\nTraceback" in (text := made.path.read_text()) and "what is said of a defect\nTraceback" in text
    monkeypatch.setattr(boundary, "RAISES", True)
    with pytest.raises(ZeroDivisionError):
        made.caught("another place", ZeroDivisionError())


@pytest.mark.pty
async def test_the_thread_of_the_keys_outlives_a_stop_that_it_cannot_write() -> None:
    reading, typing = os.pipe()
    taken: list[bytes] = []
    ends = threading.Event()
    terminal: Any = SimpleNamespace(
        fileno=reading,
        exit_event=ends,
        _app=SimpleNamespace(stop_ahead=boom, interrupted=lambda: None),
        _loop=asyncio.get_running_loop(),
        _take=taken.append,
        _read=lambda: os.read(reading, 4096),
    )
    thread = threading.Thread(target=Terminal.run_input_thread, args=(terminal,))
    thread.start()
    try:
        async with asyncio.timeout(PATIENCE):
            for number in (1, 2):
                os.write(typing, b"\x18")
                while len(taken) < number:
                    await asyncio.sleep(0.001)
    finally:
        ends.set()
        await asyncio.to_thread(thread.join)
        os.close(reading)
        os.close(typing)
    assert taken == [b"\x18", b"\x18"], "the loop takes each of them, and stops"
