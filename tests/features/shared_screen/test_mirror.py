"""A screen that is shared, and one that watches it: two apps over a Unix socket, with simulated drives."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
from textual import events
from textual.pilot import Pilot

from multidrop.drives.stopping import Fate
from multidrop.features.shared_screen.feed import ScreenFeed, Shared, SharedBus, SharedDrive, sharing
from multidrop.features.shared_screen.join import joined
from multidrop.features.shared_screen.mirror import watch
from multidrop.features.shared_screen.wire import Dropped, Item, line
from multidrop.shell.configuration import Settings
from multidrop.shell.roles import Series
from multidrop.shell.secrets import without_secrets
from multidrop.shell.stop_report import DriveFate, headline
from multidrop.transports.relay_pipe import SocketStream
from multidrop.tui.app import MultidropApp
from multidrop.tui.curves.samples import TraceQuantity
from multidrop.tui.screen_model import Record
from tests.support.fake_session import painted, readable
from tests.support.real_screen import real_app
from tests.support.until import PATIENCE, until

pytestmark = [pytest.mark.tui, pytest.mark.AF_UNIX]


class Pair(NamedTuple):
    """A host, a watcher, and the connection of the watcher."""

    host: MultidropApp
    at_host: Pilot[int]
    watcher: MultidropApp
    pilot: Pilot[int]
    connection: SocketStream
    feed: ScreenFeed

    async def until(self, true: Callable[[], object]) -> None:
        """Let both work until a condition holds."""
        async with asyncio.timeout(PATIENCE):
            while not true():
                await asyncio.sleep(0.01)

    async def type(self, *keys: str) -> None:
        """Press keys at the watcher."""
        await self.pilot.press(*keys)


@asynccontextmanager
async def watched(url: str = "sim:#press", size: tuple[int, int] = (80, 24)) -> AsyncIterator[Pair]:
    """A host on a cell at 100 x 30, and a watcher."""
    with tempfile.TemporaryDirectory(prefix="md") as made:
        folder = Path(made)
        host = real_app(folder, url)
        async with host.run_test(size=(100, 30)) as at_host:
            async with asyncio.timeout(PATIENCE):
                while host.session.selected is None:
                    await at_host.pause(0.01)
            with sharing(host, folder / "screens") as feed:
                connection, name, early = await asyncio.to_thread(joined, "", folder / "screens")
                watcher = watch(connection, name, early, Settings(folder=folder / "other", state=folder / "others"))
                async with watcher.run_test(size=size) as pilot:
                    pair = Pair(host, at_host, watcher, pilot, connection, feed)
                    await pair.until(lambda: watcher.session.buses and feed.watchers)
                    try:
                        yield pair
                    finally:
                        connection.close(False)
            await watcher.session.close()
        await host.session.close()


def texts(app: MultidropApp) -> list[str]:
    """The transcript that is shown, without the remarks of that screen and without passwords."""
    return [without_secrets(each.text) for each in app.last_records(100) if not each.private]


def remarks(app: MultidropApp) -> list[str]:
    kept = [each.text for each in app.last_records(100) if each.private or each.mark == "x"]
    return [each for each in kept if not each.startswith("you watch the screen of ")]


def shown(app: MultidropApp) -> str:
    return "\n".join(strip.text for strip in painted(app.screen))


async def test_a_watcher_sees_and_stops_what_the_host_has() -> None:
    async with watched() as pair:
        host, watcher = pair.host.session, pair.watcher
        host.start("VM=5")
        host.start("/open tcp://me:secret@127.0.0.1:1")
        pair.host.show_line("not sent: PASSWORD")
        host.start("MR 51200")
        await pair.until(lambda: "MR 51200" in texts(watcher) and texts(watcher) == texts(pair.host))
        await pair.until(lambda: any("error 23" in text for text in texts(watcher)))
        said = "".join(each.text for each in watcher.last_records(100))
        assert "tcp://***@127.0.0.1:1" in said and "secret" not in said and "PASSWORD" not in said
        quantity = TraceQuantity("press", "a", "", "position")
        await pair.until(lambda: watcher.model.traces.get(quantity) is not None)
        own, other = (app.model.traces.get(quantity) for app in (pair.host, watcher))
        assert own is not None and other is not None
        await pair.until(lambda: other.values and other.values[-1] == own.values[-1] == 51200)
        assert list(zip(own.at, own.values, strict=True))[-len(other.at) :] == [
            *zip(other.at, other.values, strict=True)
        ]
        await pair.until(lambda: "5.000 mm" in shown(watcher))
        names = pair.feed.watchers
        assert names
        await pair.until(lambda: "watched by 1" in shown(watcher) and names[0][:20] in shown(pair.host))
        watcher.stop_ahead()  # as the thread that reads the keys does
        watcher.stop_all()
        assert watcher.session.tally().of(Fate.SENT)
        await pair.until(lambda: host.stops == 1 and host.tally().stand and watcher.session.tally().stand)
        assert headline(watcher.session.tally()) == headline(host.tally())
        by = f"stop by {names[0]}, who watches: stop sent to every drive; macros and scripts wait for /resume"
        await pair.until(lambda: by in texts(watcher))
        assert not await watcher.session.start("/resume")
        assert host.latched


async def test_the_end_of_a_watcher_is_no_end_at_the_host() -> None:
    async with watched() as pair:
        host = pair.host.session
        task = asyncio.ensure_future(host.run("/sleep 60"))
        await pair.until(lambda: host.busy)
        pair.watcher.interrupted()
        pair.connection.close(True)
        await pair.until(lambda: any(text.endswith("no longer watches this screen") for text in texts(pair.host)))
        assert (host.stops, host.latched, host.busy, pair.feed.watchers) == (0, False, True, [])
        task.cancel()


DRIVES = tuple(SharedDrive(each, "", "mcode", "LMDCM", "6.002", False, ()) for each in "ab")
PRESS = SharedBus(1, "press", "/dev/ttyUSB0", "", DRIVES)
ETH = SharedBus(2, "eth", "tcp://10.0.0.5:503", "", (DRIVES[0]._replace(address=""),))
STATE = Shared(stops=0, selected=("press", "b"), buses=(PRESS, ETH))


class Wire:
    """A connection whose other end is the test: bytes in, bytes out."""

    def __init__(self) -> None:
        self.sent = b""
        self._arrived = asyncio.Queue[bytes]()

    def feed(self, *values: object, bus: str = "press") -> None:
        self._arrived.put_nowait(line(Item(each, bus) for each in values))

    def feed_bytes(self, data: bytes) -> None:
        self._arrived.put_nowait(data)

    def fileno(self) -> int:
        raise AssertionError

    def write(self, data: bytes) -> int:
        self.sent += data
        return len(data)

    def read(self, most: int) -> bytes:
        raise AssertionError

    async def read_some(self) -> bytes:
        return await self._arrived.get()

    def last_words(self) -> str:
        return ""

    def close(self, lost: bool) -> None:
        pass


@asynccontextmanager
async def fed(folder: Path, *values: object) -> AsyncIterator[tuple[Wire, MultidropApp, Pilot[int]]]:
    """A watcher to which the test sends values; the first is the state."""
    wire = Wire()
    app = watch(
        wire, "anna@pc", line(Item(each) for each in (STATE, *values)), Settings(folder=folder, state=folder / "state")
    )
    async with app.run_test(size=(80, 24)) as pilot:
        await until(lambda: app.session.selected_bus)
        await pilot.pause()
        yield wire, app, pilot
    await app.session.close()


REFUSED = ("MR 51200", "/resume", "@b SL 100", "/play go", "/open sim:", "/record x", "/log on", "/macros", "exit", "*")


async def test_nothing_that_a_watcher_types_leaves_but_a_stop(tmp_path: Path) -> None:
    async with fed(tmp_path) as (wire, app, pilot):
        for text in REFUSED:
            assert not await app.session.start(text), text
        await pilot.press(*"MR 5", "enter")
        await until(lambda: sum("only watches" in text for text in remarks(app)) == len(REFUSED) + 1)
        assert remarks(app)[-1] == (
            "MR 5: this screen only watches: Ctrl+X stops everything, and all other lines are typed at the host"
        )
        assert wire.sent == b""
        await pilot.press("ctrl+n")
        await until(lambda: remarks(app)[-1].startswith("the page of controls is at the host; a watcher has drives"))
        assert await app.session.start("/stop")
        assert wire.sent == b"\x18"


PAGES: tuple[tuple[str, ...], ...] = (
    ("M",),
    ("f1",),
    ("ctrl+o",),
    ("ctrl+p", "s"),
    ("ctrl+r",),
    ("ctrl+a",),
    ("ctrl+g",),
)


async def test_the_stop_key_leaves_from_every_screen_of_a_watcher(tmp_path: Path) -> None:
    async with fed(tmp_path) as (wire, app, pilot):
        for number, keys in enumerate(PAGES, 1):
            await pilot.press(*keys)
            app.post_message(events.Key("ctrl+x", None))
            assert wire.sent == b"\x18" * number, keys
            await pilot.pause()
            readable(pilot)
            await pilot.press("escape")
        app.stop_ahead()
        app.stop_all()  # which follows, and sends no second one
        assert wire.sent == b"\x18" * (len(PAGES) + 1)


async def test_buses_drives_and_selection_follow_the_host_until_a_watcher_chooses(tmp_path: Path) -> None:
    record = Record(1.0, "b", ">", "PR P")
    async with fed(tmp_path, record) as (wire, app, _):
        session = app.session
        assert (session.place, [*session.buses]) == (("press", "b"), ["press", "eth"])
        wire.feed(STATE._replace(selected=("eth", "")))
        await until(lambda: session.selected_bus == "eth")
        session.select("a", "press")
        wire.feed(STATE._replace(selected=("press", "b"), plotted=(Series("press", "b"),)))
        await until(lambda: session.plotted)
        assert session.place == ("press", "a")
        programming = PRESS._replace(name="left", drives=(DRIVES[0]._replace(programming=True, label="x"),))
        lost = ETH._replace(lost="no such port; trying again")
        wire.feed(STATE._replace(selected=("left", "a"), buses=(lost, programming)))
        await until(lambda: [*session.buses] == ["eth", "left"])
        assert str(session.buses["eth"].lost) == "no such port; trying again"
        drive = session.buses["left"].drives["a"]
        assert (drive.programming, drive.label, list(session.buses["left"].drives)) == (True, "x", ["a"])
        await until(lambda: app.session.place.bus == "press" or app.session.place.bus == "left")
        assert "PR P" in texts(app)
        wire.feed(STATE._replace(selected=("eth", ""), buses=(ETH,)))
        await until(lambda: [*session.buses] == ["eth"])
        assert (session.buses["eth"].lost, session.place.bus) == (None, "eth")


async def test_what_was_dropped_and_a_stop_of_another_are_said(tmp_path: Path) -> None:
    async with fed(tmp_path) as (wire, app, pilot):
        await pilot.press(*"MR 5")
        found = (DriveFate(Fate.SENT, "a", "press"),)
        wire.feed(Dropped(812), STATE._replace(stops=1, stopped_at=1.0, latched=True, found=found))
        await until(lambda: app.session.latched)
        assert app.session.stops == 1 and app.session.tally().found == found
        await until(lambda: remarks(app))
        assert remarks(app)[0] == "812 lines and values were dropped: this screen was not read in time"
        await until(lambda: not app.main.entry.value)


async def test_a_stop_that_cannot_be_delivered_is_not_reached(tmp_path: Path) -> None:
    for end, why in ((b"", "it has ended, or the connection is lost"), (b"rubbish\n", "it sends what a shared screen")):
        async with fed(tmp_path) as (wire, app, _):
            wire.feed_bytes(end)
            await until(lambda: app.session.buses["press"].lost)
            await until(lambda: any("the host is gone" in text for text in texts(app)))
            assert any(text.startswith(f"the host is gone: {why}") for text in texts(app))
            app.stop_ahead()
            app.stop_all()
            assert wire.sent == b""
            assert [(each.fate, each.name) for each in app.session.tally().found] == [(Fate.NOT_REACHED, "the host")]
            app.frames.wake()
            await until(lambda: "NOT REACHED" in shown(app) and "the host is gone" in shown(app))


@pytest.mark.virtual
async def test_a_stop_that_the_host_does_not_confirm_in_time_is_not_reached(tmp_path: Path) -> None:
    wire = Wire()
    session = watch(wire, "anna@pc", b"", Settings(folder=tmp_path, state=tmp_path / "state")).session
    session.stop()
    assert (wire.sent, [each.fate for each in session.tally().found], session.latched) == (b"\x18", [Fate.SENT], True)
    await asyncio.sleep(1.1)
    (found,) = session.tally().found
    assert (found.fate, found.name, found.why) == (Fate.NOT_REACHED, "the host", "no reply")
    assert "NOT REACHED: the host (no reply) - use the E-stop" in headline(session.tally())
    await session.close()
