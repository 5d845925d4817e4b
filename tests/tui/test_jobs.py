"""The jobs of every day, with no more keys than were agreed on. What is typed counts, and Enter."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from textual.pilot import Pilot

from multidrop.dialects.values import Reading, Readings
from multidrop.drives.events import Sample
from multidrop.shell.events import OnBus, SettingsRead
from multidrop.tui.app import MultidropApp
from multidrop.tui.screens.all_drives import AllDrives
from multidrop.tui.screens.program import ProgramPage
from tests.support.fake_session import (
    FakeBus,
    FakeDrive,
    FakeSession,
    a_move,
    demo_session,
    emit,
    make_app,
    press,
    settle,
)

pytestmark = pytest.mark.tui
Outcome = Callable[[MultidropApp, FakeSession], bool]


class Job(NamedTuple):
    """A job: its keys, the most that it may take, and what has happened then."""

    keys: tuple[str, ...]
    most: int
    done: Outcome


def at_rest(session: FakeSession) -> None:
    session.emit(*(OnBus("press", Sample(session.time, each, 500, 0)) for each in "abc"))


JOBS = {
    "open a known line": Job(("enter",), 1, lambda app, session: list(session.buses) == ["press"]),
    "stop everything": Job(("ctrl+x",), 1, lambda app, session: session.stops == 1),
    "the worst drive": Job(
        ("ctrl+a",),
        1,
        lambda app, session: isinstance(app.screen, AllDrives) and "▸pmx:00" in app.screen.lines("drives").plain,
    ),
    "select drive h of 12": Job(
        ("ctrl+o", "h", "enter"),
        3,
        lambda app, session: session.selected is not None and session.selected.address == "h",
    ),
    "position of a drive": Job((*"PR P", "enter"), 5, lambda app, session: session.sent == ["press:a PR P"]),
    "jog one step": Job(("ctrl+n", "right"), 2, lambda app, session: session.sent == ["press:a MR 100"]),
    "home, on the controls": Job(("h", "-", "enter"), 3, lambda app, session: session.sent == ["press:a HM 1"]),
    "change a setting by a line": Job(
        (*"VM=600000", "enter"), 10, lambda app, session: session.sent == ["press:a VM=600000"]
    ),
    "change a setting on the page": Job(
        ("ctrl+l", *"rc", "enter", *"50", "enter", "enter"),
        8,
        lambda app, session: "press:a RC=50" in session.sent,
    ),
    "record a macro and put it on a key": Job(
        ("f5", *"go", "enter", *"PR P", "enter", "f5"),
        15,
        lambda app, session: (
            [line for line, _ in session.lines] == ["/record go", "PR P", "/record stop", "/key F5 go"]
        ),
    ),
}


async def prepared(pilot: Pilot[int], session: FakeSession, name: str) -> None:
    """Bring the screen to where the job begins."""
    if "controls" in name:
        await press(pilot, "ctrl+n")
    if "jog" in name or "controls" in name:
        at_rest(session)
    if "page" in name:
        read = Readings((Reading("RC", 25), Reading("VM", 768000)))
        await emit(pilot, SettingsRead(session.time, "press", "a", read))


def session_for(name: str) -> FakeSession:
    if "12" in name:
        return FakeSession(FakeBus("press", {each: FakeDrive(each) for each in "abcdefghijkl"}))
    if "open" in name:
        session = FakeSession()
        session.openable["press"] = FakeBus("press", {"a": FakeDrive("a")})
        return session
    return demo_session()


@pytest.mark.parametrize("name", JOBS)
async def test_a_job_takes_no_more_keys_than_were_agreed_on(name: str) -> None:
    job, session = JOBS[name], session_for(name)
    assert len(job.keys) <= job.most
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        if "worst" in name:
            session.emit(*a_move(session, still_moving=False))
        await prepared(pilot, session, name)
        await settle(pilot)
        for key in job.keys:
            session.time += "record" in name  # a second press at the same time is one of a held key
            await press(pilot, key)
        assert job.done(app, session), (session.sent, app.screen)


async def test_a_file_is_downloaded_with_three_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.mxt").write_text("PG 1\nLB G1\nH 100\nE\nPG\n")
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        app.texts.open("a.mxt")
        await press(pilot, "ctrl+e")
        assert isinstance(app.screen, ProgramPage)
        await press(pilot, "ctrl+d", "s", "enter")
        for _ in range(20):
            await asyncio.sleep(0)
        assert [line for line, _ in session.lines] == ["/download a.mxt press:a"]
