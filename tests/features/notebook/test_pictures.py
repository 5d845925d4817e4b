"""Pictures of sessions, drives, script runs and samples: small, escaped, in SVG."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop import Sample, Samples, connect_async
from multidrop.features.notebook import pictures
from tests.support.cell_session import bus, party, pmx
from tests.support.examples import examples


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A press with drives a and b, and a PMX."""
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0) + bus("pmx", pmx("00"), baud=0))
    return f"sim:{tmp_path / 'cell.toml'}"


def drawn(html: str) -> list[ElementTree.Element]:
    """The SVG pictures in it, which are XML."""
    return [ElementTree.fromstring(each) for each in re.findall(r"<svg.*?</svg>", html, re.S)]


STEPS = st.integers(-(2**31), 2**31)


@examples(10, 200)
@given(st.lists(st.tuples(st.text(max_size=3), STEPS, STEPS), max_size=6))
def test_any_samples_make_a_small_safe_picture(rows: list[tuple[str, int, int]]) -> None:
    samples = Samples(Sample(at / 10, 0.0, drive, "", p, v) for at, (drive, p, v) in enumerate(rows))
    html = samples._repr_html_()
    found = drawn(re.sub(r"[^\x20-\x7e]", "?", html))
    assert len(found) == (2 if rows else 0) and "<script" not in html and len(html) < 20_000
    points = [float(each) for svg in found for line in svg.iter() for each in re.findall(r"[-\d.]+", _points(line))]
    assert all(math.isfinite(each) and 0 <= each <= 640 for each in points)


def _points(line: ElementTree.Element) -> str:
    return line.get("points", "")


def test_a_long_curve_is_thinned_and_keeps_its_peak() -> None:
    values = [0.0] * 100_000
    values[70_001] = 5.0
    [svg] = drawn(pictures.plot("position", [("a", [float(each) for each in range(len(values))], values)]))
    [line] = [each for each in svg.iter() if _points(each)]
    points = [tuple(map(float, each.split(","))) for each in _points(line).split()]
    assert len(points) <= pictures.POINTS and points == sorted(points, key=lambda point: point[0])
    assert len({y for _, y in points}) == 2, "the peak is drawn"


@pytest.mark.virtual
async def test_sessions_drives_and_runs_are_escaped_tables(url: str, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text('@a PR "<b>&"\n/print {{\n')
    async with connect_async(f"{url}#press") as session:
        html = (await session.run(str(tmp_path / "t.txt")))._repr_html_()
        assert "&lt;b&gt;&amp;" in html and "<b>" not in html and html.count("<tr>") == 3
        assert "LMDCM" in session._repr_html_() and "LMDCM" in session.drive("a")._repr_html_()
    assert "closed" in session._repr_html_()


async def test_a_drive_is_a_table_with_what_is_known_of_it(url: str) -> None:
    async with connect_async(url) as session:
        a, y = session.drive("press:a"), session.drive("pmx:00", "y")
        assert "<td style='white-space:pre-wrap;text-align:left'></td></tr>" in a._repr_html_(), "no velocity is known"
        await a.run_at(1000)
        await a.velocity()
        assert f">{a.version}</td>" in a._repr_html_() and ">1000</td></tr>" in a._repr_html_()
        assert ">y</td>" in y._repr_html_()


def test_long_tables_are_cut() -> None:
    assert "and 50 more" in pictures.table("t", ["a"], [(str(each),) for each in range(pictures.MOST_ROWS + 50)])
