"""`log at` and `log bisect` on logs of 100 MB, as processes: a session of one drive that is polled or commanded.

Figures are processor time. `bisect` compares two such logs that differ in their last line.

Run: python bench/bench_logs.py [--full]
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from report import Row, alone, main

from multidrop.shell.log.files import LogEntry, line_of
from multidrop.shell.log.index import IndexKeeper

SIZE = 100 * 1000 * 1000
AIM = 1.0
ROUNDS = 5
AT = datetime(2026, 11, 22, 8, 0, tzinfo=UTC)


def rows(full: bool) -> Iterator[Row]:
    """Moments in a log, and two runs that are alike up to their ends; with polls, and with commands only."""
    with tempfile.TemporaryDirectory() as folder:
        for polls in (True, False):
            what = "polls" if polls else "commands"
            paths = [Path(folder, f"{name}.jsonl") for name in ("one", "other")]
            ends = [written(path, polls, last) for path, last in zip(paths, ("512", "513"), strict=True)]
            for name, share in (("begin", 0.01), ("middle", 0.5), ("end", 1.0)):
                at = (AT + (ends[0] - AT) * share).isoformat()
                seconds = [_run("log", "at", at, str(paths[0])) for _ in range(ROUNDS)]
                yield alone(f"log at, {name}, {what}", "s", seconds, aim=AIM)
            end, older = written(paths[0], polls, "512", indexed=False), []
            for _ in range(ROUNDS):
                older.append(_run("log", "at", (AT + (end - AT) * 0.5).isoformat(), str(paths[0])))
            yield alone(f"log at, middle, {what}, no index", "s", older, aim=AIM, note="a log of an older version")
            seconds = [_run("log", "bisect", *map(str, paths), code=1) for _ in range(ROUNDS)]
            yield alone(f"log bisect, last line, {what}", "s", seconds, aim=AIM, note="two logs of 100 MB")
        if full:
            yield alone("log show, all entries", "s", [_run("log", "show", str(paths[0]))])


def written(path: Path, polls: bool, last: str, indexed: bool = True) -> datetime:
    """Write a log of this size whose last drive's line is `last`; return its last time."""
    now, size, keeper = AT, 0, IndexKeeper(0)
    with path.open("wb") as file:
        begin = [LogEntry(now, "log", "session of process 1", marks=True)]
        begin += [LogEntry(now, "bus", "/dev/ttyUSB0: b LMDCM 6.002", "press")]
        while size < SIZE:
            now += timedelta(seconds=0.02)
            data = b"".join(map(line_of, [*begin, *_exchange(now, polls)]))
            size += file.write(data + (keeper.take(data) if indexed else b""))
            begin = []
        file.write(line_of(LogEntry(now, "printed", last, "press", "b")))
    return now


def _exchange(now: datetime, poll: bool) -> Iterator[LogEntry]:
    number = str(int(now.timestamp() * 50) % 100000)
    if not poll:
        yield LogEntry(now, "typed", f"@b MA {number}", "press", "b", by="script")
    yield LogEntry(now, "sent", "bPR P,DN,V\n", "press", "b", poll=poll)
    yield LogEntry(now, "received", f'bPR P,DN,V\r\n{number}"b"6114\r\n>', "press", "b", poll=poll)
    if not poll:
        yield LogEntry(now, "printed", number, "press", "b")


def _run(*arguments: str, code: int = 0) -> float:
    """Processor time of a command, which is its time on an idle machine: it has one thread, and the file is cached."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "multidrop", *arguments], capture_output=True, text=True)
    assert done.returncode == code and done.stdout, done.stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main(rows)
