"""The maker's Python client for TMCL modules, unchanged against `multidrop sim`, on a pseudo-terminal and over TCP."""

from __future__ import annotations

import json
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import partial
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


SPEED = 20
AT_ONCE = 4
EXAMPLES = {
    "TMCM1140/TMCL/rotate_demo.py": "",
    "TMCM1140/TMCL/StallGuard2_demo.py": "stall_at = 3000000",
    "TMCM1140/TMCL/CoolStep_demo.py": "stall_at = 3000000",
    "TMCM1161/TMCL/rotate_demo.py": "",
    "TMCM1240/TMCL/rotate_demo.py": "",
    "TMCM1240/TMCL/StallGuard2_demo.py": "stall_at = 1000000",
    "TMCM1241/TMCL/rotate_demo.py": "",
    "TMCM1241/TMCL/StallGuard2_demo.py": "stall_at = 1000000",
    "TMCM1276/TMCL/rotate_demo.py": "",
    "TMCM1276/TMCL/six_point_ramp_demo.py": "",
    "TMCM1276/TMCL/stop_switch_demo.py": "limit_plus = 200000",
    "TMCM3110/TMCL/rotate_demo.py": "",
    "TMCM6110/TMCL/rotate_demo.py": "",
}
"""Every example of the library for a module that the simulator has, but for CAN, and what surrounds its motor."""
ENDS = {
    "rotate_demo.py": ("Reached position 0", "Reached Position 0"),
    "StallGuard2_demo.py": ("stopped by StallGuard2",),
}


@pytest.mark.slow
def test_every_example_of_the_maker_for_a_simulated_module_runs_to_its_end(tmp_path: Path) -> None:
    python = foreign_python(*PACKAGES, *NEEDED)
    buses = []
    for number, (example, world) in enumerate(EXAMPLES.items()):
        product = example.partition("/")[0].replace("TMCM", "TMCM-")
        served = f'name = "b{number}"\nserve = ["tcp://127.0.0.1:0"]\nbaud = 115200\n'
        buses.append(f'[[bus]]\n{served}[[bus.drive]]\npersonality = "{product}"\n[bus.drive.world]\n{world}\n')
    (tmp_path / "cell.toml").write_text("".join(buses))
    running = Running("sim", "cell.toml", "--json", "--speed", str(SPEED), folder=tmp_path)
    said = running.until('{"ready": true}')
    places = [json.loads(line)["endpoint"].removeprefix("tcp://") for line in said if "endpoint" in line]
    runner = str(SUPPORT / "example_pytrinamic.py")
    scripts = [[str(python), runner, *each, str(SPEED)] for each in zip(EXAMPLES, places, strict=True)]
    with ThreadPoolExecutor(AT_ONCE) as pool:  # an example waits most of its time
        ended = list(pool.map(partial(subprocess.run, capture_output=True, text=True, timeout=2 * PATIENCE), scripts))
    for example, done in zip(EXAMPLES, ended, strict=True):
        assert done.returncode == 0, (example, done.stdout[-500:], done.stderr)
        ends = ENDS.get(example.rpartition("/")[2], ("",))
        assert any(each in done.stdout for each in ends), (example, done.stdout)
        assert done.stdout.endswith("the example has ended\n")
    running.process.terminate()
    assert running.end() == 0
