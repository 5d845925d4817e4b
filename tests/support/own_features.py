"""Features of a person's own, beside the configuration of a test."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base import registry


def forget_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin without the features by others that were loaded before, and end so."""
    for name in ("_others", "_failed"):
        monkeypatch.setattr(registry, name, {})
    monkeypatch.setattr(registry, "_untold", [])


def own(folder: Path, name: str, text: str) -> Path:
    """Write a feature; return the path of its file."""
    path = folder / "conf" / "features" / f"{name}.py"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path
