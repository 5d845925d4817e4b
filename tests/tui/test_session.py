"""The screen on a real Session with the simulated press: from a key to the drive and back."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.keys import _character_to_key
from textual.pilot import Pilot

from multidrop.families.lexium.host.mcode.framing import sealed
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from tests.support.fake_session import driver_of
from tests.support.real_screen import real_screen, until

pytestmark = pytest.mark.tui

NAMED = frozenset({"enter", "ctrl+p", "ctrl+x", "f4"})


@asynccontextmanager
async def press(tmp_path: Path, size: tuple[int, int] = (80, 24), reconnect: bool = False) -> AsyncIterator[Pilot[int]]:
    async with real_screen(tmp_path, size=size, reconnect=reconnect) as pilot:
        await until(pilot, lambda: "■ at rest" in status(pilot))
        yield pilot


def app_of(pilot: Pilot[int]) -> MultidropApp:
    assert isinstance(pilot.app, MultidropApp)
    return pilot.app


def status(pilot: Pilot[int]) -> str:
    main = app_of(pilot).main
    return main.lines("side" if main.wide else "status").plain


def transcript(pilot: Pilot[int]) -> str:
    main = app_of(pilot).main
    return main.page(main.current).plain


def typed(pilot: Pilot[int], *pieces: str) -> None:
    """Keys by name, and texts by their characters, without a pause: the pilot would wait after each until the process
    is idle.
    """
    driver = driver_of(pilot.app)
    for piece in pieces:
        named = piece in NAMED
        for character in (piece,) if named else piece:
            key = piece if named else _character_to_key(character)
            driver.send_message(events.Key(key, None if named else character))


async def test_a_typed_move_is_seen_and_its_end_is_read(tmp_path: Path) -> None:
    async with press(tmp_path) as pilot:
        typed(pilot, "MR 102400", "enter")
        await until(pilot, lambda: "▶ moving" in status(pilot))
        await until(pilot, lambda: re.search(r"▸a +■ at rest .* 10\.000 mm", status(pilot)) is not None)
        typed(pilot, "PR P", "enter")
        await until(pilot, lambda: "  102400" in transcript(pilot))


async def test_clear_empties_the_transcript_and_help_is_shown_to_its_end(tmp_path: Path) -> None:
    async with press(tmp_path) as pilot:
        typed(pilot, "PR 424242", "enter")
        await until(pilot, lambda: "  424242" in transcript(pilot))
        typed(pilot, "/clear", "enter")
        await until(pilot, lambda: "424242" not in transcript(pilot))
        typed(pilot, "/help", "enter")
        await until(pilot, lambda: "[screen]: only on the screen" in transcript(pilot))


async def test_ctrl_x_stops_a_drive_that_nobody_selected(tmp_path: Path) -> None:
    async with press(tmp_path) as pilot:
        typed(pilot, "@b SL 50000", "enter")
        await until(pilot, lambda: " b        ▶ moving" in status(pilot))
        typed(pilot, "ctrl+x")
        await until(pilot, lambda: " b        ■ at rest" in status(pilot))
        assert app_of(pilot).main.query_one(".banner").display
        typed(pilot, "/resume", "enter")
        await until(pilot, lambda: not app_of(pilot).main.query_one(".banner").display)


async def test_a_refusal_is_red_and_named_and_the_words_are_completed(tmp_path: Path) -> None:
    async with press(tmp_path, (120, 40)) as pilot:
        typed(pilot, "PR V")
        await pilot.pause()
        assert {"V", "VM", "VI"} <= {each.text for each in app_of(pilot).main.entry.listing.found}
        typed(pilot, "Q", "enter")
        await until(pilot, lambda: "✗" in transcript(pilot))


async def test_a_macro_is_recorded_put_on_a_key_and_played(tmp_path: Path) -> None:
    async with press(tmp_path) as pilot:
        typed(pilot, "ctrl+p", "record", "enter", "nudge", "enter")
        await until(pilot, lambda: app_of(pilot).session.recording == "nudge")
        typed(pilot, "MR 1000", "enter")
        await until(pilot, lambda: " 0.098 mm" in status(pilot))
        typed(pilot, "/record stop", "enter")
        await until(pilot, lambda: not app_of(pilot).session.recording)
        typed(pilot, "/key F4 nudge", "enter")
        await until(pilot, lambda: "F4 nudge" in app_of(pilot).main.lines("footer").plain)
        typed(pilot, "f4")
        await until(pilot, lambda: "» @a MR 1000" in transcript(pilot))
        await until(pilot, lambda: " 0.195 mm" in status(pilot))


async def test_an_unplugged_bus_says_so(tmp_path: Path) -> None:
    async with press(tmp_path) as pilot:
        typed(pilot, "/sim unplug press", "enter")
        await until(pilot, lambda: "press ✗ lost" in app_of(pilot).main.lines("top").plain)
        assert "stopped" not in status(pilot)


async def test_a_lost_bus_comes_back_in_its_tab(tmp_path: Path) -> None:
    async with press(tmp_path, reconnect=True) as pilot:
        typed(pilot, "/sim unplug press", "enter")
        await until(pilot, lambda: "press ✗ lost" in app_of(pilot).main.lines("top").plain)
        await until(pilot, lambda: "LOST - " in app_of(pilot).main.query_one(".banner").plain)  # type: ignore[attr-defined]
        assert app_of(pilot).main.query_one(".banner").plain.rstrip().endswith("; trying again")  # type: ignore[attr-defined]
        typed(pilot, "/sim plug press", "enter")
        await until(pilot, lambda: "■ at rest" in status(pilot) and "press is back after" in transcript(pilot))
        assert not app_of(pilot).main.query_one(".banner").display
        typed(pilot, "MR 1000", "enter")
        await until(pilot, lambda: " 0.098 mm" in status(pilot))


async def test_a_controller_shows_both_axes_and_ctrl_x_stops_them(tmp_path: Path) -> None:
    async with real_screen(tmp_path, "sim:#pmx", (120, 40)) as pilot:
        await until(pilot, lambda: "■ at rest" in status(pilot))
        typed(pilot, "X300Y-200", "enter")
        await until(pilot, lambda: "   300 pulses" in status(pilot))
        await until(pilot, lambda: "  -200 pulses" in status(pilot) and "■ at rest" in status(pilot))
        typed(pilot, "JY+", "enter")
        await until(pilot, lambda: "▶ moving" in status(pilot))
        typed(pilot, "ctrl+x")
        await until(pilot, lambda: "■ at rest" in status(pilot))


async def test_raw_mode_shows_the_bytes_and_names_the_bus(tmp_path: Path) -> None:
    async with press(tmp_path) as pilot:
        typed(pilot, "/raw", "enter")
        await until(pilot, lambda: "press raw, /raw off ends ▸" in app_of(pilot).main.lines("label").plain)
        assert "press is raw" in transcript(pilot)
        typed(pilot, "/raw end lf", "enter")
        typed(pilot, "aPR P", "enter")
        await until(pilot, lambda: "61 50 52 20 50 0A" in transcript(pilot))
        typed(pilot, f"/bytes {sealed(b'aPR P').hex()} LF", "enter")
        await until(pilot, lambda: "06 30 D0 0D 0A" in transcript(pilot))
        typed(pilot, "/raw off", "enter")
        await until(pilot, lambda: "a ▸" in app_of(pilot).main.lines("label").plain)


async def test_what_no_frame_showed_before_a_bus_was_there_is_on_its_page(
    tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Settings(folder=tmp_path / "config", state=tmp_path / "state", data=tmp_path / "data")
    session = Session(settings)
    app = MultidropApp(session, [], Assist(session, settings))
    async with app.run_test(size=(80, 24)) as pilot:
        with monkeypatch.context() as patch:
            patch.setattr(app.presenter, "take_records", print)
            app.show_line("this is said early")
            await session.open("sim:#press")
            await until(pilot, lambda: app.main.current == "press")
        await until(pilot, lambda: "press: a b c" in transcript(pilot))
        assert "this is said early" in transcript(pilot)
    await session.close()
