"""The page on the architecture names modules, classes and functions that exist."""

from __future__ import annotations

import importlib
import inspect
import re
from types import ModuleType

from tests.support.cases import for_each
from tests.support.paths import ROOT

ROOMS = "multidrop|features|families|tui|shell|macros|drives|simulator|dialects|transports|base"
PAGES = ("architecture.md", "new-family.md")
TEXT = "".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in PAGES)
NAMES = sorted(set(re.findall(rf"`((?:{ROOMS})(?:\.\w+)+)`", TEXT)))


FILES = sorted(set(re.findall(rf"`((?:{ROOMS})(?:/\w+)+\.\w+)`", TEXT)))


def exists(name: str) -> bool:
    """Whether a dotted name leads to a module, or to something in one."""
    parts = [*([] if name.startswith("multidrop.") else ["multidrop"]), *name.split(".")]
    for count in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            fields = getattr(found, "__annotations__", {}) if not isinstance(found, ModuleType) else {}
            if part not in fields and inspect.getattr_static(found, part, None) is None:
                return False
            found = getattr(found, part, None)
        return True
    return False


def test_there_are_names_to_check():
    assert len(NAMES) > 40
    assert not exists("multidrop.drives.line.Line.converse")


@for_each("name", NAMES)
def test_every_name_exists(name):
    assert exists(name)


@for_each("file", [each for each in FILES if "FAMILY" not in each])
def test_every_file_exists(file):
    assert (ROOT / file).is_file()


def test_the_page_stays_short():
    assert len((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").splitlines()) <= 190


def test_the_index_leads_to_every_page():
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\(([a-z-]+\.md)", index))
    assert linked == {page.name for page in (ROOT / "docs").glob("*.md")} - {"README.md"}


def test_the_site_has_every_page():
    listed = set(re.findall(r": ([a-z-]+\.md)$", (ROOT / "packaging" / "mkdocs.yml").read_text(encoding="utf-8"), re.M))
    assert listed == {page.name for page in (ROOT / "docs").glob("*.md")} - {"README.md"}
