"""A release: one version in all places, a clean tree, and a smoke test that can fail."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

import multidrop
from tests.support.paths import ROOT


@pytest.fixture(scope="module")
def release() -> ModuleType:
    spec = importlib.util.spec_from_file_location("release", ROOT / "packaging" / "release.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_command_wheel_pages_and_citation_have_one_version(release: ModuleType) -> None:
    assert set(release.versions().values()) == {multidrop.__version__}


def test_a_version_that_differs_is_named_with_its_place(
    release: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in release.PLACES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    (tmp_path / "CITATION.cff").write_text("version: 0.0.9\n")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## Unreleased\n")
    found = release.versions(tmp_path)
    monkeypatch.setattr(release, "versions", lambda: found)
    with pytest.raises(release.Wrong, match="CHANGELOG.md has no version, CITATION.cff has 0.0.9"):
        release.checked_version()


def test_a_tree_with_changes_is_no_release(release: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    done = SimpleNamespace(returncode=0, stdout="?? new.py\n", stderr="")
    monkeypatch.setattr(release.subprocess, "run", lambda *command, **named: done)
    with pytest.raises(release.Wrong, match="commit them first"):
        release.checked_version()


def test_the_workflow_makes_what_make_release_makes() -> None:
    text = (ROOT / "packaging" / "release.yml").read_text()
    assert "make release" in text and "bash .ci/run" in text
