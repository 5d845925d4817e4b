"""Entries of a session log, written into a file, and `multidrop log` called on it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from multidrop.cli import parse, run
from multidrop.shell.log.files import LogEntry, line_of

AT = datetime(2026, 11, 22, 12, 41, 6, 20115, tzinfo=UTC)
Done = tuple[int, list[str], list[str]]
"""How a command ended; the lines that it printed, and those on standard error."""


def entry(kind: str, text: str, bus: str = "press", drive: str = "b", after: float = 0.0, **more: Any) -> LogEntry:
    """Return an entry of a time, `after` in s."""
    return LogEntry(AT + timedelta(seconds=after), kind, text, bus, drive, **more)


BEGIN = entry("log", "session of process 7", "", "", marks=True)
OPENED = entry("bus", "p: a, b", drive="")
TYPED = entry("typed", "@b PR P", by="operator", after=1.0)
PRINTED = entry("printed", "512", after=2.0)
STOP = entry("stop", "stop", "", "", after=3.0)
POLLS = (
    entry("sent", "aPR P,DN,V\n", drive="a", poll=True, after=4.0),
    entry("received", 'aPR P,DN,V\r\n18"a"6114\r\n>', drive="a", poll=True, after=4.5),
    *(
        entry(kind, text, "stage", "00", poll=True, after=after)
        for after, sent, reply in ((5.0, "PX", "1"), (5.2, "MSTX", "0"), (5.4, "PY", "2"), (5.6, "MSTY", "0"))
        for kind, text in (("sent", f"@00{sent}\r"), ("received", f"{reply}\r"))
    ),
)
ENTRIES = (
    entry("log", "session log", "", ""),
    entry("typed", "@b PR P", by="operator"),
    entry("sent", "bPR P\n"),
    entry("received", "\x065"),
    entry("received", "12\r\n", after=1.0),
    entry("printed", "512"),
    entry("sent", "cPR V\n", drive="c", poll=True),
    entry("failed", "b refused 'ZZ': error 60", after=2.0),
    entry("typed", "/drives", "", ""),
)
"""A session with a refusal: pieces of one reply, a poll, a line for no drive."""


def newest_log(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder with a configuration and a state of its own; return the newest log there, not written yet."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(folder / "config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(folder / "state"))
    path = folder / "state" / "logs" / "day.jsonl"
    path.parent.mkdir(parents=True)
    return path


def log_command(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Return a function that runs `multidrop log` with words."""

    def call(*words: object) -> Done:
        code = run(parse(["log", *map(str, words)]))
        out, err = capsys.readouterr()
        return code, out.splitlines(), err.splitlines()

    return call


def put(path: Path, *entries: LogEntry) -> None:
    """Write a log of these entries."""
    path.write_bytes(b"".join(map(line_of, entries)))
