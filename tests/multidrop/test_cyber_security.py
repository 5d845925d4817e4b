"""From outside: a drive whose cyber security is on, and a slow one, over TCP, UDP and Modbus/TCP."""

import pytest

from tests.support.cell_session import ETHERNET, bus

pytestmark = pytest.mark.process

SERVE = [f"{scheme}://127.0.0.1:0" for scheme in ("tcp", "udp", "modbus")]
CELL = bus("cse", ETHERNET + "\ncse = true", baud=0, serve=SERVE)
CELL += bus("slow", ETHERNET, baud=0, serve=SERVE[2:]) + "[bus.faults]\ndelay = [1.2, 1.3]\n"
NAMED = "cyber security may be on"
ANOTHER = "another program or a PLC may hold the only connection"


def test_silence_is_named_over_each_port_and_a_slow_drive_is_not(home):
    ends = home.serve(CELL).endpoints
    for scheme, url in ends["cse"].items():
        done = home.run("send", url, "VM=200000")
        assert (done.returncode, done.stdout) == (1, ""), scheme
        assert ANOTHER in done.stderr and NAMED in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr
    for scheme in ("tcp", "udp"):
        done = home.run("scan", ends["cse"][scheme], "--yes")
        assert done.returncode == 3 and NAMED in done.stderr.splitlines()[-1], done.stderr
    done = home.run("send", ends["slow"]["modbus"], "PR P")
    assert done.returncode == 1 and NAMED not in done.stderr, done.stderr
    done = home.run("send", "udp://127.0.0.1:9", "PR P")
    assert done.returncode == 3 and NAMED not in done.stderr, done.stderr
