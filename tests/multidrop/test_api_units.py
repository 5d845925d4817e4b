"""A program moves and reads in units: awaited and blocking; whole steps stay whole steps."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop import Diagnostic, Refused, connect, connect_async
from tests.support.cell_session import bus, party, pmx

CELL = bus("press", party("a"), baud=0) + bus("pmx", pmx("00"), baud=0)
ANCHORED = '{ scale = "5 mm/turn", travel = "-100..100 mm" }'


@pytest.fixture
def saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """The names of two saved connections: a press whose drive has a travel, and a controller."""
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "multidrop.toml").write_text(
        f'[connections.press]\nurl = "sim:{tmp_path / "cell.toml"}#press"\nunits = {{ a = {ANCHORED} }}\n'
        f'[connections.pmx]\nurl = "sim:{tmp_path / "cell.toml"}#pmx"\nunits = {{ "00.y" = "-1 mm/step" }}\n'
    )
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    return "press", "pmx"


@pytest.mark.virtual
async def test_moves_and_positions_in_units(saved: tuple[str, str]) -> None:
    async with connect_async(*saved) as session:
        a, y = session.drive("press:a"), session.drive("pmx:00", "y")
        await a.move(12.5, "mm")
        await a.wait()
        assert (await a.position(), await a.position_in("mm"), await a.position_in("cm")) == (128_000, 12.5, 1.25)
        await a.move_to(-1, "cm")
        assert await a.velocity_in("mm/s") < 0
        await a.wait()
        assert await a.position() == -102_400 and await a.velocity_in("m/min") == 0
        await a.move(51200)
        await y.move_to(-300, "mm")
        await y.wait()
        assert (await y.position(), await y.position_in("mm")) == (300, -300)


@pytest.mark.virtual
async def test_what_cannot_be_is_refused_and_nothing_moves(saved: tuple[str, str]) -> None:
    async with connect_async(*saved) as session:
        a = session.drive("press:a")
        with pytest.raises(TypeError):
            await a.move(12.5)
        for number in (float("nan"), float("inf")):
            with pytest.raises(Diagnostic, match="not a quantity"):
                await a.move(number, "mm")
        with pytest.raises(Diagnostic, match="after rounding"):
            await a.move(1e-12, "mm")
        for unit, named in (
            ("deg", "the scale of the axis is 5 mm/turn"),
            ("mm/s", "is a velocity"),
            ("q", "no unit q"),
        ):
            with pytest.raises(Diagnostic, match=named):
                await a.move(1, unit)
            with pytest.raises(Diagnostic, match=named):
                await a.position_in(unit)
        with pytest.raises(Diagnostic, match="has no scale"):
            await session.drive("pmx:00", "x").position_in("mm")
        await a.send("PG 1")
        with pytest.raises(Refused, match="in program mode"):
            await a.move(1, "mm")
        await a.send("PG")
        assert await a.position() == 0


@pytest.mark.virtual
async def test_a_move_beyond_the_travel_says_so(saved: tuple[str, str]) -> None:
    async with connect_async("press", yes=True) as session:
        a = session.drive("a")
        with pytest.raises(Diagnostic, match="the travel is -100 mm to 100 mm.*beyond=True agrees"):
            await a.move_to(101, "mm")
        await a.move_to(101, "mm", beyond=True)
        await a.wait()
        with pytest.raises(Diagnostic, match="the travel is"):
            await a.move(51200)
    async with connect_async("press", beyond=True) as session:
        await session.drive("a").move_to(101, "mm")


def test_the_same_blocking(saved: tuple[str, str]) -> None:
    with connect("press") as session:
        a = session.drive("a")
        a.move(0.5, "mm")
        a.wait()
        assert (a.position, a.position_in("mm"), a.velocity_in("mm/s")) == (5120, 0.5, 0)
