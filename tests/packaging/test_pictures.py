"""The pictures of the README and the docs: each is there, is shown somewhere, and shows what the program shows."""

from __future__ import annotations

import html
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
STATE = re.compile(r"\d|moving|at rest")


@pytest.fixture(scope="module")
def pictures() -> ModuleType:
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "packaging" / "pictures.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_picture_is_taken_and_each_is_shown(pictures: ModuleType) -> None:
    shown = {name for page in PAGES for name in re.findall(r"pictures/([\w.-]+)\)", page.read_text(encoding="utf-8"))}
    taken = {f"{name}.svg" for name in (pictures.MOVING, *pictures.SCENES)}
    assert shown == taken == {path.name for path in pictures.PICTURES.iterdir()}


@pytest.mark.tui
def test_a_picture_shows_what_the_program_shows(pictures: ModuleType) -> None:
    kept = (pictures.PICTURES / "macros-80x24.svg").read_text(encoding="utf-8")
    assert words(pictures.taken("macros-80x24")) == words(kept), "make pictures takes them again"


def words(svg: str) -> set[str]:
    """The words in a picture that do not change from second to second."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    found = {word for text in texts for word in html.unescape(text).replace("\xa0", " ").split()}
    return {word for word in found if not STATE.search(word)}


def test_the_moving_picture_is_one_file_that_needs_nothing_else(pictures: ModuleType) -> None:
    kept = (pictures.PICTURES / "tour.svg").read_text(encoding="utf-8")
    assert "<script" not in kept and set(re.findall(r"https?://[^\"\s]+", kept)) <= {
        "http://www.w3.org/2000/svg",
        "https://www.textualize.io",
    }
    shown = {html.unescape(text).replace("\xa0", " ") for text in re.findall(r"<text[^>]*>([^<]*)</text>", kept)}
    assert all(any(line in text for text in shown) for line, _ in pictures.TOUR)


def test_a_row_is_shown_from_frame_to_frame_and_kept_once(pictures: ModuleType) -> None:
    """Three frames of one row: the second differs, the third is the first again."""

    def frame(text: str) -> str:
        line = f'<text class="terminal-r1" x="0" y="20" clip-path="url(#terminal-line-0)">{text}</text>'
        same = '<text class="terminal-r1" x="0" y="44" clip-path="url(#terminal-line-1)">same</text>'
        inner = '<g transform="translate(9, 41)" clip-path="url(#terminal-clip-terminal)">'
        return f"<svg><style>.terminal-r1 {{ fill: red }}</style>{inner}{line}{same}</g></svg>"

    film = pictures.moving([(0.0, frame("one")), (1.0, frame("two")), (2.0, frame("one"))])
    assert [film.count(f">{text}<") for text in ("one", "two", "same")] == [2, 1, 1]
    assert "@keyframes t0-100 { 0.000% { visibility: visible } 20.000% { visibility: hidden }" in film
    assert "@keyframes t200-500 { 0% { visibility: hidden } 40.000% { visibility: visible } 100%" in film
