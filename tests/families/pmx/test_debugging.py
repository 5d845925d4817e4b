"""Programs of a PMX followed in a session, in virtual time: trace by program counter, pause, going on, registers."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, Inexpressible, Refused
from tests.support.cell_session import CellSession, bus, pmx
from tests.support.debugged import out, run

pytestmark = pytest.mark.virtual

PROGRAM = '''
program_text = """
PRG 0
WHILE V1<2
    X1000
    WAITX
    X0
    WAITX
    V1=V1+1
ENDWHILE
END
PRG 1
WHILE 1=1
    DELAY=100
ENDWHILE
END
"""
'''


@pytest.fixture(params=[False, True], ids=["line", "usb"])
async def stage(tmp_path: Path, request: pytest.FixtureRequest):
    async with CellSession(tmp_path, bus("stage", pmx("00") + PROGRAM), usb=request.param) as made:
        yield made


async def test_a_trace_shows_the_statements_at_which_the_program_was_seen(stage: CellSession) -> None:
    await run(stage, "/watch V1 PX")
    rows = await run(stage, "/trace")
    assert {row.split()[1] for row in rows} <= {"X1000", "WAITX", "X0", "WHILE", "V1=V1+1", "ENDWHILE"}
    assert any("WAITX" in row for row in rows) and len(rows) == len([*dict.fromkeys(enumerate(rows))])
    assert any("the program has ended" in text and "V1=2" in text for text in stage.told())


async def test_break_now_pauses_and_continue_goes_on(stage: CellSession) -> None:
    await run(stage, "SR0=1", "/sleep 0.1")
    rows = await run(stage, "/break now")
    assert [row for row in rows if row.startswith("->")] and stage.device("stage:00").programs.status(0) == 2
    with pytest.raises(Inexpressible, match="a PMX has no single step: .*; nothing was sent"):
        await stage.session.run("/step")
    await run(stage, "/continue")
    assert stage.device("stage:00").programs.status(0) == 1
    with pytest.raises(Refused, match="program 0 is not paused; nothing was sent"):
        await stage.session.run("/continue")


async def test_a_traced_program_that_is_paused_shows_where(stage: CellSession) -> None:
    trace = asyncio.ensure_future(stage.session.run(f"/trace {stage.address('00')} 1"))
    await asyncio.sleep(0.5)
    await stage.session.run("SR1=2")
    await trace
    assert any(row.startswith("->") and row.split()[-1] in ("DELAY=100", "ENDWHILE") for row in out(stage))
    await run(stage, "/continue")
    assert stage.device("stage:00").programs.status(1) == 1


@pytest.mark.parametrize(
    "line, error, told",
    [
        ("/step 0", Inexpressible, "no single step"),
        ("/break 3", Inexpressible, "no break points"),
        ("/break off", Inexpressible, "no break points"),
        ("/break now", Refused, "program 0 does not run; nothing was sent"),
        ("/trace 2", Diagnostic, "no program 2; valid: 0 or 1"),
        ("/watch JX+", Diagnostic, "JX\\+ cannot be watched"),
        ("/watch STORE", Diagnostic, "STORE cannot be watched"),
    ],
)
async def test_what_a_pmx_lacks_sends_nothing(stage: CellSession, line: str, error: type[Exception], told: str) -> None:
    with pytest.raises(error, match=told):
        await stage.session.run(line)
    assert not stage.moving() and not stage.device("stage:00").programs.running


async def test_a_program_that_runs_is_not_started_again(stage: CellSession) -> None:
    await run(stage, "SR1=1")
    with pytest.raises(Refused, match="program 1 runs already; not started"):
        await stage.session.run("/trace 1")
