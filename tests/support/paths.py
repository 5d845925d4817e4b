"""Folders that tests read: the checkout, its tests' programs, and the tables of facts beside it (absent elsewhere)."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
FACTS = ROOT.parent / "shared" / "facts"
