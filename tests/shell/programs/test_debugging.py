"""Trace, single step and break points of an MCode drive in a session, in virtual time: what is sent and what is not."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, Inexpressible, Refused, Stopped
from tests.support.cell_session import CellSession
from tests.support.debugged import ROUND, cell, ethernet, keys, run, serial, shown

pytestmark = pytest.mark.virtual


@pytest.mark.parametrize("em", range(4))
async def test_a_trace_shows_every_line_to_the_end(tmp_path: Path, em: int) -> None:
    async with cell(tmp_path, ethernet(EM=em)) as it:
        rows = await run(it, "/trace")
        assert rows == [*shown(6, *ROUND * 3, 45), "3", *shown(50)]
        assert any("the program has ended" in text for text in it.told())


@pytest.mark.parametrize("em", range(4))
async def test_each_step_executes_one_line_and_shows_what_it_changed(tmp_path: Path, em: int) -> None:
    async with cell(tmp_path, ethernet(EM=em)) as it:
        rows = await run(it, "/step G1")
        assert [row for row in rows if row.startswith("->")] == ["->  6  VA Q1=0"]
        device = it.device("line:!")
        assert device.thread.stepping and keys(it) == 0
        assert await run(it, "/step") == shown(6)
        assert await run(it, "/watch Q1 P") == ["Q1=0   P=0"]
        assert not it.moving()
        assert (await run(it, "/step"))[0].startswith("19  MR 51200") and it.moving() == {"line:!"}
        assert keys(it) == 1
        await run(it, "/wait stopped")
        assert await run(it, "/step") == ["26  H   P=51200"]
        assert await run(it, "/step") == ["28  IC Q1   Q1=1"]
        assert device.thread.stepping


@pytest.mark.parametrize("drive", [serial("!", party=False), serial("!", party=False, product="MDI"), ethernet()])
async def test_a_traced_program_waits_at_its_break_point(tmp_path: Path, drive: str) -> None:
    async with cell(tmp_path, drive) as it:
        await run(it, "/watch P", "/break K1 2")
        rows = await run(it, "/trace")
        assert [row.split("  ")[0] for row in rows[:5]] == ["6", "19", "26", "28", "33"]
        assert rows[5:] == [
            "    1  LB G1",
            "    6  VA Q1=0",
            "   14  LB K1",
            "-> 19  MR 51200",
            "   26  H",
            "   28  IC Q1",
            "   33  BR K1,Q1<3",
        ]
        assert any("waits at the break point K1" in text and "P=51200" in text for text in it.told())
        assert it.device("line:!").thread.stepping and not it.moving()
        assert (await run(it, "/step"))[0].startswith("19  MR 51200") and it.moving()


async def test_a_hold_is_no_break_point(it: CellSession) -> None:
    """H 5000 stands before the line of the break point; its 5 s count as a hold."""
    at = next(line for line in await run(it, "/list") if line.endswith("SL 0")).split()[0]
    await run(it, f"/break {at}")
    began = it.session.now()
    rows = await run(it, "/trace K2")
    assert any(row.startswith("->") and row.endswith("SL 0") for row in rows)
    assert it.session.now() - began > 5


async def test_no_key_is_sent_while_a_hold_is_under_way(it: CellSession) -> None:
    await run(it, "/step K2", "/step", "/step")
    it.events.clear()
    with pytest.raises(Refused, match="'H 5000' holds for another .* no key was sent"):
        await it.session.run("/step")
    await run(it, "/sleep 5")
    assert (await run(it, "/step"))[0].endswith("SL 0")
    assert keys(it) == 1


async def test_no_key_is_sent_while_a_motion_is_waited_for(it: CellSession) -> None:
    await run(it, "/step G1", "/step", "/step", "/step")
    it.events.clear()
    with pytest.raises(Refused, match="'H' waits for the end of the motion; no key was sent"):
        await it.session.run("/step")
    assert keys(it) == 0
    assert await run(it, "/wait stopped", "/step") == shown(28)


async def test_enter_runs_on_and_a_break_shows_where_it_is(it: CellSession) -> None:
    await run(it, "/step K3", "/step", "/continue")
    assert it.device("line:!").running and not it.device("line:!").thread.stepping
    await run(it, "/sleep 1", "/break now")
    assert it.device("line:!").thread.stepping
    assert (await run(it, "/step"))[0].split("  ")[1] in ("IC R1", "BR K3")


@pytest.mark.parametrize(
    "before, line",
    [
        ((), "/step"),
        ((), "/continue"),
        (("EX K3",), "/step"),
        (("EX K3",), "/continue"),
        (("/step K3", "/step", "E"), "/step"),
        (("/step K3", "E", "EX K3"), "/step"),
        (("/step K3", "/continue"), "/step"),
        (("/step K3", "/continue"), "/continue"),
    ],
)
async def test_no_key_without_proof_that_the_drive_waits(it: CellSession, before: tuple[str, ...], line: str) -> None:
    await run(it, *before)
    it.events.clear()
    with pytest.raises(Refused, match="no key was sent|none was sent"):
        await it.session.run(line)
    assert keys(it) == keys(it, b"\r") == 0


async def test_a_value_that_a_person_sets_does_not_end_single_step(it: CellSession) -> None:
    await run(it, "/step G1", "/step", "Q1=2", "PR Q1")
    assert await run(it, "/step") == shown(19)


@pytest.mark.parametrize("settings", [{"CK": 1}, {"CK": 2}])
async def test_no_single_step_with_a_checksum(tmp_path: Path, settings: dict[str, int]) -> None:
    async with cell(tmp_path, serial("!", party=False, **settings)) as it:
        it.events.clear()
        for line in ("/step G1", "/step", "/continue", "/break now", "/break K1"):
            with pytest.raises(Inexpressible, match="with a checksum; nothing was sent"):
                await it.session.run(line)
        assert not it.device("line:!").running
        assert await run(it, "/trace") == [*shown(6, *ROUND * 3, 45), "3", *shown(50)]


async def test_a_party_line_is_traced_but_not_stepped(tmp_path: Path) -> None:
    async with cell(tmp_path, serial("a", EM=1), serial("b", EM=1)) as it:
        with pytest.raises(Inexpressible, match="in party mode; nothing was sent"):
            await it.session.run("/step b G1")
        assert not it.device("line:b").running
        assert await run(it, "/trace b") == [*shown(6, *ROUND * 3, 45), "3", *shown(50)]


async def test_a_drive_named_by_a_digit_bars_the_trace(tmp_path: Path) -> None:
    """Its neighbour prints `4  VA Q1=0`: drive 4 would take that for a command."""
    async with cell(tmp_path, serial("a", EM=1), serial("4", EM=1)) as it:
        with pytest.raises(Refused, match="drive 4 on this line may take it for a command; not started"):
            await it.session.run("/trace a")
        assert not it.device("line:a").running


async def test_a_program_that_runs_is_not_started_again(it: CellSession) -> None:
    await run(it, "EX K3")
    for line in ("/trace", "/step G1"):
        with pytest.raises(Refused, match="a program runs already; not started"):
            await it.session.run(line)


async def test_a_stop_ends_program_and_single_step_and_says_so(it: CellSession) -> None:
    await run(it, "/break K1", "/step G1", "/step", "/step")
    it.session.stop()
    await asyncio.sleep(2)
    assert not it.moving() and not it.device("line:!").thread.stepping
    assert any("no program runs, and single step is over" in text for text in it.told())
    it.events.clear()
    with pytest.raises(Refused, match="none was sent|no key was sent"):
        await it.session.run("/step")
    assert keys(it) == 0


async def test_a_stop_ends_a_trace_and_names_the_break_point_that_is_left(it: CellSession) -> None:
    await run(it, "/break K1 3")
    trace = asyncio.ensure_future(it.session.run("/trace"))
    await asyncio.sleep(0.3)
    it.session.stop()
    with pytest.raises(Stopped):
        await trace
    await asyncio.sleep(2)
    assert not it.moving() and not it.device("line:!").running
    assert any("the break point at K1 stays in the drive until /break off" in text for text in it.told())


async def test_a_bus_that_is_closed_says_what_waits(it: CellSession) -> None:
    await run(it, "/break K1", "/trace", "/close line")
    assert [text for text in it.warned() if "waiting for /step" in text or "stays in the drive" in text] == [
        "line: its program may go on waiting for /step or /continue; a stop ends it",
        "line: the break point at K1 stays in the drive until /break off or power-off",
    ]


async def test_a_locked_program_is_refused_before_the_drive_could(it: CellSession) -> None:
    await run(it, "LK=1")
    for line in ("/trace", "/step G1"):
        with pytest.raises(Refused, match="locked"):
            await it.session.run(line)
    assert await run(it, "PR EF") == ["0"]


async def test_the_lines_have_the_remarks_of_the_downloaded_file(tmp_path: Path) -> None:
    file = tmp_path / "turn.mxt"
    file.write_text("PG 1\nLB Z1\n MR 100   'a small turn\n H\n E\nPG\n")
    async with cell(tmp_path, ethernet()) as it:
        it.session.questions.agreed = True
        await run(it, f"/download {file}")
        rows = await run(it, "/trace Z1")
        assert [row.split()[1:] for row in rows] == [["MR", "100", "'a", "small", "turn"], ["H"], ["E"]]


@pytest.mark.parametrize("line", ["/step", "/continue", "/step ZZ;", "/trace", "/break now"])
async def test_what_is_refused_before_it_is_sent_counts_as_no_start(it: CellSession, line: str) -> None:
    """Else a stop before it would be said to be undone, and a script would stop a drive that a person has started."""
    drive = it.session.drive()
    await run(it, "EX K3" if line == "/trace" else "PR P")
    before = drive.started_at, drive.commanded_at
    with pytest.raises((Refused, Diagnostic)):
        await it.session.run(line)
    assert (drive.started_at, drive.commanded_at) == before


@pytest.mark.parametrize(
    "line, told",
    [
        ("/trace X;1", "no place X;1"),
        ("/step G1,0", "no place G1,0"),
        ("/break G1 0", "no number of passes 0"),
        ("/break G1 x", "no number of passes x"),
        ("/watch", "usage: /watch"),
        ("/watch ER", "ER cannot be watched: reading it clears it"),
        ("/watch MA", "MA cannot be watched: it prints no value"),
        ("/watch P=5", "P=5 cannot be watched"),
        ("/trace a b c", "usage: /trace"),
    ],
)
async def test_wrong_words_are_one_line_and_nothing_is_sent(it: CellSession, line: str, told: str) -> None:
    await run(it, "/list")
    witness = it.device("line:!").thread.executed
    with pytest.raises(Diagnostic, match=told):
        await it.session.run(line)
    assert it.device("line:!").thread.executed == witness and not it.device("line:!").running


async def test_a_label_that_is_not_there_is_refused_by_the_drive(it: CellSession) -> None:
    for line in ("/trace ZZ", "/step ZZ", "/break ZZ"):
        with pytest.raises(Refused, match="error 30"):
            await it.session.run(line)
    await run(it, "/break")
    assert any("no break point of this session" in text for text in it.told())
