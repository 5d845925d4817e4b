"""The file of a plot is read back by `multidrop.read_rrd`."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop import Diagnostic, connect_async, read_rrd
from tests.support.cell_session import bus, party, pmx


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A press with drives a and b, and a PMX."""
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0) + bus("pmx", pmx("00"), baud=0))
    return f"sim:{tmp_path / 'cell.toml'}"


@pytest.mark.slow
async def test_a_plot_reads_back_with_one_call(url: str, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    file = tmp_path / "run.rrd"
    async with connect_async(url) as session:
        await session.send(f"/plot --to {file}")
        await session.drive("press:a").move(20000)
        await session.drive("press:a").wait()
        await asyncio.sleep(0.2)
        await session.send("/plot off")
    samples = read_rrd(file)
    a = samples.of("press:a")
    assert a[-1].position == 20000 and max(each.velocity for each in a) > 0
    assert {(each.drive, each.axis) for each in samples} >= {("press:a", ""), ("pmx:00", "x"), ("pmx:00", "y")}
    assert list(a.arrays()["elapsed"]) == sorted(a.arrays()["elapsed"]) and a[0].time > 1.7e9


def test_a_file_that_is_no_plot_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    (tmp_path / "x.rrd").write_text("no")
    for name, said in (("x.rrd", "not a recording of rerun"), ("gone.rrd", "cannot be read: there is no such file")):
        with pytest.raises(Diagnostic, match=said):
            read_rrd(tmp_path / name)
