"""The start page: what it lists, narrows, opens, opens raw, edits and searches."""

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.state import opened as store
from multidrop.transports import Unreachable
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import StartEntry
from multidrop.tui.screens.dialogs import ChoiceList
from multidrop.tui.screens.start import Start
from multidrop.tui.text import ago
from tests.support.fake_session import FakeAssist, FakeBus, FakeDrive, FakeSession, painted, press, settle


class Assist(FakeAssist):
    def lately(self) -> list[StartEntry]:
        return [StartEntry("lately", "tcp://10.0.0.9:503", "tcp://10.0.0.9:503", "opened 3 h ago")]

    async def scan(self, url: str, found) -> str:
        if "slow" in url:
            await asyncio.Event().wait()
        if "gone" in url:
            raise Diagnostic("no drive replies", url)
        found("a LMDCM at 19200")
        return f"serial:{url}?baud=19200&drives=a"


def made(*openable: str) -> tuple[MultidropApp, FakeSession]:
    session = FakeSession()
    for n, url in enumerate(openable):
        session.openable[url] = FakeBus(f"bus{n}", {"a": FakeDrive("a")})
    return MultidropApp(session, (), Assist()), session


def listed(app: MultidropApp) -> list[str]:
    options = app.screen.query_one(ChoiceList)
    return [str(options.get_option_at_index(n).prompt).strip() for n in range(options.option_count)]


def outcome(app: MultidropApp) -> str:
    return str(app.screen.query_one("#outcome").render())


@pytest.mark.tui
async def test_everything_that_can_be_opened_is_listed_and_typing_narrows_it() -> None:
    app, _ = made()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        shown = listed(app)
        assert [row for row in shown if "  " not in row] == [
            "Saved connections",
            "Opened lately",
            "Serial ports",
            "Without hardware",
        ]
        assert any("opened 3 h ago" in row for row in shown) and any(row.startswith("the tour") for row in shown)
        await pilot.press(*"ftdi")
        assert [row.split()[0] for row in listed(app)] == ["Serial", "/dev/ttyUSB0"]


@pytest.mark.tui
async def test_a_typed_url_is_opened_and_one_that_fails_stays_in_the_line() -> None:
    app, session = made("tcp://10.0.0.7:503")
    async with app.run_test(size=(80, 24)) as pilot:
        await press(pilot, *"tcp://10.0.0.8:503", "enter")
        assert isinstance(app.screen, Start) and "✗ tcp://10.0.0.8:503: no such port" in outcome(app)
        await press(pilot, "left", "left", "left", "left", "backspace", "7", "enter")
        assert app.screen is app.main and list(session.buses) == ["bus0"]


@pytest.mark.tui
async def test_a_port_is_opened_raw_on_its_key() -> None:
    app, session = made("/dev/ttyUSB0")
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "down", "down", "ctrl+b")
        assert session.raw == {"bus0"}


@pytest.mark.tui
async def test_a_search_puts_the_url_of_what_it_finds_into_the_line() -> None:
    app, session = made("serial:/dev/ttyUSB0?baud=19200&drives=a")
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "down", "down", "ctrl+f")
        assert "found 1; Enter opens what is in the line" in outcome(app)
        await press(pilot, "enter")
        assert list(session.buses) == ["bus0"]


@pytest.mark.tui
async def test_a_search_that_finds_nothing_says_so_and_a_stop_leaves_the_page_usable() -> None:
    app, session = made("sim:")
    async with app.run_test(size=(80, 24)) as pilot:
        await press(pilot, *"/dev/gone", "ctrl+f")
        assert "✗ /dev/gone: no drive replies" in outcome(app)
        app.screen.query_one("#url").value = "/dev/slow"  # type: ignore[attr-defined]
        await press(pilot, "ctrl+f", "ctrl+x")
        assert isinstance(app.screen, Start) and session.stops == 1
        assert outcome(app) == "✗ stopped; the search has ended"
        app.screen.query_one("#url").value = "sim:"  # type: ignore[attr-defined]
        await press(pilot, "enter")
        assert app.screen is app.main and list(session.buses) == ["bus0"]


@pytest.mark.tui
async def test_the_url_of_a_port_can_be_edited() -> None:
    app, _ = made()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await pilot.press("down", "down", "tab")
        assert app.screen.query_one("#url").value == "/dev/ttyUSB0?baud=9600"  # type: ignore[attr-defined]
        assert listed(app)[1].startswith("/dev/ttyUSB0?baud=9600")


def test_what_was_opened_last_is_kept_newest_first(tmp_path: Path) -> None:
    assert store.lately(tmp_path / "none") == []
    for url in ("a", "b", "a", *map(str, range(store.MOST_OPENED))):
        store.note(tmp_path, url)
    assert [each.url for each in store.lately(tmp_path)][:2] == ["11", "10"]
    assert len(store.lately(tmp_path)) == store.MOST_OPENED
    (tmp_path / "opened.json").write_text("[")
    assert store.lately(tmp_path) == []
    store.note(tmp_path, "b")
    assert [each.url for each in store.lately(tmp_path)] == ["b"]


@pytest.mark.parametrize(
    ("seconds", "words"), [(3, "just now"), (130, "2 min ago"), (3 * 3600, "3 h ago"), (4 * 86400, "4 days ago")]
)
def test_how_long_ago_is_said_roughly(seconds: float, words: str) -> None:
    assert ago(seconds) == words


@pytest.mark.tui
async def test_on_the_smallest_screen_all_of_a_failure_is_shown() -> None:
    app, session = made("sim:")
    why = "no drive replies; check power, baud and names (drives=a,b,... for a party line); multidrop scan tries all"

    async def refused(*_: object, **__: object) -> None:
        raise Unreachable(why)

    session.open = refused  # type: ignore[method-assign,assignment]
    async with app.run_test(size=(60, 15)) as pilot:
        await press(pilot, *"tcp://x:1", "enter")
        assert why in outcome(app)
        shown = [strip.text for strip in painted(app.screen)]
        assert "tries all" in " ".join(row.strip() for row in shown)
