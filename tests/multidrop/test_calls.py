"""The calls of a program's session beside the wire: a loss, a session that is not begun, its loop, and its end."""

from __future__ import annotations

import asyncio
import logging
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop import connect_async
from multidrop.api import endings
from multidrop.api import programs as programs_of
from multidrop.api.calls import Calls, Lost, lost
from multidrop.api.threads import LoopThread
from multidrop.base.errors import Diagnostic, Stopped, TransportLost
from multidrop.shell.streams import stdout
from tests.support.behind_api import end_all
from tests.support.cell_session import bus, party
from tests.support.virtual import VirtualLoop


def test_a_loss_keeps_its_notes_and_what_is_known_of_the_command() -> None:
    error = TransportLost("press: no carrier")
    error.add_note("script.txt:3")
    found = lost(error)
    assert isinstance(found, Lost) and found.__notes__ == ["script.txt:3"]
    assert str(found) == "press: no carrier; no command of this call is in doubt"
    assert lost(found) is found
    error.unproven = "MA 1"
    assert (str(lost(error)), lost(error).unproven) == ("press: no carrier", "MA 1")


async def test_a_call_before_the_session_has_begun_sends_nothing() -> None:
    calls, shell = Calls(), SimpleNamespace(subscribe=lambda *_: None)
    with pytest.raises(Diagnostic, match="the session is closed"):
        await calls.run(lambda: asyncio.sleep(0))
    calls.open(shell)  # type: ignore[arg-type]
    with pytest.raises(Stopped, match="nothing was sent"):
        await calls.run(lambda: asyncio.sleep(0))
    assert calls.closing() and not calls.closing() and not calls.accepted


def test_what_is_left_in_the_loop_of_a_session_ends_with_it() -> None:
    loop, told = LoopThread(), list[str]()
    begun = threading.Event()

    async def work() -> None:
        begun.set()
        try:
            await asyncio.sleep(60)
        finally:
            await asyncio.sleep(0)
            told.append("its end")

    future = loop.begin(work())
    assert begun.wait(10)
    loop.end()
    assert told == ["its end"] and future.cancelled() and not loop.alive


@pytest.fixture
def at_default() -> Iterator[None]:
    """SIGTERM as a process begins with it."""
    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.usefixtures("at_default")
def test_the_last_session_that_is_closed_gives_the_signals_and_the_reader_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stdout, "watch", None)
    first, second = object(), object()
    endings.opened(first, lambda: None)
    endings.opened(second, lambda: None)
    handler, watch = signal.getsignal(signal.SIGTERM), stdout.watch
    assert handler is not signal.SIG_DFL and watch is not None
    endings.closed(first)
    assert signal.getsignal(signal.SIGTERM) is handler and stdout.watch is watch and not watch.over
    endings.closing(second)
    assert watch.over
    endings.closed(second)
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL and stdout.watch is None


def on_a_line(tmp_path: Path, work: Any) -> None:
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))

    async def connected() -> None:
        async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
            await work(session)

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(connected())


def test_a_session_that_is_open_at_the_end_of_the_process_says_that_no_drive_was_asked(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async def work(session: Any) -> None:
        with caplog.at_level(logging.WARNING):
            end_all()

    on_a_line(tmp_path, work)
    text = "a session was not closed; the stop of its lines was sent, and no drive was asked"
    assert [each.getMessage() for each in caplog.records].count(text) == 1


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({}, (True, False, False, "")),
        ({"save": True}, (True, True, False, "")),
        ({"verify": False}, (False, False, False, "")),
        ({"only_changed": True, "run": "G1"}, (True, False, True, "G1")),
    ],
)
def test_a_download_compares_and_does_nothing_more_unless_that_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: dict[str, Any], wanted: tuple[Any, ...]
) -> None:
    asked = list[Any]()

    async def download(shell: object, origin: object, drive: object, file: str, how: Any, text: str | None) -> None:
        asked.append((file, (not how.no_verify, how.save, how.only_changed, how.run), text))

    async def work(session: Any) -> None:
        monkeypatch.setattr(programs_of.transfers, "download", download)
        await session.drive("a").programs.download("job.mxt", "PG 1\nPG\n", **given)

    on_a_line(tmp_path, work)
    assert asked == [("job.mxt", wanted, "PG 1\nPG\n")]
