"""pylablib's stage for this controller, written for real units, run unchanged against `multidrop sim`.

The package comes from PyPI; where it cannot be had the tests are skipped.
"""

import json
import subprocess

import pytest

from tests.support.foreign_python import foreign_python
from tests.support.paths import SUPPORT
from tests.support.processes import Running
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

CLIENT = SUPPORT / "client_pylablib.py"
PACKAGES = ("pylablib-lightweight==1.4.3", "numpy", "scipy", "pandas", "python-dateutil", "six", "pyserial==3.5")
PACKAGES += ("pyft232", "pyusb", "tzdata")
CELL = """
[[bus]]
name = "stage"
serve = ["pty:stage.tty", "tcp://127.0.0.1:0"]
baud = 9600
[[bus.drive]]
personality = "PMX"
name = "00"
[bus.drive.world.x]
home = -500
[bus.drive.world.y]
limit_plus = 400
"""
EXPECTED = {
    "number": "2ED00",
    "baudrate": 9600,
    "enabled": [True, True],
    "limit errors": False,
    "speeds": [5000, 8000, 0],
    "low speed": "OK",
    "moving": True,
    "position": [2000, -1000],
    "stopped": [[False, False], [0, 0]],
    "limit": [["", "+"], ["sw_plus_lim", "err_plus_lim"]],
    "cleared": "",
    "homing": "OK",
    "home": 0,
    "outputs": [4, 0],
    "analog": 0.0,
    "unknown": "?HS",
}


@pytest.fixture(scope="module")
def python():
    """A Python that has the package."""
    return foreign_python(*PACKAGES)


@pytest.mark.parametrize("way", ["pty", pytest.param("tcp", marks=pytest.mark.nightly)])
def test_its_stage_moves_stops_meets_limits_and_homes(python, tmp_path, way):
    (tmp_path / "cell.toml").write_text(CELL)
    running = Running("sim", "cell.toml", "--json", folder=tmp_path)
    try:
        said = [json.loads(line) for line in running.until('{"ready": true}')[:-1]]
        (endpoint,) = [each["endpoint"] for each in said if each["endpoint"].startswith(way)]
        target = "stage.tty" if way == "pty" else endpoint.removeprefix("tcp://")
        done = subprocess.run(
            [str(python), str(CLIENT), target], capture_output=True, text=True, timeout=4 * PATIENCE, cwd=tmp_path
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert json.loads(done.stdout.splitlines()[-1]) == EXPECTED
    finally:
        running.process.terminate()
        running.end()
