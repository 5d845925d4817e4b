"""New files: whole or not there at all, and never in place of another."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic


def test_a_full_disk_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Diagnostic, match="kept.toml: cannot be written: No space left on device"):
        new_file.write(tmp_path / "kept.toml", "[parameters]\n")
    assert list(tmp_path.iterdir()) == []


def test_a_file_or_a_dangling_link_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("of somebody")
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    for name in ("file", "link"):
        for refused in (lambda path: new_file.check(path), lambda path: new_file.write(path, "ours")):
            with pytest.raises(Diagnostic, match=f"{name}: exists already; name a new file"):
                refused(tmp_path / name)
    assert (tmp_path / "file").read_text() == "of somebody" and not (tmp_path / "gone").exists()


def test_a_folder_that_does_not_exist_is_said(tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match="its folder does not exist; make the folder first"):
        new_file.check(tmp_path / "none" / "a.toml")
