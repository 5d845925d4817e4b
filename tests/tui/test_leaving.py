"""What is typed after a quit is never sent, and it is named; the stop key works until the process ends."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events

from multidrop.shell.session import Session
from multidrop.tui.screens.dialogs import Confirm
from tests.support.fake_session import FakeSession, demo_session, on_screen
from tests.support.pty_screen import PtyScreen, demo, on_a_pty
from tests.support.real_screen import real_app

pytestmark = [pytest.mark.tui, pytest.mark.pty]

QUITS = {"key": b"\x11", "verb": b"/quit\r", "other verb": b"/exit\r", "word": b"quit\r", "other word": b" Exit\r"}


@asynccontextmanager
async def real(folder: Path) -> AsyncIterator[tuple[PtyScreen, Session]]:
    """The app on a real session with three simulated drives, on a pseudo-terminal."""
    apps = []

    def make(driver):  # type: ignore[no-untyped-def]
        apps.append(real_app(folder, driver=driver))
        return apps[-1]

    async with on_a_pty(make) as screen:
        session = screen.app.session
        await screen.until(lambda: session.selected is not None)
        await screen.rest()
        try:
            yield screen, session
        finally:
            await session.close()


def sent(session: Session) -> list[str]:
    """The commands that can move the selected drive, as its record counts them."""
    drive = session.selected
    return [] if drive is None else [drive.address] * drive.commands


@pytest.mark.parametrize("quit_", QUITS.values(), ids=QUITS)
async def test_a_line_after_a_quit_in_the_same_read_is_not_sent_and_named(tmp_path: Path, quit_: bytes) -> None:
    async with real(tmp_path) as (screen, session):
        before = sent(session)
        screen.write(quit_ + b"SL 200000\r@b MR 5\r")
        await screen.until(lambda: screen.exits == [0])
        await screen.rest()
        assert sent(session) == before
        assert screen.app.leaving.named() == [
            "not sent, as multidrop is ending: SL 200000",
            "not sent, as multidrop is ending: @b MR 5",
        ]


async def test_the_session_refuses_a_line_of_a_person_after_a_quit_but_a_stop(tmp_path: Path) -> None:
    async with real(tmp_path) as (screen, session):
        screen.write(b"\x11")
        await screen.until(lambda: screen.exits == [0])
        assert not await session.start("SL 200000")
        assert await session.start("/stop") and session.stops == 1


async def test_what_was_sent_before_the_quit_is_answered_before_it_is_decided(tmp_path: Path) -> None:
    async with real(tmp_path) as (screen, session):
        screen.write(b"SL 200000\r\x11@b SL 5\r")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        assert any("a moves at" in line for line in screen.app.screen.lines)  # type: ignore[attr-defined]
        assert screen.exits == []
        screen.write(b"\x18")
        await screen.until(lambda: session.stops == 1)
        await screen.shows("not sent, as it was typed after a quit: @b SL 5")
        assert session.buses["press"].drives["b"].commands == 0


async def test_the_stop_key_after_an_accepted_quit_stops(tmp_path: Path) -> None:
    async with real(tmp_path) as (screen, session):
        screen.write(b"\x11")
        await screen.until(lambda: screen.exits == [0])
        screen.write(b"MR 5\r\x18")
        await screen.until(lambda: session.stops == 1)
        halt = session.buses["press"].last_stop
        assert halt is not None and halt.data


async def test_of_a_quit_and_a_stop_in_one_read_the_stop_is_done_and_the_quit_dropped() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"\x11\x18")
        assert (session.stops, screen.exits) == (1, [])


@pytest.mark.parametrize("answer", [b"\x1b[B\x1b[B\r", b"\x1b", b"s\x1b"], ids=["stay", "escape", "letter"])
async def test_keys_typed_before_the_question_answer_nothing_and_after_a_no_the_lines_are_named(
    answer: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = demo_session()
    session.moves = ["press:a moves at 5 a second"]
    async with demo(session) as (screen, _, _):
        screen.write(b"\x11\rSL 200000\r")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        await screen.rest()
        assert (screen.exits, session.stops) == ([], 0), "Enter stops all and quits, but it was typed before"
        screen.app.keyboard.hear()
        await screen.type(answer)
        await screen.until(lambda: screen.app.screen is screen.app.main)
        await screen.shows("not sent, as it was typed after a quit: SL 200000")
        await screen.type(b"PR P\r")
        assert session.sent == ["press:a PR P"] and screen.exits == []


async def test_lines_that_wait_are_asked_about_and_sent_after_a_no(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    session = demo_session()
    session.gate = asyncio.Event()
    async with demo(session) as (screen, _, _):
        screen.write(b"MR 1\rMR 2\r\x11")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        assert screen.app.screen.lines == ["1 line waits and would not be sent"]  # type: ignore[attr-defined]
        session.gate.set()
        for _ in range(20):
            await asyncio.sleep(0)
        assert session.sent == ["press:a MR 1"], "it waits for the answer"
        screen.write(b"\x1b")
        await screen.until(lambda: session.sent == ["press:a MR 1", "press:a MR 2"])


async def test_lines_that_wait_are_named_after_a_yes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    session = demo_session()
    session.gate = asyncio.Event()
    async with demo(session) as (screen, _, _):
        screen.write(b"MR 1\rMR 2\r\x11")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        screen.write(b"\x1b[B\r")
        await screen.until(lambda: screen.exits == [0])
        session.gate.set()
        await screen.rest()
        assert session.sent == ["press:a MR 1"]
        assert screen.app.leaving.named() == ["not sent, as multidrop is ending: MR 2"]


@pytest.mark.parametrize("close", [b"/quit", b"/close press"], ids=["quit", "close"])
async def test_a_paste_is_sent_as_far_as_its_quit_or_close(
    tmp_path: Path, close: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    async with real(tmp_path) as (screen, session):
        a, b = (session.buses["press"].drives[name] for name in "ab")
        screen.write(b"\x1b[200~MR 1\r" + close + b"\rSL 200000\r@b SL 5\r\x1b[201~")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        screen.write(b"\r")
        if b"quit" in close:  # lines wait, so it asks
            await screen.until(lambda: getattr(screen.app.screen, "heading", "") == "Quit?")
            screen.write(b"\x1b[B\r")
            await screen.until(lambda: screen.exits == [0])
            assert [text.rpartition(": ")[2] for text in screen.app.leaving.named()] == ["SL 200000", "@b SL 5"]
        else:
            await screen.until(lambda: not session.buses)
            await screen.until(lambda: screen.app.outbox.idle)
        await screen.rest()
        assert (a.commands, b.commands) == (1, 0)


async def test_a_macro_with_a_quit_that_is_declined_ends_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    async with real(tmp_path) as (screen, session):
        await session.run("/record m")
        for line in ("/quit", "SL 200000"):
            session.recorder.record(line, session.now())
        await session.run("/record stop")
        commands = session.buses["press"].drives["a"].commands
        screen.write(b"/play m\r")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        assert screen.app.screen.lines == ["a macro, a script or a transfer runs"]  # type: ignore[attr-defined]
        screen.write(b"\x1b")
        await screen.shows("multidrop goes on")
        await screen.until(lambda: not session.playing)
        assert screen.exits == []
        assert session.buses["press"].drives["a"].commands == commands


async def test_a_signal_drops_what_is_typed_after_it() -> None:
    async with demo() as (screen, session, _):
        screen.app.interrupted()
        await screen.type(b"MR 5\r")
        assert (screen.exits, session.sent) == ([130], [])
        assert screen.app.leaving.named() == ["not sent, as multidrop is ending: MR 5"]


class Closing(FakeSession):
    """Its `in_motion` takes as long as a gate is closed."""

    asked: asyncio.Event

    async def in_motion(self) -> list[str]:
        await self.asked.wait()
        return self.moves


async def test_keys_wait_while_a_quit_is_decided_whatever_their_reads() -> None:
    session = Closing(*demo_session().buses.values())
    session.asked = asyncio.Event()
    async with demo(session) as (screen, _, _):
        screen.write(b"\x11")
        await screen.read_all()
        screen.write(b"SL 2")
        await screen.read_all()
        screen.write(b"00000\r")
        await screen.read_all()
        screen.write(b"/quit\r\x11")
        await screen.read_all()
        assert (session.sent, screen.exits) == ([], [])
        session.asked.set()
        await screen.until(lambda: screen.exits == [0])
        assert session.sent == []
        assert screen.app.leaving.named()[0] == "not sent, as multidrop is ending: SL 200000"


async def test_a_stop_cancels_a_quit_that_is_being_decided_and_what_is_typed_after_it_counts() -> None:
    session = Closing(*demo_session().buses.values())
    session.asked, session.busy = asyncio.Event(), True
    async with demo(session) as (screen, _, _):
        screen.write(b"\x11")
        await screen.read_all()
        screen.write(b"SL 2")
        await screen.read_all()
        screen.write(b"\x18PR P\r")
        await screen.until(lambda: session.stops == 1)
        session.asked.set()
        await screen.rest()
        assert (screen.app.screen, screen.exits) == (screen.app.main, [])
        assert session.sent == ["press:a PR P"]


async def test_keys_count_at_once_behind_a_stop_that_closed_the_question_of_a_quit() -> None:
    async with demo() as (screen, session, _):
        session.busy = True
        screen.write(b"\x11")
        await screen.until(lambda: isinstance(screen.app.screen, Confirm))
        await screen.type(b"\x18PR P\r")
        assert (session.stops, session.sent, screen.exits) == (1, ["press:a PR P"], [])


async def test_what_is_typed_once_the_end_is_accepted_is_taken_by_no_part_of_the_screen_and_named() -> None:
    async with on_screen() as (pilot, app, session):
        app.leaving.accept()
        for key in (*"SL", "enter", *"PR"):
            app.post_message(events.Key(key, "\r" if key == "enter" else key))
        await pilot.pause()
        assert (app.main.entry.value, session.lines) == ("", [])
        named = app.leaving.named()
        assert [text.rpartition(" ")[2] for text in named] == ["SL", "PR"], named
