"""The maker's Python client for TMCL modules, unchanged against `multidrop sim`, on a pseudo-terminal and over TCP."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.support.foreign_python import foreign_python
from tests.support.paths import SUPPORT
from tests.support.processes import Running
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

PACKAGES = ("pytrinamic==0.2.26", "python-can==4.6.1", "canopen==2.4.1", "pyserial==3.5")
NEEDED = ("typing_extensions", "wrapt", "packaging", "intelhex")
CELL = """
[[bus]]
name = "slide"
serve = ["pty:slide.tty", "tcp://127.0.0.1:0"]
baud = 9600
[[bus.drive]]
personality = "TMCM"
[bus.drive.world]
limit_minus = -2000
"""
FACTS = {
    "version": "1241V115",
    "address": 1,
    "moved": 51_200,
    "moved by": 50_000,
    "turns": -20_000,
    "stopped": 0,
    "searched": 0,
    "refused": 3,
}


def test_the_makers_client_works_on_a_pseudo_terminal_and_over_tcp(tmp_path: Path) -> None:
    python = foreign_python(*PACKAGES, *NEEDED)
    (tmp_path / "cell.toml").write_text(CELL)
    running = Running("sim", "cell.toml", "--json", folder=tmp_path)
    said = running.until('{"ready": true}')
    places = [json.loads(line)["endpoint"] for line in said if "endpoint" in line]
    for place in places:
        where = place.removeprefix("pty:").removeprefix("tcp://")
        script = [str(python), str(SUPPORT / "client_pytrinamic.py"), where]
        done = subprocess.run(script, capture_output=True, text=True, timeout=PATIENCE)
        assert done.returncode == 0, done.stdout + done.stderr
        assert json.loads(done.stdout.splitlines()[-1]) == FACTS
    running.process.terminate()
    assert running.end() == 0
