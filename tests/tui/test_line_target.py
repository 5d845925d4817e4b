"""A line goes only to the drive that its writer saw: the prompt, tabs, changes without a key."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from textual import events
from textual.message import Message

from multidrop.drives.events import Sample
from multidrop.shell.events import Failed, OnBus, StateChanged
from multidrop.tui.screens.dialogs import Confirm, SearchDialog
from multidrop.tui.screens.start import Start
from multidrop.tui.terminal.keyboard import DEAF_TIME
from tests.support.fake_session import FakeBus, FakeDrive, FakeSession, demo_session
from tests.support.pty_screen import demo, on_a_pty
from tests.support.real_screen import real_app

pytestmark = [pytest.mark.tui, pytest.mark.pty]
NEXT_BUS, BUS_1, BUS_2 = b"\x1b[6;5~", b"\x1b1", b"\x1b2"


@pytest.mark.parametrize(
    "there, back", [(BUS_2, BUS_1), (NEXT_BUS, b"\x1b[5;5~"), (b"\x0f\x1b[B\x1b[B\x1b[B\r", BUS_1)]
)
async def test_a_half_typed_line_stays_with_its_tab(there: bytes, back: bytes) -> None:
    async with demo() as (screen, session, _):
        entry = screen.app.main.entry
        await screen.type(b"MR 51200\x1b[D\x1b[D", there)
        assert (session.selected_bus, entry.value) == ("eth", "")
        await screen.type(b"PR P\r", b"SL", back)
        assert session.sent == ["eth: PR P"]
        assert (entry.value, entry.cursor_position) == ("MR 51200", 6)
        await screen.type(b"9\r", BUS_2)
        assert session.sent[1:] == ["press:a MR 512900"]
        assert entry.value == "SL"


async def test_completions_and_history_stay_with_their_tab_too() -> None:
    async with demo() as (screen, session, _):
        entry = screen.app.main.entry
        await screen.type(b"PR M\t\t", BUS_2, b"\x1b[A\x1b[A", BUS_1, b"\t")
        assert entry.value == "PR MS"
        await screen.type(BUS_2, b"\x1b[A")
        assert entry.value == "VM=600000"


async def test_use_typed_as_a_line_leaves_no_half_a_line_to_another_machine() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"/use eth\rMR 5\r", b"/use press\rMR")
        assert session.sent == ["eth: /use eth", "eth: MR 5", "press:a /use press"]
        assert (session.selected_bus, screen.app.main.entry.value) == ("press", "MR")


async def test_what_is_typed_behind_a_use_that_waits_is_for_what_it_selects() -> None:
    async with demo() as (screen, session, _):
        session.gate = asyncio.Event()
        screen.write(b"MR 1\r/use eth\rMR 2\rMR 345\x1b[D")
        await screen.until(lambda: screen.app.main.entry.value == "MR 345")
        assert session.sent == ["press:a MR 1"]
        session.gate.set()
        await screen.until(lambda: session.selected_bus == "eth")
        await screen.type(b"9\r")
        assert session.sent == ["press:a MR 1", "eth: /use eth", "eth: MR 2", "eth: MR 3495"]
        await screen.type(BUS_1)
        assert screen.app.main.entry.value == ""


async def test_a_selection_that_changes_by_itself_takes_no_key_until_there_is_a_pause() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"MR 512")
        session.select("", "eth")
        await screen.rest()
        await screen.type(b"00\r")
        assert session.sent == []
        assert screen.app.main.entry.value == ""
        await screen.shows(
            "the screen changed while you typed: these keys were dropped; keys count again after a", "eth"
        )
        await asyncio.sleep(DEAF_TIME + 0.1)
        await screen.type(b"PR P\r", BUS_1)
        assert session.sent == ["eth: PR P"]
        assert screen.app.main.entry.value == "MR 512"


async def test_a_drive_that_is_selected_by_something_else_does_not_get_the_line_that_was_for_the_one_before() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"MR 512")
        session.select("b", "press")
        await screen.rest()
        await screen.type(b"00\r")
        assert session.sent == []
        assert screen.app.main.lines("label").plain == " press:clamp ▸ "


async def test_a_frame_that_comes_first_does_not_hide_that_the_selection_changed_by_itself() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"MR 512")
        session.select("", "eth")
        screen.app.tick()
        await screen.type(b"00\r")
        assert session.sent == []
        await screen.type(BUS_1)


async def test_an_enter_that_comes_as_the_selection_changes_by_itself_sends_nothing() -> None:
    async with demo() as (screen, session, assist):
        await screen.type(b"MR 512")
        session.select("", "eth")
        await screen.app.typist.typed("MR 512", screen.app.main.entry.exchange)
        assert session.sent == []
        assert assist.history()[-1] == "MR 512"
        await screen.shows("not sent: MR 512")


async def test_an_enter_that_comes_with_a_paste_does_not_answer_its_question() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"\x1b[200~MR 1\rMR 2\r\x1b[201~\r")
        assert isinstance(screen.app.screen, Confirm)
        assert session.sent == []
        await asyncio.sleep(DEAF_TIME + 0.1)
        await screen.type(b"\r")
        assert session.sent == ["press:a MR 1", "press:a MR 2"]


async def test_pasted_lines_go_to_the_drive_that_their_question_names_whatever_is_selected_by_then() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"\x1b[200~MR 1\rMR 2\r\x1b[201~")
        assert isinstance(screen.app.screen, Confirm)
        session.select("", "eth")
        await screen.rest()
        screen.app.keyboard.hear()  # the person has seen it
        await screen.type(b"\r")
        assert session.sent == ["eth: @press:a MR 1", "eth: @press:a MR 2"]


async def test_the_line_of_a_bus_that_is_closed_is_kept_and_said() -> None:
    async with demo() as (screen, session, assist):
        await screen.type(BUS_2, b"MR 512", BUS_1)
        del session.buses["eth"]
        session.emit(StateChanged(session.time))
        await screen.shows("not sent: MR 512")
        assert assist.history()[-1] == "MR 512"


async def test_a_failure_on_a_bus_that_is_not_open_is_shown_where_one_looks() -> None:
    async with demo() as (screen, session, _):
        session.emit(Failed(session.time, "no bus nosuch is open", "nosuch", "a"))
        await screen.shows("no bus nosuch is open")
        session.emit(OnBus("nosuch", Sample(session.time, "a", 1, 1)))
        assert session.buses["press"].name == "press"
        assert "nosuch" not in screen.app.main.pages


async def test_a_line_or_a_macro_for_a_bus_that_is_not_open_says_so(tmp_path: Path) -> None:
    macros = tmp_path / "config" / "macros"
    macros.mkdir(parents=True)
    (macros / "go.toml").write_text('name = "go"\nkey = "F3"\n[[step]]\nline = "@there:a MR 5"\n')
    async with on_a_pty(lambda driver: real_app(tmp_path, driver=driver)) as screen:
        session = screen.app.session
        await screen.until(lambda: session.selected is not None)
        await screen.type(b"@here:a MR 5\r")
        await screen.shows("no bus here")
        await asyncio.sleep(0.6)
        await screen.type(b"\x1bOR")
        await screen.shows("no bus there")
    await session.close()


# History


async def test_ctrl_r_searches_the_history_and_takes_a_line_without_sending_it() -> None:
    async with demo() as (screen, session, assist):
        assist.kept += ["MR 100", "/wait stopped", "MR 512000", "SL 5"]
        await screen.type(b"PR\x12mr")
        assert isinstance(screen.app.screen, SearchDialog)
        assert [match.key for match in screen.app.screen.found] == ["MR 512000", "MR 100"]
        await screen.type(b"\x12\r")
        assert screen.app.main.entry.value == "MR 100"
        assert session.sent == []
        await screen.type(b"0\r")
        assert session.sent == ["press:a MR 1000"]


async def test_escape_leaves_the_search_and_the_line_as_it_was() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"PR\x12m", b"\x1b")
        await screen.until(lambda: screen.app.screen is screen.app.main)
        assert screen.app.main.entry.value == "PR"


async def test_what_is_nowhere_in_the_history_takes_nothing() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"PR\x12nowhere\r")
        assert isinstance(screen.app.screen, SearchDialog)
        assert session.sent == []


# The first screen


class Slow(FakeSession):
    """Opens a port on request."""

    gate: asyncio.Event
    opening = False

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> list[FakeBus]:
        self.opening = True
        await self.gate.wait()
        return await super().open(url, name)


async def test_keys_behind_the_enter_that_opens_a_bus_are_for_what_it_opens() -> None:
    session = Slow()
    session.openable["sim:"] = FakeBus("press", {"a": FakeDrive("a")})
    session.gate = gate = asyncio.Event()
    async with demo(session) as (screen, _, _):
        assert isinstance(screen.app.screen, Start)
        screen.write(b"sim:\rMR 5\rPR")
        await screen.read_all()
        await asyncio.sleep(0.05)
        assert isinstance(screen.app.screen, Start)
        assert session.sent == []
        session.gate = None
        gate.set()
        await screen.until(lambda: screen.app.screen_stack[-1:] == [screen.app.main])
        await screen.rest()
        assert session.sent == ["press:a MR 5"]
        assert screen.app.main.entry.value == "PR"


async def test_while_a_bus_is_being_opened_one_can_stop_and_quit() -> None:
    session = Slow()
    session.gate = asyncio.Event()
    async with demo(session) as (screen, _, _):
        screen.write(b"sim:\rMR 5\r")
        await screen.until(lambda: session.opening)
        screen.write(b"\x18")
        await screen.until(lambda: session.stops == 1)
        screen.write(b"MR 6\r\x11")
        await screen.until(lambda: screen.exits == [0])
        assert session.sent == []


async def test_to_quit_right_behind_the_enter_that_opens_a_bus_is_to_quit() -> None:
    session = Slow()
    session.gate = asyncio.Event()
    async with demo(session) as (screen, _, _):
        screen.write(b"sim:\rMR 6\r\x11")
        await screen.until(lambda: screen.exits == [0])
        assert session.sent == []


@pytest.mark.parametrize("opened", [b"\x0f", b"\x1bOP", b"\x11"], ids=["selector", "help", "quit"])
async def test_a_paste_into_what_takes_no_text_is_not_asked_about_later(
    opened: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    session = demo_session()
    session.busy = True
    async with demo(session) as (screen, _, _):
        pastes: list[Message] = []
        take = screen.app.keyboard.take

        def noted(message: Message) -> bool:
            pastes.extend([message] if isinstance(message, events.Paste) else [])
            return take(message)

        screen.app.keyboard.take = noted  # type: ignore[method-assign]
        await screen.type(opened, b"\x1b[200~MR 1\rMR 2\r\x1b[201~")
        await asyncio.sleep(0.1)
        assert len(pastes) == 1, "it does not come back"
        await screen.type(b"\x1bM")
        assert screen.app.screen is screen.app.main
        assert (session.sent, screen.app.main.entry.value) == ([], "M")


# The terminal


async def test_keys_typed_as_the_terminal_grows_again_are_not_half_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 1e6)  # keys count once the test says so
    async with demo() as (screen, session, _):
        await screen.type(b"MR 5")
        screen.resize(40, 10)
        await screen.until(lambda: len(screen.app.screen_stack) == 2)
        await screen.type(b"12")
        screen.resize(80, 24)
        await screen.until(lambda: len(screen.app.screen_stack) == 1)
        await screen.type(b"00\r")
        assert session.sent == []
        assert screen.app.main.entry.value == "MR 5"


async def test_a_window_that_loses_the_focus_loses_no_key() -> None:
    async with demo() as (screen, session, _):
        await screen.type(b"MR\x1b[O 5\x1b[I00\r")
        assert session.sent == ["press:a MR 500"]


async def test_clicks_keep_their_place_between_keys() -> None:
    tab = b"\x1b[<0;%d;1M\x1b[<0;%d;1m"
    async with demo() as (screen, session, _):
        await screen.until(lambda: "eth" in screen.app.main.lines("top").plain)
        column = screen.app.main.lines("top").plain.index("eth") + 1
        await screen.type(b"MR 5" + tab % (column, column) + b"PR P\r")
        assert session.sent == ["eth: PR P"]
        await screen.type(BUS_1)
        assert screen.app.main.entry.value == "MR 5"
