"""`shell --twin`: twins of all drives from the beginning."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.cell_session import bus, party
from tests.support.front_door import on_lines


def test_twins_are_beside_all_drives_from_the_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cell.toml").write_text(bus("press", party("a", CK=0), party("b", CK=0), baud=0))
    piped = on_lines(tmp_path, monkeypatch, capfd)
    beside, alone = piped("/twin\n", "--twin"), piped("/twin\n")
    assert beside[1:] != alone[1:] and beside.returncode == 0
