"""The fixtures for other people's tests: used as they use them, and without cost where they are not used."""

from __future__ import annotations

import os
import socket
import sys
import tomllib
from pathlib import Path

import pytest

from multidrop import Diagnostic, Drive, Session, SimulatedCell, connect, simulate
from multidrop.shell import configuration
from tests.support.paths import ROOT
from tests.support.processes import environment
from tests.support.until import PATIENCE

pytest_plugins = ["pytester"]

TESTS = """
import socket
import sys
import pytest


def test_a_client_of_its_own(multidrop_cell):
    host, _, port = multidrop_cell.url().removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port)), 10) as wire:
        wire.sendall(b"\\naPR P\\n")
        seen = b""
        while not seen.endswith(b"0\\r\\n>"):
            seen += wire.recv(100)


def test_a_drive(multidrop_drive):
    multidrop_drive.move(200)
    multidrop_drive.wait()
    assert multidrop_drive.position == 200


class TestAnother:
    @pytest.fixture
    def multidrop_cell_text(self):
        return '[[bus]]\\nname = "y"\\n[[bus.drive]]\\npersonality = "LMDCE"\\n'

    def test_a_cell_of_its_own(self, multidrop_cell, multidrop_session):
        assert multidrop_cell.url("y", "modbus").startswith("modbus://127.0.0.1:")
        assert [each.product for each in multidrop_session.drives] == ["LMDCE"]
"""
IDLE = """
import sys


def test_nothing_of_multidrop_is_loaded():
    rooms = {"drives", "shell", "dialects", "families", "simulator", "multidrop.api"}
    assert "multidrop.pytest_plugin" in sys.modules and not rooms & {*sys.modules}
"""


@pytest.mark.process
def test_the_fixtures_work_and_cost_nothing_where_they_are_not_used(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in environment(pytester.path).items():
        monkeypatch.setenv(name, value)
    pytester.makepyfile(test_idle=IDLE, test_with_drives=TESTS)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    done = pytester.runpytest_subprocess("-p", "multidrop.pytest_plugin", "-p", "no:cacheprovider")
    done.assert_outcomes(passed=4)


BROKEN = """
import pytest


@pytest.fixture
def multidrop_cell_text():
    return '[[bus]]\\nname = "y"\\n[[bus.drive]]\\npersonality = "LMDCE"\\nnme = "a"\\n'


def test_it(multidrop_cell):
    raise AssertionError


def test_another(multidrop_drive):
    raise AssertionError
"""


@pytest.mark.process
def test_folders_of_a_persons_own_and_a_fault_of_a_cell(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in environment(pytester.path).items():
        monkeypatch.setenv(name, value)
    for room in ("drives", "shell", "simulator", "dialects", "families", "macros", "transports", "tui", "base"):
        pytester.mkpydir(room).joinpath("__init__.py").write_text("raise ImportError('of a person')")
    pytester.makepyfile(test_with_drives=TESTS, test_broken=BROKEN)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    done = pytester.runpytest_subprocess("-p", "multidrop.pytest_plugin", "-p", "no:cacheprovider")
    done.assert_outcomes(passed=3, errors=2)
    fault = '[[bus]] "y": [[bus.drive]] 1: unknown key "nme"; did you mean "name"?'
    done.stdout.fnmatch_lines([f"cell:5: {fault}".replace("[", "[[]"), f"*.toml:5: {fault}".replace("[", "[[]")])
    assert "Traceback" not in done.stdout.str() and "cells.py" not in done.stdout.str()


def test_a_fault_of_a_cell_is_an_error_of_the_test_in_one_line(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(test_broken=BROKEN)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    done = pytester.runpytest_inprocess("-p", "multidrop.pytest_plugin", "-p", "no:cacheprovider")
    done.assert_outcomes(errors=2)
    fault = '[[bus]] "y": [[bus.drive]] 1: unknown key "nme"; did you mean "name"?'.replace("[", "[[]")
    done.stdout.fnmatch_lines([f"cell:5: {fault}", f"*multidrop-cell.toml:5: {fault}"])
    assert "Traceback" not in done.stdout.str() and "pytest_plugin.py" not in done.stdout.str()


def test_a_drive_of_a_session_in_memory_has_folders_of_its_own(
    multidrop_drive: Drive, multidrop_session: Session, multidrop_folders: Path, multidrop_cell_text: str
) -> None:
    assert multidrop_drive.name == "a" and repr(multidrop_session) == "<multidrop: line: a, b>"
    assert multidrop_drive.product == "LMDCM" and multidrop_drive.read("PY") == 1
    assert (multidrop_folders / "multidrop-cell.toml").read_text(encoding="utf-8") == multidrop_cell_text
    for name in ("config", "state", "data"):
        assert os.environ[f"MULTIDROP_{name.upper()}_DIR"] == str(multidrop_folders / f"multidrop-{name}")
    assert configuration.config_folder() == multidrop_folders / "multidrop-config"
    seen = [multidrop_session.send(f"/sim input a 1 {level}") or multidrop_drive.inputs[1] for level in (0, 1)]
    assert sorted(seen) == [False, True], "the world of its cell moves"


def test_a_served_cell_speaks_to_any_client(multidrop_cell: SimulatedCell) -> None:
    assert multidrop_cell.buses == ["line"]
    host, _, port = multidrop_cell.url().removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port)), PATIENCE) as wire:
        wire.sendall(b"\nbPR DN\n")
        seen = b""
        while b'"b"' not in seen:
            assert (data := wire.recv(100)), seen
            seen += data


def test_pytest_loads_the_plugin_where_multidrop_is_installed() -> None:
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    assert project["entry-points"]["pytest11"] == {"multidrop": "multidrop.pytest_plugin"}


def test_a_served_cell_has_several_ways_in(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text('[[bus]]\nname = "x"\n[[bus.drive]]\npersonality = "LMDCE"\n')
    with simulate(tmp_path / "cell.toml", speed=50) as cell:
        assert cell.buses == ["x"] and cell.url() == cell.url("x", "tcp")
        with connect(cell.url()) as session, connect(cell.url(scheme="modbus")) as other:
            drive = session.drive()
            drive.move(51200)
            drive.wait()
            assert drive.position == 51200 == other.drive().position
            cell.world("input ! 1 0")
            with pytest.raises(Diagnostic, match="valid: "):
                cell.world("frob")
        if sys.platform != "win32":
            with connect(cell.url(scheme="pty")) as session:
                assert session.drive().position == 51200
        with pytest.raises(Diagnostic, match="no tcp to y; its buses: x"):
            cell.url("y")
        port = int(cell.url().rpartition(":")[2])
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port), 1)
    with pytest.raises(Diagnostic, match="closed"):
        cell.world("input ! 1 0")
    cell.close()


def test_a_wrong_cell_is_one_line() -> None:
    with pytest.raises(Diagnostic, match="frob"):
        simulate(text="frob = 1")
    with pytest.raises(Diagnostic, match="no speed 0"):
        simulate(speed=0)
