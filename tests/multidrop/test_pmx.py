"""From outside: `multidrop sim` serves two controllers on a pty and over TCP, `multidrop send` speaks to both."""

import socket

import pytest

from tests.support.cell_session import TCP, bus, pmx
from tests.support.front_door import Home
from tests.support.processes import Running
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

LIMITED = pmx("07", "[bus.drive.world.x]", "limit_plus = 500")
CELL = bus("stages", pmx("00"), LIMITED, serve=["pty:stages.tty", *TCP]) + bus("alone", pmx("00"), baud=0, serve=TCP)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    made = Home(tmp_path_factory.mktemp("pmx")).serve(CELL)
    yield made
    made.close()


def test_two_controllers_on_a_pty(cell):
    done = cell.run(
        "send", "./stages.tty?dialect=pmx&drives=00,07",
        "HSPD=5000", "X1000", "@07 HSPD=5000", "@07 JX+", "/wait ended", "PX", "@07 PX", "@07 MSTX", "/status 07",
        "@07 CLRX", "@* STOP",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[:3] == ["1000", "500", "144"]
    assert lines[3].startswith("X: at rest, plus limit error, plus limit switch on;")


def test_a_gateway_with_and_without_a_number(cell):
    url = cell.endpoints["alone"]["tcp"]
    for query in ("?dialect=pmx", "?dialect=pmx&address=none", "?dialect=pmx&drives=00"):
        done = cell.run("send", url + query, "ID", "V5=7", "V5")
        assert (done.returncode, done.stdout) == (0, "Performax-2ED-SA\n7\n"), done.stderr


def test_refusals_are_one_line_and_exit_1(cell):
    url = cell.endpoints["alone"]["tcp"] + "?dialect=pmx"
    for line, named in (
        ("hspd=5", "it reads capitals only: HSPD=5"),
        ("HS=5", "it is HSPD"),
        ("GS9", "?Sub not Initialized: no subroutine"),
        ("@55 PX", "55 does not reply"),
    ):
        done = cell.run("send", url, line, "PX")
        assert (done.returncode, done.stdout) == (1, ""), (line, done.stderr)
        assert named in done.stderr and "Traceback" not in done.stderr


def test_a_script_that_is_interrupted_stops_both_axes(cell):
    url = cell.endpoints["alone"]["tcp"] + "?dialect=pmx"
    script = cell.script("HSPD=2000\nJX+\nJY-\n/sleep 0.2\nPX\n/sleep 600\n")
    running = Running("run", script, "--on", url, folder=cell.folder)
    assert int(running.lines.get(timeout=PATIENCE)) > 0
    running.process.terminate()
    assert running.end() != 0
    done = cell.run("send", url, "MSTX", "MSTY")
    assert [int(line) & 7 for line in done.stdout.splitlines()] == [0, 0], done.stderr


def test_bytes_as_the_manual_has_them(cell):
    host, port = cell.endpoints["stages"]["tcp"].removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE) as wire:
        for asked, answer in ((b"@00POLX\r", b"0\r"), (b"@07DN\r", b"2ED07\r"), (b"@00HS\r", b"?HS\r")):
            wire.sendall(asked)
            heard = b""
            while not heard.endswith(b"\r"):
                heard += wire.recv(64)
            assert heard == answer
