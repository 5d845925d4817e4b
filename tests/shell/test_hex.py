"""The bytes of a line beside its lines: /hex, without polls, and never where raw mode shows them."""

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.events import Bytes
from multidrop.shell.streams.event_printer import EventPrinter
from tests.support.cell_session import CellSession, bus

pytestmark = pytest.mark.virtual

CELL = bus("line", 'personality = "LMDCM"\nset = { EM = 0 }')


def shown(cell: CellSession) -> list[tuple[str, str]]:
    return [
        (">" if each.outgoing else "<", row) for each in cell.events if isinstance(each, Bytes) for row in each.rows
    ]


async def test_the_bytes_of_a_typed_line_are_shown_and_those_of_polls_are_not(tmp_path: Path) -> None:
    async with CellSession(tmp_path, CELL) as cell:
        await cell.session.run("/hex hex")
        await cell.session.run("PR P")
        await asyncio.sleep(1)
        typed = shown(cell)
        sent, received = (" ".join(row for way, row in typed if way == each) for each in "><")
        assert sent.startswith("50 52 20 50") and sent.endswith("0D")
        assert "0D 0A" in received
        subscription = cell.session.buses["line"].telemetry.subscribe(["!"], 0.1)
        await asyncio.sleep(2)
        subscription.close()
        assert shown(cell) == typed
        await cell.session.run("/hex")
        await cell.session.run("PR P")
        await asyncio.sleep(1)
        assert shown(cell) == typed, "without a word it ends"


async def test_raw_mode_shows_its_bytes_once(tmp_path: Path) -> None:
    async with CellSession(tmp_path, CELL) as cell:
        await cell.session.run("/hex on")
        await cell.session.run("/raw on")
        await cell.session.run("PR P")
        await asyncio.sleep(1)
        assert [row for way, row in shown(cell) if way == ">"] == ["PR P\\r                   50 52 20 50 0D"]
        with pytest.raises(Diagnostic, match="is raw"):
            await cell.session.run("/hex on")


def test_they_are_no_output_of_a_program_that_reads_replies(capsys: pytest.CaptureFixture[str]) -> None:
    printer = EventPrinter()
    printer.show(Bytes(1.0, "line", False, "12:00:00.000", ("30 0D 0A",), watched=True))
    printer.show(Bytes(1.0, "line", False, "12:00:00.000", ("31",)))
    out, error = capsys.readouterr()
    assert (out, error) == ("12:00:00.000 < 31\n", "12:00:00.000 < 30 0D 0A\n")
