"""pytest fixtures for programs that talk to drives: a simulated cell, a session with it, a drive.

A fault of the cell is an error of the test in one line, with the line of the cell.

Installed with `multidrop[pytest]`. pytest loads this file in every run, so it imports nothing until a fixture is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from multidrop.api.blocking import Drive, Session
    from multidrop.api.simulated import SimulatedCell

CELL = """
[[bus]]
name = "line"
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
[[bus.drive]]
personality = "LMDCM"
name = "b"
party = true
"""


@pytest.fixture
def multidrop_cell_text() -> str:
    """The cell file of the other fixtures: a bus `line` with drives a and b. Override it with your own."""
    return CELL


@pytest.fixture
def multidrop_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A configuration and a state of multidrop for one test only."""
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "multidrop-config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "multidrop-state"))
    monkeypatch.setenv("MULTIDROP_DATA_DIR", str(tmp_path / "multidrop-data"))
    return tmp_path


@contextmanager
def _faults_named() -> Iterator[None]:
    from multidrop.base.errors import Diagnostic

    try:
        yield
    except Diagnostic as fault:
        pytest.fail(str(fault), pytrace=False)


@pytest.fixture
def multidrop_cell(multidrop_cell_text: str) -> Iterator[SimulatedCell]:
    """The cell, served: `.url()`, `.url("line", "pty")`, `.world("input a 1 0")`."""
    from multidrop.api.simulated import simulate

    with _faults_named():
        cell = simulate(text=multidrop_cell_text)
    with cell:
        yield cell


@pytest.fixture
def multidrop_session(multidrop_cell_text: str, multidrop_folders: Path) -> Iterator[Session]:
    """A session with a cell of its own in memory; `.send("/sim input a 1 0")` moves its world."""
    from multidrop.api.blocking import connect

    file = multidrop_folders / "multidrop-cell.toml"
    file.write_text(multidrop_cell_text, encoding="utf-8")
    with _faults_named():
        session = connect(f"sim:{file}")
    with session:
        yield session


@pytest.fixture
def multidrop_drive(multidrop_session: Session) -> Drive:
    """The first drive of that session."""
    return multidrop_session.drives[0]
