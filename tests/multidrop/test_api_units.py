"""A program moves and reads in units: awaited and blocking; whole steps stay whole steps."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

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
            with pytest.raises(Diagnostic, match="no value for a line"):
                await a.move(number, "mm")
        with pytest.raises(Diagnostic, match=r"not a quantity: 5\\x0aMR 5 mm"):
            await a.move("5\nMR 5", "mm")  # type: ignore[arg-type]
        for truth in ("mm", ""):
            with pytest.raises(TypeError):
                await a.move(True, truth)
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


class NumPy(float):
    """A float as NumPy has it: its repr is no number."""

    def __repr__(self) -> str:
        return f"np.float64({float(self)!r})"


@pytest.mark.virtual
async def test_numbers_of_other_libraries_are_numbers(saved: tuple[str, str], tmp_path: Path) -> None:
    (tmp_path / "speed.txt").write_text("VM={SPEED}\nPR VM\n")
    async with connect_async(saved[0]) as session:
        a = session.drive("a")
        for number in (NumPy(0.1), Decimal("0.1"), Fraction(1, 10)):
            await a.move_to(number, "mm")  # type: ignore[arg-type]
            await a.wait()
            assert await a.position() == 1024
            await a.move_to(0)
            await a.wait()
        for value in (NumPy(500_000), 500_000.0, Decimal(500_000), "500000"):
            await a.write("VM", 400_000)
            await a.write("VM", value)  # type: ignore[arg-type]
            assert await a.read("VM") == 500_000
            run = await session.run(str(tmp_path / "speed.txt"), SPEED=value)
            assert run.results[-1].printed == ("500000",)
        await a.write("EE", True)
        assert await a.read("EE") == 1


@pytest.mark.virtual
@pytest.mark.parametrize("value", [float("nan"), float("inf"), Decimal("NaN"), None, [5], b"5", 1e-12])
async def test_what_is_no_number_is_not_sent_to_a_drive(saved: tuple[str, str], tmp_path: Path, value: Any) -> None:
    (tmp_path / "speed.txt").write_text("VM={SPEED}\n")
    async with connect_async(saved[0]) as session:
        with pytest.raises(Diagnostic):
            await session.drive("a").write("VM", value)
        with pytest.raises(Diagnostic):
            await session.run(str(tmp_path / "speed.txt"), SPEED=value)
        assert await session.drive("a").read("VM") == 768_000


@pytest.mark.virtual
@pytest.mark.parametrize("limit", [float("nan"), -1, "5", None])
async def test_a_wait_without_a_time_limit_that_is_one_is_refused(saved: tuple[str, str], limit: Any) -> None:
    """A wait until NaN would never end, and a watch with such a period never read anything."""
    async with connect_async(saved[0]) as session:
        a = session.drive("a")
        for waiting in (a.wait(limit), a.wait_for("P=5", limit), session.wait_back(limit)):
            with pytest.raises(Diagnostic, match="no timeout"):
                await waiting
        with pytest.raises(Diagnostic, match="no period"):
            session.events(every=limit)
