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
STATE = re.compile(r"\d|moving|idle|stopped")


@pytest.fixture(scope="module")
def pictures() -> ModuleType:
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "packaging" / "pictures.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_picture_is_taken_and_each_is_shown(pictures: ModuleType) -> None:
    shown = {name for page in PAGES for name in re.findall(r"pictures/([\w.-]+)\)", page.read_text())}
    taken = {f"{name}.svg" for name in pictures.SCENES}
    assert shown == taken == {path.name for path in pictures.PICTURES.iterdir()}


@pytest.mark.tui
def test_a_picture_shows_what_the_program_shows(pictures: ModuleType) -> None:
    kept = (pictures.PICTURES / "macros-80x24.svg").read_text()
    assert words(pictures.taken("macros-80x24")) == words(kept), "make pictures takes them again"


def words(svg: str) -> set[str]:
    """The words in a picture that do not change from second to second."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    found = {word for text in texts for word in html.unescape(text).replace("\xa0", " ").split()}
    return {word for word in found if not STATE.search(word)}
