"""Features by others: those that are loaded, and those of a person's own, beside the configuration of a test."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from multidrop.base import registry
from multidrop.base.feature import Feature
from multidrop.base.registry import FeatureEntry


def forget_loaded(monkeypatch: pytest.MonkeyPatch, *loaded: tuple[FeatureEntry, Feature]) -> None:
    """Begin with these features by others alone, without those that were loaded before, until the test ends."""
    monkeypatch.setattr(registry, "_others", {entry.place: (entry, feature) for entry, feature in loaded})
    monkeypatch.setattr(registry, "_failed", {})
    monkeypatch.setattr(registry, "_untold", [])


def load(monkeypatch: pytest.MonkeyPatch, feature: Feature) -> None:
    """Let this be the only feature by others, as if the distribution `dist` had an entry point for it."""
    forget_loaded(monkeypatch, (FeatureEntry(feature.name, "dist", "1", "p"), feature))


def wheel_unread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin as if no feature of the wheel was imported yet."""
    monkeypatch.setattr(registry, "wheel", cache(registry.wheel.__wrapped__))


def own(folder: Path, name: str, text: str) -> Path:
    """Write a feature; return the path of its file."""
    path = folder / "conf" / "features" / f"{name}.py"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path
