"""Two programs on a port: who the other one is, at the opening, where nothing replies, and where nobody may look."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from multidrop.dialects import DriveError
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.transports import port_users, serial_pipe
from multidrop.transports.port_users import User, beside, holder, in_use, lock_owner, other, suspects, taker
from multidrop.transports.serial_port import open_error, open_serial
from tests.support.cases import for_each
from tests.support.front_door import Command

PORT = "/dev/ttyUSB7"


class Machine:
    """The files of an imaginary machine."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for folder in ("proc", "run/lock", "var/lock/lockdev"):
            (root / folder).mkdir(parents=True)

    def process(self, pid: int, name: str, *files: str, line: str = "") -> Path:
        """Start a process that has some files open."""
        folder = self.root / "proc" / str(pid)
        (folder / "fd").mkdir(parents=True)
        (folder / "fdinfo").mkdir()
        (folder / "comm").write_text(f"{name}\n")
        (folder / "cmdline").write_bytes((line or name).replace(" ", "\0").encode() + b"\0")
        for number, file in enumerate(files, 3):
            (folder / "fd" / str(number)).symlink_to(file)
        return folder

    def lock(self, name: str, pid: str, folder: str = "run/lock") -> None:
        (self.root / folder / name).write_text(pid)


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


def hide(monkeypatch: pytest.MonkeyPatch, *pids: int) -> None:
    """Make processes those of another account."""
    every = Path.iterdir

    def listed(path: Path) -> Iterator[Path]:
        if path.name == "fd" and int(path.parent.name) in pids:
            raise PermissionError(path)
        return every(path)

    monkeypatch.setattr(Path, "iterdir", listed)


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


@for_each(
    "line, told",
    [
        ("1: FLOCK  ADVISORY  WRITE 42 {place} 0 EOF", "minicom (pid 42)"),
        ("1: FLOCK  ADVISORY  WRITE 42 {place}", "minicom (pid 42)"),
        ("1: POSIX  ADVISORY  READ 43 {place} 0 EOF\n2: FLOCK  ADVISORY  WRITE 42 {place} 0 EOF", "minicom (pid 42)"),
        ("1: FLOCK  ADVISORY  WRITE 41 {place} 0 EOF", "pid 41"),
        (f"1: FLOCK  ADVISORY  WRITE {os.getpid()} {{place}} 0 EOF", "this program itself"),
        ("1: FLOCK  ADVISORY  WRITE 0 {place} 0 EOF", "None"),
        ("1: FLOCK  ADVISORY  WRITE 42 {place}1 0 EOF", "None"),
        ("1: -> FLOCK  ADVISORY  WRITE 42 {place} 0 EOF", "None"),
        ("1: POSIX  ADVISORY  WRITE 42 {place} 0 EOF", "None"),
        ("1: FLOCK  ADVISORY  WRITE 42", "None"),
        ("", "None"),
    ],
)
@pytest.mark.fork
def test_who_has_locked_a_port_is_read_from_the_locks_of_the_kernel(
    line: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = tmp_path / "port"
    port.touch()
    node, read = port.stat(), Path.read_text
    place = f"{os.major(node.st_dev):02x}:{os.minor(node.st_dev):02x}:{node.st_ino}"
    if not (tmp_path / "proc").exists():
        Machine(tmp_path).process(42, "minicom")
    with monkeypatch.context() as patched:
        patched.setattr(port_users, "ROOT", tmp_path)
        patched.setattr(
            Path,
            "read_text",
            lambda path, *given, **named: (
                line.format(place=place) if str(path) == "/proc/locks" else read(path, *given, **named)
            ),
        )
        assert str(lock_owner(str(port))) == told
        assert lock_owner(str(tmp_path / "no such port")) is None
        assert str(holder(str(port), tmp_path)) == told
        patched.setattr("sys.platform", "win32")
        assert lock_owner(str(port)) is None and other(str(port), tmp_path) is None


def test_a_lock_counts_before_an_open_file_and_a_lock_file_too(machine: Machine) -> None:
    machine.process(41, "cat", PORT)
    machine.process(42, "minicom")
    machine.lock("LCK..ttyUSB7", "42")
    assert str(holder(PORT, machine.root)) == "minicom (pid 42)"


def test_a_lock_file_may_have_the_name_of_the_link_to_the_port(machine: Machine) -> None:
    (machine.root / "ttyUSB7").touch()
    link = machine.root / "press"
    link.symlink_to("ttyUSB7")
    machine.process(41, "picocom")
    machine.lock(f"LCK..{str(link).replace('/', '_')}", "41", "var/lock")
    assert str(other(str(link), machine.root)) == "picocom (pid 41)"
    machine.lock(f"LCK..{str(machine.root / 'ttyUSB7').replace('/', '_')}", str(os.getpid()))
    assert str(other(str(link), machine.root)) == "picocom (pid 41)", "the lock of this program is passed over"


def test_this_program_and_what_cannot_be_read_are_passed_over(machine: Machine) -> None:
    (machine.root / "proc/self").mkdir()
    machine.process(os.getpid(), "python", PORT)
    assert other(PORT, machine.root) is None
    ended = machine.process(41, "ended")
    (ended / "fd").rmdir()
    program = machine.process(42, "cat", PORT)
    (program / "fd/9").touch()
    (program / "comm").unlink()
    assert str(other(PORT, machine.root)) == "pid 42"
    assert other(PORT, machine.root / "nowhere") is None
    assert suspects(PORT, machine.root / "nowhere") == taker(machine.root / "nowhere") == ""


def test_only_the_server_of_this_very_terminal_is_no_other_user(machine: Machine) -> None:
    serving = machine.process(40, "sshd", "/dev/null", "/dev/pts/ptmx", "/dev/pts/7")
    (serving / "fdinfo/3").write_text("pos:\t0\ntty-index:\t7\n")
    (serving / "fdinfo/4").write_text("pos:\t0\ntty-index:\t7\n")
    assert other("/dev/pts/7", machine.root) is None
    (serving / "fdinfo/4").write_text("pos:\t0\ntty-index:\t17\n")
    assert str(other("/dev/pts/7", machine.root)) == "sshd (pid 40)", "what is read of a file that is no terminal"
    (serving / "fdinfo/4").unlink()
    assert str(other("/dev/pts/7", machine.root)) == "sshd (pid 40)"
    both = machine.process(41, "socat", "/dev/ptmx", PORT)
    (both / "fdinfo/3").write_text(f"pos:\t0\ntty-index:\t{PORT}\n")
    assert str(other(PORT, machine.root)) == "socat (pid 41)"


def test_a_login_is_suspected_by_its_command_line_and_an_ended_one_is_not(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.process(50, "getty", line="/sbin/getty 9600 /dev/ttyUSB7")
    machine.process(51, "mgetty", line="/sbin/mgetty /dev/ttyUSB77")
    (machine.process(52, "login") / "cmdline").unlink()
    (machine.process(53, "agetty") / "cmdline").write_bytes(b"\xff\0ttyUSB7\0")
    machine.process(54, "gpsd", line="/usr/sbin/gpsd /dev/ttyUSB7")
    machine.process(55, "cat", line="cat /dev/ttyUSB7")
    hide(monkeypatch, *range(50, 56))
    login = "it is a login: `sudo systemctl stop serial-getty@ttyUSB7`"
    assert suspects(PORT, machine.root) == (
        f"getty (pid 50): {login}; or agetty (pid 53): {login}; or "
        "gpsd (pid 54): it reads GPS receivers: `sudo systemctl stop gpsd.socket gpsd`"
    )
    (machine.root / "proc/54/fd").rmdir()
    assert "gpsd" in suspects(PORT, machine.root)
    monkeypatch.undo()
    assert suspects(PORT, machine.root) == "", "a process that has ended hides nothing"


@for_each(
    "user, told, remedy",
    [
        (User("", 0), "this program itself", "close it there"),
        (User("minicom", 0), "this program itself", "close it there"),
        (User("", 7), "pid 7", "close it there"),
        (User("minicom", 7), "minicom (pid 7)", "close it there"),
        (User("brltty", 7), "brltty (pid 7)", "it takes adapters for Braille displays: `sudo systemctl stop brltty`"),
        (User("login", 7), "login (pid 7)", "it is a login: `sudo systemctl stop serial-getty@ttyUSB7`"),
    ],
)
def test_a_user_of_a_port_is_named_with_what_frees_the_port(user: User, told: str, remedy: str) -> None:
    assert (str(user), user.remedy(PORT)) == (told, remedy)


@for_each(
    "platform, tool",
    [("linux", f" (`sudo fuser -v {PORT}` names it)"), ("darwin", f" (`sudo lsof {PORT}` names it)"), ("freebsd", "")],
)
def test_where_nobody_is_known_the_command_of_this_system_is_told(
    platform: str, tool: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(port_users, "holder", lambda port: None)
        patched.setattr(port_users, "suspects", lambda port: "")
        patched.setattr("sys.platform", platform)
        assert in_use(PORT) == f"another program; close it there{tool}"


def test_another_program_on_an_open_port_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    for found, told in (
        (None, ""),
        (
            User("screen", 7),
            f"screen (pid 7) has {PORT} open as well, and each takes bytes from the other; close it there",
        ),
    ):
        monkeypatch.setattr(port_users, "other", lambda port, found=found: found)
        assert beside(PORT) == told


class Memory:
    """Memory that processes of Windows share by its name."""

    every: dict[str, bytearray]

    def __init__(self, file: int, size: int, tagname: str) -> None:
        assert file == -1 and size == 4 and "\\" not in tagname, "Windows takes that for the name of a folder"
        self._name, self._size = tagname, size
        self.every.setdefault(tagname, bytearray(size))

    def __getitem__(self, part: slice) -> bytes:
        return bytes(self.every[self._name][part])

    def __setitem__(self, part: slice, data: bytes) -> None:
        assert len(data) == self._size
        self.every[self._name][part] = data

    def __enter__(self) -> Memory:
        return self

    def __exit__(self, *_: object) -> None: ...


def test_on_windows_a_port_has_the_mark_of_the_process_that_has_opened_it(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.spec_from_file_location("port_users_on_windows", port_users.__file__)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with monkeypatch.context() as patched:
        patched.setattr("sys.platform", "win32")
        patched.setattr("mmap.mmap", Memory)
        Memory.every = {}
        spec.loader.exec_module(module)
        for port, again in (("com10", r"\\.\COM10"), (r"\\.\CNCA0", r"\\.\CNCA0")):
            assert module.holder(port) is None
            marked = module.mark(port)
            assert str(module.holder(again)) == "this program itself"
            marked[:] = (os.getpid() + 1).to_bytes(4, "little")
            assert str(module.holder(again)) == f"multidrop (pid {os.getpid() + 1})"
        assert module.holder("COM1") is None
        assert (module.lock_owner("COM10"), module.other("COM10")) == (None, None)


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
