"""The way through libusb under umockdev: multidrop, and a host in C, ask simulated controllers by system calls."""

from __future__ import annotations

import contextlib
import ctypes
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
from tests.support.processes import environment
from tests.support.tools import absent, tool
from tests.support.until import PATIENCE

pytestmark = [pytest.mark.process, pytest.mark.skipif(sys.platform != "linux", reason="umockdev is for Linux")]
DEBIANS = "/usr/bin/python3"
"""The Python that has the bindings of Debian's umockdev."""
PRELOADED = "libumockdev-preload.so.0"
FIRST, SECOND = "1-1", "1-2"
"""The sockets of controllers 00 and 07."""


class Machine(Home):
    """A machine with two controllers in its USB sockets. Their RS-485 line is served over TCP."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.serve(bus("w", pmx("00"), pmx("07"), baud=0, serve=["usbip://127.0.0.1:0", *TCP]))
        server = self.endpoints["w"]["usbip"].split("/")[2]
        self.bench = subprocess.Popen(
            [DEBIANS, str(ROOT / "tests" / "support" / "usb_bench.py"), server, FIRST, SECOND],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={"PYTHONPATH": str(ROOT), "PATH": os.environ["PATH"], "LD_PRELOAD": PRELOADED},
        )
        self.unplugged: set[str] = set()
        self.mocked = environment(folder) | {"LD_PRELOAD": PRELOADED, "UMOCKDEV_DIR": self._said()["root"]}
        """The environment of a program that sees them."""

    def _said(self) -> dict[str, str]:
        assert self.bench.stdout is not None
        return dict(json.loads(self.bench.stdout.readline()))

    def fault(self, text: str) -> None:
        """Make a fault, and wait until it is there."""
        assert self.bench.stdin is not None
        self.bench.stdin.write(text + "\n")
        self.bench.stdin.flush()
        assert "done" in self._said(), text
        word, place, *_ = text.split()
        if word in ("plug", "unplug"):
            (self.unplugged.discard if word == "plug" else self.unplugged.add)(place)

    def start(self, *arguments: str, stdin: Any = subprocess.PIPE, **more: Any) -> subprocess.Popen[str]:
        return super().start(*arguments, stdin=stdin, env=self.mocked, **more)

    def send(self, *lines: str, url: str = "usb:2ED00", **more: Any) -> Done:
        return self.process("send", url, *lines, **more)

    def on_the_line(self, *lines: str) -> list[str]:
        """The replies of controller 00 over RS-485, at the same time."""
        done = self.run("send", f"{self.endpoints['w']['tcp']}?dialect=pmx&drives=00", "--yes", *lines)
        assert done.returncode == 0, done
        return done.stdout.split()

    def again(self) -> None:
        """End what a test has started, and plug both in anew: without any fault, at rest, with 0 in V1."""
        self.end_all()
        for place in (FIRST, SECOND):
            if place not in self.unplugged:
                self.fault(f"unplug {place}")
            self.fault(f"plug {place}")
        self.on_the_line("ABORT", "V1=0")

    def close(self) -> None:
        self.started.append(self.bench)
        super().close()


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    pytest.importorskip("usb1", reason="libusb1 is not installed: the extra usb")
    tool("umockdev-run")
    bindings = [DEBIANS, "-W", "ignore", "-c", "from gi.repository import UMockdev"]
    if not Path(DEBIANS).exists() or subprocess.run(bindings, capture_output=True).returncode:
        absent("gir1.2-umockdev-1.0 with python3-gi is not installed")
    with contextlib.closing(Machine(tmp_path_factory.mktemp("machine"))) as made:
        yield made


@pytest.fixture
def here(machine: Machine) -> Iterator[Machine]:
    """The machine for one test."""
    yield machine
    machine.again()


def one_line(done: Done, code: int) -> str:
    """The one line on standard error of a command that ended so."""
    assert (done.returncode, done.stdout) == (code, ""), done
    [line] = done.stderr.splitlines()
    return line


class Shell:
    """`multidrop shell` on pipes, at one controller."""

    def __init__(self, here: Machine, url: str) -> None:
        self.process = here.start("shell", url)

    def ask(self, *lines: str) -> str:
        """Type lines; the first that is printed."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write("\n".join(lines) + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline()


# The whole way


def test_a_controller_is_asked_and_is_one_device_with_its_line(here: Machine) -> None:
    assert here.send("V1=77", "V1", "DN", "ID").stdout.split() == ["77", "2ED00", "Performax-2ED-SA"]
    assert here.on_the_line("V1", "V1=78") == ["77"]
    assert here.send("V1").stdout == "78\n"


def test_two_controllers_are_told_apart_by_number_place_and_index(here: Machine) -> None:
    refused = one_line(here.send("V1", url="usb:"), 3)
    assert refused == "usb:: 2 controllers; name one of usb:2ED00@1-1, usb:2ED07@1-2"
    for url, number in (("usb:2ED07", "2ED07"), ("usb:2ED00@1-1", "2ED00"), ("usb:1", "2ED07")):
        assert here.send("DN", url=url).stdout == f"{number}\n", url
    elsewhere = one_line(here.send("DN", url="usb:2ED07@1-1"), 3)
    assert elsewhere == "usb:2ED07@1-1 is not there; controllers on USB: usb:2ED00@1-1, usb:2ED07@1-2"
    listed = here.process("ports").stdout
    assert re.findall(r"^usb:\S+", listed, re.M) == ["usb:2ED00@1-1", "usb:2ED07@1-2"]


@pytest.mark.parametrize("form", ["short", "bare", "dirty"])
def test_a_reply_ends_at_its_nul_or_with_its_packet(here: Machine, form: str) -> None:
    here.fault(f"reply {FIRST} {form}")
    assert here.send("V1=12345678", "V1", "DN").stdout.split() == ["12345678", "2ED00"]


def test_packets_of_no_bytes_before_a_reply_mean_nothing(here: Machine) -> None:
    for _ in range(3):
        here.fault(f"empty {FIRST}")
    assert here.send("V1=5", "V1").stdout == "5\n"


# Failures, each with one clear line


def test_a_packet_of_too_many_bytes_loses_the_connection(here: Machine) -> None:
    here.fault(f"reply {FIRST} long")
    assert one_line(here.send("V1"), 3).startswith("usb:2ED00@1-1 was lost: a transfer failed")


def test_a_command_that_is_not_taken_ends_in_time_and_is_not_executed_later(here: Machine) -> None:
    shell = Shell(here, "usb:2ED00")
    assert shell.ask("V1") == "0\n"
    here.fault(f"hold {FIRST} 02")
    out, err = shell.process.communicate("V1=9\n", timeout=PATIENCE)
    assert (out, shell.process.returncode) == ("", 1), err
    assert "it is not known whether 'V1=9' was executed; it was sent once" in err
    here.fault(f"free {FIRST} 02")
    assert here.send("V1").stdout == "0\n"


def test_a_stall_ends_the_connection_with_its_reason(here: Machine) -> None:
    here.fault(f"stall {FIRST} 82")
    assert one_line(here.send("V1"), 3) == "usb:2ED00@1-1 was lost: the controller refused a transfer"


def test_without_permission_the_error_names_the_rule(here: Machine) -> None:
    def without_roots_rights() -> None:
        for capability in (1, 2):  # to override and to search any file's permissions
            ctypes.CDLL(None).prctl(24, capability)  # PR_CAPBSET_DROP

    here.fault(f"forbid {FIRST}")
    refused = one_line(here.send("V1", url="usb:0", preexec_fn=without_roots_rights), 3)
    assert re.fullmatch(
        r"usb:unread@1-1: no permission; copy \S+/60-multidrop-usb\.rules to /etc/udev/rules\.d and plug it in again",
        refused,
    )


def test_a_second_process_is_told_that_another_one_has_it(here: Machine) -> None:
    shell = Shell(here, "usb:2ED00")
    assert shell.ask("V1=4", "V1") == "4\n"
    assert re.fullmatch(r"usb:2ED00@1-1: .* has it", one_line(here.send("V1"), 3))
    shell.process.communicate(timeout=PATIENCE)
    assert shell.process.returncode == 0
    assert here.send("V1").stdout == "4\n"


def test_unplugged_while_a_reply_is_awaited_it_is_lost_and_another_is_not_taken_for_it(here: Machine) -> None:
    shell = Shell(here, "usb:2ED00?timeout=60")
    assert shell.ask("V1") == "0\n"
    here.fault(f"hold {FIRST} 82")
    assert shell.process.stdin is not None
    shell.process.stdin.write("V1=5\n")
    shell.process.stdin.flush()
    while here.on_the_line("V1") != ["5"]:
        pass
    here.fault(f"unplug {FIRST}")
    out, err = shell.process.communicate("V1\n", timeout=PATIENCE)
    assert (shell.process.returncode, out, err) == (3, "", "usb:2ED00@1-1 was lost: unplugged, or without power\n")
    assert one_line(here.send("V1"), 3) == "usb:2ED00 is not there; controllers on USB: usb:2ED07@1-2"
    here.fault(f"plug {FIRST}")
    assert here.send("V1").stdout == "5\n"


def test_an_interrupt_stops_it_while_the_reply_is_awaited(here: Machine) -> None:
    jogging = here.start("send", "usb:2ED00?timeout=60", "--yes", "EO=3", "HSPD=1000", "JX+", "/sleep 60")
    while here.on_the_line("PSX") == ["0"]:
        assert jogging.poll() is None, jogging.communicate()
    here.fault(f"hold {FIRST} 82")
    jogging.send_signal(signal.SIGINT)
    out, err = jogging.communicate(timeout=PATIENCE)
    assert (jogging.returncode, out) == (130, ""), err
    assert here.on_the_line("PSX") == ["0"]


# A host in C


@pytest.fixture(scope="module")
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
def ask(here: Machine, host: Path) -> Callable[..., list[str]]:
    """Run the host in C on controller 00, with a time in ms: its lines, or its error."""

    def run(*arguments: str) -> list[str]:
        done = subprocess.run(
            [host, "2ED00", *arguments], env=here.mocked, capture_output=True, text=True, timeout=PATIENCE
        )
        assert (done.returncode == 0) == (done.stderr == "")
        return (done.stdout + done.stderr).splitlines()

    return run


def test_the_host_in_c_speaks_to_the_simulated_controller(here: Machine, ask: Callable[..., list[str]]) -> None:
    said = ask("500", "ID", "DN", "V1=31", "=V1", "=V2=1", "HELLO")
    assert said == ["Performax-2ED-SA", "2ED00", "OK", "31", "OK", "?HELLO"]
    assert here.send("V1").stdout == "31\n"


def test_the_host_in_c_meets_each_error(here: Machine, ask: Callable[..., list[str]]) -> None:
    for fault, expected in (
        (f"hold {FIRST} 02", "write: LIBUSB_ERROR_TIMEOUT"),
        (f"free {FIRST} 02", "0"),
        (f"reply {FIRST} long", "read: LIBUSB_ERROR_OVERFLOW"),
        (f"reply {FIRST} full", "0"),
        (f"stall {FIRST} 82", "read before: LIBUSB_ERROR_PIPE"),
    ):
        here.fault(fault)
        assert ask("200", "V1")[-1] == expected, fault
    here.fault(f"unplug {FIRST}")
    here.fault(f"unplug {SECOND}")
    assert ask("200", "V1") == ["open: no controller"]


def test_the_host_in_c_finds_it_busy_while_multidrop_has_it(here: Machine, ask: Callable[..., list[str]]) -> None:
    assert Shell(here, "usb:2ED00").ask("V1") == "0\n"
    assert ask("200", "V1") == ["claim: LIBUSB_ERROR_BUSY"]


def test_a_reply_that_the_host_in_c_left_is_not_multidrops(here: Machine, ask: Callable[..., list[str]]) -> None:
    here.fault(f"hold {FIRST} 82")
    assert ask("200", "V1")[-1] == "read: LIBUSB_ERROR_TIMEOUT"
    here.fault(f"free {FIRST} 82")
    assert here.send("DN").stdout == "2ED00\n"
