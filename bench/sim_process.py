"""A `multidrop sim` in a process of its own, for measurements: where it serves, and the processor time it uses."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@contextmanager
def served(cell: str, files: Mapping[str, str] | None = None) -> Iterator[tuple[int, str]]:
    """The process's id and the port that its one bus is served on. `files`: what else the cell needs, by name."""
    with all_served(cell, files) as (pid, [place]):
        yield pid, place


@contextmanager
def all_served(cell: str, files: Mapping[str, str] | None = None) -> Iterator[tuple[int, list[str]]]:
    """The process's id and the ports that its buses are served on, in the order of the cell."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {"cell.toml": cell, **(files or {})}.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        command = [sys.executable, "-m", "multidrop", "sim", "cell.toml", "--json"]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                places = []
                while (fact := json.loads(process.stdout.readline())) != {"ready": True}:
                    places.append(fact["endpoint"].removeprefix("pty:"))
                yield process.pid, places
            finally:
                process.terminate()


def busy(pid: int) -> float:
    """Seconds of processor time that a process has used, its own and the system's for it."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
