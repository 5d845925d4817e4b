"""Run noise, kills and the long run, and write the report. Run: `make soak`, or `SOAK=short make soak`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from soak import kills, long_run, noise
from soak.report import Report

LENGTHS = {
    "full": {"commands": 1000, "kills": 400, "hours": 8.0, "minutes": 30.0},
    "short": {"commands": 60, "kills": 24, "hours": 0.5, "minutes": 1.0},
}
RESULTS = Path(__file__).parent / "results"


def main() -> int:
    """Run everything; return 1 if something failed. Arguments name parts: noise, kills, long."""
    length = os.environ.get("SOAK", "full")
    if length not in LENGTHS:
        print(f"SOAK={length}: valid: {', '.join(LENGTHS)}", file=sys.stderr)
        return 2
    sizes, parts = LENGTHS[length], sys.argv[1:] or ["noise", "kills", "long"]
    report = Report(length)
    if "noise" in parts:
        report.noise(noise.run(int(sizes["commands"])))
    if "kills" in parts:
        report.add("kills", *kills.run(int(sizes["kills"])))
    if "long" in parts:
        report.add("virtual time", *long_run.in_virtual_time(sizes["hours"]))
        report.add("real time", *long_run.in_real_time(sizes["minutes"]))
    print(report.write(RESULTS))
    return 1 if report.failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
