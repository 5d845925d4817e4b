"""What the files of a machine tell of the other program on a port, and how a person is told."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest

from multidrop.transports import port_users
from multidrop.transports.port_users import User, beside, holder, in_use, lock_owner, other, suspects, taker
from tests.support.cases import for_each
from tests.support.machine_files import Machine, hide

pytestmark = pytest.mark.fork
PORT = "/dev/ttyUSB7"


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


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
        assert told != "this program itself" or lock_owner(str(port)) == User("", 0)
        assert lock_owner(str(tmp_path / "no such port")) is None
        assert str(holder(str(port), tmp_path)) == told
        patched.setattr("sys.platform", "win32")
        assert lock_owner(str(port)) is None


def test_a_lock_counts_before_an_open_file_and_a_lock_file_too(machine: Machine) -> None:
    machine.process(41, "cat", PORT)
    machine.process(42, "minicom")
    machine.lock("LCK..ttyUSB7", "42")
    assert str(holder(PORT, machine.root)) == "minicom (pid 42)"


def test_windows_tells_of_no_open_files(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine.process(41, "cat", PORT)
    assert str(other(PORT, machine.root)) == "cat (pid 41)"
    monkeypatch.setattr("sys.platform", "win32")
    assert other(PORT, machine.root) is None


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
