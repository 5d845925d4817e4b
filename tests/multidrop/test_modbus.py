"""From outside: `multidrop sim` serves one drive on MCode/TCP and Modbus/TCP, `multidrop send` speaks to both."""

import json
import subprocess
import sys

import pytest

from tests.support.processes import Running, environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process


@pytest.fixture
def endpoints(tmp_path):
    running = Running("sim", "--json", folder=tmp_path)
    found = {}
    try:
        while True:
            said = json.loads(running.lines.get(timeout=PATIENCE))
            if "ready" in said:
                break
            if said["bus"] == "eth":
                found[said["endpoint"].partition(":")[0]] = said["endpoint"]
        yield found
    finally:
        running.process.terminate()
        running.end()


def send(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "multidrop", "send", *arguments],
        cwd=folder,
        env=environment(folder),
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE,
    )


def test_the_same_lines_on_both(endpoints, tmp_path):
    moved = send(tmp_path, endpoints["modbus"], "P=0", "MR 51200", "/wait stopped", 'PR P," ",V', "PR VM")
    assert (moved.returncode, moved.stdout) == (0, "51200 0\n768000\n"), moved.stderr
    seen = send(tmp_path, endpoints["tcp"], 'PR P," ",V', "PR VM")
    assert (seen.returncode, seen.stdout) == (0, moved.stdout), seen.stderr


def test_refusals_are_one_line_and_exit_1(endpoints, tmp_path):
    for line, named in (
        ("HC=101", "exception 03 illegal data value at register 0x0029 (HC)"),
        ("PR UV", "MCode/TCP"),
        ("/register 2", "exception 02 illegal data address at register 0x0002"),
    ):
        done = send(tmp_path, endpoints["modbus"], line, "PR P")
        assert (done.returncode, done.stdout) == (1, "")
        assert named in done.stderr and "Traceback" not in done.stderr


def test_registers_and_identification_go_to_standard_output(endpoints, tmp_path):
    done = send(tmp_path, endpoints["modbus"], "/register 0x8B", "/coil 1", "/device")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[:3] == ["0x008B = 47104 (0xB800)", "0x008C = 11 (0x000B)", "VM = 768000"]
    assert "vendor: SEM USA" in done.stdout
