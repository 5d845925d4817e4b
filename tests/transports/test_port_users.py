"""Two programs on a port: who the other one is, at the opening, where nothing replies, and where nobody may look."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from multidrop.base.errors import DriveError
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.transports import port_users, serial_pipe
from multidrop.transports.port_users import holder, in_use, other, suspects, taker
from multidrop.transports.serial_port import open_error, open_serial
from tests.support.front_door import Command
from tests.support.machine_files import Machine, hide

PORT = "/dev/ttyUSB7"


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_a_program_without_a_lock_is_found_by_its_open_file(machine: Machine) -> None:
    assert holder(PORT, machine.root) is None
    machine.process(41, "bash", "/dev/null")
    machine.process(42, "minicom", "/dev/null", PORT)
    assert str(holder(PORT, machine.root)) == "minicom (pid 42)"
    assert str(other(PORT, machine.root)) == "minicom (pid 42)"
    assert other("/dev/ttyUSB8", machine.root) is None


@pytest.mark.parametrize(
    ("port", "lock"),
    [
        (PORT, "LCK..ttyUSB7"),
        ("/dev/pts/7", "LCK..pts_7"),
        ("/dev/serial/by-id/usb-A-if00", "LCK..serial_by-id_usb-A-if00"),
    ],
)
@pytest.mark.parametrize("folder", ["run/lock", "var/lock/lockdev"])
def test_a_lock_file_has_the_ports_path_with_its_slashes_replaced(
    machine: Machine, port: str, lock: str, folder: str
) -> None:
    machine.process(41, "picocom")
    machine.lock(lock, "        41\n", folder)
    assert str(other(port, machine.root)) == "picocom (pid 41)"


def test_a_lock_file_that_was_left_or_is_garbage_says_nothing(machine: Machine) -> None:
    for text in ("99\n", "", "\0\0", "minicom", str(os.getpid())):
        machine.lock("LCK..ttyUSB7", text)
        assert other(PORT, machine.root) is None, text
    machine.process(42, "minicom")
    machine.lock("LCK..7", "42")
    assert other("/dev/pts/7", machine.root) is None, "a lock of another port"


def test_the_program_that_serves_a_pseudo_terminal_is_not_another_user_of_it(machine: Machine) -> None:
    serving = machine.process(40, "socat", "/dev/ptmx", "/dev/pts/7")
    (serving / "fdinfo/3").write_text("pos:\t0\nflags:\t02\ntty-index:\t7\n")
    assert other("/dev/pts/7", machine.root) is None
    elsewhere = machine.process(41, "screen", "/dev/ptmx", "/dev/pts/7")
    (elsewhere / "fdinfo/3").write_text("pos:\t0\nflags:\t02\ntty-index:\t77\n")
    assert str(other("/dev/pts/7", machine.root)) == "screen (pid 41)"


def test_services_are_suspected_only_where_nobody_may_look(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine.process(50, "ModemManager")
    machine.process(51, "agetty", line="/sbin/agetty -o -p 115200 ttyUSB7 vt220")
    machine.process(52, "agetty", line="/sbin/agetty tty1")
    machine.process(53, "bash")
    assert suspects(PORT, machine.root) == "", "they have not got it open"
    hide(monkeypatch, 50, 51, 52, 53)
    assert suspects(PORT, machine.root) == (
        "ModemManager (pid 50): it tries new ports as modems: `sudo systemctl stop ModemManager`; or "
        "agetty (pid 51): it is a login: `sudo systemctl stop serial-getty@ttyUSB7`"
    )
    assert suspects("/dev/pts/7", machine.root) == "", "no modem and no login is there"


def test_a_refusal_names_the_holder_or_the_suspects_or_a_command_that_names_it(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(port_users, "ROOT", machine.root)
    for name in ("holder", "suspects"):
        found = getattr(port_users, name)
        monkeypatch.setattr(port_users, name, lambda port, found=found: found(port, machine.root))
    error = OSError(16, "Device or resource busy")
    tool = {"linux": f" (`sudo fuser -v {PORT}` names it)", "darwin": f" (`sudo lsof {PORT}` names it)"}.get(
        sys.platform, ""
    )
    assert in_use(PORT) == f"another program; close it there{tool}"
    machine.process(60, "ModemManager", PORT)
    assert in_use(PORT) == "ModemManager (pid 60); it tries new ports as modems: `sudo systemctl stop ModemManager`"
    assert str(open_error(PORT, error)) == f"{PORT} is in use by {in_use(PORT)}"
    hide(monkeypatch, 60)
    assert in_use(PORT).startswith(
        "another program, perhaps ModemManager (pid 60): it tries new ports as modems: `sudo"
    )


def test_a_port_that_is_not_there_names_the_service_that_takes_adapters(machine: Machine) -> None:
    assert taker(machine.root) == ""
    machine.process(70, "brltty")
    machine.process(69, "gpsd")
    assert taker(machine.root) == (
        "; brltty (pid 70) is running, and may have taken it: it takes adapters for Braille displays: "
        "`sudo systemctl stop brltty`"
    )


# On this machine


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    """A descriptor of the far side, and the path of the port."""
    master, slave = os.openpty()
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


@contextlib.contextmanager
def reader(path: str) -> Iterator[int]:
    """A program that has a port open without a lock, as `cat` and `screen` do."""
    code = "import os, sys; os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print(1, flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", code, path]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None and program.stdout.readline() == "1\n"
        yield program.pid
        program.communicate()


linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux lists the open files of other programs")


@linux
@pytest.mark.process
async def test_another_program_on_the_port_is_told_at_the_opening(pty: tuple[int, str]) -> None:
    with reader(pty[1]) as pid:
        transport = await open_serial(pty[1])
        await transport.close()
    assert (
        f"(pid {pid}) has {pty[1]} open as well, and each takes bytes from the other; close it there"
        in transport.limits
    )
    transport = await open_serial(pty[1])
    await transport.close()
    assert transport.limits == ""


@linux
@pytest.mark.process
def test_a_command_names_the_other_program_at_the_opening_and_where_nothing_replies(
    pty: tuple[int, str], multidrop: Command
) -> None:
    with reader(pty[1]) as pid:
        done = multidrop("send", f"{pty[1]}?dialect=mcode&timeout=0.1", "PR P")
    assert done.returncode == 1, done.stderr
    assert done.stderr.count(f"(pid {pid}) has {pty[1]} open as well") == 2, done.stderr
    assert "termination" not in done.stderr, "the cause is known"


async def failure(folder: Path, url: str) -> str:
    """What a session says of a line on which nothing replies, and of a second question on it."""
    session = Session(Settings({}, folder / "c", folder / "s", data=folder / "d"), lazy=True)
    try:
        with pytest.raises(DriveError) as caught:
            await session.open(url)
            await session.run("PR P")
    finally:
        await session.close()
    return str(caught.value)


async def test_where_nobody_may_look_the_services_are_named_after_the_wiring(
    pty: tuple[int, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(serial_pipe, "beside", lambda port: "")
    monkeypatch.setattr(serial_pipe, "suspects", lambda port: "ModemManager (pid 5): stop it")
    text = await failure(tmp_path, f"{pty[1]}?dialect=mcode&timeout=0.1")
    assert "check power" in text
    assert text.endswith("; a service may have the port open: ModemManager (pid 5): stop it"), text
