"""The descriptor of a serial port on POSIX: its claim, its queue, its loss, and the reason of each refusal."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from multidrop.transports import Unreachable, serial_port
from multidrop.transports.serial_port import open_error, open_serial, opened
from multidrop.transports.serial_ports import PortInfo, list_ports, present, stable_name
from tests.support.cases import for_each
from tests.support.posix import fcntl, termios

pytestmark = pytest.mark.fork

TIOCGEXCL = 0x80045440
"""Linux: whether a terminal is claimed."""
GONE = "the port is gone (unplugged, or its other side closed it); plug it in"


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    """A descriptor of the port, and its path."""
    master, slave = os.openpty()
    yield slave, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def endpoint(path: str, baud: int = 9600) -> serial_port.SerialEndpoint:
    return serial_port.SerialEndpoint(path, baud)


@pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="only Linux tells who has claimed a terminal")
def test_a_port_with_hardware_is_claimed_while_it_is_open_and_a_pseudo_terminal_is_not(
    pty: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def claimed() -> bool:
        return any(fcntl.ioctl(pty[0], TIOCGEXCL, bytes(4)))

    port = endpoint(pty[1])
    assert not claimed()
    port.close()
    monkeypatch.setattr(serial_port, "TERMINALS", "/dev/of-no-machine/")
    port = endpoint(pty[1])
    assert claimed()
    port.close()
    assert not claimed()


def test_a_read_never_waits_and_breaks_do_not_empty_the_queues(pty: tuple[int, str]) -> None:
    attributes = termios.tcgetattr(pty[0])
    attributes[0] |= termios.BRKINT
    termios.tcsetattr(pty[0], termios.TCSANOW, attributes)
    port = endpoint(pty[1], 19200)
    flags, _, _, _, speed, _, characters = termios.tcgetattr(pty[0])
    assert not flags & termios.BRKINT and speed == termios.B19200
    assert (characters[termios.VMIN], characters[termios.VTIME]) in ((1, 0), (b"\x01", b"\x00"))
    with pytest.raises(BlockingIOError):
        port.read()
    port.close()


def test_a_slow_port_is_one_all_the_same(pty: tuple[int, str]) -> None:
    port = opened(serial_port.SerialEndpoint, pty[1], 50)
    assert (port.name, port.control.baud, termios.tcgetattr(pty[0])[4]) == (pty[1], 50, termios.B50)
    port.close()


async def test_without_a_rate_a_port_is_opened_at_9600_and_1_is_a_rate(pty: tuple[int, str]) -> None:
    transport = await open_serial(pty[1])
    assert transport.control is not None and transport.control.baud == 9600
    await transport.close()
    with pytest.raises(Unreachable) as caught:
        await open_serial(pty[1], 0)
    assert str(caught.value) == f"{pty[1]}: invalid baud rate 0; give one such as 9600"
    with pytest.raises(Unreachable, match="no port /dev/nowhere"):
        await open_serial("/dev/nowhere", 1)


def test_a_stop_and_a_close_empty_the_drivers_queue_and_an_empty_one_is_left_alone(
    pty: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A close waits else until a port without a reader has sent all."""
    held, flushed = [7], list[tuple[int, int]]()
    port = endpoint(pty[1])
    monkeypatch.setattr(serial_port, "output_queue", lambda descriptor: held[0])

    def flush(descriptor: int, queue: int) -> None:
        flushed.append((descriptor, queue))
        held[0] = 0

    monkeypatch.setattr(termios, "tcflush", flush)
    assert (port.unsent(), port.drop(), port.unsent()) == (7, 7, 0)
    both = [(port.fileno(), termios.TCOFLUSH)]
    assert flushed == both
    port.close()
    assert flushed == both, "nothing was held"
    port = endpoint(pty[1])
    held[0] = 3
    flushed.clear()
    port.close()
    assert (port.fileno(), termios.TCOFLUSH) in flushed


def test_a_port_that_is_gone_cannot_be_flushed_and_is_closed_all_the_same(
    pty: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> None:
        raise termios.error(errno.EIO, os.strerror(errno.EIO))

    port = endpoint(pty[1])
    with monkeypatch.context() as patched:
        patched.setattr(termios, "tcflush", gone)
        assert port.drop() == 0
    port.close()
    endpoint(pty[1]).close()


@for_each(
    "error, told",
    [
        (None, GONE),
        (OSError(), GONE),
        (OSError("in words only"), GONE),
        (OSError(errno.EIO, "Input/output error"), f"{GONE} (Input/output error)"),
    ],
)
def test_a_loss_is_told_with_its_remedy_and_the_systems_words(
    pty: tuple[int, str], error: OSError | None, told: str
) -> None:
    port = endpoint(pty[1])
    try:
        assert port.explain(error) == told
    finally:
        port.close()


# Refusals

PORT = "/dev/ttyS9"


@for_each(
    "numbers, text, told",
    [
        ((errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK), "", f"{PORT} is in use by minicom (pid 7); close it there"),
        ((errno.EACCES, errno.EPERM), "", f"no permission to open {PORT}; `sudo usermod -aG dialout $USER`, then log"),
        (
            (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR),
            "",
            f"no port {PORT}; plug it in, or see `multidrop",
        ),
        ((errno.EISDIR, errno.ENOTTY), "", f"{PORT} is not a serial port, or has no hardware; see `multidrop ports`"),
        ((errno.EIO, None), "Could not configure port", f"{PORT} is not a serial port, or has no hardware; see `multi"),
        ((errno.EMFILE,), "", f"{PORT} could not be opened: {os.strerror(errno.EMFILE)}"),
        ((None,), "what pyserial says", f"{PORT} could not be opened: what pyserial says"),
    ],
)
def test_each_error_of_the_system_is_told_with_its_remedy(
    numbers: tuple[int | None, ...], text: str, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "in_use", lambda port: "minicom (pid 7); close it there")
    for number in numbers:
        error = OSError(text) if number is None else OSError(number, text or os.strerror(number))
        assert str(open_error(PORT, error)).startswith(told)


@for_each(
    "mode, owner, group, remedy",
    [
        (0o661, 0, 20, "`sudo usermod -aG dialout $USER`, then log in again"),
        (0o671, 0, 20, "`sudo usermod -aG dialout $USER`, then log in again"),
        (0o671, 0, 0, "it is of the group root only, so no other group helps: a udev rule with GROUP='dialout', MODE="),
        (0o620, 0, 0, "group root, its mode is 0620, so no other group helps: a udev rule with GROUP='dialout', MODE="),
        (0o620, 0, 20, "group dialout, its mode is 0620, so no other group helps: "),
        (0o660, 0, 1, "`sudo usermod -aG 1 $USER`, then log in again"),
        (0o660, 0, 30, "`sudo usermod -aG 'two words' $USER`, then log in again"),
        (0o660, 0, 500, "you are in its group fitters, but this login began before that: log out and in again"),
        (0o660, 0, 100, "you are in its group users, which may use it: something else refuses it"),
        (0o601, 500, 20, "you own it, and its mode is 0601: something else refuses it"),
        (0o711, 500, 20, "you own it, and its mode is 0711: something else refuses it"),
        (0o400, 500, 20, "you own it, and its mode is 0400: `chmod u+rw /dev/ttyS9`"),
        (0o200, 500, 20, "you own it, and its mode is 0200: `chmod u+rw /dev/ttyS9`"),
        (0o4660, 500, 20, "you own it, and its mode is 0660: something else refuses it"),
    ],
)
def test_the_remedy_for_a_missing_permission_is_one_that_helps(
    mode: int, owner: int, group: int, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = {0: "root", 20: "dialout", 30: "two words", 100: "users", 500: "fitters"}
    found = os.stat_result((stat.S_IFCHR | mode, 0, 0, 1, owner, group, 0, 0, 0, 0))
    with monkeypatch.context() as patched:
        patched.setattr(os, "stat", lambda path, **_: found)
        patched.setattr(os, "geteuid", lambda: 500)
        patched.setattr(os, "getegid", lambda: 100)
        patched.setattr(os, "getgroups", lambda: [])
        patched.setattr("grp.getgrgid", lambda number: SimpleNamespace(gr_name=names[number], gr_mem=["other"]))
        patched.setattr("pwd.getpwuid", lambda number: SimpleNamespace(pw_name="fitter", pw_gid=500))
        told = str(open_error(PORT, OSError(errno.EACCES, "")))
    assert told.startswith(f"no permission to open {PORT}; {remedy}")


def test_an_account_that_no_list_has_is_in_no_group(monkeypatch: pytest.MonkeyPatch) -> None:
    found = os.stat_result((stat.S_IFCHR | 0o660, 0, 0, 1, 0, 20, 0, 0, 0, 0))

    def unknown(number: int) -> SimpleNamespace:
        raise KeyError(number)

    with monkeypatch.context() as patched:
        patched.setattr(os, "stat", lambda path, **_: found)
        patched.setattr(os, "geteuid", lambda: 65000)
        patched.setattr(os, "getegid", lambda: 65000)
        patched.setattr(os, "getgroups", lambda: [])
        patched.setattr("pwd.getpwuid", unknown)
        patched.setattr("grp.getgrgid", lambda number: SimpleNamespace(gr_name="dialout", gr_mem=[]))
        told = str(open_error(PORT, OSError(errno.EACCES, "")))
    assert told.endswith("; `sudo usermod -aG dialout $USER`, then log in again")


# The names of ports on this machine


def test_a_name_that_lasts_is_a_link_or_the_whole_path_of_the_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dev/serial/by-id").mkdir(parents=True)
    (tmp_path / "dev/ttyUSB0").touch()
    link = tmp_path / "dev/serial/by-id/usb-FTDI-if00"
    link.symlink_to("../../ttyUSB0")
    for device, name in [
        (str(tmp_path / "dev/ttyUSB0"), str(link)),
        ("dev/ttyUSB0", str(link)),
        (str(link), str(link)),
        ("dev/../dev/ttyS0", str(tmp_path / "dev/ttyS0")),
        ("ttyS0", "ttyS0"),
    ]:
        assert stable_name(device, tmp_path) == name
    assert [present(each) for each in ("dev/ttyUSB0", "dev/ttyS0", str(link))] == ["dev/ttyUSB0", "", str(link)]
    other = tmp_path / "dev/serial/by-id/a-first-name"
    other.symlink_to("../../ttyUSB0")
    assert stable_name("dev/ttyUSB0", tmp_path) == str(other), "the first of several, each time"


def test_a_listed_port_has_the_name_of_the_link_to_it_and_its_description(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [SimpleNamespace(device=str(tmp_path / f"tty{n}"), description=said) for n, said in ((10, "x"), (9, None))]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    assert list_ports(tmp_path) == [PortInfo(str(tmp_path / "tty9")), PortInfo(str(tmp_path / "tty10"), "", "x")]
