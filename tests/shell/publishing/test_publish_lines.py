"""The lines of `multidrop publish`: those that are not there at the start delay no other."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.dialects import Diagnostic
from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import Notified
from multidrop.shell.publishing.command import AGAIN, open_later, open_lines
from multidrop.shell.session import Session
from multidrop.transports import TransportLost
from tests.support.cell_session import bus, party

pytestmark = pytest.mark.virtual


@pytest.fixture
async def session(tmp_path: Path):
    (tmp_path / "here.toml").write_text(bus("press", party("a"), baud=0))
    (tmp_path / "silent.toml").write_text(bus("far", party("b"), baud=0))
    made = Session(Settings({}, tmp_path / "config", tmp_path / "state"), reconnect=True)
    yield made
    await made.close()


def url(folder: Path, name: str) -> str:
    """The URL of a cell in the folder; a line of another drive is one that does not reply."""
    return f"sim:{folder / name}.toml"


async def test_a_line_that_does_not_reply_is_said_and_opened_later(session: Session, tmp_path: Path) -> None:
    said: list[str] = []
    session.subscribe(lambda event: said.append(event.text) if isinstance(event, Notified) and event.warning else None)
    absent = f"{url(tmp_path, 'silent')}?drives=c&timeout=0.1"
    assert await open_lines(session, [url(tmp_path, "here"), absent], later=True) == [absent]
    assert [*session.buses] == ["press"]
    assert len(said) == 1 and said[0].startswith(absent) and "c" in said[0] and "every 30 s" in said[0]
    added: list[str] = []
    waiting = asyncio.create_task(open_later(session, absent, lambda each: added.append(each.name)))
    await asyncio.sleep(2 * AGAIN)
    assert added == [] and [*session.buses] == ["press"]
    (tmp_path / "silent.toml").write_text(bus("far", party("c"), baud=0))
    await asyncio.wait_for(waiting, 3 * AGAIN)
    assert added == ["far"] and [*session.buses] == ["press", "far"]


async def test_without_any_line_or_without_a_second_attempt_the_failure_is_raised(
    session: Session, tmp_path: Path
) -> None:
    absent = "tcp://127.0.0.1:1"
    with pytest.raises(TransportLost):
        await open_lines(session, [absent, absent], later=True)
    with pytest.raises(TransportLost):
        await open_lines(session, [url(tmp_path, "here"), absent], later=False)


async def test_a_wrong_url_is_raised_whatever_opens(session: Session, tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match="gone.toml"):
        await open_lines(session, [url(tmp_path, "here"), url(tmp_path, "gone")], later=True)
