"""Nothing that was typed before a stop runs after it: bytes at the real driver, and the simulated drives to check."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from multidrop.drives.events import Traffic
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.shell.events import Entered, OnBus, SessionEvent
from multidrop.shell.session import Session
from multidrop.tui.screens.dialogs import Confirm, SearchDialog
from multidrop.tui.screens.start import Start
from tests.support.fake_session import FakeSession, demo_session
from tests.support.pty_screen import PtyScreen, demo, on_a_pty
from tests.support.real_screen import real_app
from tests.support.until import PATIENCE

pytestmark = [pytest.mark.tui, pytest.mark.pty]
STOP = b"\x18"


class Press:
    """The simulated press under the app, on a pty."""

    def __init__(self, session: Session, screen: PtyScreen) -> None:
        self.session, self.screen = session, screen
        self.entered: list[str] = []
        self.wire = bytearray()
        session.subscribe(self._hear)

    def _hear(self, event: SessionEvent) -> None:
        if isinstance(event, Entered):
            self.entered.append(event.line)
        elif isinstance(event, OnBus) and isinstance(event.event, Traffic) and event.event.outgoing:
            self.wire += event.event.data

    def moving(self) -> list[str]:
        """The drives that move in the simulator."""
        running = self.session.cells["press"]
        now = running.now()
        return [
            placed.spec.name
            for placed in running.floor.drives
            if isinstance(placed.device, MCodeDevice) and placed.device.moving(now)
        ]

    async def stands(self) -> None:
        """Wait until the stop was repeated and read back; then nothing moves, and nothing starts to."""
        await asyncio.wait_for(self.session.buses["press"].stopped(), PATIENCE)
        for _ in range(20):
            await asyncio.sleep(0.01)
            assert self.moving() == []


@asynccontextmanager
async def press(folder: Path) -> AsyncIterator[Press]:
    async with on_a_pty(lambda driver: real_app(folder, driver=driver)) as screen:
        session = screen.app.session
        await screen.until(lambda: session.selected is not None)
        await screen.rest()
        yield Press(session, screen)
    await session.close()


async def test_a_line_and_a_stop_in_one_write_never_leave_a_drive_running(tmp_path: Path, nightly: bool) -> None:
    async with press(tmp_path) as bench:
        for count in range(1, 9 if nightly else 4):
            await bench.screen.type(b"SL 50000\r" + STOP)
            assert bench.session.stops == count
            assert bench.entered == [], "the line was typed before the stop"
            await bench.stands()
        assert b"SL 50000" not in bench.wire
        await bench.screen.shows("stopped; not sent: SL 50000")
        await bench.screen.type(b"PR P\r")
        await bench.screen.until(lambda: bench.entered == ["PR P"])


@pytest.mark.parametrize(
    "apart", [0.0, 0.002, 0.01, 0.05, *(pytest.param(each, marks=pytest.mark.nightly) for each in (0.001, 0.005, 0.02))]
)
async def test_a_stop_shortly_after_a_line_leaves_nothing_running(tmp_path: Path, apart: float, nightly: bool) -> None:
    async with press(tmp_path) as bench:
        for count in range(1, 9 if nightly else 4):
            for group in (b"SL 50000\r", b"@b SL 7000\rMR", STOP):
                bench.screen.write(group)
                await asyncio.sleep(apart)
            await bench.screen.until(lambda count=count: bench.session.stops == count)  # type: ignore[misc]
            await bench.stands()
            await bench.screen.rest()
            assert bench.screen.app.main.entry.value == ""


async def test_lines_that_wait_for_an_answer_are_not_sent_after_the_stop(tmp_path: Path) -> None:
    async with press(tmp_path) as bench:
        bench.screen.write(b"".join(b"SL %d\r" % (1000 + n) for n in range(40)))
        await bench.screen.until(lambda: len(bench.entered) > 3)
        bench.screen.write(STOP)
        await bench.screen.until(lambda: bench.session.stops == 1)
        sent = len(bench.entered)
        await bench.stands()
        assert len(bench.entered) == sent < 40
        await bench.screen.shows("lines were not sent")


@pytest.mark.parametrize("how", ["byte", "/stop", "signal", "elsewhere"])
async def test_any_stop_empties_the_line_of_every_tab_and_keeps_it_in_the_history(how: str) -> None:
    async with demo() as (screen, session, assist):
        await screen.type(b"MR 51", b"\x1b2", b"SL 9")
        if how == "byte":
            await screen.type(STOP + b"PR")
        elif how == "/stop":
            await screen.type(b"\x1b3", b"/stop\rPR")
        else:
            session.stop(how)
            await screen.rest()
            await screen.type(b"PR")
        assert screen.app.main.entry.value == "PR", "what came behind the stop begins a new line"
        await screen.type(b"\x1b1")
        assert screen.app.main.entry.value == ("PR" if session.selected_bus != "press" else "")
        assert {"MR 51", "SL 9"} <= set(assist.history())
        await screen.shows("not sent: MR 51", "press")
        await screen.shows("not sent: SL 9", "eth")
        assert [line for line, _ in session.lines] == (["/stop"] if how == "/stop" else [])


ASKED = {
    "selector": b"\x0f\x1b[B",
    "history": b"\x12m",
    "palette": b"\x10st",
    "help": b"\x1bOP",
    "name": b"\x10record a\rgo",
    "quit": b"\x11",
    "paste": b"\x1b[200~MR 1\rMR 2\r\x1b[201~",
}


@pytest.mark.parametrize("together", [True, False])
async def test_a_stop_cancels_what_is_being_asked(together: bool) -> None:
    session = demo_session()
    async with demo(session) as (screen, _, _):
        for count, (asked, keys) in enumerate(ASKED.items(), 1):
            session.busy = True
            await screen.type(*([keys + STOP + b"\rPR P\r"] if together else [keys, STOP, b"\rPR P\r"]))
            assert session.stops == count, asked
            assert screen.app.screen is screen.app.main, asked
            assert session.sent == ["press:a PR P"] * count, asked
            assert screen.exits == [], asked


async def test_a_stop_leaves_the_first_screen_where_it_is_the_only_one() -> None:
    async with demo(FakeSession()) as (screen, session, _):
        await screen.type(b"sim", STOP)
        assert session.stops == 1
        assert isinstance(screen.app.screen, Start)
    async with demo() as (screen, session, _):
        await screen.type(b"\x10open\r")
        assert isinstance(screen.app.screen, Start)
        await screen.type(STOP)
        assert screen.app.screen is screen.app.main


async def test_a_stop_under_a_small_terminal_cancels_the_dialog_beneath() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"\x1b[200~MR 1\rMR 2\r\x1b[201~")
        assert isinstance(screen.app.screen, Confirm)
        screen.resize(40, 10)
        await screen.until(lambda: len(screen.app.screen_stack) == 3)
        await screen.type(STOP)
        screen.resize(80, 24)
        await screen.until(lambda: len(screen.app.screen_stack) == 1)
        await asyncio.sleep(0.6)
        await screen.type(b"\r")
        assert session.sent == []


async def test_a_stop_in_a_paste_drops_all_of_the_paste() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"\x1b[200~MR 1\rMR", STOP, b" 2\rMR 3\r", b"MR 4\r\x1b[201~PR P\r")
        assert session.sent == ["press:a PR P"]
        assert isinstance(screen.app.screen, type(screen.app.main))
        await screen.shows("the rest of the paste in which the stop came was dropped, too")


async def test_keys_and_stops_in_quick_alternation_send_only_what_came_behind_a_stop() -> None:
    async with demo() as (screen, session, _):
        for count in range(30):
            screen.write(b"MR %d\rMR" % count + STOP + b"PR %d\r" % count)
        await screen.rest()
        assert session.stops >= 1
        assert not [line for line in session.sent if "MR" in line.partition(" ")[2] and "PR" not in line]


async def test_a_stop_that_automation_is_refused_by_is_not_undone_by_a_key_behind_it() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"/resume\r" + STOP)
        assert session.latched
        assert session.sent == []


@pytest.mark.parametrize("waiting", [False, True], ids=["in the line", "not yet in the line"])
async def test_what_a_stop_drops_is_told_with_the_line_that_it_belonged_to(waiting: bool) -> None:
    async with demo() as (screen, session, assist):
        if waiting:
            screen.app.keyboard.hold("a test")
            screen.write(b"MR 51")
            await screen.read_all()
        else:
            await screen.type(b"MR 51")
        screen.write(b"200\rPR P\rS" + STOP + b"PR")
        await screen.read_all()
        screen.app.keyboard.release("a test")
        await screen.rest()
        assert session.sent == []
        await screen.shows("stopped; 3 lines were not sent: MR 51200 · PR P · S")
        assert assist.history()[-3:] == ["MR 51200", "PR P", "S"]
        assert screen.app.main.entry.value == "PR"
        await screen.type(b"\x10st" + STOP)
        assert assist.history()[-1] == "PR", "the letters of a search are no line"


async def test_two_stops_before_the_line_is_emptied_tell_of_all_that_was_dropped_once() -> None:
    async with demo() as (screen, session, assist):
        await screen.type(b"MR 51")
        session.stop("first")
        screen.app.dropped("200")
        session.stop("second")
        screen.app.dropped("MR 7\rS")
        await screen.rest()
        assert session.sent == []
        await screen.shows("stopped; 3 lines were not sent: MR 51200 · MR 7 · S")
        assert assist.history()[-3:] == ["MR 51200", "MR 7", "S"]
        assert screen.app.main.entry.value == ""


async def test_the_search_is_closed_and_its_line_is_not_taken() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"\x12MR 5")
        assert isinstance(screen.app.screen, SearchDialog)
        await screen.type(STOP + b"\r")
        assert screen.app.main.entry.value == ""
        assert session.sent == []
