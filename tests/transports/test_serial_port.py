"""The peculiarities of serial ports: locks, refusals, raw mode, rates, symlinks."""

from __future__ import annotations

import asyncio
import errno
import os
import re
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial

from multidrop.transports import Unreachable
from multidrop.transports.pipe import in_thread
from multidrop.transports.serial_port import open_error, open_serial
from tests.support.posix import termios
from tests.support.until import PATIENCE

LOCKS = """
import fcntl, os, sys
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.flock(port, fcntl.LOCK_EX)
print("locked", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    """A descriptor of the far side, and the path of the port."""
    master, slave = os.openpty()
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


async def test_a_port_is_ours_alone_and_free_again_after_closing(pty: tuple[int, str]) -> None:
    _, path = pty
    first = await open_serial(path)
    with pytest.raises(Unreachable, match=f"^{path} is in use by .*; close it there$"):
        await open_serial(path)
    await first.close()
    await (await open_serial(path)).close()


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells who holds a lock")
async def test_who_uses_a_port_is_named(pty: tuple[int, str]) -> None:
    _, path = pty
    command = [sys.executable, "-c", LOCKS, path]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "locked\n"
        with pytest.raises(Unreachable, match=rf"in use by \S+ \(pid {other.pid}\); close it there"):
            await open_serial(path)
        other.communicate()


async def test_a_symlink_to_a_pseudo_terminal_is_a_port(pty: tuple[int, str], tmp_path: Path) -> None:
    master, path = pty
    link = tmp_path / "press.tty"
    link.symlink_to(path)
    transport = await open_serial(str(link))
    assert transport.name == str(link)
    transport.write(b"PR P\r\n")
    assert os.read(master, 99) == b"PR P\r\n"
    await transport.close()


@pytest.mark.parametrize("baud", [9600, 38400, 12345])
async def test_the_port_is_raw_and_at_its_rate(pty: tuple[int, str], baud: int) -> None:
    master, path = pty
    before = termios.tcgetattr(master)
    before[0] |= termios.BRKINT | termios.ICRNL | termios.IXON
    before[3] |= termios.ECHO | termios.ICANON
    termios.tcsetattr(master, termios.TCSANOW, before)
    transport = await open_serial(path, baud)
    iflag, oflag, cflag, lflag, _, _, _ = termios.tcgetattr(master)
    assert not iflag & (termios.BRKINT | termios.ICRNL | termios.INLCR | termios.IXON | termios.ISTRIP)
    assert not oflag & termios.OPOST
    assert not lflag & (termios.ECHO | termios.ICANON | termios.ISIG)
    assert cflag & termios.CSIZE == termios.CS8 and not cflag & (termios.CSTOPB | termios.PARENB)
    if sys.platform == "linux":
        assert rate(master) == baud
    await transport.close()


def rate(descriptor: int) -> int:
    """The true rate in Linux's termios2, custom ones included."""
    import struct

    from tests.support.posix import fcntl

    settings = fcntl.ioctl(descriptor, 0x802C542A, bytes(44))
    return int(struct.unpack("4I B 19s 2I", settings)[-1])


async def test_an_empty_slot_is_no_port(tmp_path: Path) -> None:
    path = str(tmp_path / "ttyUSB0")
    with pytest.raises(Unreachable, match=f"^no port {re.escape(path)}; .*`multidrop ports`"):
        await open_serial(path)


async def test_a_file_and_a_folder_are_no_ports(tmp_path: Path) -> None:
    file = tmp_path / "press.toml"
    file.write_text("seed = 7\n")
    for path in (file, tmp_path):
        with pytest.raises(Unreachable, match="is not a serial port"):
            await open_serial(str(path))
    assert file.read_text() == "seed = 7\n"


@pytest.mark.parametrize("baud", [0, -9600, 10**12])
async def test_an_impossible_rate_is_refused(pty: tuple[int, str], baud: int) -> None:
    with pytest.raises(Unreachable, match="baud"):
        await open_serial(pty[1], baud)


@pytest.mark.parametrize("call", ["tcgetattr", "tcsetattr", "tcflush"])
async def test_a_port_that_goes_while_it_is_opened_is_unreachable_and_closed(
    pty: tuple[int, str], call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plug that bounces. pyserial passes on errors of termios, which are no OSErrors."""
    before = len(os.listdir("/dev/fd"))

    def gone(*_: object) -> None:
        raise termios.error(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patched:
        patched.setattr(termios, call, gone)
        with pytest.raises(Unreachable):
            await open_serial(pty[1])
    with monkeypatch.context() as patched:
        patched.setattr("multidrop.transports.serial_port._ignore_breaks", gone)
        with pytest.raises(Unreachable, match="Input/output error"):
            await open_serial(pty[1])
    assert len(os.listdir("/dev/fd")) == before


@pytest.mark.fork
def test_a_missing_permission_names_the_group() -> None:
    error = serial.SerialException(errno.EACCES, "could not open port")
    assert "usermod -aG dialout" in str(open_error("/dev/ttyNOWHERE", error))


@pytest.mark.fork
@pytest.mark.parametrize(
    ("mode", "owner", "group", "groups", "members", "remedy"),
    [
        (0o660, 0, 20, (), (), "`sudo usermod -aG dialout $USER`, then log in again"),
        (0o660, 0, 77, (), (), "`sudo usermod -aG plugdev $USER`, then log in again"),
        (0o660, 0, 20, (), ("fitter",), "you are in its group dialout, but this login began before that"),
        (0o660, 0, 20, (20,), (), "you are in its group dialout, which may use it: something else refuses it"),
        (0o600, 0, 20, (20,), (), "group dialout, its mode is 0600, so no other group helps: a udev rule"),
        (0o640, 0, 20, (), (), "group dialout, its mode is 0640, so no other group helps: a udev rule"),
        (0o660, 0, 0, (), (), "it is of the group root only, so no other group helps: a udev rule"),
        (0o060, 500, 20, (20,), (), "you own it, and its mode is 0060: `chmod u+rw /dev/ttyS9`"),
        (0o600, 500, 20, (), (), "you own it, and its mode is 0600: something else refuses it"),
    ],
)
def test_the_remedy_for_a_missing_permission_follows_from_owner_group_and_mode(
    monkeypatch: pytest.MonkeyPatch,
    mode: int,
    owner: int,
    group: int,
    groups: tuple[int, ...],
    members: tuple[str, ...],
    remedy: str,
) -> None:
    names = {0: "root", 20: "dialout", 77: "plugdev"}
    found = os.stat_result((stat.S_IFCHR | mode, 0, 0, 1, owner, group, 0, 0, 0, 0))
    account = SimpleNamespace(pw_name="fitter", pw_gid=500)
    monkeypatch.setattr(os, "stat", lambda path, **_: found)
    monkeypatch.setattr(os, "geteuid", lambda: 500)
    monkeypatch.setattr(os, "getegid", lambda: 500)
    monkeypatch.setattr(os, "getgroups", lambda: [500, *groups])
    monkeypatch.setattr("grp.getgrgid", lambda number: SimpleNamespace(gr_name=names[number], gr_mem=[*members]))
    monkeypatch.setattr("pwd.getpwuid", lambda number: account)
    told = str(open_error("/dev/ttyS9", serial.SerialException(errno.EACCES, "could not open port")))
    assert told.startswith("no permission to open /dev/ttyS9; ") and remedy in told and "\n" not in told


@pytest.mark.fork
def test_a_busy_port_is_in_use() -> None:
    error = serial.SerialException(errno.EBUSY, "could not open port")
    assert str(open_error("/dev/ttyNOWHERE", error)).startswith(
        "/dev/ttyNOWHERE is in use by another program; close it there"
    )


@pytest.mark.parametrize(
    "met, told",
    [
        ("PermissionError(13, 'Access is denied.', None, 5)", "COM3 is in use by another program; close it there"),
        ("FileNotFoundError(2, 'The system cannot find the file', None, 2)", "no port COM3"),
        ("OSError(22, 'A device attached is not functioning')", "COM3 could not be opened: could not open"),
    ],
)
def test_on_windows_the_text_of_the_error_decides(monkeypatch: pytest.MonkeyPatch, met: str, told: str) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    assert str(open_error("COM3", serial.SerialException(f"could not open port 'COM3': {met}"))).startswith(told)


async def test_starting_twice_is_a_mistake_of_the_caller(pty: tuple[int, str]) -> None:
    transport = await open_serial(pty[1])
    transport.start(lambda data: None, lambda error: None)
    with pytest.raises(RuntimeError, match="started before"):
        transport.start(lambda data: None, lambda error: None)
    await transport.close()


async def test_an_opening_that_is_cancelled_leaves_the_port_free(pty: tuple[int, str]) -> None:
    opening = asyncio.create_task(open_serial(pty[1]))
    await asyncio.sleep(0)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    async with asyncio.timeout(PATIENCE):
        while True:
            try:
                transport = await open_serial(pty[1])
            except Unreachable:
                continue
            break
    await transport.close()


async def test_what_a_cancelled_opening_opened_late_is_closed_again() -> None:
    go, undone = threading.Event(), asyncio.Queue[str]()

    def slow() -> str:
        go.wait(PATIENCE)
        return "the port"

    opening = asyncio.create_task(in_thread(slow, undone.put_nowait))
    await asyncio.sleep(0)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    go.set()
    assert await asyncio.wait_for(undone.get(), 10) == "the port"


async def test_the_baud_rate_changes_while_the_port_is_open_and_a_refused_one_changes_nothing(
    pty: tuple[int, str],
) -> None:
    transport = await open_serial(pty[1], 9600)
    assert transport.control is not None
    control = transport.control
    descriptor = os.open(pty[1], os.O_RDWR | os.O_NOCTTY)
    try:
        received = asyncio.Queue[bytes]()
        transport.start(received.put_nowait, lambda error: None)
        control.set_baud(19200)
        assert termios.tcgetattr(descriptor)[4:6] == [termios.B19200] * 2 and control.baud == 19200
        assert not termios.tcgetattr(descriptor)[0] & termios.BRKINT
        with pytest.raises(OSError):
            control.set_baud(-1)
        assert termios.tcgetattr(descriptor)[4:6] == [termios.B19200] * 2 and control.baud == 19200
        os.write(pty[0], b"still read")
        assert await asyncio.wait_for(received.get(), 10) == b"still read"
    finally:
        os.close(descriptor)
        await transport.close()
    assert control.baud == 19200  # for the reopening of a lost port


async def test_a_port_without_control_lines_refuses_them(pty: tuple[int, str]) -> None:
    transport = await open_serial(pty[1])
    assert transport.control is not None
    for change in (transport.control.set_dtr, transport.control.set_rts):
        with pytest.raises(OSError):
            change(True)
    await transport.close()
