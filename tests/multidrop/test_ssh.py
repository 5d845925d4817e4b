"""A port of another machine: a real sshd on loopback, and a program `ssh` that fails in every way."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

import multidrop
from multidrop.__main__ import main
from multidrop.base.errors import TransportLost
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.shell.signals import early_ends
from multidrop.transports import Transport, Unreachable, ssh_session
from multidrop.transports.port_users import User, lock_owner
from multidrop.transports.ssh import FarPort
from multidrop.transports.ssh_session import open_ssh, reason
from tests.support.cell_session import bus, party
from tests.support.posix import tty
from tests.support.ssh_server import fake_ssh, far_programs, script, ssh_server
from tests.support.until import until

pytestmark = pytest.mark.fork

CELL = bus("press", party("a"), baud=0)


def pid_of(owner: User | None) -> int:
    return owner.pid if owner is not None else 0


def ssh_here() -> int:
    """The process of ssh that this one has started."""
    children = (each.read_text().split() for each in Path("/proc/self/task").glob("*/children"))
    found = [int(child) for each in children for child in each if Path(f"/proc/{child}/comm").read_text() == "ssh\n"]
    return found[0]


@pytest.mark.process
@pytest.mark.needs("sshd", "ssh")
@pytest.mark.skipif(sys.platform != "linux", reason="an sshd of the test's own, on Linux")
async def test_a_drive_behind_a_real_sshd_moves_and_comes_back_after_each_kill_without_an_orphan(
    tmp_path: Path,
) -> None:
    with ssh_server(tmp_path) as server, multidrop.simulate(text=CELL) as cell:
        port = cell.url(scheme="pty")
        session = Session(Settings({}, tmp_path / "conf", tmp_path / "state", data=tmp_path / "data"), reconnect=True)
        (bus,) = await session.open(f"ssh://127.0.0.1:{server}{port}?drives=a")
        await session.run("MR 5120")
        await session.run("/wait stopped")
        with pytest.raises(Unreachable, match=r"in use by .* \(pid"):
            await open_ssh(FarPort("127.0.0.1", port, port=server))
        for victim in (lambda: pid_of(lock_owner(port)), ssh_here):
            relay = pid_of(lock_owner(port))
            os.kill(victim(), signal.SIGKILL)
            await until(lambda: bus.lost)
            await until(lambda: not bus.link.away)
            assert pid_of(lock_owner(port)) not in (0, relay)
            assert [each.position for each in await bus.drives["a"].motion()] == [5120]
        await session.close()
        assert not lock_owner(port)


REFUSES_THE_FIRST = 'case "$last" in *"multidrop relay"*) exit 127;; *) echo multidrop-socat; exec cat;; esac'


def running(file: Path) -> bool:
    """Whether the process that a file names runs; one that has ended may wait for its parent."""
    try:
        return Path(f"/proc/{int(file.read_text())}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (OSError, ValueError):
        return False


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="reads signal masks in /proc")
async def test_ssh_does_not_inherit_that_a_script_blocks_sigpipe(tmp_path: Path, monkeypatch) -> None:
    body = "exec grep SigBlk /proc/self/status >&2"
    monkeypatch.setenv("PATH", fake_ssh(tmp_path / "bin", body))
    with early_ends(), pytest.raises(Unreachable, match="SigBlk: 0000000000000000"):
        await open_ssh(FarPort("pc", "/dev/tty9"))


FAILURES = [
    (
        "echo 'ssh: connect to host pc port 22: Connection refused' >&2; exit 255",
        ["not reached: ", "refused", "no ssh"],
    ),
    ("echo 'Host key verification failed.' >&2; exit 255", ["`ssh -p 22 me@pc` once by hand"]),
    ("echo 'me@pc: Permission denied (publickey).' >&2; exit 255", ["publickey", "ssh-copy-id"]),
    ("exit 255", ["not reached: ssh ended without a word"]),
    ("kill -9 $$", ["ended by signal 9"]),
    ("exit 127", ["neither multidrop nor socat is installed on pc"]),
    ("echo 'multidrop-relay 2'; exec cat >/dev/null", ["'multidrop-relay 2'", "'multidrop-relay 1'", "one version"]),
    ("echo 'This account is not available.'; exit 1", ["This account is not available."]),
    ("echo 'multidrop: no port /dev/tty9; plug it in' >&2; exit 3", ["/dev/tty9: no port /dev/tty9; plug it in"]),
    ("yes | head -c 100000", ["y"]),
    ('sleep 60 & echo $! >"$0.way"; wait', ["not reached within 0.3 s", "ssh -p 22 me@pc"]),
]


@pytest.mark.process
async def test_what_goes_wrong_before_the_greeting_is_one_line_that_quotes_it(tmp_path: Path, monkeypatch) -> None:
    before = len(os.listdir("/dev/fd"))
    monkeypatch.setenv("PATH", fake_ssh(tmp_path / "bin", REFUSES_THE_FIRST))
    await (await open_ssh(FarPort("pc", "/dev/tty9"))).close()
    for body, words in FAILURES:
        monkeypatch.setenv("PATH", fake_ssh(tmp_path / "bin", body))
        with pytest.raises(Unreachable) as caught:
            await open_ssh(FarPort("pc", "/dev/tty9", "me", 22), within=0.3 if "sleep" in body else None)
        text = str(caught.value)
        assert text.startswith("ssh://me@pc:22/dev/tty9: ") and "\n" not in text
        assert [word for word in words if word not in text] == [], text
    await until(lambda: not running(tmp_path / "bin" / "ssh.way"))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(Unreachable, match="the program ssh cannot be started"):
        await open_ssh(FarPort("pc", "/dev/tty9"))
    assert len(os.listdir("/dev/fd")) == before


class Unanswered:
    """A program `ssh` that never replies; every worker of the loop is busy by then."""

    closed = False

    def __init__(self, far: FarPort, baud: int, way: str) -> None:
        self.free = threading.Event()

    async def read_some(self) -> bytes:
        asyncio.get_running_loop().run_in_executor(None, self.free.wait)
        return await asyncio.get_running_loop().create_future()

    def last_words(self) -> str:
        asyncio.get_running_loop().call_soon(asyncio.current_task().cancel)  # in the moment of the time-out
        return ""

    def close(self, lost: bool) -> None:
        self.closed = True


async def test_a_login_that_is_cancelled_in_the_moment_of_its_time_out_leaves_no_program(monkeypatch) -> None:
    begun: list[Unanswered] = []
    monkeypatch.setattr(ssh_session, "SshSession", lambda *given: begun.append(Unanswered(*given)) or begun[0])
    loop = asyncio.get_running_loop()
    loop.set_default_executor(ThreadPoolExecutor(1))
    opening = asyncio.create_task(open_ssh(FarPort("pc", "/dev/tty9"), within=0.001))
    await asyncio.wait([opening])
    begun[0].free.set()
    await loop.shutdown_default_executor()  # once it has done its work
    assert opening.cancelled() and begun[0].closed


@pytest.mark.process
def test_the_command_to_try_by_hand_runs_nothing_of_the_ports_name(tmp_path: Path, monkeypatch) -> None:
    """A person pastes it: the shell here and the one there each take the path as one word."""
    path = f"/dev/$(touch {tmp_path}/ran) `touch {tmp_path}/ran` it's"
    fake_ssh(tmp_path / "bin", 'shift; exec /bin/sh -c "$*"')
    script(tmp_path / "bin" / "multidrop", 'printf "%s\\n" "$@"')
    hint = reason(FarPort("pc", path), 7, "").partition("try: ")[2]
    assert reason(FarPort("pc", "/dev/ttyUSB0"), 7, "").endswith("try: ssh pc multidrop relay /dev/ttyUSB0")
    env = {"PATH": f"{tmp_path / 'bin'}:/usr/bin:/bin"}
    done = subprocess.run(["/bin/sh", "-c", hint], capture_output=True, text=True, env=env)
    assert (done.stdout.splitlines(), (tmp_path / "ran").exists()) == (["relay", path], False), hint


@contextlib.contextmanager
def pty(folder: Path) -> Iterator[tuple[int, str]]:
    """A port whose other side reads only when the test says, with a name that no shell may execute."""
    master, slave = os.openpty()
    tty.setraw(slave)
    name = folder / f'a\'b $(touch {folder.name}) ; "x", 0:1'
    name.symlink_to(os.ttyname(slave))
    os.close(slave)
    try:
        yield master, str(name)
    finally:
        os.close(master)


async def opened(far: FarPort) -> tuple[Transport, bytearray, list[TransportLost]]:
    transport, data, losses = await open_ssh(far), bytearray(), []
    transport.start(data.extend, losses.append)
    return transport, data, losses


@pytest.mark.process
@pytest.mark.needs("socat")
async def test_multidrop_is_started_there_and_without_it_socat_which_says_less(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    programs = {name: far_programs(tmp_path / name, name, "readlink") for name in ("multidrop", "socat")}
    for name, far in programs.items():
        body = f'HOME=/nowhere PATH={far} exec /bin/sh -c "$last"'
        monkeypatch.setenv("PATH", fake_ssh(tmp_path / "bin", body))
        with pytest.raises(Unreachable, match="(?i)no such|no port"):
            await open_ssh(FarPort("pc", "/dev/does-not-exist"))
        with pty(tmp_path / "multidrop" if name == "socat" else tmp_path) as (master, port):
            transport, data, losses = await opened(FarPort("pc", port))
            assert bool(transport.limits) == (name == "socat")
            transport.write(bytes(range(256)))
            received = b""
            while len(received) < 256:
                received += await asyncio.to_thread(os.read, master, 256)
            assert received == bytes(range(256))
            os.write(master, b"51200\r\n")
            await until(partial(data.endswith, b"51200\r\n"))
            with pytest.raises(Unreachable):
                await open_ssh(FarPort("pc", port))
            await transport.close()
            assert not losses
    assert not (tmp_path / tmp_path.name).exists()


def test_a_terminal_is_told_what_the_relay_is_for(monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    assert main(["relay", "/dev/ttyUSB0"]) == 2
    assert "open ssh://THIS-HOST/dev/ttyUSB0 on the other machine" in capsys.readouterr().err
