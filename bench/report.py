"""Figures side by side with a peer's, as a text table and as JSON. Every `bench/bench_*.py` yields rows and ends here.

A row compares one figure of this program with the same figure of a peer, measured in the same run. The ratio is the
median of the ratios of rounds side by side, so other work on the machine affects both. A row has an aim and no pass
mark: a figure depends on the machine, and no run fails because of one.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("textual", "prompt_toolkit", "pyserial", "pymodbus", "pyModbusTCP", "rerun-sdk")
"""Packages whose versions a result names."""


@dataclass(frozen=True)
class Row:
    """One figure; None: not measured."""

    figure: str
    unit: str
    ours: float | None
    peer: float | None = None
    peer_name: str = ""
    ratio: float | None = None
    """Ours by the peer's, the median over the rounds."""
    aim: float | None = None
    aim_of: Literal["ours", "ratio"] = "ours"
    better: Literal["less", "more"] = "less"
    note: str = ""

    @property
    def reached(self) -> bool | None:
        """Whether the figure is within its aim; None without an aim or a figure."""
        value = self.ratio if self.aim_of == "ratio" else self.ours
        if value is None or self.aim is None:
            return None
        return value <= self.aim if self.better == "less" else value >= self.aim


def compared(figure: str, unit: str, ours: Sequence[float], peer: Sequence[float], peer_name: str, **more: Any) -> Row:
    """Medians of rounds that took turns, and the median of their ratios."""
    ratio = statistics.median(a / b for a, b in zip(ours, peer, strict=True))
    return Row(figure, unit, statistics.median(ours), statistics.median(peer), peer_name, ratio, **more)


def alone(figure: str, unit: str, ours: Sequence[float], **more: Any) -> Row:
    """The median of rounds without a peer."""
    return Row(figure, unit, statistics.median(ours), **more)


def absent(figure: str, unit: str, ours: Sequence[float], peer_name: str, **more: Any) -> Row:
    """The median of rounds beside a peer that is not installed."""
    note = f"{peer_name} is not installed; " + more.pop("note", "")
    return Row(figure, unit, statistics.median(ours), None, peer_name, note=note.rstrip("; "), **more)


def percentile(values: Iterable[float], n: int) -> float:
    """The value below which `n` of 100 lie."""
    return statistics.quantiles(values, n=100, method="inclusive")[n - 1]


# Text

COLUMNS = (50, 10, 10, 19, 7, 10, 9)
HEADS = ("figure", "ours", "peer", "peer is", "ratio", "aim", "unit")


def head() -> str:
    """The heads of the columns."""
    return _columns(HEADS)


def line(row: Row) -> str:
    """A row of the table."""
    ratio = "-" if row.ratio is None else f"{row.ratio:.2f}"
    return _columns((row.figure, number(row.ours), number(row.peer), row.peer_name, ratio, _aim(row), row.unit)) + (
        f"  {row.note}" if row.note else ""
    )


def _columns(texts: Sequence[str]) -> str:
    figure, *rest = texts
    cells = [f"{text:>{width}}" for text, width in zip(rest, COLUMNS[1:], strict=True)]
    return " ".join([f"{figure:{COLUMNS[0]}}", *cells]).rstrip()


def _aim(row: Row) -> str:
    if row.aim is None:
        return "-"
    sign = {None: "", True: "", False: "!"}[row.reached]
    bound = "<=" if row.better == "less" else ">="
    return f"{sign}{bound}{number(row.aim)}{'x' if row.aim_of == 'ratio' else ''}"


def number(value: float | None) -> str:
    """Three significant digits at least."""
    if value is None:
        return "-"
    if abs(value) >= 100:
        return f"{value:.0f}"
    return f"{value:.3g}"


# Machine


def machine() -> dict[str, Any]:
    """The revision and the machine of a result."""
    return {
        "machine": {"cpu": _cpu(), "cores": os.cpu_count(), "system": platform.platform(terse=True)},
        "python": platform.python_version(),
        "packages": {name: found for name in PACKAGES if (found := _version(name))},
        "commit": _git("rev-parse", "--short", "HEAD") + ("+" if _git("status", "--porcelain", "-uno") else ""),
    }


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((each.partition(":")[2].strip() for each in lines if each.startswith("model name")), "")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    except OSError:
        return ""
    return done.stdout.strip()


# A bench by itself


def main(rows: Callable[[bool], Iterable[Row]]) -> None:
    """Measure and print one bench. `rows` is called with whether long cases run too."""
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("--full", action="store_true", help="run the long cases too (several minutes)")
    parser.add_argument("--json", action="store_true", help="print each row as a JSON object")
    options = parser.parse_args()
    if not options.json:
        print(head())
    for row in rows(options.full):
        print(json.dumps(asdict(row)) if options.json else line(row), flush=True)
