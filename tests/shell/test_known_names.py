"""Labels and variables of the program in a drive, for completion: read when a person asks, and never by themselves."""

import asyncio

import pytest
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document

from multidrop.dialects import Priority
from multidrop.dialects.program_files import Held
from multidrop.drives.events import Ended
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.programs import MCodePrograms
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.shell.events import OnBus
from multidrop.shell.prompt.complete import complete, names_of
from multidrop.shell.prompt.view import SessionCompleter
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual

PROGRAM = 'program_text = """VA CT=7\\nPG 100\\nLB GO\\nMR 100\\nH\\nBR GO\\nE\\nPG\\n"""'
CELL = bus("press", f"{party('a')}\n{PROGRAM}", party("b"))
HELD = Held(names=("COUNT = G 7", "CLAMP = L -3", "GO = 100", "C9 = 212"))


def words(cell: CellSession, text: str) -> list[str]:
    return [each.text for each in complete(cell.session, text)]


@pytest.fixture
async def cell(tmp_path):
    async with CellSession(tmp_path, CELL) as made:
        yield made


@for_each(
    ("line", "names"),
    [
        ("EX ", ["GO", "C9"]),
        ("ex g", ["GO"]),
        ("BR GO,", ["COUNT", "CLAMP"]),
        ("PR C", ["COUNT", "CLAMP", "C9"]),
        ("PR P,c", ["COUNT", "CLAMP", "C9"]),
        ("C", ["COUNT", "CLAMP"]),
        ("MR ", ["COUNT", "CLAMP"]),
        ("COUNT=", ["COUNT", "CLAMP"]),
        ("", []),
        ('PR "C', []),
        ("Z", []),
    ],
)
def test_labels_are_offered_after_jumps_and_variables_elsewhere(line: str, names: list[str]) -> None:
    assert [name for name, _ in MCodePrograms(MCodeState(MCode())).offered(HELD, line)] == names


def test_a_name_comes_with_what_it_is() -> None:
    assert dict(MCodePrograms(MCodeState(MCode())).offered(HELD, "PR C")) == {
        "COUNT": "variable, 7 when it was read",
        "CLAMP": "variable, -3 when it was read",
        "C9": "label at 212",
    }


async def test_names_are_read_when_a_person_asks_and_offered_before_the_words(cell) -> None:
    drive = cell.session.drive("press", "a")
    assert "GO" not in words(cell, "EX G")
    assert cell.events == [], "typing asks no drive"
    asked: list[str] = []
    reading = cell.session.names.ask(drive, lambda: asked.append("told"))
    assert reading is not None and cell.session.names.ask(drive) is reading
    await reading
    await asyncio.sleep(0)
    assert asked == ["told"]
    requests = [e.event.transaction.request for e in cell.events if isinstance(e, OnBus) and isinstance(e.event, Ended)]
    assert requests and {request.priority for request in requests} == {Priority.POLL}
    assert words(cell, "EX ") == ["GO"]
    assert words(cell, "@a PR C")[0] == "CT"
    assert "CT" not in words(cell, "@b PR C"), "the names of another drive"
    assert cell.session.names.ask(drive) is None, "nothing was sent since"
    await cell.session.run("VM=500000")
    assert cell.session.names.ask(drive) is not None


async def test_a_listing_teaches_the_names(cell) -> None:
    await cell.session.run("/list a")
    assert words(cell, "EX ") == ["GO"]


async def test_a_drive_that_stores_lines_or_is_gone_is_not_asked(cell) -> None:
    drive = cell.session.drive("press", "a")
    await cell.session.run("@a PG 300")
    assert cell.session.names.ask(drive) is None
    await cell.session.run("@a PG")
    cell.world("power a off")
    reading = cell.session.names.ask(drive)
    assert reading is not None
    await reading
    assert words(cell, "EX ") == []
    assert names_of(cell.session, "@* EX ") is None


async def test_tab_at_the_prompt_waits_for_the_names(cell) -> None:
    completer = SessionCompleter(cell.session)

    async def found(*, tab: bool) -> list[str]:
        event = CompleteEvent(completion_requested=tab, text_inserted=not tab)
        return [each.text async for each in completer.get_completions_async(Document("EX "), event)]

    assert await found(tab=False) == []
    assert await found(tab=True) == ["GO"]


async def test_a_stop_ends_the_reading(cell) -> None:
    reading = cell.session.names.ask(cell.session.drive("press", "a"))
    assert reading is not None
    await asyncio.sleep(0.01)
    cell.session.stop()
    await reading
    assert words(cell, "EX ") == []
