"""Folders that tests read: the checkout, its tests' programs, and the tables of facts beside it (absent elsewhere)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from multidrop.base.registry import IN_WHEEL

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
ROOMS = (
    "multidrop",
    "tui",
    "shell",
    "macros",
    "drives",
    "simulator",
    "dialects",
    "transports",
    "base",
    "families",
    "features",
)
THERE = tuple(each for each in IN_WHEEL if (ROOT / "features" / each).is_dir())
"""The features of the tree: all of the wheel, or fewer in a copy of `make seams`."""
FACTS = ROOT.parent / "shared" / "facts"


def sources(*rooms: str) -> Iterator[tuple[str, Path]]:
    """Yield the Python files of rooms, by their names below the root. The links in `multidrop/` are not followed."""
    for path in (path for room in rooms for path in (ROOT / room).rglob("*.py")):
        parts = path.relative_to(ROOT).parts
        if parts[0] != "multidrop" or parts[1] not in ROOMS:
            yield "/".join(parts), path
