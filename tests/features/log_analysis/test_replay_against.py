"""`log replay --against`: the positions of a log are compared with those of a simulated cell."""

from __future__ import annotations

import json
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

from multidrop.shell.log.files import BEGIN, LogEntry, line_of
from tests.support.cell_session import bus, party
from tests.support.front_door import Command

AT = datetime(2026, 11, 22, tzinfo=UTC)


def log(folder: Path, *positions: tuple[float, int]) -> None:
    """A log of a drive that was asked where it is."""
    entries = [LogEntry(AT, "log", f"{BEGIN} of process 1")]
    for after, position in positions:
        at = AT + timedelta(seconds=after)
        entries += [
            LogEntry(at, "typed", "@a PR P", "press", "a", "operator"),
            LogEntry(at, "sent", "aPR P\n", "press", "a"),
            LogEntry(at, "printed", str(position), "press", "a"),
        ]
    (folder / "day.log").write_bytes(b"".join(map(line_of, entries)))
    (folder / "cell.toml").write_text(bus("press", party("a")))


def test_an_hour_in_a_log_takes_no_hour_and_positions_are_compared(tmp_path: Path, multidrop: Command) -> None:
    log(tmp_path, (0, 400), (3600, 400), (3601, 900), (3602, 900))
    began = time.monotonic()
    done = multidrop("log", "replay", "day.log", "--against", "sim:cell.toml", "--json")
    assert time.monotonic() - began < 1800
    assert done.returncode == 1
    *differences, summary = map(json.loads, done.stdout.splitlines())
    (diverged,) = [each["diverged"] for each in differences if "diverged" in each]
    assert (diverged["drive"], diverged["difference"], diverged["causes"][0]) == ("press:a", 500, "slip")
    assert diverged["time"].startswith("2026-11-22T01:00:01")
    assert [each["differs"] for each in differences if "differs" in each] == ["then 900; now 400"] * 2
    wanted = {"lines": 4, "differ": 2, "compared": 4, "diverged": 1, "largest": {"press:a": 500}}
    assert summary["summary"] == wanted


def test_equal_positions_are_exit_0(tmp_path: Path, multidrop: Command) -> None:
    log(tmp_path, (0, 400), (5, 400))
    done = multidrop("log", "replay", "day.log", "--against", "cell.toml")
    assert (done.returncode, done.stdout) == (0, "")
    assert "press:a: 2 positions compared, largest difference 0 steps" in done.stderr
