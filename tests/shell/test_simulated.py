"""The whole path in one process: a session on a simulated cell, through real buses."""

import asyncio

import pytest

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped, TransportLost
from multidrop.drives.events import Traffic
from multidrop.shell.configuration import SavedConnection, Settings
from multidrop.shell.events import Failed, Notified, OnBus, Output, Printed
from multidrop.shell.session import Session
from tests.support.cell_session import ETHERNET, bus, drive, party
from tests.support.until import PATIENCE

pytestmark = pytest.mark.virtual

CELL = bus("press", party("a"), drive("LMDCM", "b", party=True, EM=2), baud=0) + bus("eth", ETHERNET, baud=0)
PROGRAM = "' a remark\nVA Q1\nPG 100\nLB Ga\nMR 100\nH\nE\nPG\n"


@pytest.fixture
async def session(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "p.mxt").write_text(PROGRAM)
    saved = {
        "line": SavedConnection("line", "sim:cell.toml#press?timeout=0.3", {"b": "gantry"}),
        "door": SavedConnection("door", "sim:cell.toml#eth", {"!": "door"}),
    }
    made = Session(Settings(saved, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"))
    made.events = []
    made.subscribe(made.events.append)
    yield made
    await made.close()


def output(session):
    return [event.text for event in session.events if isinstance(event, Output | Printed)]


def written(session):
    return b"".join(
        event.event.data
        for event in session.events
        if isinstance(event, OnBus) and isinstance(event.event, Traffic) and event.event.outgoing
    )


async def test_lines_move_drives_and_print_what_they_say(session):
    await session.open("line")
    for line in ("MR 5000", "@gantry MR -700", "/wait stopped", "PR P", "@b PR P", "@* P=0", "PR P"):
        await session.run(line)
    assert output(session) == ["5000", "-700", "0"]


async def test_a_program_is_downloaded_listed_and_run(session, tmp_path):
    await session.open("line")
    for line in ("/use b", "/download p.mxt", "/list", "/list a", "/list b b.txt", "EX Ga", "/wait idle", "PR P"):
        await session.run(line)
    listed = output(session)[:-1]
    assert [line.split(None, 1)[1] for line in listed] == ["LB Ga", "MR 100", "H", "E"]
    assert (tmp_path / "b.txt").read_text().splitlines() == listed
    assert output(session)[-1] == "100"


async def test_a_stop_in_a_download_leaves_a_drive_that_listens(session, tmp_path):
    lines = "".join(f"P={number}\n" for number in range(400))
    (tmp_path / "long.mxt").write_text(f"PG 1\n{lines}E\nPG\n")
    await session.open("line")
    loading = asyncio.create_task(session.run("/download long.mxt"))
    async with asyncio.timeout(PATIENCE):
        while not session.selected.programming:
            await asyncio.sleep(0.001)
    session.stop()
    with pytest.raises(Stopped):
        await loading
    await session.buses[session.selected_bus].stopped()
    await session.run("PR P")
    assert output(session)[-1] == "0" and not session.selected.programming


async def test_nothing_is_sent_to_an_address_at_which_no_drive_answers(session):
    await session.open("line")
    with pytest.raises(NoAnswer, match="x does not reply: 'MR 51200' was not sent"):
        await session.run("@x MR 51200")
    assert written(session).count(b"MR 51200") == 0


async def test_refusals_are_seen_in_every_echo_mode(session):
    await session.open("line")
    for address in "ab":
        with pytest.raises(Refused, match="error 35"):
            await session.run(f"@{address} PR VX")


async def test_a_line_that_is_too_long_is_not_sent(session):
    await session.open("line")
    before = written(session)
    with pytest.raises(Inexpressible):
        await session.run("PR " + " ".join(["P"] * 40))
    assert written(session) == before


async def test_a_drive_without_an_address_is_the_bus(session):
    await session.open("line")
    await session.open("door")
    assert session.buses["door"].drives[""].label == "door"
    for line in ("@door: MR 100", "/record m", "@door:door PR P", "/use door", "PR P", "/record stop", "/drives"):
        await session.run(line)
    assert [step.line for step in session.macros.load("m").steps] == ["@door: PR P", "@door: PR P"]
    assert output(session)[-1].startswith("* door:door door LMDCE")
    with pytest.raises(Exception, match="no address x: the drive on door takes none"):
        await session.run("@door:x MR 100")


async def test_an_unplugged_line_is_told_once_and_fails_what_follows(session, tmp_path):
    await session.open("line")
    await session.run("SL 1000")
    await session.run("/sim unplug press")
    with pytest.raises(TransportLost):
        await session.run("/wait stopped")
    failed = [event for event in session.events if isinstance(event, Failed)]
    assert {event.text for event in failed} == {f"sim:{tmp_path}/cell.toml#press was lost: unplugged"}
    warnings = [event.text for event in session.events if isinstance(event, Notified) and event.warning]
    assert all("EM=2 cannot distinguish" in text for text in warnings)  # found at opening


async def test_a_wait_that_runs_out_names_the_drive_that_moves(session):
    await session.open("line")
    await session.run("@b SL 1000")
    with pytest.raises(DriveError, match="gantry still runs"):
        await session.run("/wait stopped 0")


async def test_the_world_of_a_simulated_cell_moves_by_sim_lines(session):
    await session.open("line")
    for line in ("@b IS=1,0,1", "/sim input b 1 1", "@b PR I1", "/sim input b 1 0", "@b PR I1"):
        await session.run(line)
    assert sorted(output(session)) == ["0", "1"]
