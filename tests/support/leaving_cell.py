"""A cell whose paths leave its folder, which the configuration has to allow."""

from __future__ import annotations

from pathlib import Path

from tests.support.front_door import command

OWN = '[[bus]]\nname = "p"\nserve = ["pty:../p.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\nprogram = "../feed.mxt"\n'


def write_leaving(folder: Path) -> None:
    """Write the cell, `cell/own.toml`, and the program of its drive, `feed.mxt` beside its folder."""
    (folder / "cell").mkdir()
    (folder / "feed.mxt").write_text("PG 1\nLB G1\n PR 7\nE\nPG\n")
    (folder / "cell" / "own.toml").write_text(OWN)


def assert_allowed_by_configuration(folder: Path, *words: str) -> None:
    """A command on the cell is refused, and works once `simulator.allow` names the paths."""
    settings = folder / "conf" / "multidrop.toml"
    settings.unlink(missing_ok=True)
    refused = command(folder, *words)
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1
    assert "simulator.allow in the configuration" in refused.stderr
    settings.parent.mkdir(exist_ok=True)
    settings.write_text('[simulator]\nallow = ["../feed.mxt", "../p.tty"]\n')
    assert command(folder, *words).returncode == 0, words
