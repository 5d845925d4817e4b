"""A program that runs a drive by a quantity, and one whose drive stores every line."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop import (
    AsyncSession,
    DriveError,
    Inexpressible,
    connect_async,
)
from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus
from tests.support.behind_api import shell_of
from tests.support.cell_session import bus, drive, pmx

pytestmark = pytest.mark.virtual
HOME = "world = { home = -2000, limit_minus = -400000, limit_plus = 400000 }"
IS = 'set = { EM = 1, IS = ["1,1,0", "2,3,0", "3,2,0"] }'
MCODE = drive("LMDCM", "a", IS, HOME, party=True)


async def test_a_quantity_runs_where_the_family_has_a_sign(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(
        bus("line", drive("LMDCM", "a", 'units = "5 mm/turn"', party=True)) + bus("pmx", pmx("00"))
    )
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a, x = session.drive("line:a"), session.drive("pmx:00")
        await a.run_at(-10, "mm/s")
        await asyncio.sleep(1)
        assert await a.velocity() == -102400
        with pytest.raises(Inexpressible, match=r"\{10 mm/s\}: a PMX has speeds without a sign"):
            await x.run_at(10, "mm/s")


def bytes_out(session: AsyncSession) -> list[bytes]:
    """The bytes that go out from now on."""
    found: list[bytes] = []

    def take(event: Any) -> None:
        if isinstance(event, OnBus) and isinstance(event.event, Traffic) and event.event.outgoing:
            found.append(event.event.data)

    shell_of(session).subscribe(take)
    return found


async def test_a_program_mode_and_a_refused_choice_send_nothing(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("line", MCODE, baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a = session.drive("a")
        await a.send("PG 100")
        sent = bytes_out(session)
        calls: list[Any] = [a.homed, a.enable, a.disable, a.inputs, a.limits, a.error, lambda: a.home("-")]
        for call in [*calls[1:], lambda: a.set_output(1, True), lambda: a.run_at(5), a.read_error]:
            with pytest.raises(DriveError, match="program mode"):
                await call()
        assert b"".join(sent) == b""
