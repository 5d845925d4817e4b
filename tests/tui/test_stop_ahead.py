"""The stop does not wait for the event loop: the thread that reads the terminal writes it."""

from __future__ import annotations

import threading

import pytest

from multidrop.tui.app import MultidropApp
from tests.support.fake_session import FakeAssist, demo_session
from tests.support.pty_screen import on_a_pty
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui


async def test_the_stop_is_written_while_the_event_loop_is_held_up() -> None:
    session = demo_session()
    written = threading.Event()
    session.stop_ahead = written.set
    async with on_a_pty(lambda driver: MultidropApp(session, [], FakeAssist(), driver)) as screen:
        screen.write(b"MR 5\x18")
        assert written.wait(PATIENCE)  # and nothing else runs in the loop meanwhile
        assert session.stops == 0
        await screen.rest()
        assert (session.stops, session.lines) == (1, [])
