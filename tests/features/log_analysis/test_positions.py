"""`log replay --against`: the positions in a log beside those of simulated drives."""

from __future__ import annotations

import asyncio
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import DriveError
from multidrop.dialects import Priority
from multidrop.dialects.families import FAMILIES
from multidrop.drives.drive import Drive
from multidrop.features.log_analysis.replay import ReplayReport, replay
from multidrop.shell.log.decoding import Decoding
from multidrop.shell.log.steps import LoggedPoll, read
from multidrop.shell.log.writer import SessionLog
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx
from tests.support.procedure import ProcedureRunner
from tests.support.twin_cell import encoder, run

pytestmark = pytest.mark.virtual
AT = datetime(2026, 11, 22, tzinfo=UTC)


async def recorded(folder: Path, real: str, *lines: str, polled: bool = True) -> Path:
    """The log of a session on a cell, as the time of its loop has it."""
    (folder / "then").mkdir()
    async with CellSession(folder / "then", real) as cell:
        cell.session.wall = lambda at: AT + timedelta(seconds=at)  # type: ignore[method-assign]
        cell.session.log = SessionLog(cell.session, folder / "day.log")
        (line,) = cell.session.buses.values()
        polls = line.telemetry.subscribe(list(line.drives), 0.1) if polled else None
        await run(cell, *lines)
        if polls is not None:
            polls.close()
        await asyncio.sleep(0.5)
    return folder / "day.log"


async def replayed(folder: Path, log: Path, simulated: str, as_json: bool = False) -> list[str]:
    """What a replay against another cell said; it ends with what it raised."""
    (folder / "now").mkdir()
    async with CellSession(folder / "now", simulated) as cell:
        try:
            await replay(cell.session, read(log), fast=False, positions=True, report=ReplayReport(as_json))
        except DriveError as failure:
            return [*cell.told(), str(failure)]
        return cell.told()


MOVES = (
    "/sleep 0.5",
    "@a MR 100000",
    "/sleep 2",
    "@a SL -30000",
    "/sleep 1",
    "@a SL 0",
    "/sleep 1",
    "@a MA 0",
    "/sleep 2",
)


async def test_an_equal_cell_gives_equal_positions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    real = bus("press", party("a", VM=200000), party("b"))
    log = await recorded(tmp_path, real, "@a P=777", *MOVES)
    told = await replayed(tmp_path, log, real)
    assert capsys.readouterr().out == ""
    assert any(" lines replayed, 0 differ" in each for each in told)
    (a,) = [each for each in told if each.startswith("press:a: ")]
    assert int(a.split()[1]) > 50 and "positions compared, largest difference" in a


async def test_a_stall_in_a_log_is_found_with_its_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = await recorded(tmp_path, bus("press", encoder(world="stall_at = 20000")), "MR 16000", "/sleep 3")
    told = await replayed(tmp_path, log, bus("press", encoder()), as_json=True)
    diverged, summary = map(json.loads, capsys.readouterr().out.splitlines())
    assert diverged["diverged"]["drive"] == "press:a"
    assert diverged["diverged"]["causes"][0] == "stall"
    assert AT < datetime.fromisoformat(diverged["diverged"]["time"]) < AT + timedelta(seconds=3)
    assert summary["summary"]["diverged"] == 1 and summary["summary"]["largest"]["press:a"] > 10000
    assert told[-1] == "1 of 1 axes were not where the log has them"


@pytest.mark.parametrize(
    ("then", "now", "cause"),
    [
        (encoder(), encoder(world="stall_at = 20000"), "a command not seen here"),
        (encoder(), encoder().replace("A = 40000", "A = 9000"), "settings changed"),
        (encoder(world="locked = [[2.0, 2.4]]", SF=60000), encoder(), "stall"),
    ],
    ids=["the cell stalls", "the cell is slower", "the drive was held"],
)
async def test_a_difference_in_a_log_has_its_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], then: str, now: str, cause: str
) -> None:
    log = await recorded(tmp_path, bus("press", then), "/sleep 1", "MR 16000", "/sleep 3")
    await replayed(tmp_path, log, bus("press", now), as_json=True)
    found = json.loads(capsys.readouterr().out.splitlines()[0])["diverged"]["causes"]
    assert found[0] == cause


async def test_typed_positions_are_compared_without_polls(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ("MR 16000", "/wait ended", "/sleep 0.3", "PR P", "/sleep 0.3")
    log = await recorded(tmp_path, bus("press", encoder(world="stall_at = 20000")), *lines, polled=False)
    told = await replayed(tmp_path, log, bus("press", encoder()))
    assert "steps from the simulated drive since" in capsys.readouterr().out
    assert told[-1].endswith("1 of 1 axes were not where the log has them")


async def test_a_first_position_after_a_motion_is_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = await recorded(tmp_path, bus("press", encoder()), "MR 16000", "/wait ended", "PR P", polled=False)
    told = await replayed(tmp_path, log, bus("press", encoder(world="stall_at = 20000")), as_json=True)
    found = [json.loads(each) for each in capsys.readouterr().out.splitlines()]
    (diverged,), summary = [each for each in found if "diverged" in each], found[-1]
    assert diverged["diverged"]["drive"] == "press:a"
    assert summary["summary"]["compared"] == 1 and summary["summary"]["largest"]["press:a"] > 10000
    assert any(each.startswith("press:a: 1 position compared") for each in told)


@pytest.mark.parametrize(
    ("real", "lines"),
    [
        (
            bus("line", pmx("00")),
            ("HSPD=20000", "LSPD=1000", "ACC=300", "EO=3", "X10000", "/sleep 1.5", "Y-2000", "/sleep 1.5"),
        ),
        (bus("eth", ETHERNET, baud=0), ("MR 51200", "/sleep 2")),
        (bus("mods", 'personality = "TMCM"\nname = "1"'), ("MVP REL, 0, 20000", "/sleep 3")),
    ],
    ids=["pmx", "modbus", "tmcl"],
)
async def test_polls_of_every_family_are_decoded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], real: str, lines: tuple[str, ...]
) -> None:
    log = await recorded(tmp_path, real, *lines)
    told = await replayed(tmp_path, log, real)
    assert capsys.readouterr().out == ""
    compared = [each for each in told if "positions compared" in each]
    assert compared and all(int(each.split()[1]) > 10 for each in compared)


REPLIES = {
    "mcode": b'PR P,"~",V\r\n5~7\r\n>',
    "pmx": b"5\r",
    "modbus": bytes.fromhex("000000000007010304000500000000"),
    "tmcl": bytes.fromhex("020164060000000572"),
}
"""A whole reply to the first request of a poll, or its like."""


@given(
    st.sampled_from(sorted(REPLIES)),
    st.lists(st.tuples(st.booleans(), st.binary(max_size=24), st.integers(0, 30)), max_size=6),
)
def test_no_bytes_in_a_log_break_the_decoding(name: str, polls: list[tuple[bool, bytes, int]]) -> None:
    family = FAMILIES[name]
    state = family.new_state(family.codec, {"pmx": "00", "tmcl": "1"}.get(name, ""))
    first = ProcedureRunner(family(state).motion(Priority.POLL)).request
    assert first is not None
    decoding = Decoding(cast(Drive, SimpleNamespace(state=state)))
    for known, noise, cut in polls:
        sent = first.codec.encode(first) if known else noise
        poll = LoggedPoll("log:1", AT, "bus", "", sent, REPLIES[name][:cut] + noise)
        assert all(isinstance(each.position, int) for each in decoding.take(poll))
