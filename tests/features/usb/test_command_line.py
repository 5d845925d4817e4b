"""From outside: controllers over USB/IP, beside their RS-485 line; `usb:` on a machine without any."""

from __future__ import annotations

import json
import subprocess

import pytest

from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified
from multidrop.shell.session import Session
from tests.support.cell_session import TCP, bus, pmx
from tests.support.front_door import Home
from tests.support.processes import Running
from tests.support.until import PATIENCE, until

pytestmark = pytest.mark.process

LIMITED = pmx("07", "[bus.drive.world.x]", "limit_plus = 500")
CELL = bus("stages", pmx("00"), LIMITED, baud=0, serve=["usbip://127.0.0.1:0", *TCP])


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    made = Home(tmp_path_factory.mktemp("usb")).serve(CELL)
    yield made
    made.close()


@pytest.fixture
def url(cell):
    """Of the first controller."""
    return cell.endpoints["stages"]["usbip"].replace("/1-2", "/1-1")


def on_the_line(cell, *lines):
    return cell.run("send", cell.endpoints["stages"]["tcp"] + "?dialect=pmx&drives=00", *lines).stdout.split()


def test_it_is_one_device_with_the_one_on_the_line(cell, url):
    done = cell.run("send", url, "HSPD=5000", "X1000", "/wait stopped", "PX", "DN", "V9=4", "/status")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[:3] == ["1000", "2ED00", "X: at rest; StepNLoop off"]
    assert on_the_line(cell, "PX", "V9") == ["1000", "4"]
    assert cell.run("send", cell.endpoints["stages"]["usbip"], "DN", "V9").stdout.split() == ["2ED07", "0"]


def test_refusals_are_one_line_and_exit_1(cell, url):
    for line, named in (("hspd=5", "it reads capitals only: HSPD=5"), ("GS9", "?Sub not Initialized: no subroutine")):
        done = cell.run("send", url, line, "PX")
        assert (done.returncode, done.stdout) == (1, "") and named in done.stderr, done.stderr


def test_keys_of_a_line_are_refused(cell, url):
    for key in ("drives=00", "baud=9600", "dialect=pmx", "party=1"):
        done = cell.run("send", f"{url}?{key}", "PX")
        assert done.returncode == 2 and "is not valid on USB" in done.stderr, done.stderr


def test_a_script_that_is_interrupted_stops_both_axes(cell, url):
    script = cell.script("HSPD=2000\nJX+\nJY-\n/sleep 0.2\nPX\n/sleep 600\n")
    running = Running("run", script, "--on", url, folder=cell.folder)
    assert int(running.lines.get(timeout=PATIENCE)) > 0
    running.process.terminate()
    assert running.end() != 0
    assert [int(line) & 7 for line in on_the_line(cell, "MSTX", "MSTY")] == [0, 0]


def test_a_second_program_is_told(cell, url):
    first = cell.start("shell", url, stdin=subprocess.PIPE)
    first.stdin.write("DN\n")
    first.stdin.flush()
    assert first.stdout.readline() == "2ED00\n"
    done = cell.run("send", url, "DN")
    assert (done.returncode, done.stdout) == (3, "") and f"{url}: another program has it" in done.stderr
    first.stdin.close()
    assert first.wait(PATIENCE) == 0
    assert cell.run("send", url, "DN").stdout == "2ED00\n"


def test_it_is_scanned_for(cell, url):
    done = cell.run("scan", url, "--json")
    found = json.loads(done.stdout)
    assert (found["url"], found["name"], found["product"], found["baud"]) == (url, "2ED00", "PMX-2ED-SA", None)
    done = cell.run("scan", url)
    assert done.stdout == f"{url}  (2ED00)  PMX-2ED-SA  V128BL\n" and f"open with: multidrop shell {url}" in done.stderr


def test_the_simulator_says_how_a_controller_is_attached(cell, url):
    port = url.rpartition(":")[2].partition("/")[0]
    home = Home(cell.folder / "said")
    done = home.start("sim", home.file("cell.toml", CELL))
    lines = [done.stderr.readline() for _ in range(2)]
    done.terminate()
    done.communicate(timeout=PATIENCE)
    assert [f"attach -r 127.0.0.1 -b 1-{number} " in line for number, line in enumerate(lines, 1)] == [True, True], port


def test_without_a_controller_the_urls_say_so(cell):
    pytest.importorskip("usb1", reason="libusb1 is not installed: the extra usb")
    for url in ("usb:", "usb:2ED01", "usb:2ED01@1-1.4", "usb:0"):
        done = cell.run("send", url, "PX")
        assert (done.returncode, done.stdout) == (3, "")
        assert f"{url} is not there; controllers on USB: none" in done.stderr, done.stderr
    done = cell.run("scan", "usb:")
    assert (done.returncode, done.stdout) == (3, "")


def test_without_the_library_the_error_names_the_extra(cell):
    hidden = cell.folder / "hidden"
    hidden.mkdir()
    (hidden / "usb1.py").write_text("raise ImportError\n")
    from tests.support.processes import environment

    done = cell.process("send", "usb:", "PX", env=environment(cell.folder) | {"PYTHONPATH": str(hidden)})
    assert done.returncode == 3 and "pip install 'multidrop[usb]'" in done.stderr, done.stderr
    assert cell.process("ports", env=environment(cell.folder) | {"PYTHONPATH": str(hidden)}).returncode == 0


async def test_another_controller_at_the_same_bus_id_is_not_taken_for_it(home):
    where = home.serve(CELL).endpoints["stages"]["usbip"].replace("/1-2", "/1-1")
    session = Session(Settings(state=home.folder / "own"), reconnect=True)
    session.questions.agreed = True
    told = []
    session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    (bus,) = await session.open(where)
    assert bus.link.transport.identity == "2ED00"
    for line in ("DN=2ED05", "STORE"):
        await session.run(line)
    home.sim.say("/sim power 00 off", "/sim power 00 on")
    await until(lambda: any("another controller, 2ED05, is in the place of 2ED00" in text for text in told))
    assert bus.lost
    await session.close()
