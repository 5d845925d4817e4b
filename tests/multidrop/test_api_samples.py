"""Samples: from telemetry, as columns, as pictures, and from a plot's file."""

from __future__ import annotations

import asyncio
import math
import re
from array import array
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop import Diagnostic, Sample, Samples, TransportLost, connect_async, read_rrd
from multidrop.api import pictures, telemetry
from tests.support.cell_session import bus, party, pmx
from tests.support.examples import examples

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
        polled = session._shell.buses["press"].telemetry
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
    monkeypatch.setattr(telemetry, "KEPT", 5)
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


def drawn(html: str) -> list[ElementTree.Element]:
    """The SVG pictures in it, which are XML."""
    return [ElementTree.fromstring(each) for each in re.findall(r"<svg.*?</svg>", html, re.S)]


STEPS = st.integers(-(2**31), 2**31)


@examples(10, 200)
@given(st.lists(st.tuples(st.text(max_size=3), STEPS, STEPS), max_size=6))
def test_any_samples_make_a_small_safe_picture(rows: list[tuple[str, int, int]]) -> None:
    samples = Samples(Sample(at / 10, 0.0, drive, "", p, v) for at, (drive, p, v) in enumerate(rows))
    html = samples._repr_html_()
    pictures = drawn(re.sub(r"[^\x20-\x7e]", "?", html))
    assert len(pictures) == (2 if rows else 0) and "<script" not in html and len(html) < 20_000
    points = [float(each) for svg in pictures for line in svg.iter() for each in re.findall(r"[-\d.]+", _points(line))]
    assert all(math.isfinite(each) and 0 <= each <= 640 for each in points)


def _points(line: ElementTree.Element) -> str:
    return line.get("points", "")


def test_a_long_curve_is_thinned_and_keeps_its_peak() -> None:
    values = [0.0] * 100_000
    values[70_001] = 5.0
    times, kept = pictures._thinned([float(each) for each in range(len(values))], values)
    assert len(kept) <= pictures.POINTS and max(kept) == 5.0 and times == sorted(times)


@pytest.mark.virtual
async def test_sessions_drives_and_runs_are_escaped_tables(url: str, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text('@a PR "<b>&"\n/print {{\n')
    async with connect_async(f"{url}#press") as session:
        html = (await session.run(str(tmp_path / "t.txt")))._repr_html_()
        assert "&lt;b&gt;&amp;" in html and "<b>" not in html and html.count("<tr>") == 3
        assert "LMDCM" in session._repr_html_() and "LMDCM" in session.drive("a")._repr_html_()
    assert "closed" in session._repr_html_()


def test_long_tables_are_cut() -> None:
    assert "and 50 more" in pictures.table("t", ["a"], [(str(each),) for each in range(pictures.ROWS + 50)])


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


def test_samples_compare(tmp_path: Path) -> None:
    different: Any = Samples(ROWS[:1])
    assert different != Samples(ROWS) and different != ROWS and hash(different) == hash(Samples(ROWS[:1]))
