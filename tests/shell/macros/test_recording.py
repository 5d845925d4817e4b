"""A recording on simulated drives: lines, drives, what came back, roles, and waits in place of pauses."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.base.errors import Refused
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified
from multidrop.shell.session import Session

pytestmark = pytest.mark.virtual

CELL = """
[[bus]]
name = "press"
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { EM = 0 }
[bus.drive.world]
inputs = [[0.0, 1, 1], [7.0, 1, 0]]
[[bus]]
name = "eth"
[[bus.drive]]
personality = "LMDCE"
"""


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[Session]:
    (tmp_path / "cell.toml").write_text(CELL)
    session = Session(Settings({}, tmp_path, tmp_path / "state"))
    session.cell_file = f"sim:{tmp_path / 'cell.toml'}"  # type: ignore[attr-defined]
    yield session
    await session.close()


async def typed(session: Session, *lines: str | float) -> list[str]:
    """Type lines; a number is a pause, s. Returns the notices."""
    told: list[str] = []
    leave = session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    for line in lines:
        if isinstance(line, str):
            await session.run(line)
        else:
            await asyncio.sleep(line)
    leave()
    return told


def url(session: Session) -> str:
    return session.cell_file  # type: ignore[attr-defined,no-any-return]


async def test_the_file_holds_drive_time_and_what_came_back(session: Session) -> None:
    await session.open(f"{url(session)}#press")
    await typed(session, "/record m", "PR P", 0.5, "VM 99000")
    with pytest.raises(Refused):
        await session.run("PR QZ")
    await typed(session, "/record stop")
    macro = session.macros.load("m")
    asked, speed, refused = macro.steps
    assert (asked.line, asked.drive, asked.replies) == ("@a PR P", "press:a", ("0",))
    assert (speed.line, speed.replies) == ("@a VM 99000", ())
    assert refused.replies[0].startswith("failed: ")
    assert macro.roles == () and macro.recorded[:2] == "20"


async def test_with_several_buses_the_bus_becomes_a_role(session: Session) -> None:
    await session.open(url(session))
    await typed(session, "/record m", "PR P", "/wait P=0", "/record stop")
    macro = session.macros.load("m")
    assert macro.lines == ("@press:a PR P", "/wait @press:a P=0") and macro.roles == ("press",)


async def test_waits_are_put_in_on_request(session: Session) -> None:
    await session.open(f"{url(session)}#press")
    told = await typed(session, "/record m", "MR 51200", 4.0, "PR P", "/record stop --waits")
    assert told[-1].startswith("macro m: before step 2, /wait stopped 1")
    macro = session.macros.load("m")
    assert [step.line.rpartition(" ")[0] for step in macro.steps] == ["@a MR", "/wait stopped", "@a PR"]
    assert [step.after for step in macro.steps] == [0.0, 0.0, 0.0]


async def test_waits_are_offered_and_a_yes_puts_them_in(session: Session) -> None:
    await session.open(f"{url(session)}#press")
    asked: list[str] = []

    async def ask(question: str) -> bool:
        asked.append(question)
        assert len(session.macros.load("m").steps) == 2  # it is saved already
        return True

    session.front.ask = ask
    told = await typed(session, "/record m", "MR 51200", 4.0, "PR P", "/record stop")
    assert asked[0].startswith("macro m: put waits in place of pauses: before step 2, /wait stopped 1")
    assert told[-1] == "macro m: 1 pause replaced"
    assert len(session.macros.load("m").steps) == 3


@pytest.mark.parametrize("person", [True, False])
async def test_after_a_no_and_without_a_person_the_pauses_stay_and_the_way_is_told(
    session: Session, person: bool
) -> None:
    await session.open(f"{url(session)}#press")

    async def ask(question: str) -> bool:
        return False

    session.front.ask, session.questions.agreed = ask if person else None, not person
    told = await typed(session, "/record m", "MR 51200", 4.0, "PR P", "/record stop")
    assert told[-1].endswith("would fit; /macro edit m changes it")
    assert [step.after > 3 for step in session.macros.load("m").steps] == [False, True]


async def test_an_input_that_changed_is_seen_while_conditions_are_watched(session: Session) -> None:
    (bus,) = await session.open(f"{url(session)}#press")
    with_watch = bus.telemetry.watch(["a"], 0.2)
    told = await typed(session, 1.0, "/record m", "PR P", 8.0, "PR V", "/record stop")
    with_watch.close()
    assert "/wait @a I1=1" in told[-1]


async def test_a_recording_that_nobody_ended_is_kept(session: Session, tmp_path: Path) -> None:
    await session.open(f"{url(session)}#press")
    await typed(session, "/record m", "PR P")
    told: list[str] = []
    session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    await session.close()
    assert told == [f"the recording m was not ended: 1 line kept in {tmp_path / 'macros' / 'm.toml'}"]
    again = Session(Settings({}, tmp_path, tmp_path / "state"))
    await again.run("/record m --replace")
    await again.run("/sleep 0")
    await again.close()
    assert again.macros.load("m").lines == ("@a PR P",) and again.macros.load("m-2").lines == ("/sleep 0",)


async def test_an_empty_recording_leaves_no_file(session: Session) -> None:
    await typed(session, "/record m")
    await session.close()
    assert session.macros.names() == []


async def test_replace_keeps_key_page_note_and_on_stop(session: Session) -> None:
    await session.open(f"{url(session)}#press")
    session.macros.folder.mkdir()
    (session.macros.folder / "m.toml").write_text(
        'name = "m"\nkey = "F3"\npage = 2\nnote = "n"\non_stop = ["@a MA 0"]\non_early_end_moves = true\n'
        '[[step]]\nline = "x"\n'
    )
    await typed(session, "/record m --replace", "PR P", "/record stop")
    macro = session.macros.load("m")
    assert (macro.place, macro.note, macro.on_early_end, macro.on_early_end_moves, macro.lines) == (
        "F3 (page 2)",
        "n",
        ("@a MA 0",),
        True,
        ("@a PR P",),
    )
