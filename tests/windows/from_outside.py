"""A working day of multidrop for Windows under Wine, seen from this side, by `make windows` (pytest does not find it).

A COM port of Wine is a pseudo-terminal here: a served cell is the drives at it, and its end is a pulled plug. The judge
asks the cell on a second wire, with pauses: its questions and their answers are on the line, too. `make windows` builds
what runs here (`packaging/windows.py`).
"""

from __future__ import annotations

import contextlib
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pexpect
import pytest

from tests.support.cell_session import TCP, bus, party
from tests.support.front_door import Done
from tests.support.paths import ROOT
from tests.support.processes import Running
from tests.support.served_cell import NOISE, _asked

sys.path.insert(0, str(ROOT / "packaging"))
from windows import PORTS, PYTHON, wine_environment  # type: ignore[import-not-found]

pytestmark = pytest.mark.process
PATIENCE = 180.0
STOP = "\x18"
STOPS = 40
KNOWN = "drives=a,b&party=1&checksum=1&em=1&timeout=20"
NOISY = "COM6?baud=115200&drives=n&party=1&checksum=1&em=1&timeout=20"


class Windows:
    """A folder in which multidrop for Windows works, beside a cell that this side serves on COM5, COM6 and on TCP."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.started: list[subprocess.Popen[str]] = []
        self.cell: Running | None = None
        self.url = f"COM5?{KNOWN}"
        for name, port in PORTS.items():
            port.parent.mkdir(exist_ok=True)
            port.unlink(missing_ok=True)
            port.symlink_to(folder / name)
        (folder / "noise.mxt").write_text(NOISE)
        quiet = bus("press", party("a"), party("b"), baud=0, serve=[*TCP, "pty:COM5"])
        noisy = bus("noisy", party("n", 'program = "noise.mxt"'), baud=115200, serve=["pty:COM6"])
        (folder / "cell.toml").write_text(quiet + noisy)

    def environment(self) -> dict[str, str]:
        folders = {f"MULTIDROP_{each.upper()}_DIR": f"Z:{self.folder / each}" for each in ("config", "state")}
        return {**wine_environment(), **folders, "PYTHONPATH": f"Z:{ROOT}"}

    def command(self, *arguments: str) -> list[str]:
        return ["wine", str(PYTHON / "python.exe"), "-m", "multidrop", *arguments]

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        streams: dict[str, Any] = {name: subprocess.PIPE for name in ("stdin", "stdout", "stderr")}
        command = self.command(*arguments)
        self.started.append(subprocess.Popen(command, cwd=self.folder, env=self.environment(), text=True, **streams))
        return self.started[-1]

    def run(self, *arguments: str, stdin: str = "") -> Done:
        process = self.start(*arguments)
        out, err = process.communicate(stdin, timeout=PATIENCE)
        return Done(process.returncode, out.replace("\r", ""), err.replace("\r", ""))

    def terminal(self, *arguments: str) -> Any:
        program, *words = self.command(*arguments)
        child = pexpect.spawn(
            program, words, cwd=self.folder, env={**self.environment(), "TERM": "xterm"}, timeout=PATIENCE,
            encoding="utf-8", codec_errors="replace", dimensions=(30, 100),
        )  # fmt: skip
        child.delaybeforesend = None
        return child

    def plug_in(self) -> None:
        self.cell = Running("sim", "cell.toml", "--json", folder=self.folder)
        ready = "".join(self.cell.until('{"ready": true}'))
        self.place = re.findall(r"tcp://127\.0\.0\.1:(\d+)", ready)[0]

    def unplug(self) -> None:
        if self.cell is not None:
            self.cell.kill()
        self.cell = None

    def says(self, name: str, what: str) -> int:
        """What drive `name` of the served cell says of itself, asked on the judge's own wire."""
        with socket.create_connection(("127.0.0.1", int(self.place)), 3.0) as wire:
            return int(_asked(wire, f'{name}PR "<",{what},">"'.encode(), rb"<(-?\d+)>"))

    def until(self, true: Any, what: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while not true():
            assert time.monotonic() < deadline, what
            time.sleep(0.05)

    def close(self) -> None:
        for process in self.started:
            process.kill()
            process.wait(PATIENCE)
            for stream in (process.stdin, process.stdout, process.stderr):
                with contextlib.suppress(BrokenPipeError):
                    if stream is not None:
                        stream.close()
        self.unplug()


@pytest.fixture
def windows(tmp_path: Path) -> Iterator[Windows]:
    if not (PYTHON / "python.exe").exists():
        pytest.skip("`make windows` has not built it")
    made = Windows(tmp_path)
    with contextlib.closing(made):
        made.plug_in()
        yield made


def test_a_cell_served_under_windows_is_reached_there_over_tcp(windows: Windows) -> None:
    (windows.folder / "inside.toml").write_text(bus("press", party("a"), party("b"), baud=0, serve=TCP))
    serving = windows.start("sim", "inside.toml", "--json")
    assert serving.stdout is not None
    place = re.findall(r"tcp://[\d.:]+", serving.stdout.readline())[0]
    done = windows.run("send", f"{place}?{KNOWN}", "@a PR P", "@b MR 5000", "/wait stopped 30", "@b PR P")
    assert (done.returncode, done.stdout.split()[0], done.stdout.split()[-1]) == (0, "0", "5000"), done.stderr


def test_a_party_line_at_a_com_port_is_commanded_loaded_played_and_plotted(windows: Windows) -> None:
    done = windows.run("send", windows.url, "@a PR P", "@b PR CK")
    assert (done.returncode, done.stdout.split()[:2]) == (0, ["0", "1"]), done.stderr
    (windows.folder / "p.mxt").write_bytes(b"PG 1\r\nLB G1\r\nMR 100\r\nH\r\nE\r\nPG\r\n")
    done = windows.run("program", "download", windows.url, "p.mxt", "--drive", "b")
    assert done.returncode == 0, done.stderr
    macros = windows.folder / "config" / "macros"
    macros.mkdir(parents=True)
    (macros / "go.toml").write_text('name = "go"\n[[step]]\nline = "@b MR 1000"\n[[step]]\nline = "/wait stopped"\n')
    done = windows.run("macro", "play", "go", "--on", windows.url)
    assert done.returncode == 0 and windows.says("b", "P") == 1000, done.stderr
    for file, begins in (("run.csv", b""), ("run.rrd", b"RRF2")):
        (windows.folder / "s.txt").write_text(f"/plot b --to {file}\n@b MR 20000\n/wait stopped 60\n")
        done = windows.run("run", "s.txt", "--on", windows.url)
        assert done.returncode == 0, done.stderr
        kept = (windows.folder / file).read_bytes()
        assert len(kept) > 200 and kept.startswith(begins)


def test_the_stop_under_a_flood_leaves_nothing_running(windows: Windows) -> None:
    shell = windows.terminal("shell", windows.url, NOISY)
    shell.expect("COM6: n")
    shell.send("@COM6:n EX G1\r")
    shell.expect("noise noise")

    def stands(wanted: bool) -> bool:
        with contextlib.suppress(pexpect.TIMEOUT):
            shell.read_nonblocking(1 << 20, 0)
        return (windows.says("b", "V") == 0) == wanted

    for _ in range(STOPS):
        shell.send("/resume\r@COM5:b SL 50000\r")
        windows.until(lambda: stands(False), "the drive does not start")
        shell.send(STOP)
        windows.until(lambda: stands(True), "the drive goes on")
    shell.close(force=True)


def test_a_killed_session_is_repaired_by_the_next(windows: Windows) -> None:
    (windows.folder / "long.mxt").write_text("PG 1\n" + "".join(f"R1={n}\n" for n in range(300)) + "E\nPG\n")
    loading = windows.start("program", "download", windows.url, "long.mxt", "--drive", "b", "--no-verify")
    windows.until(lambda: list((windows.folder / "state" / "ports").glob("*.json")), "nothing is owed")
    loading.send_signal(signal.SIGKILL)
    loading.communicate()
    done = windows.run("send", windows.url, "@b PR EM", "@b PR P")
    assert done.stdout.split() == ["1", "0"], done.stderr
    assert "cut off with its session" in done.stderr


def test_a_port_that_is_unplugged_and_plugged_in_is_used_again(windows: Windows) -> None:
    shell = windows.terminal("shell", windows.url)
    shell.send('@a PR "be","fore"\r')
    shell.expect("before")
    windows.unplug()
    shell.expect("COM5 was lost")
    windows.plug_in()
    shell.expect("COM5 is back")
    shell.send('@a PR "af","ter"\r')
    shell.expect("after")
    shell.close(force=True)


def test_a_second_program_does_not_get_the_port(windows: Windows) -> None:
    first = windows.start("shell", windows.url)
    assert first.stdin is not None and first.stdout is not None
    first.stdin.write('@a PR "mine"\n')
    first.stdin.flush()
    while "mine" not in first.stdout.readline():
        pass
    done = windows.run("send", windows.url, "@a PR P")
    assert done.returncode != 0 and re.search(r"COM5 is in use by multidrop \(pid \d+\)", done.stderr)
