"""Parameters of a TMCL module in a program: one meaning, however they are spelled."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop import Diagnostic, connect_async
from tests.support.cell_session import bus, drive

pytestmark = pytest.mark.virtual


async def test_parameters_of_tmcl_have_one_meaning_however_they_are_spelled(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("line", drive("TMCM-3110", "1"), baud=0))
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
