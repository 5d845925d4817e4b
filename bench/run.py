"""All benches one after the other: one table in text and one in JSON under bench/results/. `make bench` starts it.

`latest.txt` and `latest.json` are written by each run. `reference.txt` and `reference.json` are the kept result, with
the machine that it came from; only `--keep` overwrites them. With `--only` the other benches there stay, each with the
commit and the date that it was measured at.

Run: python bench/run.py [--only stop,line] [--full] [--keep]
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import report
from report import Row

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
LONGEST = 900.0
"""Time after which a bench is ended, s; --full has ten times as much."""


def main() -> int:
    """Measure, print and write. Exit 1 if a bench broke, 2 if there is none of that name; figures fail nothing."""
    options = _options()
    benches = {path.stem.removeprefix("bench_"): path for path in sorted(HERE.glob("bench_*.py"))}
    chosen = options.only.split(",") if options.only else list(benches)
    if unknown := [name for name in chosen if name not in benches]:
        print(f"no bench {', '.join(unknown)}; there are: {', '.join(benches)}", file=sys.stderr)
        return 2
    result: dict[str, Any] = {"date": datetime.now(UTC).isoformat(timespec="seconds"), **report.machine()}
    result |= {"full": options.full, "load": os.getloadavg()[0], "benches": {}, "failed": [], "earlier": {}}
    path = RESULTS / f"{'reference' if options.keep else 'latest'}.txt"
    if options.keep:
        result |= earlier(path.with_suffix(".json"), chosen)
    text = _Text(path)
    text.add(_heading(result))
    for name, when in result["earlier"].items():
        text.add(f"\n{name}, measured at {when}\n{report.head()}")
        for row in result["benches"][name]:
            text.add(report.line(Row(**row)))
    for name in chosen:
        _measure(name, benches[name], options.full, result, text)
        text.path.with_suffix(".json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 1 if result["failed"] else 0


def earlier(reference: Path, chosen: list[str]) -> dict[str, Any]:
    """The benches of a kept result that are not measured now, and the commit and the date of each."""
    before = json.loads(reference.read_text(encoding="utf-8")) if reference.exists() else {"benches": {}}
    others = [name for name in before["benches"] if name not in chosen and (HERE / f"bench_{name}.py").exists()]
    benches = {name: before["benches"][name] for name in others}
    dates = before.get("earlier", {})
    return {
        "benches": benches,
        "earlier": {name: dates.get(name) or f"commit {before['commit']}, {before['date']}" for name in benches},
    }


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="names of benches with commas between: stop,line")
    parser.add_argument("--full", action="store_true", help="run the long cases too")
    parser.add_argument("--keep", action="store_true", help="write reference.* instead of latest.*")
    return parser.parse_args()


class _Text:
    """The table, on standard output and in its file at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(exist_ok=True)
        path.write_text("", encoding="utf-8")

    def add(self, line: str) -> None:
        """A line more."""
        print(line, flush=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def _heading(result: dict[str, Any]) -> str:
    on, packages = result["machine"], ", ".join(f"{name} {found}" for name, found in result["packages"].items())
    return (
        f"multidrop {result['commit']}, {result['date']}, Python {result['python']}, {packages}\n"
        f"{on['cpu']}, {on['cores']} cores, {on['system']}, load {result['load']:.2f} at the start\n"
        "Ours and a peer's figure from one run, medians; ! before an aim: not reached here."
    )


def _measure(name: str, path: Path, full: bool, result: dict[str, Any], text: _Text) -> None:
    begin = time.monotonic()
    text.add(f"\n{name}\n{report.head()}")
    rows = result["benches"][name] = []
    try:
        for row in _rows(path, full):
            rows.append(asdict(row))
            text.add(report.line(row))
    except _Failed as error:
        result["failed"].append(name)
        text.add(f"{name} ended early: {error}")
    text.add(f"({time.monotonic() - begin:.0f} s)")


class _Failed(Exception):
    """A bench broke or took too long."""


def _rows(path: Path, full: bool) -> Iterator[Row]:
    """Rows of one bench as they come, from a process of its own."""
    command = [sys.executable, str(path), "--json", *(["--full"] if full else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True, process_group=0)
    limit = threading.Timer(LONGEST * (10 if full else 1), _kill, [process])
    limit.start()
    try:
        assert process.stdout is not None
        for line in process.stdout:
            yield Row(**json.loads(line))
        if process.wait():
            raise _Failed(f"exit code {process.returncode}")
    finally:
        limit.cancel()
        _kill(process)
        process.wait()


def _kill(process: subprocess.Popen[str]) -> None:
    """The bench and what it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
