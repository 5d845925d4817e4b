"""The origin of a line decides to what it belongs, whatever task runs it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.base.foreign import ForeignGuard
from multidrop.shell.events import Entered, Output, Printed
from multidrop.shell.operations.table import VERBS
from multidrop.shell.origin import PERSON, Origin
from multidrop.shell.session import Call
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[CellSession]:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"), baud=0)) as made:
        yield made


async def test_of_two_automations_in_one_task_the_early_end_stops_what_its_own_lines_started(shop: CellSession) -> None:
    session = shop.session
    async with session.automations.run(PERSON, "one") as one:
        with pytest.raises(RuntimeError):
            async with session.automations.run(PERSON, "other") as other:
                await session.run("@a SL 1000", one)
                await session.run("@b SL 1000", other)
                raise RuntimeError
        assert shop.moving() == {"press:a"}
        session.automations.leave(one)


async def test_a_line_that_another_task_runs_belongs_to_the_automation_of_its_origin(shop: CellSession) -> None:
    with pytest.raises(RuntimeError):
        async with shop.session.automations.run(PERSON) as origin:
            work = shop.session.run("@a SL 1000", origin)
            await asyncio.wait([asyncio.get_running_loop().create_task(work)])
            assert shop.moving() == {"press:a"}
            raise RuntimeError
    assert shop.moving() == set()


async def test_a_line_that_a_verb_runs_belongs_to_the_automation_of_the_verb(shop: CellSession) -> None:
    with pytest.raises(RuntimeError):
        async with shop.session.automations.run(PERSON) as origin:
            await Call(shop.session, VERBS["/drives"], "", origin).run("@a SL 1000")
            raise RuntimeError
    assert shop.moving() == set()


async def test_who_a_line_belongs_to_hears_what_it_enters_and_prints_and_nothing_else(shop: CellSession) -> None:
    heard: list[Any] = []
    origin = Origin(heard=heard.append, printed=[])
    await shop.session.run("@a PR P", origin)
    Call(shop.session, VERBS["/drives"], "", origin).output("of the verb")
    await shop.session.run("@b PR P")
    shop.session.output("of a person")
    assert [type(each) for each in heard] == [Entered, Printed, Output]
    assert origin.printed == ["0", "of the verb"]


def test_a_role_is_played_by_the_bus_that_was_cast_last() -> None:
    origin = PERSON.cast({"line": "press", "other": "gantry"}).cast({"line": "gantry"})
    assert [origin.bus_of_role(name) for name in ("line", "other", "press", "")] == ["gantry", "gantry", "press", ""]
    assert origin.target("line:a") == ("gantry", "a") and origin.target("a") == ("", "a")
    assert PERSON.bus_of_role("line") == "line"


async def test_a_line_that_a_feature_by_others_runs_without_its_origin_is_refused_unsent(shop: CellSession) -> None:
    """It may be a script's line: its early end would stop nothing of it."""

    async def verb() -> None:
        await shop.session.run("@a SL 1000")

    async def said() -> None:
        await shop.session.run("@a SL 1000", shop.session.origin)

    shop.events.clear()
    with pytest.raises(Diagnostic, match=r"a feature ran it without its origin; it was not sent.*call\.run"):
        await ForeignGuard("gauge").function(verb)()
    assert shop.written("press") == b"" and shop.moving() == set()
    await ForeignGuard("gauge").function(said)()
    assert shop.moving() == {"press:a"}
