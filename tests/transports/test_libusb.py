"""The way through libusb under umockdev: multidrop, and a host in C, ask simulated controllers by system calls."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.cell_session import TCP, bus, pmx
from tests.support.front_door import Done, Home
from tests.support.paths import ROOT
from tests.support.tools import absent, tool
from tests.support.until import PATIENCE

pytestmark = [pytest.mark.process, pytest.mark.skipif(sys.platform != "linux", reason="umockdev is for Linux")]
DEBIANS = "/usr/bin/python3"
"""The Python that has the bindings of Debian's umockdev."""
PRELOADED = "libumockdev-preload.so.0"
NOBODY = 65534


@functools.cache
def umockdev() -> None:
    """Skip without umockdev and its bindings."""
    pytest.importorskip("usb1", reason="libusb1 is not installed: the extra usb")
    tool("umockdev-run")
    check = [DEBIANS, "-c", "import gi; gi.require_version('UMockdev', '1.0'); from gi.repository import UMockdev"]
    if not Path(DEBIANS).exists() or subprocess.run(check, capture_output=True).returncode:
        absent("gir1.2-umockdev-1.0 with python3-gi is not installed")


class Machine(Home):
    """A machine with controllers in its USB sockets; they are served over TCP, as their RS-485 line, too."""

    def __init__(self, folder: Path, *numbers: str) -> None:
        super().__init__(folder)
        self.serve(bus("w", *map(pmx, numbers), baud=0, serve=["usbip://127.0.0.1:0", *TCP]))
        server = self.endpoints["w"]["usbip"].split("/")[2]
        places = [f"1-{number}" for number in range(1, len(numbers) + 1)]
        self.bench = subprocess.Popen(
            [DEBIANS, str(ROOT / "tests" / "support" / "usb_bench.py"), server, *places],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={"PYTHONPATH": str(ROOT), "PATH": os.environ["PATH"]},
        )
        self.started.append(self.bench)
        self.root = self.said()["root"]

    def said(self) -> dict[str, str]:
        """The next line of the bench."""
        assert self.bench.stdout is not None
        return dict(json.loads(self.bench.stdout.readline()))

    def fault(self, text: str) -> None:
        """Make a fault, and wait until it is there."""
        assert self.bench.stdin is not None
        self.bench.stdin.write(text + "\n")
        self.bench.stdin.flush()
        assert "done" in self.said(), text

    def start(self, *arguments: str, stdin: Any = subprocess.PIPE, **more: Any) -> subprocess.Popen[str]:
        given = more.pop("env", None) or self.mocked
        return super().start(*arguments, stdin=stdin, env=given, **more)

    @property
    def mocked(self) -> dict[str, str]:
        """An environment whose programs see the mocked devices."""
        from tests.support.processes import environment

        return environment(self.folder) | {"LD_PRELOAD": PRELOADED, "UMOCKDEV_DIR": self.root}

    def send(self, *lines: str, url: str = "usb:", **more: Any) -> Done:
        return self.process("send", url, *lines, **more)

    def on_the_wire(self, *lines: str, number: str = "00") -> list[str]:
        """Replies over RS-485 at the same time."""
        url = f"{self.endpoints['w']['tcp']}?dialect=pmx&drives={number}"
        return self.run("send", url, *lines).stdout.split()

    def close(self) -> None:
        """End what runs."""
        self.end_all()


Plugged = Callable[..., Machine]


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Plugged]:
    umockdev()
    with contextlib.ExitStack() as stack:

        def make(*numbers: str) -> Machine:
            made = Machine(tmp_path, *(numbers or ("00",)))
            stack.callback(made.close)
            return made

        yield make


def one_line(done: Done, code: int) -> str:
    """The one line on standard error of a command that ended so."""
    assert done.returncode == code, done
    [line] = [each for each in done.stderr.splitlines() if each.startswith("multidrop: ")]
    return line


# The whole way


def test_the_only_controller_is_asked_and_is_one_device_with_its_line(machine: Plugged) -> None:
    here = machine()
    assert here.send("V1=77", "V1", "DN", "ID").stdout.split() == ["77", "2ED00", "Performax-2ED-SA"]
    assert here.on_the_wire("V1", "V1=78") == ["77"]
    assert here.send("V1").stdout == "78\n"


def test_two_controllers_are_told_apart_by_number_place_and_index(machine: Plugged) -> None:
    here = machine("00", "07")
    refused = one_line(here.send("V1"), 3)
    assert "usb:2ED00@1-1" in refused and "usb:2ED07@1-2" in refused
    for url, number in (("usb:2ED07", "2ED07"), ("usb:2ED00@1-1", "2ED00"), ("usb:1", "2ED07")):
        assert here.send("DN", url=url).stdout == f"{number}\n", url
    assert "usb:2ED07@1-1" in one_line(here.send("DN", url="usb:2ED07@1-1"), 3)
    listed = here.process("ports").stdout
    assert "usb:2ED00@1-1" in listed and "usb:2ED07@1-2" in listed


@pytest.mark.parametrize("form", ["short", "bare", "dirty"])
def test_a_reply_ends_at_its_nul_or_with_its_packet(machine: Plugged, form: str) -> None:
    here = machine()
    here.fault(f"reply 1-1 {form}")
    assert here.send("V1=12345678", "V1", "DN").stdout.split() == ["12345678", "2ED00"]


def test_packets_of_no_bytes_before_a_reply_mean_nothing(machine: Plugged) -> None:
    here = machine()
    for _ in range(3):
        here.fault("empty 1-1")
    assert here.send("V1=5", "V1").stdout == "5\n"


# Failures, each with one clear line


def test_a_packet_of_too_many_bytes_loses_the_connection(machine: Plugged) -> None:
    here = machine()
    here.fault("reply 1-1 long")
    assert "usb:2ED00@1-1" in one_line(here.send("V1"), 3)


def test_a_command_that_is_not_taken_ends_in_time_and_is_not_executed_later(machine: Plugged) -> None:
    here = machine()
    here.fault("hold 1-1 02")
    assert "usb:2ED00@1-1" in one_line(here.send("V1=9"), 3)
    here.fault("free 1-1 02")
    assert here.send("V1").stdout == "0\n"


def test_a_stall_ends_the_connection_with_its_reason(machine: Plugged) -> None:
    here = machine()
    here.fault("stall 1-1 82")
    assert "refused a transfer" in one_line(here.send("V1"), 3)


def test_without_permission_the_error_names_the_rule(machine: Plugged) -> None:
    here = machine()
    here.fault("forbid 1-1")
    options = {"user": NOBODY, "group": NOBODY} if os.getuid() == 0 else {}
    if options:
        for each in (here.folder, *here.folder.parents):
            if each != Path("/") and each.stat().st_uid == 0:
                each.chmod(0o777)
    refused = one_line(here.send("V1", **options), 3)
    assert "permission" in refused and "60-multidrop-usb.rules" in refused and "/etc/udev/rules.d" in refused


def test_a_second_process_is_told_that_another_one_has_it(machine: Plugged) -> None:
    here = machine()
    first = here.start("shell", "usb:")
    assert first.stdin is not None and first.stdout is not None
    first.stdin.write("V1=4\nV1\n")
    first.stdin.flush()
    assert first.stdout.readline() == "4\n"
    assert re.search(r"usb:2ED00@1-1: .* has it", one_line(here.send("V1"), 3))
    first.stdin.close()
    assert first.wait(PATIENCE) == 0
    assert here.send("V1").stdout == "4\n"


def test_unplugged_in_mid_transfer_is_said_once(machine: Plugged) -> None:
    here = machine()
    here.fault("hold 1-1 82")
    asked = here.start("send", "usb:2ED00?timeout=60", "V1")
    assert here.on_the_wire("V1") == ["0"]
    here.fault("unplug 1-1")
    out, err = asked.communicate(timeout=PATIENCE)
    assert "unplugged" in one_line(Done(asked.returncode, out, err), 3)
    assert "usb:: not there" in one_line(here.send("V1"), 3)
    here.fault("plug 1-1")
    assert here.send("V1").stdout == "0\n"


def test_plugged_in_again_it_is_the_same_connection_and_nothing_is_sent_twice(machine: Plugged) -> None:
    here = machine("00", "07")
    shell = here.start("shell", "usb:2ED07")
    assert shell.stdin is not None and shell.stdout is not None and shell.stderr is not None

    def ask(line: str) -> str:
        shell.stdin.write(line + "\n")  # type: ignore[union-attr]
        shell.stdin.flush()  # type: ignore[union-attr]
        return str(shell.stdout.readline())  # type: ignore[union-attr]

    assert ask("V1=3\nV1") == "3\n"
    here.fault("unplug 1-2")
    while "was lost" not in shell.stderr.readline():
        pass
    here.fault("plug 1-2")
    while "again" not in shell.stderr.readline():
        pass
    assert ask("V1") == "3\n"
    shell.stdin.close()
    assert shell.wait(PATIENCE) == 0


def test_an_interrupt_stops_it_while_the_reply_is_awaited(machine: Plugged) -> None:
    here = machine()
    assert here.on_the_wire("HSX=1000", "X=0", "EO=3") is not None
    shell = here.start("send", "usb:?timeout=60", "--yes", "J+X", "V1", "/sleep 60")
    moving = False
    while not moving:
        assert shell.poll() is None, shell.communicate()
        moving = here.on_the_wire("MSTX") != ["0"]
    shell.send_signal(signal.SIGINT)
    out, err = shell.communicate(timeout=PATIENCE)
    assert shell.returncode == 130, (out, err)
    assert here.on_the_wire("SLX" if False else "PSX") is not None
    assert here.on_the_wire("MSTX") == ["0"]


# A host in C


@pytest.fixture(scope="session")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host in C, compiled."""
    compiler, config = tool("gcc"), tool("pkg-config")
    found = subprocess.run([config, "--cflags", "--libs", "libusb-1.0"], capture_output=True, text=True)
    if found.returncode:
        absent("libusb-1.0-0-dev is not installed")
    made = tmp_path_factory.mktemp("host") / "performax"
    source = Path(__file__).with_name("performax.c")
    subprocess.run([compiler, "-Wall", "-Werror", "-o", made, source, *found.stdout.split()], check=True)
    return made


@pytest.fixture
def ask(machine: Plugged, host: Path) -> Callable[..., Any]:
    """Run the host in C on a machine: its lines, or its error."""

    def run(here: Machine, *arguments: str) -> list[str]:
        done = subprocess.run(
            [host, *arguments], env=here.mocked, capture_output=True, text=True, timeout=PATIENCE, cwd=here.folder
        )
        assert (done.returncode == 0) == (done.stderr == "")
        return (done.stdout + done.stderr).splitlines()

    return run


@pytest.mark.needs("gcc", "pkg-config")
def test_the_host_in_c_speaks_to_the_simulated_controller(machine: Plugged, ask: Callable[..., Any]) -> None:
    here = machine()
    said = ask(here, "500", "ID", "DN", "V1=31", "=V1", "=V2=1", "V1=", "EX")
    assert said == ["serial 2ED00", "Performax-2ED-SA", "2ED00", "OK", "31", "OK", "?V1=", said[-1]]
    assert here.send("V1").stdout == "31\n"


@pytest.mark.needs("gcc", "pkg-config")
def test_the_host_in_c_meets_each_error(machine: Plugged, ask: Callable[..., Any]) -> None:
    here = machine()
    for fault, expected in (
        ("hold 1-1 02", "write: LIBUSB_ERROR_TIMEOUT"),
        ("free 1-1 02", "0"),
        ("stall 1-1 82", "read before: LIBUSB_ERROR_PIPE"),
    ):
        here.fault(fault)
        assert ask(here, "200", "V1")[-1] == expected, fault
    here.fault("unplug 1-1")
    here.fault("plug 1-1")
    here.fault("reply 1-1 long")
    assert ask(here, "200", "V1")[-1] == "read: LIBUSB_ERROR_OVERFLOW"
    here.fault("unplug 1-1")
    assert ask(here, "200", "V1") == ["open: no controller"]


@pytest.mark.needs("gcc", "pkg-config")
def test_the_host_in_c_finds_it_busy_while_multidrop_has_it(machine: Plugged, ask: Callable[..., Any]) -> None:
    here = machine()
    shell = here.start("shell", "usb:")
    assert shell.stdin is not None and shell.stdout is not None
    shell.stdin.write("V1\n")
    shell.stdin.flush()
    assert shell.stdout.readline() == "0\n"
    assert ask(here, "200", "V1") == ["claim: LIBUSB_ERROR_BUSY"]
