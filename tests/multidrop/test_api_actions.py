"""What a program asks of any family without its words: homing, running, current, inputs, outputs, errors, waits."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop import (
    AsyncSession,
    Diagnostic,
    DriveError,
    Inexpressible,
    connect_async,
)
from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus
from tests.support.cell_session import bus, drive, pmx

pytestmark = pytest.mark.virtual
HOME = "world = { home = -2000, limit_minus = -400000, limit_plus = 400000 }"
IS = 'set = { EM = 1, IS = ["1,1,0", "2,3,0", "3,2,0"] }'
TMCL = drive("TMCM-3110", "1", HOME.replace("00000", "000"))
MCODE = drive("LMDCM", "a", IS, HOME, party=True)
PMX = pmx("00", f"world.x = {HOME.removeprefix('world = ')}", f"world.y = {HOME.removeprefix('world = ')}")


async def test_parameters_of_tmcl_have_one_meaning_however_they_are_spelled(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("line", TMCL, baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a, second = session.drive("1"), session.drive("1", axis="1")
        await a.write(4, 1500)
        await second.write("maximum_velocity", 700)
        for name in (4, "4", "AP4", "ap4", "4_0", "AP4/0", "maximum_velocity", "MaximumVelocity"):
            assert await a.read(name) == 1500, name
        for name in ("4_1", "AP4/1", "maximum_velocity_1"):
            assert await a.read(name) == 700, name
        assert await second.read(4) == 700 and await second.read("4_0") == 1500
        await a.write("G75", 5)
        assert await a.read("pause") == 5 and await second.read("G75") == 5
        assert (await a.parameters.read()).values["4_1"] == 700
        await a.wait_for("AP4_1=700", timeout=0)
        assert await session.send("/wait AP4=1500 1") == []
        for wrong in ("AP256", "nothing", "G75_1"):
            with pytest.raises(Diagnostic, match="no value to read|no line gives"):
                await a.read(wrong)
            with pytest.raises(Diagnostic, match="no value to read|no line gives"):
                await a.write(wrong, 1)
        with pytest.raises(Diagnostic, match="no value to read"):
            await a.read("AP207")  # reading clears it
        with pytest.raises(Diagnostic, match="SGP 66, 0, 3.*address"):
            await a.write("address", 3)


async def test_a_cell_has_the_same_spellings_of_parameters(tmp_path: Path) -> None:
    spelled = "set = { AP4 = 1500, maximum_velocity_1 = 700, pause = 5 }"
    (tmp_path / "cell.toml").write_text(bus("line", drive("TMCM-3110", "1", spelled), baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a = session.drive("1")
        assert [await a.read(name) for name in ("4", "4_1", "G75")] == [1500, 700, 5]
    (tmp_path / "cell.toml").write_text(bus("line", drive("TMCM-3110", "1", "set = { AP4 = 1, 4_0 = 2 }"), baud=0))
    with pytest.raises(Diagnostic, match='"4_0" is given twice'):
        async with connect_async(f"sim:{tmp_path / 'cell.toml'}"):
            pass


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

    session._shell.subscribe(take)
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
