"""Processes that are killed (SIGKILL) at random moments: what they leave in files, and in a drive.

A worker is a fork, so that a kill costs milliseconds. The files are those of one user, who starts again each time.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AsyncExitStack
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.macros import MacroStore
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified
from multidrop.shell.log.files import entry_of
from multidrop.shell.prompt.line_queue import History
from multidrop.shell.session import Session
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor

PROGRAM = "VM=400000\nPG 1\nLB G1\n" + "".join(f"R1={number}\n" for number in range(30)) + "E\nPG\nS\n"
CELL = '[[bus]]\nname = "w"\n{serve}baud = {baud}\n[[bus.drive]]\npersonality = "LMDCM"\nname = "a"\nparty = true\n'
DRIVE = "set = { EM = 1, CK = 1 }\n"
PUT_BACK = "left EM=0; EM=1 is set again"
PATIENCE = 60.0


def run(kills: int) -> tuple[dict[str, Any], list[str]]:
    """Kill so many workers, a quarter of them in downloads; return figures and failures."""
    with tempfile.TemporaryDirectory() as folder:
        figures, failures = in_files(kills - kills // 4, Path(folder))
    with tempfile.TemporaryDirectory() as folder:
        more, worse = in_downloads(kills // 4, Path(folder))
    return {**figures, **more}, failures + worse


# Files


def in_files(kills: int, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Kill a user who records, sets keys, logs and types."""
    (folder / "cell.toml").write_text(CELL.format(serve="", baud=0) + DRIVE)
    rng, failures = Random(12), []
    for number in range(kills):
        with _worker(partial(_write_files, folder, number), folder):
            _wait_for_lines(folder / "session.log", rng.randrange(2, 40))
            time.sleep(rng.random() * 0.02)
        failures += [f"kill {number} in files: {each}" for each in wrong_files(folder)]
    log = folder / "session.log"
    return {"kills in files": kills, "log lines": _lines(log), **_counted(folder)}, failures


def _wait_for_lines(log: Path, more: int) -> None:
    """Wait until a log has so many more lines: a busy machine takes longer for the same work."""
    begun, deadline = _lines(log), time.monotonic() + PATIENCE
    while _lines(log) < begun + more and time.monotonic() < deadline:
        time.sleep(0.002)


def _lines(log: Path) -> int:
    return log.read_bytes().count(b"\n") if log.exists() else 0


def _counted(folder: Path) -> dict[str, int]:
    macros = folder / "config" / "macros"
    return {"macros": len(list(macros.glob("*.toml"))), "files left beside them": len(list(macros.glob(".*.tmp")))}


async def _write_files(folder: Path, number: int) -> None:
    """Record, set keys, log and type until the kill."""
    settings = Settings({}, folder / "config", folder / "state", data=folder / "data")
    session, history = Session(settings), History(settings.history)
    await session.open(f"sim:{folder / 'cell.toml'}")
    os.chdir(folder)
    _say_ready(folder)
    while True:
        macro = f"m{number % 5}"
        known = (folder / "config" / "macros" / f"{macro}.toml").exists()
        begin = f"/record {macro}{' --replace' * known}"
        for line in ("/log session.log", begin, *_typed(number), "/record stop", f"/key F{2 + number % 5} {macro}"):
            history.append(line)
            await session.run(line)


def _typed(number: int) -> tuple[str, ...]:
    return f"R1={number}", "PR R1", "PR VM", f"R2={number * 7}"


def wrong_files(folder: Path) -> list[str]:
    """Find the files that are not whole."""
    failures: list[str] = []
    macros = folder / "config" / "macros"
    for path in macros.glob("*.toml"):
        try:
            MacroStore(macros).load(path.stem)
        except Diagnostic as problem:
            failures.append(str(problem))
    typed = re.compile(r"R[12]=\d+|PR R1|PR VM|/log session\.log|/record (m\d( --replace)?|stop)|/key F\d m\d")
    lines = History(folder / "state" / "history").lines()
    failures += [f"history: {line!r}" for line in lines if not typed.fullmatch(line)]
    log = folder / "session.log"
    *logged, _ = log.read_bytes().split(b"\n") if log.exists() else [b""]
    return failures + [f"log: {line!r}" for line in logged if entry_of(line) is None]


# Downloads


def in_downloads(kills: int, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Kill downloads over a pseudo-terminal; the next session must find the drive as it was before."""
    rng, failures, owed, restored = Random(13), [], 0, 0
    (folder / "p.mxt").write_text(PROGRAM)
    (folder / "cell.toml").write_text(CELL.format(serve='serve = ["pty:w.tty"]\n', baud=115200) + DRIVE)
    with _worker(partial(_serve, folder), folder):
        for number in range(kills):
            with _worker(partial(_download, folder), folder):
                time.sleep(rng.random() * 0.5)
            owed += bool(list(folder.glob("state/ports/*.json")))
            read = folder / f"read-{number}.json"
            with _worker(partial(_read, folder, read), folder):
                _wait_for(read)
            found = json.loads(read.read_text())
            if found["printed"] != ["1", "0", "0"] or list(folder.glob("state/ports/*.json")):
                failures.append(f"kill {number} in a download: {found}")
            restored += any(PUT_BACK in each for each in found["said"])
    if restored < owed // 2:  # a kill between the record and EM=0 leaves nothing to restore
        failures.append(f"{owed} downloads left a record, and {restored} sessions explained that they restored a mode")
    return {"kills in downloads": kills, "records left": owed, "modes restored": restored}, failures


async def _serve(folder: Path) -> None:
    """Serve the drive until it is killed."""
    cell = cells.load(str(folder / "cell.toml"))
    async with AsyncExitStack() as stack:
        await serve_bus(RunningFloor(Floor(cell)), cell.buses[0], stack)
        _say_ready(folder)
        await asyncio.Event().wait()


async def _opened(folder: Path) -> tuple[Session, list[str]]:
    said: list[str] = []
    session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"))
    session.subscribe(lambda event: said.append(event.text) if isinstance(event, Notified) else None)
    await session.open(f"serial:{folder / 'w.tty'}?baud=115200&drives=a&party=1")
    return session, said


async def _download(folder: Path) -> None:
    session, _ = await _opened(folder)
    os.chdir(folder)
    _say_ready(folder)
    while True:
        await session.run("/download p.mxt")


async def _read(folder: Path, result: Path) -> None:
    """Open the port as the next session, and write down what it finds."""
    _say_ready(folder)
    session, said = await _opened(folder)
    [bus] = session.buses.values()
    printed = [(await bus.at("a").send(line))[0] for line in ("PR EM", "PR P", "PR MV")]
    beside = result.with_suffix(".new")
    beside.write_text(json.dumps({"printed": printed, "said": said}))
    beside.replace(result)
    await session.close()


# Workers


@contextlib.contextmanager
def _worker(work: Callable[[], Coroutine[Any, Any, None]], folder: Path) -> Iterator[None]:
    """Fork a process that works; the block begins when it is ready, and it is killed at the end of the block."""
    ready = folder / "ready"
    ready.unlink(missing_ok=True)
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        try:
            asyncio.run(work())
        finally:
            os._exit(0)
    try:
        _wait_for(ready)
        yield
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _say_ready(folder: Path) -> None:
    (folder / "ready").touch()


def _wait_for(path: Path) -> None:
    ends = time.monotonic() + PATIENCE
    while not path.exists():
        if time.monotonic() > ends:
            raise TimeoutError(f"{path.name} did not come")
        time.sleep(0.002)
