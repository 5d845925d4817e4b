"""The command line: in the test's own process, as processes on pipes and terminals, and beside a served cell."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import pytest

from multidrop.__main__ import main
from multidrop.shell.batch import runner
from multidrop.shell.batch.virtual_loop import VirtualLoop
from tests.support.processes import Running, environment
from tests.support.until import PATIENCE


class Done(NamedTuple):
    """How a command ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


Command = Callable[..., Done]


def command(folder: Path, *arguments: str, stdin: str = "") -> Done:
    """Run a command of the front door in a folder that has a configuration and a state of its own."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.ExitStack() as around,
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, environment(folder)),
        mock.patch("sys.stdin", io.TextIOWrapper(io.BytesIO(stdin.encode()), "utf-8")),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        if on_cells(arguments):
            around.enter_context(virtual_runner())
        code = main(arguments)
    return Done(code, out.getvalue(), err.getvalue())


def on_cells(arguments: Sequence[str]) -> bool:
    """Whether a command has to do with embedded cells alone, so that nothing outside keeps the real time."""
    return any(each.startswith("sim:") for each in arguments) and not any(
        re.search("://|/dev/|tty|COM", each) for each in arguments
    )


def virtual_runner() -> contextlib.AbstractContextManager[Any]:
    """Let what asks asyncio for a runner run on a clock that does not wait."""
    runner = asyncio.Runner
    return mock.patch("asyncio.Runner", lambda **more: runner(**more | {"loop_factory": VirtualLoop}))


@pytest.fixture
def multidrop(tmp_path: Path) -> Command:
    """Run commands in the folder of the test."""
    return functools.partial(command, tmp_path)


class Home:
    """A folder with a configuration and a state of its own, the processes that work in it, and its served cell."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.started: list[subprocess.Popen[str]] = []
        self.terminals: list[Any] = []
        self.sim: Running | None = None
        self.endpoints: dict[str, dict[str, str]] = {}
        """Of the served cell: by bus and scheme."""

    def file(self, name: str, text: str | bytes) -> str:
        """Write a file; return its name."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return name

    def script(self, text: str) -> str:
        return self.file("script.txt", text)

    def settings(self, text: str) -> None:
        self.file("conf/multidrop.toml", text)

    def macro(self, name: str, *lines: str, key: str = "") -> None:
        """Keep a macro of these lines, without a pause between them."""
        steps = "".join(f"[[step]]\nafter = 0.0\nline = '''{line}'''\n" for line in lines)
        self.file(f"conf/macros/{name}.toml", f"name = '{name}'\nkey = '{key}'\n{steps}")

    def serve(self, cell: str = "") -> Home:
        """Serve a cell, the shipped one without a text, in a process of its own."""
        files = [self.file("cell.toml", cell)] if cell else []
        self.sim = Running("sim", *files, "--json", folder=self.folder)
        for line in self.sim.until('{"ready": true}')[:-1]:
            fact = json.loads(line)
            self.endpoints.setdefault(fact["bus"], {})[fact["endpoint"].partition(":")[0]] = fact["endpoint"]
        return self

    def port(self, bus: str) -> int:
        return int(self.endpoints[bus]["tcp"].rpartition(":")[2])

    def run(self, *arguments: str, stdin: str = "") -> Done:
        """Run a command that needs no process of its own."""
        return command(self.folder, *arguments, stdin=stdin)

    def start(self, *arguments: str, stdin: Any = subprocess.PIPE, **more: Any) -> subprocess.Popen[str]:
        """Start a process on pipes."""
        process = subprocess.Popen(
            [sys.executable, "-m", "multidrop", *arguments],
            **{"stdin": stdin, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
            | {"cwd": self.folder, "env": environment(self.folder)}
            | more,
        )
        self.started.append(process)
        return process

    def process(self, *arguments: str, stdin: str | None = None, **more: Any) -> Done:
        """Run a process to its end; `stdin`: what it is given to read, nothing without one."""
        process = self.start(*arguments, stdin=subprocess.DEVNULL if stdin is None else subprocess.PIPE, **more)
        out, err = process.communicate(stdin, timeout=PATIENCE)
        return Done(process.returncode, out, err)

    def terminal(self, *arguments: str, columns: int = 80, **variables: str) -> Any:
        """Start a process on a pseudo-terminal of its own; `variables`: more of its environment."""
        from tests.support.posix import pexpect

        child = pexpect.spawn(
            sys.executable,
            ["-m", "multidrop", *arguments],
            cwd=self.folder,
            env=environment(self.folder) | variables,
            timeout=PATIENCE,
            encoding="utf-8",
            dimensions=(24, columns),
        )
        child.delaybeforesend = None
        self.terminals.append(child)
        return child

    def end_all(self) -> None:
        """End the processes of a test."""
        from tests.support.posix import pexpect

        for child in self.terminals:
            try:
                child.close(force=True)
            except pexpect.ExceptionPexpect:  # it is killed, and ends later than pexpect waits: the machine is busy
                child.ptyproc.wait()
        self.terminals.clear()
        for process in self.started:
            process.kill()
            process.wait(PATIENCE)
            for stream in (process.stdin, process.stdout, process.stderr):
                with contextlib.suppress(BrokenPipeError):
                    if stream is not None:
                        stream.close()
        self.started.clear()

    def close(self) -> None:
        """End every process, the served cell last."""
        self.end_all()
        if self.sim is not None:
            if self.sim.process.poll() is None:
                self.sim.process.terminate()
            assert self.sim.end() == 0 or sys.platform == "win32", self.sim.errors


def read_to_end(child: Any) -> int:
    """Read a terminal until its process has ended; return the exit code, negative for a signal."""
    from tests.support.posix import pexpect

    child.expect(pexpect.EOF)
    child.wait()  # to close its terminal before that would end it by a signal
    child.close()
    return int(child.exitstatus if child.exitstatus is not None else -child.signalstatus)


@pytest.fixture
def home(tmp_path: Path) -> Iterator[Home]:
    """The folder of the test, whose processes end with it."""
    made = Home(tmp_path)
    yield made
    made.close()


class Terminal(io.StringIO):
    """A stream that is a terminal, or none."""

    terminal = True

    def isatty(self) -> bool:
        return self.terminal


class Called:
    """A function that keeps what it is called with, and returns a code."""

    def __init__(self, code: int = 0) -> None:
        self.code, self.calls = code, list[tuple[Any, ...]]()

    def __call__(self, *given: Any, **named: Any) -> int:
        self.calls.append((*given, named) if named else given)
        return self.code


def at_terminal(folder: Path, *words: str, closed: Sequence[str] = ()) -> Done:
    """Run a command in a folder, at a terminal; those of the standard streams that are `closed` are none."""
    streams = {name: Terminal() for name in ("stdin", "stdout", "stderr")}
    for name in closed:
        streams[name].terminal = False
    with contextlib.ExitStack() as around:
        around.enter_context(contextlib.chdir(folder))
        around.enter_context(mock.patch.dict(os.environ, MULTIDROP_CONFIG_DIR=str(folder / "conf")))
        for name, stream in streams.items():
            around.enter_context(mock.patch.object(sys, name, stream))
        code = main(words)
    return Done(code, streams["stdout"].getvalue(), streams["stderr"].getvalue())


def on_lines(
    folder: Path, monkeypatch: pytest.MonkeyPatch, captured: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Return a function that runs `multidrop shell` on lines from a file, beside `cell.toml` of the folder."""
    monkeypatch.chdir(folder)
    for name in ("CONFIG", "STATE", "DATA"):
        monkeypatch.setenv(f"MULTIDROP_{name}_DIR", str(folder / name))

    def run(lines: str, *options: str) -> Done:
        (folder / "lines").write_text(lines)
        with (folder / "lines").open() as stdin, mock.patch("sys.stdin", stdin):
            code = main(["shell", "sim:cell.toml", *options])
        return Done(code, *captured.readouterr())

    return run


def change_before_opening(monkeypatch: pytest.MonkeyPatch, path: Path, text: str) -> None:
    """Let another program write a file once a command has checked its files, and before anything is opened."""
    run = runner.run

    def changed(*given: object, **more: object) -> int:
        path.write_text(text)
        return run(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(runner, "run", changed)


def tables(done: Done) -> dict[str, list[str]]:
    """The lines of each table that `config show` prints."""
    found: dict[str, list[str]] = {"": []}
    for line in done.stdout.splitlines():
        if line.startswith("["):
            found[line] = []
        elif line:
            found[[*found][-1]].append(line)
    return found
