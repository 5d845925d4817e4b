"""MDrivePlus units in a session: what they are called, and what help, completion and refusals say for them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.base.errors import Refused
from multidrop.shell.events import Output
from multidrop.shell.prompt import complete
from multidrop.shell.session import Session
from tests.support.cell_session import bus, drive, session_on

pytestmark = pytest.mark.virtual

PARTY = (drive(personality, name, party=True) for personality, name in (("MDIE", "e"), ("MDIX", "x"), ("LMDCM", "l")))
CELL = bus("base", drive("MDI"), baud=0) + bus("party", *PARTY, baud=0)


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[Session]:
    async with session_on(tmp_path, CELL) as made:
        yield made


async def said(session: Session, line: str) -> list[str]:
    events: list[object] = []
    forget = session.subscribe(events.append)
    await session.run(line)
    forget()
    return [event.text for event in events if isinstance(event, Output)]


async def test_each_unit_is_known_for_what_it_is(session: Session) -> None:
    products = {name: drive.product for bus in session.buses.values() for name, drive in bus.drives.items()}
    assert products == {"": "MDI", "e": "MDIE", "x": "MDIX", "l": "LMDCM"}


async def test_help_is_about_the_selected_unit(session: Session) -> None:
    lines = await said(session, "/help VM")
    assert "  range      2 to 5000000 steps/s (EE=0), 2 to 200000 counts/s (EE=1)" in lines
    assert "  default    768000 (EE=0), 30720 (EE=1)" in lines and "  products   all" in lines
    assert "  manual     MCode reference of 2012, page 5-80" in lines
    assert "  here       not in an MDI: error 37" in await said(session, "/help S9")
    assert "  products   MDIX" in await said(session, "/help S9")
    assert "  here       a free name in an MDI" in await said(session, "/help AO")
    assert "  products   LMDCE, LMDCM, LMM, MDIE, MDIX" in await said(session, "/help EE")
    await session.run("/use party:x")
    assert not any("here" in line for line in await said(session, "/help S9"))
    assert "  default    512" in await said(session, "/help EL")
    await session.run("/use party:l")
    assert "  range      2 to 2560000 steps/s (EE=0), 2 to 200000 counts/s (EE=1)" in await said(session, "/help VM")
    assert "  here       a free name in an LMDCM" in await said(session, "/help OL")


async def test_completion_and_hints_are_those_of_the_unit(session: Session) -> None:
    def offered(text: str) -> list[str]:
        return [each.text for each in complete.complete(session, text)]

    assert offered("O") == ["O1", "O2", "O3", "O4", "OE", "OL", "OT"]
    assert offered("S1") == ["S1"] and offered("E") == ["E", "EF", "EM", "ER", "ES", "EX"]
    assert offered("@party:e E")[:2] == ["E", "EE"]
    assert "S13" in offered("@party:x S1") and "RD" not in offered("@party:x R") and "RD" in offered("@party:l R")
    assert complete.hint(session, "AO=5") == "" and complete.hint(session, "OL 3").startswith("OL=<0-15>")
    assert complete.hint(session, "@party:l AO=5").startswith("AO=<mask>")


async def test_refusals_are_explained_in_the_units_words(session: Session) -> None:
    for line, told in (
        ("O1=1", "error 9: .*S<n>=16,<active>"),
        ("XX", "error 20: unknown variable, flag or command"),
        ("EE=1", "error 37: .*(/help NAME)"),
        ("HM 1", r"error 80: .*S<n>=1,<active>"),
    ):
        with pytest.raises(Refused, match=told):
            await session.run(line)


async def test_the_state_in_words_has_the_inputs_of_the_unit(session: Session) -> None:
    assert (await said(session, "/status"))[-1] == "inputs: 1 high, 2 high, 3 high, 4 high"
    await session.run("/use party:x")
    await session.run("/sim input x 10 0")
    await session.run("/sim input x 2 0")
    found = (await said(session, "/status"))[-1]
    assert found == "inputs: 1 high, 2 low, 3 high, 4 high, 9 high, 10 low, 11 high, 12 high"
