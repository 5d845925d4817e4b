"""Samples: from telemetry, and as columns."""

from __future__ import annotations

import asyncio
import math
from array import array
from pathlib import Path
from typing import Any

import pytest

from multidrop import Sample, Samples, TransportLost, connect_async
from multidrop.api import telemetry
from tests.support.behind_api import shell_of
from tests.support.cell_session import bus, party, pmx

FAR = 10**8
ROWS = [Sample(0.0, 10.0, "a", "", 0, 0), Sample(0.5, 10.5, "b", "x", 7, -3), Sample(1.0, 11.0, "a", "", 9, 0)]


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A press with drives a and b, and a PMX."""
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0) + bus("pmx", pmx("00"), baud=0))
    return f"sim:{tmp_path / 'cell.toml'}"


@pytest.mark.virtual
async def test_telemetry_follows_a_move_and_ends_with_its_block(url: str) -> None:
    async with connect_async(f"{url}#press") as session:
        a = session.drive("a")
        async with a.telemetry(rate=20) as opened:
            await a.move(51200)
            await a.wait()
        samples = await opened.samples()
        assert samples[0].drive == "a" and samples[-1].position == 51200
        steps = [later.elapsed - sooner.elapsed for sooner, later in zip(samples, samples[1:], strict=False)]
        assert steps and all(0.04 < each < 0.07 for each in steps)
        assert max(each.velocity for each in samples) > 0 == opened.missed
        assert [each async for each in opened] == [] and len(await opened.samples()) == 0
        polled = shell_of(session).buses["press"].telemetry
        assert polled.period("a") == math.inf


@pytest.mark.virtual
async def test_telemetry_of_all_drives_names_them_and_their_axes(url: str) -> None:
    async with connect_async(url) as session:
        found = set()
        async for sample in session.telemetry(rate=math.inf):
            found.add((sample.drive, sample.axis))
            if len(found) == 4:
                break
        assert found == {("press:a", ""), ("press:b", ""), ("pmx:00", "x"), ("pmx:00", "y")}


@pytest.mark.virtual
async def test_samples_that_nobody_takes_are_bounded_and_counted(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(telemetry, "MOST_KEPT_SAMPLES", 5)
    async with connect_async(f"{url}#press") as session:
        opened = session.telemetry("a")
        await asyncio.sleep(1)
        samples = await opened.samples()
        assert len(samples) == 5 and opened.missed > 10
        assert samples[0].elapsed > 0.5


@pytest.mark.virtual
async def test_a_lost_line_ends_telemetry_with_its_reason(url: str) -> None:
    async with connect_async(url) as session:
        opened = session.telemetry("press:a")
        await session.send("/sim unplug press")
        with pytest.raises(TransportLost):
            async for _ in opened:
                pass


def test_columns_and_rows() -> None:
    samples = Samples(ROWS)
    columns = samples.arrays()
    assert columns["position"] == array("q", [0, 7, 9]) and columns["elapsed"] == array("d", [0.0, 0.5, 1.0])
    assert columns["drive"] == ["a", "b", "a"] and list(columns) == list(Sample._fields)
    assert samples.of("a") == Samples([ROWS[0], ROWS[2]]) and len(samples.of("b", "y")) == 0
    assert samples[1] is ROWS[1] and samples[:2] == Samples(ROWS[:2]) and repr(samples) == "<3 samples, 1.000 s>"


def test_arrow_has_the_same_columns() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    table = Samples(ROWS).arrow()
    assert table.column("position").to_pylist() == [0, 7, 9] and table.column("drive").to_pylist() == ["a", "b", "a"]
    assert pyarrow.table(Samples(ROWS)) == table


def test_samples_compare(tmp_path: Path) -> None:
    different: Any = Samples(ROWS[:1])
    assert different != Samples(ROWS) and different != ROWS and hash(different) == hash(Samples(ROWS[:1]))
