"""From outside: `multidrop sim` serves one drive on MCode/TCP and Modbus/TCP, `multidrop send` speaks to both."""

import pytest

pytestmark = pytest.mark.process


@pytest.fixture
def endpoints(home):
    return home.serve().endpoints["eth"]


def test_the_same_lines_on_both(endpoints, home):
    moved = home.run("send", endpoints["modbus"], "P=0", "MR 51200", "/wait stopped", 'PR P," ",V', "PR VM")
    assert (moved.returncode, moved.stdout) == (0, "51200 0\n768000\n"), moved.stderr
    seen = home.run("send", endpoints["tcp"], 'PR P," ",V', "PR VM")
    assert (seen.returncode, seen.stdout) == (0, moved.stdout), seen.stderr


def test_refusals_are_one_line_and_exit_1(endpoints, home):
    for line, named in (
        ("HC=101", "exception 03 illegal data value at register 0x0029 (HC)"),
        ("PR UV", "MCode/TCP"),
        ("/register 2", "exception 02 illegal data address at register 0x0002"),
    ):
        done = home.run("send", endpoints["modbus"], line, "PR P")
        assert (done.returncode, done.stdout) == (1, "")
        assert named in done.stderr and "Traceback" not in done.stderr


def test_registers_and_identification_go_to_standard_output(endpoints, home):
    done = home.run("send", endpoints["modbus"], "/register 0x8B", "/coil 1", "/device")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[:3] == ["0x008B = 47104 (0xB800)", "0x008C = 11 (0x000B)", "VM = 768000"]
    assert "vendor: SEM USA" in done.stdout
