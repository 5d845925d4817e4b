"""The pages of programs, macros and traffic as pictures, at 80x24 and 120x40. Look at them before you commit."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus, Phase, ProgramRead, ProgramSeen
from multidrop.tui.screens.program import ProgramPage
from tests.support.fake_session import FakeSession, a_move, a_talk, demo_session, make_app, settle
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui

SIZES = {"80x24": (80, 24), "120x40": (120, 40)}
TEXT = """' Goes there and comes back.
VM=768000
PG 1
LB G1
  MA 512000        ' out
  H
  PR "out at ", P
  MA 0             ' back
  H
  BR G1
E
PG
"""
LINES = ["LB G1", "MA 512000 ' out", "H", 'PR "out at ",P', "MA 0 ' back", "H", "BR G1", "E"]
ROWS = tuple((1 + 6 * number, line) for number, line in enumerate(LINES))
Compare = Callable[..., bool]
Act = Callable[[Pilot[int], FakeSession], Awaitable[None]]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("multidrop.tui.screens.edit.PAUSE", 0.02)
    (tmp_path / "shuttle.mxt").write_text(TEXT)
    (tmp_path / "wrong.mxt").write_text(TEXT.replace("MA 0", "MAX 0").replace("PR", "PRINT"))


def drawn(snap_compare: Compare, size: str, act: Act, theme: str = "multidrop-dark") -> bool:
    session = demo_session()
    app = make_app(session, theme=theme)

    async def run(pilot: Pilot[int]) -> None:
        await pilot.pause()
        session.emit(*a_talk(session), *a_move(session))
        await act(pilot, session)
        await settle(pilot)

    return snap_compare(app, terminal_size=SIZES[size], run_before=run)


async def checked(pilot: Pilot[int], file: str) -> ProgramPage:
    """Open a file, and wait for its check."""
    app = pilot.app
    app.texts.open(file)  # type: ignore[attr-defined]
    await app.run_action("act.page('program')")
    async with asyncio.timeout(PATIENCE):
        while not isinstance(app.screen, ProgramPage) or app.screen.findings.pending:
            await pilot.pause(0.01)
            app.tick()  # type: ignore[attr-defined]
    return app.screen


async def with_errors(pilot: Pilot[int], session: FakeSession) -> None:
    await checked(pilot, "wrong.mxt")


async def traced(pilot: Pilot[int], session: FakeSession) -> None:
    page = await checked(pilot, "shuttle.mxt")
    session.emit(ProgramRead(session.time, "press", "a", ROWS))
    async with asyncio.timeout(PATIENCE):
        while not page.findings.addresses:
            await pilot.pause(0.01)
            pilot.app.tick()  # type: ignore[attr-defined]
    session.emit(ProgramSeen(session.time, "press", "a", 25, Phase.BEFORE, "G1"))


async def macros(pilot: Pilot[int], session: FakeSession) -> None:
    await pilot.app.run_action("act.page('macros')")
    for _ in range(3):
        await settle(pilot)


async def traffic(pilot: Pilot[int], session: FakeSession) -> None:
    for number, data in enumerate((b"aPR P\n", b"384112\r\n", b"aMR 512000\n", b"\x06", b"bPR VX\n", b"?\r\n")):
        session.emit(OnBus("press", Traffic(session.time + number / 10, number % 2 == 0, data)))
    await pilot.app.run_action("act.page('traffic')")


@pytest.mark.wide
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("act", [with_errors, traced, macros, traffic])
def test_snapshot_of_a_page(snap_compare: Compare, size: str, act: Act) -> None:
    assert drawn(snap_compare, size, act)


@pytest.mark.parametrize("theme", ["multidrop-ansi", "multidrop-light"])
def test_snapshot_of_a_program_in_other_colours(snap_compare: Compare, theme: str) -> None:
    assert drawn(snap_compare, "80x24", traced, theme)


def test_snapshot_of_a_program_without_colours(snap_compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert drawn(snap_compare, "80x24", traced, "")
