"""What a session publishes of a drive's program: its lines as they are read, and where an observed one is."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.shell.events import Phase, ProgramRead, ProgramSeen
from tests.support.cell_session import CellSession, bus, pmx
from tests.support.debugged import LINES, ROUND, run

pytestmark = pytest.mark.virtual


def seen(it: CellSession) -> list[tuple[int | None, Phase]]:
    return [(each.line, each.phase) for each in it.events if isinstance(each, ProgramSeen)]


async def test_a_list_publishes_the_lines_with_their_addresses(it: CellSession) -> None:
    await run(it, "/list")
    (read,) = (each for each in it.events if isinstance(each, ProgramRead))
    assert (read.bus, read.address) == ("line", "")
    assert LINES.items() <= dict(read.lines).items() and read.lines[0] == (1, "LB G1")


async def test_a_download_publishes_the_lines_with_the_remarks_of_the_file(tmp_path: Path, it: CellSession) -> None:
    (tmp_path / "a.mxt").write_text("PG 1\nLB G1\n PR 1 ' one\n E\nPG\n")
    await run(it, f"/download {tmp_path / 'a.mxt'}", "/list")
    read = [each for each in it.events if isinstance(each, ProgramRead)]
    assert [text for _, text in read[-1].lines] == ["LB G1", "PR 1 ' one", "E"]


async def test_a_trace_is_seen_line_by_line_and_then_nowhere(it: CellSession) -> None:
    await run(it, "/trace")
    places = [line for line, phase in seen(it) if phase is Phase.EXECUTES]
    assert [line for line in places if line in ROUND] == ROUND * 3 and places[-1] is None


async def test_a_step_waits_before_a_line_then_after_it_and_a_stop_forgets_the_place(it: CellSession) -> None:
    await run(it, "/step G1")
    assert seen(it)[-1] == (6, Phase.BEFORE)
    await run(it, "/step")
    assert seen(it) == [(6, Phase.AFTER)]
    it.session.stop()
    assert seen(it)[-1] == (None, Phase.EXECUTES)


async def test_a_break_point_is_published_until_it_is_removed(it: CellSession) -> None:
    await run(it, "/break k1")
    assert [each.break_point for each in it.events if isinstance(each, ProgramSeen)] == ["K1"]
    await run(it, "/break off")
    assert [each.break_point for each in it.events if isinstance(each, ProgramSeen)] == [""]


@pytest.mark.parametrize("usb", [False, True])
async def test_a_controller_publishes_its_statements(tmp_path: Path, usb: bool) -> None:
    (tmp_path / "a.prg").write_text("PRG 0\nV1=5\nX1000\nEND\n")
    async with CellSession(tmp_path, bus("pmx", pmx("00")), usb=usb) as it:
        await run(it, f"/download {tmp_path / 'a.prg'}")
        read = [each for each in it.events if isinstance(each, ProgramRead)]
        assert {"V1=5", "X1000", "END"} <= {text.strip() for _, text in read[-1].lines}
